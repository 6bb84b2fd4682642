//! The torque estimator as a process.

use std::sync::atomic::AtomicBool;

use shm_types::bus::{Bus, BusError};
use shm_types::instance::{Instance, InstanceError, Mode};
use shm_types::topics::{self, Role};

use crate::answering::{Service, serve};
use crate::estimators::{Estimators, EstimatorsError};

/// Below everything the loop waits for.
const FIFO_PRIORITY: u8 = 60;

/// Why the process cannot work.
#[derive(Debug, thiserror::Error)]
pub enum EstimatorProcessError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The robot file cannot be used.
    #[error(transparent)]
    Robot(#[from] robot::RobotError),
    /// The estimators cannot be made for this robot and rate.
    #[error(transparent)]
    Estimator(#[from] EstimatorsError),
    /// A topic cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// Answers the loop's samples with torque estimates until `stop` is set.
///
/// # Errors
/// [`EstimatorProcessError`] if it cannot start.
pub fn run(instance: &Instance, stop: &AtomicBool) -> Result<(), EstimatorProcessError> {
    let run = instance.run_config()?;
    let robot = robot::load(&run.robot)?;
    let mut estimators = Estimators::new(&robot, &run.estimators, run.period_ns as f64 * 1e-9)?;
    let service = Service {
        role: Role::Estimator,
        fifo_priority: FIFO_PRIORITY,
        topic: topics::TORQUE_ESTIMATE,
        // The loop does not use it: only in lockstep it waits.
        ready: (run.mode == Mode::Lockstep).then_some(topics::TORQUE_ESTIMATE_READY),
        answer: &mut |sample| Some(estimators.estimate(sample)),
    };
    let bus = Bus::join(instance)?;
    Ok(serve(&bus, &run, robot.joints.len(), service, stop)?)
}
