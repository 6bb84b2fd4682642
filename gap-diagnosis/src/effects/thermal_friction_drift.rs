//! Thermal drift of friction: a level that changes as the joint warms. Either at a constant rate, which is the only amplitude, or
//! towards a change, which is; the time constant of that one does not enter linearly.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

/// Steps of what a second changes: a part of friction's.
const RATE_STEP: f64 = 0.1;

#[derive(Debug)]
pub struct ConstantDrift;

impl Form for ConstantDrift {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::ThermalFrictionDrift {
            drift_nm_s: Some(amplitude[0] * RATE_STEP * friction_step_nm(scale)),
            time_constant_s: None,
            change_nm: None,
        }
    }
}

#[derive(Debug)]
pub struct FirstOrderDrift;

impl Form for FirstOrderDrift {
    fn effect(&self, amplitude: &[f64], time_constant_s: f64, scale: &Scale) -> Effect {
        Effect::ThermalFrictionDrift {
            drift_nm_s: None,
            time_constant_s: Some(time_constant_s),
            change_nm: Some(amplitude[0] * friction_step_nm(scale)),
        }
    }

    fn shapes(&self, _: &Scale) -> Vec<f64> {
        vec![8.0]
    }

    fn shape_range(&self, _: &Scale) -> [f64; 2] {
        [1.0, 300.0]
    }
}
