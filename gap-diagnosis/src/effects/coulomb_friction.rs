//! Coulomb friction: a level that depends on the direction alone, as its only amplitude.

use robot::Effect;

use super::form::{Form, friction_step_nm};
use crate::twin::scale::Scale;

#[derive(Debug)]
pub struct CoulombFriction;

impl Form for CoulombFriction {
    fn effect(&self, amplitude: &[f64], _: f64, scale: &Scale) -> Effect {
        Effect::CoulombFriction {
            coulomb_nm: amplitude[0] * friction_step_nm(scale),
        }
    }

    fn lowest(&self, scale: &Scale) -> f64 {
        -scale.least_friction_nm / friction_step_nm(scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    #[test]
    fn no_more_is_taken_off_than_there_is() {
        let least = CoulombFriction.lowest(&scale());
        let Effect::CoulombFriction { coulomb_nm } =
            CoulombFriction.effect(&[least], 0.0, &scale())
        else {
            panic!("no Coulomb friction");
        };
        assert!((coulomb_nm + 1.0).abs() < 1e-12, "{coulomb_nm}");
    }
}
