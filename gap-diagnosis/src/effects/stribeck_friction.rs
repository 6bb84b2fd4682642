//! Stribeck friction: an excess at rest that falls with speed. The excess enters linearly, the velocity over which it falls does not.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

/// Friction that falls at lower speeds than this is part of how a joint begins to slip.
const CREEPING_RAD_S: f64 = 0.008;

#[derive(Debug)]
pub struct StribeckFriction;

impl Form for StribeckFriction {
    fn effect(&self, amplitude: &[f64], velocity_rad_s: f64, scale: &Scale) -> Effect {
        Effect::StribeckFriction {
            stribeck_nm: amplitude[0] * friction_step_nm(scale),
            stribeck_velocity_rad_s: velocity_rad_s,
        }
    }

    fn shapes(&self, scale: &Scale) -> Vec<f64> {
        [0.02, 0.06, 0.18]
            .map(|part| (part * scale.speed_rad_s).max(slowest_rad_s(scale)))
            .to_vec()
    }

    fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        [slowest_rad_s(scale), 0.5 * scale.speed_rad_s]
    }

    fn lowest(&self, scale: &Scale) -> f64 {
        -scale.least_friction_nm / friction_step_nm(scale)
    }
}

/// Slower is creeping, which every joint does in its own way.
fn slowest_rad_s(scale: &Scale) -> f64 {
    CREEPING_RAD_S.min(0.1 * scale.speed_rad_s)
}
