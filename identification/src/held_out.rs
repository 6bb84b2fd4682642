//! What a model is worth: the torque it predicts for motion that it was not fitted to.

use recording::Recording;
use robot::Robot;
use serde::Serialize;

use crate::IdentificationError;
use crate::friction::SETTLING_S;
use crate::statistics::root_mean_square;
use crate::steady_motion::constant::SteadyMotion;

/// Error of one joint's predicted torque at constant velocities, joint side: gravity, friction over velocity, over the
/// motor's angle and over load together, row by row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOutError {
    /// The joint's name.
    pub joint: String,
    /// Root mean square of measured less predicted torque.
    pub rms_nm: f64,
    /// Mean of the measured friction: torque less the model's gravity torque, along the motion.
    pub mean_friction_nm: f64,
    /// `rms_nm` over `mean_friction_nm`.
    pub share: f64,
    /// Rows compared.
    pub rows: usize,
    /// The same at each speed and in each direction.
    pub speeds: Vec<SpeedError>,
}

/// Error at one velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpeedError {
    /// The velocity asked for.
    pub velocity_rad_s: f64,
    /// Root mean square of measured less predicted torque.
    pub rms_nm: f64,
}

/// Compares recordings with what `model` predicts for them.
///
/// # Errors
/// [`IdentificationError`], naming joint and signal, as [`measure_steady`](crate::friction::measure_steady) has them.
pub fn held_out_error(
    recordings: &[Recording],
    model: &Robot,
    joint: &str,
) -> Result<HeldOutError, IdentificationError> {
    let motion = SteadyMotion::new(recordings, model, joint, SETTLING_S)?;
    let known = motion.drive().steady_friction();
    let (mut errors_nm, mut friction_nm, mut speeds) = (Vec::new(), 0.0, Vec::new());
    for span in motion.spans() {
        let velocity_rad_s = span.reference_rad_s;
        let rows = motion.friction_rows(span)?;
        let of_span: Vec<f64> = rows
            .iter()
            .map(|row| {
                let predicted_nm =
                    known.drag_nm(velocity_rad_s, row.load_nm, row.motor_position_rad, 0.0);
                row.friction_nm - predicted_nm
            })
            .collect();
        friction_nm += rows
            .iter()
            .map(|row| row.friction_nm * velocity_rad_s.signum())
            .sum::<f64>();
        speeds.push(SpeedError {
            velocity_rad_s,
            rms_nm: root_mean_square(of_span.iter().copied()),
        });
        errors_nm.extend(of_span);
    }
    motion.check_moved(errors_nm.len())?;
    let mean_friction_nm = friction_nm / errors_nm.len() as f64;
    let rms_nm = root_mean_square(errors_nm.iter().copied());
    Ok(HeldOutError {
        joint: joint.to_owned(),
        rms_nm,
        mean_friction_nm,
        share: rms_nm / mean_friction_nm,
        rows: errors_nm.len(),
        speeds,
    })
}
