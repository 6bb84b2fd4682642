//! Joint spring: a torque in proportion to the distance from where it rests. Its stiffness and its torque at position zero enter
//! linearly; a robot file writes the position at rest that they come to.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct JointSpring;

impl Form for JointSpring {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        let stiffness = amplitude[0];
        Effect::JointSpring {
            stiffness_nm_rad: stiffness * friction_step_nm(scale),
            rest_rad: if stiffness == 0.0 {
                0.0
            } else {
                amplitude[1] / stiffness
            },
        }
    }

    fn amplitudes(&self) -> usize {
        2
    }

    /// A spring's torque at zero needs a spring.
    fn needs_first(&self) -> bool {
        true
    }
}
