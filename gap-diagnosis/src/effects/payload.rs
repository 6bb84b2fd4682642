//! Payload: a point mass in the last link's frame, in two forms.
//!
//! An arm feels its mass and its three moments, and all four enter linearly. One joint alone does not feel the mass, only weight and
//! inertia: the two moments across its axis enter linearly, the distance from it does not.

use nalgebra::Vector3;
use robot::Effect;

use super::Shown;
use super::form::Form;
use crate::twin::scale::Scale;

const STEP_KG: f64 = 0.1;
const STEP_M: f64 = 0.1;
/// How far off a payload is tried that one joint alone carries, and between which distances it is sought.
const DISTANCE_M: f64 = 0.3;
const DISTANCES_M: [f64; 2] = [0.02, 2.0];

/// By its mass and moments.
#[derive(Debug)]
pub struct Payload;

impl Form for Payload {
    fn effect(&self, amplitude: &[f64], _: f64, _: &Scale) -> Effect {
        let mass = amplitude[0];
        // a mass of nothing has its centre nowhere
        let along = |moment: f64| {
            if mass.abs() < 1e-6 {
                0.0
            } else {
                (STEP_M * moment / mass).clamp(-2.0, 2.0)
            }
        };
        Effect::Payload {
            mass_kg: STEP_KG * mass,
            centre_m: [
                along(amplitude[1]),
                along(amplitude[2]),
                along(amplitude[3]),
            ],
        }
    }

    fn may_show(&self, shown: Shown, _: &Scale) -> bool {
        shown.joints > 1
    }

    fn amplitudes(&self) -> usize {
        4
    }

    /// A centre of mass needs a mass.
    fn needs_first(&self) -> bool {
        true
    }
}

/// By its moments across the axis, at a distance from it.
#[derive(Debug)]
pub struct PayloadAt;

impl Form for PayloadAt {
    fn effect(&self, amplitude: &[f64], distance_m: f64, scale: &Scale) -> Effect {
        let moment = scale.across_axis[0] * amplitude[0] + scale.across_axis[1] * amplitude[1];
        let size = moment.norm();
        let direction = if size > 0.0 {
            moment / size
        } else {
            Vector3::zeros()
        };
        Effect::Payload {
            mass_kg: STEP_KG * STEP_M * size / distance_m,
            centre_m: (direction * distance_m).into(),
        }
    }

    fn may_show(&self, shown: Shown, _: &Scale) -> bool {
        shown.joints == 1
    }

    fn comes(&self) -> u8 {
        1
    }

    fn shapes(&self, _: &Scale) -> Vec<f64> {
        vec![DISTANCE_M]
    }

    /// Its inertia is added whichever way it hangs.
    fn reaches(&self) -> &'static [f64] {
        &[1.0, -1.0]
    }

    fn shape_range(&self, _: &Scale) -> [f64; 2] {
        DISTANCES_M
    }

    fn amplitudes(&self) -> usize {
        2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    fn of_one_joint(moments: [f64; 2], distance_m: f64) -> (f64, [f64; 3]) {
        match PayloadAt.effect(&moments, distance_m, &scale()) {
            Effect::Payload { mass_kg, centre_m } => (mass_kg, centre_m),
            other => panic!("no payload: {other:?}"),
        }
    }

    #[test]
    fn a_payload_of_one_joint_keeps_its_moment_at_any_distance() {
        for distance_m in [0.1, 0.4] {
            let (mass_kg, centre_m) = of_one_joint([3.0, -4.0], distance_m);
            assert!((mass_kg - 0.05 / distance_m).abs() < 1e-12, "{mass_kg}");
            assert!((mass_kg * centre_m[2] + 0.04).abs() < 1e-12, "{centre_m:?}");
        }
        assert_eq!(of_one_joint([0.0; 2], 0.3), (0.0, [0.0; 3]));
    }
}
