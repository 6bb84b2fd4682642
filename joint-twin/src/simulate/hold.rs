//! A spring and a damper that hold a simulated rotor on a recorded motion.

use super::Feedback;
use crate::joint::JointModel;

/// What holds the rotor on the recorded motion during a substep: `torque - drag·velocity` with the velocity at its end.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hold {
    pub(super) torque_nm: f64,
    pub(super) drag_nm_s_rad: f64,
}

impl Hold {
    /// A rotor at this position and velocity, on the recorded positions at the substep's ends, which the motor's encoder showed
    /// with its faults.
    pub(super) fn on(
        feedback: &Feedback,
        model: &JointModel,
        [motor_rad, motor_rad_s]: [f64; 2],
        [from_rad, to_rad]: [f64; 2],
        step_s: f64,
    ) -> Self {
        let moved_rad = step_s * motor_rad_s;
        let fault_rad = model.motor_fault_rad(motor_rad);
        let more_rad = model.motor_fault_rad(motor_rad + moved_rad) - fault_rad;
        let shown = if more_rad == 0.0 {
            1.0
        } else {
            1.0 + more_rad / moved_rad
        };
        let velocity_rad_s = (to_rad - from_rad) / step_s;
        let away_rad = to_rad - fault_rad - motor_rad;
        let (stiffness, damping) = (feedback.proportional_nm_rad, feedback.derivative_nm_s_rad);
        Self {
            torque_nm: stiffness * away_rad + damping * velocity_rad_s,
            drag_nm_s_rad: (stiffness * step_s + damping) * shown,
        }
    }
}
