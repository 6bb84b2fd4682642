//! Inertia of the rotor, as its only amplitude; a robot file writes it at the motor's side.

use robot::Effect;

use super::form::{Form, INERTIA_STEP};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct RotorInertia;

impl Form for RotorInertia {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        let added_kg_m2 = amplitude[0] * INERTIA_STEP * scale.inertia_kg_m2;
        Effect::RotorInertia {
            inertia_kg_m2: added_kg_m2 / scale.gear_ratio.powi(2),
        }
    }

    fn lowest(&self, scale: &Scale) -> f64 {
        -scale.rotor_inertia_kg_m2 / (INERTIA_STEP * scale.inertia_kg_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    #[test]
    fn no_more_is_taken_off_than_there_is() {
        let least = RotorInertia.lowest(&scale());
        let Effect::RotorInertia { inertia_kg_m2 } = RotorInertia.effect(&[least], 0.0, &scale())
        else {
            panic!("no inertia of the rotor");
        };
        assert!((inertia_kg_m2 + 0.6e-4).abs() < 1e-12, "{inertia_kg_m2}");
    }
}
