//! Inertia of the link about the joint's axis, as its only amplitude.

use robot::Effect;

use super::form::{Form, INERTIA_STEP};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct LinkInertia;

impl Form for LinkInertia {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::LinkInertia {
            inertia_kg_m2: amplitude[0] * INERTIA_STEP * scale.inertia_kg_m2,
        }
    }

    fn lowest(&self, scale: &Scale) -> f64 {
        -scale.spare_link_inertia_kg_m2 / (INERTIA_STEP * scale.inertia_kg_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    #[test]
    fn no_more_is_taken_off_than_there_is() {
        let least = LinkInertia.lowest(&scale());
        let Effect::LinkInertia { inertia_kg_m2 } = LinkInertia.effect(&[least], 0.0, &scale())
        else {
            panic!("no inertia of the link");
        };
        assert!((inertia_kg_m2 + 0.1).abs() < 1e-12, "{inertia_kg_m2}");
    }
}
