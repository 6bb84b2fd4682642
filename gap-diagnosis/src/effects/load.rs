//! What moves with the joint: inertia, weight and springs, and what the whole arm carries.
//!
//! A payload is a point mass in the last link's frame, in two forms. An arm feels its mass and its three moments, and all four enter
//! linearly. One joint alone does not feel the mass, only weight and inertia: the two moments across its axis enter linearly, the
//! distance from it does not.

use nalgebra::Vector3;
use robot::Effect;

use super::form::{Form, friction_step_nm};

/// Steps of inertia: a part of the joint's own.
const INERTIA_STEP: f64 = 0.02;
/// Steps of a payload's mass, and of its first moment over that.
const PAYLOAD_STEP_KG: f64 = 0.1;
const PAYLOAD_STEP_M: f64 = 0.1;
/// How far off a payload is tried that one joint alone carries, and between which distances it is sought.
const DISTANCE_M: f64 = 0.3;
pub const DISTANCES_M: [f64; 2] = [0.02, 2.0];
/// Steps of a base's tilt, and its standard deviation: a base is set up with a level.
const TILT_STEP_RAD: f64 = 0.005;
const TILT_PLAUSIBLE_RAD: f64 = 0.03;

/// A payload by its mass and moments. A centre of mass needs a mass.
pub const PAYLOAD: Form = Form {
    amplitudes: 4,
    needs_first: true,
    may_show: |shown, _| shown.joints > 1,
    ..Form::of(|amplitude, _, _| {
        let mass = amplitude[0];
        // a mass of nothing has its centre nowhere
        let along = |moment: f64| {
            if mass.abs() < 1e-6 {
                0.0
            } else {
                (PAYLOAD_STEP_M * moment / mass).clamp(-2.0, 2.0)
            }
        };
        Effect::Payload {
            mass_kg: PAYLOAD_STEP_KG * mass,
            centre_m: [1, 2, 3].map(|axis| along(amplitude[axis])),
        }
    })
};

/// A payload by its moments across the axis, at a distance from it. Its inertia is added whichever way it hangs.
pub const PAYLOAD_AT: Form = Form {
    amplitudes: 2,
    may_show: |shown, _| shown.joints == 1,
    comes: 1,
    reaches: &[1.0, -1.0],
    shapes: |_| vec![DISTANCE_M],
    shape_range: |_| DISTANCES_M,
    ..Form::of(|amplitude, distance_m, scale| {
        let moment = scale.across_axis[0] * amplitude[0] + scale.across_axis[1] * amplitude[1];
        let size = moment.norm();
        let direction = if size > 0.0 {
            moment / size
        } else {
            Vector3::zeros()
        };
        Effect::Payload {
            mass_kg: PAYLOAD_STEP_KG * PAYLOAD_STEP_M * size / distance_m,
            centre_m: (direction * distance_m).into(),
        }
    })
};

/// Inertia of the link about the joint's axis; no more is taken off than leaves a body.
pub const LINK_INERTIA: Form = Form {
    lowest: |scale| -scale.spare_link_inertia_kg_m2 / (INERTIA_STEP * scale.inertia_kg_m2),
    ..Form::of(|amplitude, _, scale| Effect::LinkInertia {
        inertia_kg_m2: amplitude[0] * INERTIA_STEP * scale.inertia_kg_m2,
    })
};

/// Inertia of the rotor; a robot file writes it at the motor's side.
pub const ROTOR_INERTIA: Form = Form {
    lowest: |scale| -scale.rotor_inertia_kg_m2 / (INERTIA_STEP * scale.inertia_kg_m2),
    ..Form::of(|amplitude, _, scale| {
        let added_kg_m2 = amplitude[0] * INERTIA_STEP * scale.inertia_kg_m2;
        Effect::RotorInertia {
            inertia_kg_m2: added_kg_m2 / scale.gear_ratio.powi(2),
        }
    })
};

/// What weight adds to the torque that holds the joint, by the sine and by the cosine of its position.
pub const GRAVITY_TORQUE: Form = Form {
    amplitudes: 2,
    may_show: |shown, _| shown.feels_weight,
    ..Form::of(|amplitude, _, scale| Effect::GravityTorque {
        sin_nm: amplitude[0] * friction_step_nm(scale),
        cos_nm: amplitude[1] * friction_step_nm(scale),
    })
};

/// A torque in proportion to the distance from where it rests. Its stiffness and its torque at position zero enter linearly; a robot
/// file writes the position at rest that they come to. A torque at zero needs a spring.
pub const JOINT_SPRING: Form = Form {
    amplitudes: 2,
    needs_first: true,
    ..Form::of(|amplitude, _, scale| {
        let stiffness = amplitude[0];
        Effect::JointSpring {
            stiffness_nm_rad: stiffness * friction_step_nm(scale),
            rest_rad: if stiffness == 0.0 {
                0.0
            } else {
                amplitude[1] / stiffness
            },
        }
    })
};

/// Gravity points elsewhere than the file says, by the base's roll and pitch.
pub const BASE_TILT: Form = Form {
    amplitudes: 2,
    plausible_steps: TILT_PLAUSIBLE_RAD / TILT_STEP_RAD,
    ..Form::of(|amplitude, _, _| Effect::BaseTilt {
        roll_rad: amplitude[0] * TILT_STEP_RAD,
        pitch_rad: amplitude[1] * TILT_STEP_RAD,
    })
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    fn least(form: Form) -> Effect {
        (form.effect)(&[(form.lowest)(&scale())], 0.0, &scale())
    }

    #[test]
    fn no_more_inertia_is_taken_off_than_there_is() {
        let Effect::LinkInertia { inertia_kg_m2 } = least(LINK_INERTIA) else {
            panic!("no inertia of the link");
        };
        assert!((inertia_kg_m2 + 0.1).abs() < 1e-12, "{inertia_kg_m2}");
        let Effect::RotorInertia { inertia_kg_m2 } = least(ROTOR_INERTIA) else {
            panic!("no inertia of the rotor");
        };
        assert!((inertia_kg_m2 + 0.6e-4).abs() < 1e-12, "{inertia_kg_m2}");
    }

    fn of_one_joint(moments: [f64; 2], distance_m: f64) -> (f64, [f64; 3]) {
        match (PAYLOAD_AT.effect)(&moments, distance_m, &scale()) {
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
