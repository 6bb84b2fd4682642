//! The controller a run asks for.

use motion::Trajectory;
use robot::Robot;
use shm_types::instance::ControlMode;
use shm_types::messages::{Command, SensorSample};

use crate::feedforward::{Feedforward, FeedforwardError};
use crate::velocity_control::VelocityControl;

/// Answers samples with commands, in torque or velocity mode.
#[derive(Clone, Debug)]
pub enum Controller {
    /// Model feedforward and low-gain feedback.
    Torque(Box<Feedforward>),
    /// The reference's velocity, for the drives' own loops.
    Velocity(Box<VelocityControl>),
}

impl Controller {
    /// A controller that follows `trajectory`.
    ///
    /// # Errors
    /// [`FeedforwardError`] if the robot file says nothing usable about torque control.
    pub fn new(
        mode: ControlMode,
        robot: Robot,
        trajectory: Trajectory,
        period_s: f64,
    ) -> Result<Self, FeedforwardError> {
        Ok(match mode {
            ControlMode::Torque => {
                Self::Torque(Box::new(Feedforward::new(robot, trajectory, period_s)?))
            }
            ControlMode::Velocity => {
                Self::Velocity(Box::new(VelocityControl::new(&robot, trajectory)))
            }
        })
    }

    /// The command that answers one sample. No allocation, no clock.
    pub fn command(&mut self, sample: &SensorSample) -> Command {
        match self {
            Self::Torque(feedforward) => feedforward.command(sample),
            Self::Velocity(velocity) => velocity.command(sample),
        }
    }
}
