//! The steps and their order.

use serde::{Deserialize, Serialize};
use shm_types::control_options::Task;

/// One thing that is tried. The order of [`Step::ALL`] is the order of the walk: each relies on those before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Step {
    /// Every drive answers and has no fault.
    Scan,
    /// What they say fits the robot file.
    Check,
    /// With the brakes closed nothing gives.
    BrakesClosed,
    /// The brakes open, and nothing falls.
    BrakesOpen,
    /// Without torque a joint is moved by hand, and it is this joint that is seen to move.
    ZeroTorque,
    /// Moved by hand in the positive direction its position rises, on both sides of the gear.
    Sign,
    /// Both ends of its range are reached by hand.
    Limits,
    /// The switch stops the drives.
    EmergencyStop,
    /// The operator's order stops them.
    OperatorStop,
    /// Its first torque moves a joint in the torque's direction.
    FirstTorque,
    /// It follows a small sine.
    Sine,
}

impl Step {
    /// In their order.
    pub const ALL: [Self; 11] = [
        Self::Scan,
        Self::Check,
        Self::BrakesClosed,
        Self::BrakesOpen,
        Self::ZeroTorque,
        Self::Sign,
        Self::Limits,
        Self::EmergencyStop,
        Self::OperatorStop,
        Self::FirstTorque,
        Self::Sine,
    ];

    /// As it is typed.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scan => "scan",
            Self::Check => "check",
            Self::BrakesClosed => "brakes-closed",
            Self::BrakesOpen => "brakes-open",
            Self::ZeroTorque => "zero-torque",
            Self::Sign => "sign",
            Self::Limits => "limits",
            Self::EmergencyStop => "emergency-stop",
            Self::OperatorStop => "operator-stop",
            Self::FirstTorque => "first-torque",
            Self::Sine => "sine",
        }
    }

    /// The step of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|step| step.name() == name)
    }

    /// Whether each joint has to pass it by itself.
    pub const fn is_per_joint(self) -> bool {
        matches!(
            self,
            Self::ZeroTorque | Self::Sign | Self::Limits | Self::FirstTorque | Self::Sine
        )
    }

    /// Whether one run does for all joints: those that are moved by hand, one after the other.
    pub const fn shares_a_run(self) -> bool {
        matches!(self, Self::ZeroTorque | Self::Sign | Self::Limits)
    }

    /// What the loop is asked for meanwhile.
    pub const fn task(self, joint: usize) -> Task {
        match self {
            Self::Scan | Self::Check | Self::BrakesClosed => Task::Rest,
            Self::BrakesOpen
            | Self::ZeroTorque
            | Self::Sign
            | Self::Limits
            | Self::EmergencyStop
            | Self::OperatorStop => Task::Release,
            Self::FirstTorque => Task::Nudge { joint },
            Self::Sine => Task::Follow,
        }
    }

    /// What people are told before it begins; they agree or it does not begin.
    pub const fn warning(self) -> &'static str {
        match self {
            Self::Scan => "The drives are looked at. Brakes stay closed, nothing moves.",
            Self::Check => {
                "What the drives say is held against the robot file. Brakes stay closed, nothing moves."
            }
            Self::BrakesClosed => {
                "Lean on each joint by hand for the next three seconds: closed brakes must hold it. Where drives have no \
                 brakes, support the arm so that nothing moves."
            }
            Self::BrakesOpen => {
                "SUPPORT THE ARM: the brakes open and there is no torque. Two people, one hand on the emergency stop."
            }
            Self::ZeroTorque => {
                "SUPPORT THE ARM: the brakes open and there is no torque. Each joint is then moved by hand, when it is its turn."
            }
            Self::Sign => {
                "SUPPORT THE ARM: no torque. Each joint is then turned by hand in its positive direction: right-hand rule about \
                 `axis` of the robot file."
            }
            Self::Limits => {
                "SUPPORT THE ARM: no torque. Each joint is then turned by hand to both ends of its range in the robot file."
            }
            Self::EmergencyStop => {
                "SUPPORT THE ARM: no torque. When told to, press the emergency stop."
            }
            Self::OperatorStop => {
                "SUPPORT THE ARM: no torque. The loop is then stopped as the monitor's key does. Let go of the emergency stop first."
            }
            Self::FirstTorque => {
                "HANDS OFF THE JOINT, the arm supported: its torque grows to torque_limit_nm until it moves, first in the positive \
                 direction, then in the negative one."
            }
            Self::Sine => {
                "HANDS OFF: all joints are held where they stand, and this one swings by 0.05 rad at 0.2 Hz. A hand on the \
                 emergency stop."
            }
        }
    }

    /// What is to be done for one joint, once it is its turn; nothing where nobody has to do anything.
    pub fn request(self, joint: &str) -> Option<String> {
        match self {
            Self::ZeroTorque => Some(format!("{joint}: move it to and fro by hand")),
            Self::Sign => Some(format!(
                "{joint}: turn it by hand in its positive direction"
            )),
            Self::Limits => Some(format!(
                "{joint}: turn it by hand to both ends of its range"
            )),
            Self::EmergencyStop => Some("press the emergency stop now".to_owned()),
            _ => None,
        }
    }
}

/// A step, of one joint where each has its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// The step.
    pub step: Step,
    /// Index in the robot's order.
    pub joint: Option<usize>,
}

impl Stage {
    /// Every stage of a robot with so many joints, in the order of the walk.
    pub fn all(joints: usize) -> impl Iterator<Item = Self> {
        Step::ALL
            .into_iter()
            .flat_map(move |step| Self::of(step, joints))
    }

    /// Those of one step.
    pub fn of(step: Step, joints: usize) -> impl Iterator<Item = Self> {
        let count = if step.is_per_joint() { joints } else { 1 };
        (0..count).map(move |joint| Self {
            step,
            joint: step.is_per_joint().then_some(joint),
        })
    }

    /// For people: the step, and the joint where it is of one.
    pub fn name(self, joint_names: &[&str]) -> String {
        match self.joint.and_then(|joint| joint_names.get(joint)) {
            Some(joint) => format!("{} of {joint}", self.step.name()),
            None => self.step.name().to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_each_their_own_and_found_again() {
        for step in Step::ALL {
            assert_eq!(Step::from_name(step.name()), Some(step));
            let told = serde_json::to_string(&step).expect("a name");
            assert_eq!(told, format!("\"{}\"", step.name()));
        }
        assert_eq!(Step::from_name("jump"), None);
    }

    #[test]
    fn nothing_gets_torque_before_brakes_hands_signs_limits_and_stops_were_tried() {
        let first_torque = Step::ALL
            .into_iter()
            .find(|step| !matches!(step.task(0), Task::Rest | Task::Release))
            .expect("there is one");
        assert_eq!(first_torque, Step::FirstTorque);
        let first_release = Step::ALL
            .into_iter()
            .find(|step| step.task(0) == Task::Release)
            .expect("there is one");
        assert_eq!(first_release, Step::BrakesOpen);
        assert!(Step::ALL.is_sorted());
    }

    #[test]
    fn every_joint_has_its_own_where_the_step_says_so() {
        let stages: Vec<Stage> = Stage::all(3).collect();
        let per_joint = Step::ALL.iter().filter(|step| step.is_per_joint()).count();
        assert_eq!(stages.len(), 11 - per_joint + 3 * per_joint);
        assert_eq!(
            stages[0],
            Stage {
                step: Step::Scan,
                joint: None
            }
        );
        let sine = Stage {
            step: Step::Sine,
            joint: Some(2),
        };
        assert_eq!(stages[stages.len() - 1], sine);
        assert_eq!(sine.name(&["a", "b", "c"]), "sine of c");
        assert_eq!(stages[0].name(&["a"]), "scan");
    }
}
