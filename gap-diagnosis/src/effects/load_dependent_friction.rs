//! Load-dependent friction: a level in proportion to the torque the gear carries, its coefficient the only amplitude.

use robot::Effect;

use super::form::Form;
use crate::twin::scale::Scale;

const STEP: f64 = 0.01;

#[derive(Debug)]
pub struct LoadDependentFriction;

impl Form for LoadDependentFriction {
    fn effect(&self, amplitude: &[f64], _: f64, _: &Scale) -> Effect {
        Effect::LoadDependentFriction {
            load_coefficient: amplitude[0] * STEP,
        }
    }

    /// Load never takes friction away, but where a table of the file says so.
    fn lowest(&self, scale: &Scale) -> f64 {
        scale
            .load_coefficient
            .map_or(f64::NEG_INFINITY, |coefficient| -coefficient / STEP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    #[test]
    fn load_takes_no_friction_away_unless_a_table_says_so() {
        let least = LoadDependentFriction.lowest(&scale());
        let Effect::LoadDependentFriction { load_coefficient } =
            LoadDependentFriction.effect(&[least], 0.0, &scale())
        else {
            panic!("no load-dependent friction");
        };
        assert!(
            (load_coefficient + 0.05).abs() < 1e-12,
            "{load_coefficient}"
        );
        let table = Scale {
            load_coefficient: None,
            ..scale()
        };
        assert_eq!(LoadDependentFriction.lowest(&table), f64::NEG_INFINITY);
    }
}
