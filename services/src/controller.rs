//! The controller a run asks for.

use motion::Trajectory;
use robot::Robot;
use shm_types::control_options::Task;
use shm_types::instance::{ControlMode, RunConfig};
use shm_types::messages::{Command, SensorSample, TorqueEstimate};

use crate::by_hand::ByHand;
use crate::feedforward::{Feedforward, FeedforwardError};
use crate::velocity_control::VelocityControl;

/// Answers samples with commands, in torque or velocity mode.
#[derive(Clone, Debug)]
pub enum Controller {
    /// Model feedforward and low-gain feedback.
    Torque(Box<Feedforward>),
    /// The reference's velocity, for the drives' own loops.
    Velocity(Box<VelocityControl>),
    /// No torque, or one joint's until it moves.
    ByHand(Box<ByHand>),
    /// No command.
    Silent,
}

impl Controller {
    /// A controller that follows `trajectory`.
    ///
    /// # Errors
    /// [`FeedforwardError`] if the robot file says nothing usable about torque control.
    pub fn new(
        run: &RunConfig,
        robot: Robot,
        trajectory: Trajectory,
    ) -> Result<Self, FeedforwardError> {
        let period_s = run.period_ns as f64 * 1e-9;
        match run.options.task {
            Task::Follow => (),
            Task::Rest => return Ok(Self::Silent),
            Task::Release => return Ok(Self::ByHand(Box::new(ByHand::released(&robot)))),
            Task::Nudge { joint } => {
                return Ok(Self::ByHand(Box::new(ByHand::nudged(&robot, joint))));
            }
        }
        Ok(match run.control {
            ControlMode::Torque => Self::Torque(Box::new(Feedforward::new(
                robot,
                trajectory,
                period_s,
                &run.options,
            )?)),
            ControlMode::Velocity => {
                Self::Velocity(Box::new(VelocityControl::new(&robot, trajectory)))
            }
        })
    }

    /// Keeps a torque estimate for the commands of later cycles; velocity mode has no use for it.
    pub fn take_estimate(&mut self, estimate: TorqueEstimate) {
        if let Self::Torque(feedforward) = self {
            feedforward.take_estimate(estimate);
        }
    }

    /// The command that answers one sample; `None` where none is meant to be sent. No allocation, no clock.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn command(&mut self, sample: &SensorSample) -> Option<Command> {
        match self {
            Self::Torque(feedforward) => Some(feedforward.command(sample)),
            Self::Velocity(velocity) => Some(velocity.command(sample)),
            Self::ByHand(by_hand) => Some(by_hand.command(sample)),
            Self::Silent => None,
        }
    }
}
