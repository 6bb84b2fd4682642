//! The disturbance torque of a joint: what is left of the drive's torque when the rigid nominal robot's is taken off.
//!
//! `r = F[τ] - J·q̈ - RNEA(q, q̇, q̈)`, joint side, with `q = F[motor angle over ratio]`, `F` a low-pass without delay.

use joint_model::filter::FilterError;
use joint_twin::signal::smooth::low_pass;
use robot::Robot;

/// Up to here gap and noise are compared.
const COMPARED_HZ: f64 = 15.0;
/// Samples kept a second: three for each hertz, because the low-pass is no wall.
const KEPT_HZ: f64 = 3.0 * COMPARED_HZ;

/// One joint's signals, joint side.
pub(crate) struct Columns {
    pub motor_rad: Vec<f64>,
    pub torque_nm: Vec<f64>,
}

/// The disturbance torque of every joint, thinned.
pub(crate) fn disturbances_nm(
    robot: &Robot,
    columns: &[Columns],
    rate_hz: f64,
) -> Result<Vec<Vec<f64>>, FilterError> {
    let smooth = |of: fn(&Columns) -> &[f64]| -> Result<Vec<Vec<f64>>, FilterError> {
        let each = columns.iter();
        each.map(|joint| low_pass(of(joint), COMPARED_HZ, rate_hz))
            .collect()
    };
    let position_rad = smooth(|joint| &joint.motor_rad)?;
    let torque_nm = smooth(|joint| &joint.torque_nm)?;
    let count = columns.len();
    let samples = position_rad.first().map_or(0, Vec::len);
    let stride = (rate_hz / KEPT_HZ) as usize;
    let mut disturbances_nm = vec![Vec::new(); count];
    let mut rigid_nm = vec![0.0; count];
    for k in (1..samples.saturating_sub(1)).step_by(stride) {
        let each = |value: &dyn Fn(&[f64]) -> f64| -> Vec<f64> {
            position_rad.iter().map(|joint| value(joint)).collect()
        };
        let acceleration_rad_s2 = each(&|q| (q[k + 1] - 2.0 * q[k] + q[k - 1]) * rate_hz * rate_hz);
        robot.chain.inverse_dynamics(
            &each(&|q| q[k]),
            &each(&|q| 0.5 * (q[k + 1] - q[k - 1]) * rate_hz),
            &acceleration_rad_s2,
            &mut rigid_nm,
        );
        for (joint, file) in robot.joints.iter().enumerate() {
            let rotor_nm =
                file.rotor_inertia_kg_m2 * file.gear_ratio.powi(2) * acceleration_rad_s2[joint];
            disturbances_nm[joint].push(torque_nm[joint][k] - rotor_nm - rigid_nm[joint]);
        }
    }
    Ok(disturbances_nm)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_joint_shows_what_was_added_and_nothing_else() {
        let robot = robot::load("shd17").unwrap();
        let rate_hz = 1500.0;
        let inertia = robot.joints[0].rotor_inertia_kg_m2 * robot.joints[0].gear_ratio.powi(2);
        let mut columns = Columns {
            motor_rad: Vec::new(),
            torque_nm: Vec::new(),
        };
        for k in 0..15_000 {
            let (sin, cos) = (3.0 * f64::from(k) / rate_hz).sin_cos();
            let mut rigid_nm = [0.0];
            let motion = [[0.5 * sin], [1.5 * cos], [-4.5 * sin]];
            robot
                .chain
                .inverse_dynamics(&motion[0], &motion[1], &motion[2], &mut rigid_nm);
            columns.motor_rad.push(motion[0][0]);
            columns
                .torque_nm
                .push(rigid_nm[0] + inertia * motion[2][0] + 0.7);
        }
        let found_nm = disturbances_nm(&robot, &[columns], rate_hz).unwrap();
        let inside = &found_nm[0][20..found_nm[0].len() - 20];
        assert!(
            inside.iter().all(|nm| (nm - 0.7).abs() < 1e-3),
            "{inside:?}"
        );
    }
}
