//! Faults between the loop and its controller.

use shm_types::JOINTS_MAX;
use shm_types::messages::Command;

use crate::Window;

/// What happens to a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ServiceDisturbance {
    /// None comes.
    Silent,
    /// It comes one cycle late.
    Slow,
    /// Every torque is this.
    TorqueIs {
        /// Motor side.
        torque_nm: f64,
    },
    /// Every torque is the opposite.
    TorqueReversed,
    /// It claims to answer an older sample.
    StaleCycle,
    /// It claims to answer a sample that is still to come.
    FutureCycle,
    /// It is of another run.
    ForeignSession,
    /// It is of another robot.
    WrongJointCount,
    /// It asks for a mode there is none of.
    UnknownMode,
}

/// A controller's output with faults.
#[derive(Clone, Debug)]
pub struct FaultyService {
    faults: Vec<(Window, ServiceDisturbance)>,
    late: Option<Command>,
}

impl FaultyService {
    /// Disturbs what a controller answers.
    pub fn new(faults: Vec<(Window, ServiceDisturbance)>) -> Self {
        Self { faults, late: None }
    }

    /// What arrives at the loop in `cycle`, in this order, when the controller has answered with `command`.
    pub fn arriving(
        &mut self,
        cycle: u64,
        command: Option<Command>,
    ) -> impl Iterator<Item = Command> + use<> {
        let late = self.late.take();
        let mut now = command;
        let faults = self.faults.iter().filter(|(window, _)| window.holds(cycle));
        for (_, disturbance) in faults {
            let Some(command) = &mut now else { break };
            match *disturbance {
                ServiceDisturbance::Silent => now = None,
                ServiceDisturbance::Slow => self.late = now.take(),
                ServiceDisturbance::TorqueIs { torque_nm } => {
                    command.motor_torque_nm = [torque_nm; JOINTS_MAX];
                }
                ServiceDisturbance::TorqueReversed => {
                    command.motor_torque_nm = command.motor_torque_nm.map(|nm| -nm);
                }
                ServiceDisturbance::StaleCycle => {
                    command.header.cycle = command.header.cycle.saturating_sub(1);
                }
                ServiceDisturbance::FutureCycle => command.header.cycle = u64::MAX,
                ServiceDisturbance::ForeignSession => {
                    command.header.session = command.header.session.wrapping_add(1);
                }
                ServiceDisturbance::WrongJointCount => command.header.joint_count += 1,
                ServiceDisturbance::UnknownMode => command.mode = u32::MAX,
            }
        }
        late.into_iter().chain(now)
    }
}
