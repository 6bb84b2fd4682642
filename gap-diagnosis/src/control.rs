//! What keeps a joint's simulation going: gains of our own that hold it on the recorded motion, so that friction and
//! ripple are compared at the same angles; and the robot file's controller, for what the robot would really do.

use joint_model::filter::{Butterworth, FilterError};
use robot::{Control, Robot};

use crate::simulate::{Between, Feedback, Way};

/// A loop is faster than the recording if its rate is higher by this factor.
const FASTER: f64 = 1.5;
/// Bandwidth of the gains that keep a simulation on the recorded motion.
const TRACKING_RAD_S: f64 = 80.0;
/// Of the sample rate, where that is low.
const TRACKING_OF_RATE: f64 = 0.2;

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
pub(crate) fn is_slower_than_loop(control: &Control, rate_hz: f64) -> bool {
    control.rate_hz > FASTER * rate_hz
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
    })
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
    let inertia_kg_m2 =
        torque_nm[joint] - gravity_nm[joint] + drive.rotor_inertia_kg_m2 * drive.gear_ratio.powi(2);
    let bandwidth_rad_s = TRACKING_RAD_S.min(TRACKING_OF_RATE * rate_hz);
    Feedback {
        proportional_nm_rad: inertia_kg_m2 * bandwidth_rad_s.powi(2),
        derivative_nm_s_rad: 2.0 * inertia_kg_m2 * bandwidth_rad_s,
        velocity_filter: None,
        on_link: false,
        delay_samples: delay_samples(robot, rate_hz),
        way: Way::Held,
    }
}
