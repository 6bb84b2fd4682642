//! Why the loop left `Running`: a code while it runs, a sentence afterwards.

use crate::driver::DriveFault;

/// What went wrong, with the number that decided it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// No fresh command.
    CommandMissing,
    /// No sample from the drives.
    Drive(DriveFault),
    /// The drives have stopped by themselves: their watchdog missed commands.
    DrivesStopped,
    /// The drives are switched off or faulted while they should obey.
    DrivesOff,
    /// A joint moved far outside its limits.
    Runaway {
        /// The joint.
        joint: u32,
        /// Joint side.
        position_rad: f64,
        /// Joint side.
        velocity_rad_s: f64,
    },
    /// The reference went on while the joint's encoder showed no motion at all.
    Stuck {
        /// The joint.
        joint: u32,
        /// How far the reference had gone.
        reference_rad: f64,
    },
    /// A joint was far from its reference.
    Astray {
        /// The joint.
        joint: u32,
        /// How far.
        away_rad: f64,
    },
    /// The emergency stop was pressed, at the drives or by the operator.
    EmergencyStop,
    /// The supervisor, through whom an operator would stop the robot, gave no sign of life.
    SupervisorSilent,
}

impl Fault {
    /// The number it travels as: kind in the low byte, joint in the next; of a drive's own error its code above that, as far as
    /// it has room. 0 is no fault.
    pub fn code(self) -> u32 {
        match self {
            Self::CommandMissing => 1,
            Self::Drive(DriveFault::NoSample) => 2,
            Self::Drive(DriveFault::StaleSample { .. }) => 3,
            Self::Drive(DriveFault::ForeignSample) => 4,
            Self::Drive(DriveFault::InvalidSample { joint }) => 5 | (joint << 8),
            Self::Drive(DriveFault::ModeRefused { .. }) => 6,
            Self::Drive(DriveFault::NotSent) => 7,
            Self::Runaway { joint, .. } => 8 | (joint << 8),
            Self::DrivesStopped => 9,
            Self::Drive(DriveFault::JumpedSample { joint }) => 10 | (joint << 8),
            Self::Stuck { joint, .. } => 11 | (joint << 8),
            Self::EmergencyStop => 12,
            Self::SupervisorSilent => 13,
            Self::Astray { joint, .. } => 14 | (joint << 8),
            Self::Drive(DriveFault::WorkingCounter { .. }) => 15,
            Self::Drive(DriveFault::DeviceState { joint, .. }) => 16 | (joint << 8),
            Self::Drive(DriveFault::JointSilent { joint, .. }) => 17 | (joint << 8),
            Self::Drive(DriveFault::DriveError { joint, code }) => 18 | (joint << 8) | (code << 16),
            Self::Drive(DriveFault::DriveOff { joint, .. }) => 19 | (joint << 8),
            Self::Drive(DriveFault::NotEnabled { joint, .. }) => 20 | (joint << 8),
            Self::Drive(DriveFault::BusOff) => 21,
            Self::Drive(DriveFault::LinkLost) => 22,
            Self::DrivesOff => 23,
        }
    }

    /// For people. `joint_names` in the robot's order.
    pub fn sentence(self, joint_names: &[String]) -> String {
        let name = |joint: u32| {
            joint_names
                .get(joint as usize)
                .map_or("a joint", String::as_str)
        };
        match self {
            Self::CommandMissing => "no fresh command came from the feedforward service".to_owned(),
            Self::Drive(DriveFault::NoSample) => "no sample came from the drives".to_owned(),
            Self::Drive(DriveFault::StaleSample { age_cycles }) => {
                format!("the drives' newest sample was {age_cycles} cycles old")
            }
            Self::Drive(DriveFault::ForeignSample) => {
                "the drives' sample was not of this run, robot and cycle".to_owned()
            }
            Self::Drive(DriveFault::InvalidSample { joint }) => {
                format!("{}: its motor position was no number", name(joint))
            }
            Self::Drive(DriveFault::JumpedSample { joint }) => format!(
                "{}: its motor position jumped further than the joint can move",
                name(joint)
            ),
            Self::Drive(DriveFault::ModeRefused { mode }) => {
                format!("the drives refused mode {mode}")
            }
            Self::Drive(DriveFault::NotSent) => "a command could not be sent".to_owned(),
            Self::Drive(DriveFault::WorkingCounter { expected, received }) => {
                format!("the bus counted {received} of {expected} in an exchange")
            }
            Self::Drive(DriveFault::DeviceState {
                joint,
                al_status,
                al_status_code,
            }) => format!(
                "{}: its device left the exchange with AL status {al_status:#06x}, code {al_status_code:#06x}",
                name(joint)
            ),
            Self::Drive(DriveFault::JointSilent { joint, age_cycles }) => format!(
                "{}: nothing came from its drive for {age_cycles} cycles",
                name(joint)
            ),
            Self::Drive(DriveFault::DriveError { joint, code }) => {
                format!(
                    "{}: its drive is faulted with error {code:#06x}",
                    name(joint)
                )
            }
            Self::Drive(DriveFault::DriveOff { joint, state }) => format!(
                "{}: its drive should obey and is {}",
                name(joint),
                state.name()
            ),
            Self::Drive(DriveFault::NotEnabled {
                joint,
                state,
                status_word,
            }) => format!(
                "{}: its drive was not enabled in time, it is {} with status word {status_word:#06x}",
                name(joint),
                state.name()
            ),
            Self::Drive(DriveFault::BusOff) => "the bus is off".to_owned(),
            Self::Drive(DriveFault::LinkLost) => "the link to the drives is lost".to_owned(),
            Self::DrivesStopped => "the drives had stopped by themselves".to_owned(),
            Self::DrivesOff => "the drives were off although they should obey".to_owned(),
            Self::Runaway {
                joint,
                position_rad,
                velocity_rad_s,
            } => format!(
                "{} ran away: {velocity_rad_s:.3} rad/s at {position_rad:.3} rad is far outside its limits",
                name(joint)
            ),
            Self::Stuck {
                joint,
                reference_rad,
            } => format!(
                "{}: its encoder stood still while the reference went {reference_rad:.3} rad",
                name(joint)
            ),
            Self::Astray { joint, away_rad } => {
                format!(
                    "{} was {away_rad:.3} rad away from its reference",
                    name(joint)
                )
            }
            Self::EmergencyStop => "the emergency stop was pressed".to_owned(),
            Self::SupervisorSilent => "the supervisor gave no sign of life".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::drive::DriveState;

    #[test]
    fn every_fault_has_its_own_code_and_joints_are_told_apart() {
        let joint = 3;
        let faults = [
            Fault::CommandMissing,
            Fault::Drive(DriveFault::NoSample),
            Fault::Drive(DriveFault::StaleSample { age_cycles: 1 }),
            Fault::Drive(DriveFault::ForeignSample),
            Fault::Drive(DriveFault::InvalidSample { joint }),
            Fault::Drive(DriveFault::JumpedSample { joint }),
            Fault::Drive(DriveFault::ModeRefused { mode: 9 }),
            Fault::Drive(DriveFault::NotSent),
            Fault::DrivesStopped,
            Fault::Runaway {
                joint,
                position_rad: 0.0,
                velocity_rad_s: 0.0,
            },
            Fault::Stuck {
                joint,
                reference_rad: 0.2,
            },
            Fault::Astray {
                joint,
                away_rad: 1.1,
            },
            Fault::EmergencyStop,
            Fault::SupervisorSilent,
            Fault::Drive(DriveFault::WorkingCounter {
                expected: 9,
                received: 6,
            }),
            Fault::Drive(DriveFault::DeviceState {
                joint,
                al_status: 0x14,
                al_status_code: 0x1b,
            }),
            Fault::Drive(DriveFault::JointSilent {
                joint,
                age_cycles: 5,
            }),
            Fault::Drive(DriveFault::DriveError {
                joint,
                code: 0x2310,
            }),
            Fault::Drive(DriveFault::DriveOff {
                joint,
                state: DriveState::SwitchedOff,
            }),
            Fault::Drive(DriveFault::NotEnabled {
                joint,
                state: DriveState::Enabling,
                status_word: 0x0233,
            }),
            Fault::Drive(DriveFault::BusOff),
            Fault::Drive(DriveFault::LinkLost),
            Fault::DrivesOff,
        ];
        let mut kinds: Vec<u32> = faults.iter().map(|fault| fault.code() & 0xff).collect();
        kinds.sort_unstable();
        kinds.dedup();
        assert_eq!(kinds.len(), faults.len());
        assert!(!kinds.contains(&0), "0 is no fault");
        assert_eq!(faults[4].code() >> 8, joint);
        let names = ["a", "b", "c", "elbow"].map(str::to_owned);
        assert!(faults[9].sentence(&names).contains("elbow"));
        let told = faults[17].sentence(&names);
        assert!(told.contains("elbow") && told.contains("0x2310"), "{told}");
        assert_eq!(faults[17].code() >> 16, 0x2310);
    }
}
