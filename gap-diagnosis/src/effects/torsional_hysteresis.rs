//! Torsional hysteresis: the gear's twist lags behind its torque whatever the speed. The width enters linearly, the twist at which it
//! yields does not.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct TorsionalHysteresis;

impl Form for TorsionalHysteresis {
    fn effect(&self, amplitude: &[f64], yield_rad: f64, scale: &Scale) -> Effect {
        Effect::TorsionalHysteresis {
            width_nm: amplitude[0] * friction_step_nm(scale),
            yield_rad,
        }
    }

    fn shapes(&self, scale: &Scale) -> Vec<f64> {
        [0.1, 0.5].map(|part| part * scale.twist_rad()).to_vec()
    }

    fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        [0.01 * scale.twist_rad(), 3.0 * scale.twist_rad()]
    }

    fn is_positive(&self) -> bool {
        true
    }
}
