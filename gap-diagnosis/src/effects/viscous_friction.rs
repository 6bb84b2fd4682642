//! Viscous friction: drag in proportion to velocity, its coefficient the only amplitude.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct ViscousFriction;

impl Form for ViscousFriction {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::ViscousFriction {
            viscous_nm_s_rad: amplitude[0] * friction_step_nm(scale) / scale.speed_rad_s,
        }
    }
}
