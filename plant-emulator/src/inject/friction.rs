//! Effects on friction: added to the steady level, or to the drag beside it.

use joint_model::friction::{SteadyFriction, TERMS_MAX, ThermalFrictionDrift};
use robot::Effect;

use super::Full;

/// Adds a friction effect; `elapsed_s` is the time since it began.
pub(super) fn add(
    friction: &mut SteadyFriction,
    effect: &Effect,
    strength: f64,
    elapsed_s: f64,
) -> Result<(), Full> {
    match *effect {
        Effect::ThermalFrictionDrift {
            drift_nm_s,
            time_constant_s,
            change_nm,
        } => {
            // grows from nothing by itself, so the ramp is not wanted
            let drifts = [
                drift_nm_s.map(|drift_nm_s| ThermalFrictionDrift::Constant { drift_nm_s }),
                time_constant_s
                    .zip(change_nm)
                    .map(
                        |(time_constant_s, change_nm)| ThermalFrictionDrift::FirstOrder {
                            change_nm,
                            time_constant_s,
                        },
                    ),
            ];
            let change_nm: f64 = drifts
                .iter()
                .flatten()
                .map(|drift| drift.change_nm(elapsed_s))
                .sum();
            friction.coulomb.coulomb_nm += change_nm;
        }
        _ => robot::add_friction(friction, effect, strength)
            .map_err(|_| Full { at_most: TERMS_MAX })?,
    }
    Ok(())
}
