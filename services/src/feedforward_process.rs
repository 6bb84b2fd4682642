//! The feedforward controller as a process.

use std::sync::atomic::AtomicBool;

use shm_types::bus::BusError;
use shm_types::instance::{Instance, InstanceError};
use shm_types::topics::{self, Role};

use crate::answering::{Service, serve};
use crate::controller::Controller;
use crate::feedforward::FeedforwardError;

/// Below the loop, above the emulator: the loop waits for it.
const FIFO_PRIORITY: u8 = 75;

/// Why the process cannot work.
#[derive(Debug, thiserror::Error)]
pub enum FeedforwardProcessError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The robot file cannot be used.
    #[error(transparent)]
    Robot(#[from] robot::RobotError),
    /// The trajectory cannot be used.
    #[error(transparent)]
    Motion(#[from] motion::MotionError),
    /// This robot cannot be controlled this way.
    #[error(transparent)]
    Feedforward(#[from] FeedforwardError),
    /// A topic cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// Answers the loop's samples with commands until `stop` is set.
///
/// # Errors
/// [`FeedforwardProcessError`] if it cannot start.
pub fn run(instance: &Instance, stop: &AtomicBool) -> Result<(), FeedforwardProcessError> {
    let run = instance.run_config()?;
    let robot = robot::load(&run.robot)?;
    let trajectory = motion::load(&run.trajectory, &robot)?;
    let joint_count = robot.joints.len();
    let period_s = run.period_ns as f64 * 1e-9;
    let mut controller = Controller::new(run.control, robot, trajectory, period_s)?;
    let service = Service {
        role: Role::Feedforward,
        fifo_priority: FIFO_PRIORITY,
        topic: topics::COMMAND,
        ready: Some(topics::COMMAND_READY),
        answer: &mut |sample| Some(controller.command(sample)),
    };
    Ok(serve(instance, &run, joint_count, service, stop)?)
}
