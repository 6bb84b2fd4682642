//! Pairs of effects with a motion on which nobody can tell them apart.

use robot::Feedback;

use crate::course::Course;
use crate::random::Random;
use crate::rig::Rig;

/// A motion, and effects that look alike on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Design {
    /// All motion in one direction: an offset is friction of that direction.
    OneDirection,
    /// Only the sum of both delays shows, however the joint moves.
    Delays,
    /// Friction at one speed is one number per direction.
    OneSpeed,
    /// On one sine a wrong torque constant is load, friction and inertia.
    TorqueConstant,
    /// On one sine, seen from the motor alone, a softer gear is more inertia.
    Compliance,
}

pub(crate) const DESIGNS: [Design; 5] = [
    Design::OneDirection,
    Design::Delays,
    Design::OneSpeed,
    Design::TorqueConstant,
    Design::Compliance,
];

impl Design {
    pub fn suits(self, rig: &Rig) -> bool {
        let robot = &rig.robot;
        let seen_from_motor_alone = rig.plant.joint_torque_noise_nm.is_none()
            && robot
                .joints
                .iter()
                .all(|joint| joint.link_encoder_resolution_rad.is_none())
            && robot
                .control
                .as_ref()
                .is_some_and(|control| control.feedback == Feedback::Motor);
        match self {
            Self::Compliance => seen_from_motor_alone,
            // a torque sensor or the gear's twist would tell of the motor's torque
            Self::TorqueConstant => seen_from_motor_alone,
            _ => true,
        }
    }

    pub fn course(self, random: &mut Random) -> Course {
        match self {
            Self::OneDirection => Course::OneDirection,
            Self::Delays => Course::Rich,
            Self::OneSpeed => Course::OneSpeed,
            Self::TorqueConstant => Course::Sine {
                frequency_hz: random.between(0.2, 0.6),
            },
            Self::Compliance => Course::Sine {
                frequency_hz: random.between(1.0, 2.5),
            },
        }
    }

    /// What is really there.
    pub fn truth(self, random: &mut Random) -> &'static str {
        match self {
            Self::OneDirection => random.pick(&["torque_offset", "asymmetric_friction"]),
            Self::Delays => random.pick(&["command_delay", "sensor_delay"]),
            Self::OneSpeed => random.pick(&["coulomb_friction", "viscous_friction"]),
            Self::TorqueConstant => "torque_constant_error",
            Self::Compliance => "torsional_compliance",
        }
    }

    /// Names that look alike on this motion, the true one first.
    pub fn alternatives(self, truth: &str) -> Vec<String> {
        let names: &[&str] = match self {
            Self::OneDirection => &["torque_offset", "asymmetric_friction"],
            Self::Delays => &["command_delay", "sensor_delay"],
            Self::OneSpeed => &["coulomb_friction", "viscous_friction"],
            Self::TorqueConstant => &[
                "torque_constant_error",
                "payload",
                "gravity_torque",
                "link_inertia",
                "rotor_inertia",
                "coulomb_friction",
                "viscous_friction",
            ],
            Self::Compliance => &["torsional_compliance", "rotor_inertia", "link_inertia"],
        };
        let others = names.iter().filter(|name| **name != truth);
        std::iter::once(&truth)
            .chain(others)
            .map(|name| (*name).to_owned())
            .collect()
    }
}
