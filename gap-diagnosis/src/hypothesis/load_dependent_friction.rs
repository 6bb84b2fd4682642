//! Load-dependent friction: a level in proportion to the torque the gear carries, its coefficient the only amplitude.

use robot::Effect;

use super::form::Form;
use crate::scale::Scale;

const STEP: f64 = 0.01;

#[derive(Debug)]
pub struct LoadDependentFriction;

impl Form for LoadDependentFriction {
    fn name(&self) -> &'static str {
        "load_dependent_friction"
    }

    fn effect(&self, amplitude: &[f64], _: f64, _: &Scale) -> Effect {
        Effect::LoadDependentFriction {
            load_coefficient: amplitude[0] * STEP,
        }
    }
}
