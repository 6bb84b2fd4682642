//! The gear: how it leads and lags, and how it twists.

use joint_twin::scale::Scale;
use robot::{Effect, EffectKind};

use super::form::{Form, Wave, friction_step_nm, twist_step_rad};

/// Softening steps: a part of the compliance.
const COMPLIANCE_STEP: f64 = 0.05;

/// The gear leads and lags as the motor turns; each harmonic is fitted on its own.
pub const KINEMATIC_ERROR: Form = Form {
    has_harmonics: true,
    ..Form::wave(|amplitude, cycles, scale| {
        let Wave { size, phase_rad } = Wave::of(amplitude);
        Effect::kinematic_error(size * twist_step_rad(scale), cycles, phase_rad)
    })
};

/// The gear is softer than its file says, by a compliance; a robot file writes the stiffness it comes to. Beside a file that tells none
/// it cannot be stiffer.
pub const COMPLIANCE: Form = Form {
    lowest: |scale| {
        if scale.stiffness_is_known {
            f64::NEG_INFINITY
        } else {
            0.0
        }
    },
    ..Form::of(|amplitude, _, scale| Effect::TorsionalCompliance {
        stiffness_nm_rad: softened_nm_rad(amplitude[0], scale),
    })
};

/// The gear twists more easily below a torque. The compliance added there enters linearly, the knee at which it ends does not.
pub const SOFT_WINDUP: Form = Form {
    shapes: knees_nm,
    // beyond the torque that the gear carries its knee is not reached
    shape_range: |scale| {
        let most_nm = scale.torque_nm().max(5.0 * scale.friction_nm);
        [0.05 * scale.friction_nm, most_nm]
    },
    is_positive: true,
    // a knee that no torque reaches is none
    without_end: |amplitude, scale| {
        let steps = softening_steps(low_stiffness_nm_rad(amplitude[0], scale), scale);
        Some((EffectKind::TorsionalCompliance, steps))
    },
    ..Form::of(|amplitude, knee_nm, scale| Effect::SoftWindup {
        low_stiffness_nm_rad: low_stiffness_nm_rad(amplitude[0], scale),
        knee_nm,
    })
};

/// The gear's twist lags behind its torque whatever the speed. The width enters linearly, the twist at which it yields does not.
pub const HYSTERESIS: Form = Form {
    shapes: |scale| [0.1, 0.5].map(|part| part * scale.twist_rad()).to_vec(),
    shape_range: |scale| [0.01 * scale.twist_rad(), 3.0 * scale.twist_rad()],
    is_positive: true,
    ..Form::of(|amplitude, yield_rad, scale| Effect::TorsionalHysteresis {
        width_nm: amplitude[0] * friction_step_nm(scale),
        yield_rad,
    })
};

/// The gear resists being twisted by a power of how fast. The torque at a usual rate enters linearly, the exponent does not: it turns the
/// law about that rate. Its response is found at a fifth of the friction: at a fiftieth it has the wrong sign for damping that is there.
pub const STRUCTURAL_DAMPING: Form = Form {
    shapes: |_| vec![0.5, 1.0],
    shape_range: |_| [0.2, 1.5],
    reaches: &[10.0],
    is_positive: true,
    ..Form::of(|amplitude, exponent, scale| Effect::StructuralDamping {
        damping_nm_s_rad: amplitude[0] * friction_step_nm(scale)
            / twist_rate_rad_s(scale).powf(exponent),
        exponent,
    })
};

/// How fast a gear twists as its load turns with the joint.
fn twist_rate_rad_s(scale: &Scale) -> f64 {
    scale.speed_rad_s * scale.torque_nm().max(scale.friction_nm) / scale.stiffness_nm_rad
}

/// A gap that the gear crosses without torque. Within a wide one the link swings freely.
pub const BACKLASH: Form = Form {
    comes: 2,
    reaches: &[1.0, 10.0, 100.0],
    is_positive: true,
    ..Form::of(|amplitude, _, scale| Effect::Backlash {
        gap_rad: amplitude[0] * twist_step_rad(scale),
    })
};

/// Change of stiffness by so many steps of compliance; the stiffness itself where the file tells none.
fn softened_nm_rad(steps: f64, scale: &Scale) -> f64 {
    if scale.stiffness_is_known {
        let compliance = (1.0 + COMPLIANCE_STEP * steps).max(0.05);
        scale.stiffness_nm_rad * (1.0 / compliance - 1.0)
    } else {
        let compliance_rad_nm = 1.0 / scale.stiffness_nm_rad
            + steps.max(0.0) * twist_step_rad(scale) / scale.friction_nm;
        1.0 / compliance_rad_nm
    }
}

/// The steps that make a gear as soft as this: [`softened_nm_rad`], turned round.
fn softening_steps(stiffness_nm_rad: f64, scale: &Scale) -> f64 {
    let softer = scale.stiffness_nm_rad / stiffness_nm_rad - 1.0;
    if scale.stiffness_is_known {
        softer / COMPLIANCE_STEP
    } else {
        softer / scale.stiffness_nm_rad * scale.friction_nm / twist_step_rad(scale)
    }
}

/// Of a windup below its knee.
fn low_stiffness_nm_rad(steps: f64, scale: &Scale) -> f64 {
    scale.stiffness_nm_rad / (1.0 + 4.0 * COMPLIANCE_STEP * steps)
}

/// About the torque of friction, and up to half of what the gear carries where that is more.
fn knees_nm(scale: &Scale) -> Vec<f64> {
    let of_friction = [0.3, 1.0, 3.0].map(|part| part * scale.friction_nm);
    let half_nm = 0.5 * scale.torque_nm();
    let is_more = half_nm > 1.5 * of_friction[2];
    of_friction
        .into_iter()
        .chain(is_more.then_some(half_nm))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    #[test]
    fn a_windup_without_an_end_is_a_gear_as_soft() {
        for stiffness_is_known in [true, false] {
            let scale = Scale {
                stiffness_is_known,
                ..scale()
            };
            let Some((_, steps)) = (SOFT_WINDUP.without_end)(&[5.0], &scale) else {
                panic!("no soft gear");
            };
            let changed = softened_nm_rad(steps, &scale);
            let file = if stiffness_is_known {
                scale.stiffness_nm_rad
            } else {
                0.0
            };
            let soft = low_stiffness_nm_rad(5.0, &scale);
            assert!(((file + changed) / soft - 1.0).abs() < 1e-9, "{changed}");
        }
    }

    #[test]
    fn no_gear_is_stiffer_than_one_of_which_nothing_is_known() {
        let least = |stiffness_is_known: bool| {
            (COMPLIANCE.lowest)(&Scale {
                stiffness_is_known,
                ..scale()
            })
        };
        assert_eq!([true, false].map(least), [f64::NEG_INFINITY, 0.0]);
    }
}
