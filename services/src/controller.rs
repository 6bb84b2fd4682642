//! The controller a run asks for.

use motion::Trajectory;
use robot::Robot;
use shm_types::instance::{ControlMode, RunConfig};
use shm_types::messages::{Command, SensorSample, TorqueEstimate};

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
        run: &RunConfig,
        robot: Robot,
        trajectory: Trajectory,
    ) -> Result<Self, FeedforwardError> {
        let period_s = run.period_ns as f64 * 1e-9;
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

    /// The command that answers one sample. No allocation, no clock.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn command(&mut self, sample: &SensorSample) -> Command {
        match self {
            Self::Torque(feedforward) => feedforward.command(sample),
            Self::Velocity(velocity) => velocity.command(sample),
        }
    }
}
