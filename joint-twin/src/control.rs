//! What keeps a joint's simulation going: gains of our own that hold it on the recorded motion, so that friction and
//! ripple are compared at the same angles; and the robot file's controller, for what the robot would really do.

use std::f64::consts::TAU;

use joint_model::filter::{Butterworth, FilterError};
use robot::{Control, Robot};

use crate::signal::smooth::low_pass;
use crate::simulate::{Between, Feedback, Way};

/// Bandwidth of the gains that keep a simulation on the recorded motion.
const TRACKING_RAD_S: f64 = 80.0;
/// Speed that one step of an encoder may give a rotor that is held on what it shows.
const LEAP_MOST_RAD_S: f64 = 0.02;
/// Else it is held on a motion as fast as this many times what holds it can follow.
const SMOOTH: f64 = 2.0;

/// Whether the robot file tells the controller that ran.
pub fn is_known(robot: &Robot) -> bool {
    known(robot).is_some()
}

fn known(robot: &Robot) -> Option<&Control> {
    // proportional and integral on velocity are derivative and proportional on position
    robot.control.as_ref().filter(|control| control.is_closed())
}

/// The robot file's controller at a joint; none where it tells none, or one without feedback.
///
/// # Errors
/// [`FilterError`] if the velocity filter cannot be designed at this rate.
pub fn told(robot: &Robot, joint: usize, rate_hz: f64) -> Result<Option<Feedback>, FilterError> {
    known(robot)
        .map(|control| as_told(control, joint, rate_hz))
        .transpose()
}

/// Whether the loop sent commands between two rows of the recording.
pub fn is_slower_than_loop(control: &Control, rate_hz: f64) -> bool {
    (control.rate_hz / rate_hz).round() > 1.0
}

/// What a recorded torque did until the next.
pub(crate) fn between(robot: &Robot, rate_hz: f64) -> Between {
    match &robot.control {
        Some(control) if is_slower_than_loop(control, rate_hz) => Between::Line,
        _ => Between::Stays,
    }
}

/// Samples from a measurement to the beginning of its command.
pub fn delay_samples(robot: &Robot, rate_hz: f64) -> f64 {
    robot.control.as_ref().map_or(0.0, |control| {
        // a command that stays for a cycle of a faster loop comes half a cycle late, beside a straight line
        let held = if is_slower_than_loop(control, rate_hz) {
            0.5
        } else {
            0.0
        };
        (f64::from(control.delay_cycles) + held) * (rate_hz / control.rate_hz).min(1.0)
    })
}

fn as_told(control: &Control, joint: usize, rate_hz: f64) -> Result<Feedback, FilterError> {
    let order = control.velocity_filter_order as usize;
    // a recording slower than the loop cannot show a filter beyond its own band
    let cutoff_hz = control.velocity_filter_hz;
    let filtered = cutoff_hz > 0.0 && cutoff_hz < 0.45 * rate_hz;
    Ok(Feedback {
        proportional_nm_rad: control.proportional_nm_rad[joint],
        derivative_nm_s_rad: control.derivative_nm_s_rad[joint],
        velocity_filter: filtered
            .then(|| Butterworth::design(order, cutoff_hz, rate_hz))
            .transpose()?,
        on_link: control.feedback == robot::Feedback::Link,
        delay_samples: f64::from(control.delay_cycles) * (rate_hz / control.rate_hz).min(1.0),
        way: Way::Commanded,
        smooth_rad: None,
    })
}

/// A recorded motion without its encoder's steps, joint side, where these are so coarse that a rotor held on them would leap with each:
/// the real one did not, and leaps average friction away. None where they are fine, or rows come so slowly that they smooth as much.
///
/// # Errors
/// [`FilterError`].
pub(crate) fn without_leaps(
    motor_rad: &[f64],
    step_rad: f64,
    rate_hz: f64,
) -> Result<Option<Vec<f64>>, FilterError> {
    let cutoff_hz = SMOOTH * TRACKING_RAD_S / TAU;
    // what holds it is a damper of twice the bandwidth and the inertia
    let is_fine = 2.0 * TRACKING_RAD_S * step_rad <= LEAP_MOST_RAD_S;
    if is_fine || cutoff_hz >= 0.5 * rate_hz {
        return Ok(None);
    }
    low_pass(motor_rad, cutoff_hz, rate_hz).map(Some)
}

/// A critically damped follower of the recorded motion.
pub fn tracking(robot: &Robot, joint: usize, rate_hz: f64) -> Feedback {
    let drive = &robot.joints[joint];
    let count = robot.joints.len();
    let (rest, mut unit) = (vec![0.0; count], vec![0.0; count]);
    let (mut torque_nm, mut gravity_nm) = (vec![0.0; count], vec![0.0; count]);
    unit[joint] = 1.0;
    robot
        .chain
        .inverse_dynamics(&rest, &rest, &unit, &mut torque_nm);
    robot.chain.gravity_torque(&rest, &mut gravity_nm);
    let inertia_kg_m2 = torque_nm[joint] - gravity_nm[joint] + drive.reflected_inertia_kg_m2();
    Feedback {
        proportional_nm_rad: inertia_kg_m2 * TRACKING_RAD_S.powi(2),
        derivative_nm_s_rad: 2.0 * inertia_kg_m2 * TRACKING_RAD_S,
        velocity_filter: None,
        on_link: false,
        delay_samples: delay_samples(robot, rate_hz),
        way: Way::Held,
        smooth_rad: None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::joint::JointModel;
    use crate::load::Load;
    use crate::simulate::{Drive, Substeps, Trace, simulate};

    /// A link that weighs nothing, along these positions.
    fn bare(position_rad: Vec<f64>) -> Load {
        let nothing = vec![0.0; position_rad.len()];
        Load {
            inertia_kg_m2: vec![0.1; position_rad.len()],
            position_rad,
            velocity_rad_s: nothing.clone(),
            torque_nm: nothing.clone(),
            coupling_nm: nothing.clone(),
            slope_nm_rad: nothing,
        }
    }

    #[test]
    fn coarse_steps_are_smoothed_and_fine_ones_are_not() {
        let swing_rad = |k: i32| 0.3 * (TAU * 0.5 * 1e-3 * f64::from(k)).sin();
        let seen = |step_rad: f64| -> Vec<f64> {
            let all = (0..4000).map(swing_rad);
            all.map(|rad| (rad / step_rad).round() * step_rad).collect()
        };
        assert_eq!(without_leaps(&seen(1e-5), 1e-5, 1000.0).unwrap(), None);
        assert_eq!(without_leaps(&seen(1e-3), 1e-3, 50.0).unwrap(), None);
        let smooth_rad = without_leaps(&seen(1e-3), 1e-3, 1000.0).unwrap().unwrap();
        for (k, rad) in (0..4000).zip(smooth_rad) {
            assert!((rad - swing_rad(k)).abs() < 5e-4, "{k}: {rad}");
        }
    }

    #[test]
    fn held_on_coarse_steps_a_joint_rubs_as_it_does_on_the_motion_itself() {
        const STEP_RAD: f64 = 1e-3;
        let robot = robot::load("shd17").unwrap();
        let model = JointModel::nominal(&robot, 0);
        // slowly one way
        let at_rad = |k: usize| 0.03 * k as f64 / 1000.0;
        let friction_nm = |shown_rad: Vec<f64>, smooth: bool| {
            let samples = shown_rad.len();
            let mut feedback = tracking(&robot, 0, 1000.0);
            if smooth {
                feedback.smooth_rad = without_leaps(&shown_rad, STEP_RAD, 1000.0).unwrap();
            }
            let load = bare((0..samples).map(at_rad).collect());
            let drive = Drive {
                period_s: 1e-3,
                command_nm: vec![0.0; samples],
                motor_rad: shown_rad,
                ..Drive::default()
            };
            let mut trace = Trace::default();
            let fine = Substeps::Fine;
            simulate(&model, &feedback, &drive, &load, fine, None, &mut trace);
            let moving_nm = &trace.holding_nm[1000..3000];
            moving_nm.iter().sum::<f64>() / moving_nm.len() as f64
        };
        let itself_nm = friction_nm((0..4000).map(at_rad).collect(), false);
        let steps = || {
            let all = (0..4000).map(at_rad);
            all.map(|rad| (rad / STEP_RAD).round() * STEP_RAD).collect()
        };
        let (leaping_nm, smooth_nm) = (friction_nm(steps(), false), friction_nm(steps(), true));
        assert!(
            (smooth_nm / itself_nm - 1.0).abs() < 0.02,
            "{smooth_nm} {itself_nm}"
        );
        assert!(
            (leaping_nm / itself_nm - 1.0).abs() > 0.1,
            "{leaping_nm} {itself_nm}"
        );
    }

    #[test]
    fn a_joint_is_held_as_closely_on_rows_that_come_slowly() {
        let robot = robot::load("shd17").unwrap();
        let model = JointModel::nominal(&robot, 0);
        // furthest from the motion, which friction drags the rotor off wherever it turns
        let furthest_rad = |rate_hz: f64| {
            let samples = (4.0 * rate_hz) as usize;
            let at_rad = |k: usize| 0.3 * (TAU * 0.5 * k as f64 / rate_hz).sin();
            let load = bare((0..samples).map(at_rad).collect());
            let drive = Drive {
                period_s: 1.0 / rate_hz,
                command_nm: vec![0.0; samples],
                motor_rad: (0..samples).map(at_rad).collect(),
                ..Drive::default()
            };
            let mut trace = Trace::default();
            let feedback = tracking(&robot, 0, rate_hz);
            let fine = Substeps::Fine;
            simulate(&model, &feedback, &drive, &load, fine, None, &mut trace);
            let held = trace.motor_rad.iter().enumerate().skip(samples / 4);
            held.map(|(k, rad)| (rad - at_rad(k)).abs())
                .fold(0.0, f64::max)
        };
        let (slow_rad, fast_rad) = (furthest_rad(100.0), furthest_rad(1000.0));
        assert!(slow_rad < 1.1 * fast_rad, "{slow_rad} {fast_rad}");
    }
}
