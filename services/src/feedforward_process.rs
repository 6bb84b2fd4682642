//! The feedforward controller as a process.

use std::sync::atomic::{AtomicBool, Ordering};

use realtime::clock::{monotonic_ns, sleep_until};
use shm_types::bus::{Bus, BusError, Reader};
use shm_types::instance::{Instance, InstanceError, Mode, RunConfig};
use shm_types::messages::TorqueEstimate;
use shm_types::topics::{self, Role};

use crate::answering::{Service, serve};
use crate::controller::Controller;
use crate::feedforward::FeedforwardError;

/// Below the loop, above the emulator: the loop waits for it.
const FIFO_PRIORITY: u8 = 75;
/// Between two looks for an estimate that is on its way.
const LOOK_AGAIN_NS: u64 = 20_000;

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
    let mut controller = Controller::new(&run, robot, trajectory)?;
    let bus = Bus::join(instance)?;
    let mut estimates = (run.options.correction_gain > 0.0)
        .then(|| Estimates::open(&bus, &run, joint_count))
        .transpose()?;
    let service = Service {
        role: Role::Feedforward,
        fifo_priority: FIFO_PRIORITY,
        topic: topics::COMMAND,
        ready: Some(topics::COMMAND_READY),
        answer: &mut |sample| {
            if let Some(estimates) = &mut estimates {
                estimates.hand_over(sample.header.cycle, &mut controller, stop);
            }
            controller.command(sample)
        },
    };
    Ok(serve(&bus, &run, joint_count, service, stop)?)
}

/// The estimator's torques, for a controller that corrects with them.
struct Estimates {
    reader: Reader<TorqueEstimate>,
    session: u64,
    joint_count: usize,
    mode: Mode,
    /// Last cycle whose sample was answered.
    answered_cycle: Option<u64>,
    newest_cycle: Option<u64>,
}

impl Estimates {
    fn open(bus: &Bus, run: &RunConfig, joint_count: usize) -> Result<Self, BusError> {
        Ok(Self {
            reader: bus.reader(&topics::TORQUE_ESTIMATE)?,
            session: run.session,
            joint_count,
            mode: run.mode,
            answered_cycle: None,
            newest_cycle: None,
        })
    }

    /// Gives the controller what has come. In lockstep it waits for the estimate of the cycle before, which the loop has
    /// had: the estimator may still be handing it out. Not so right after a start, when it went out before this process came.
    fn hand_over(&mut self, cycle: u64, controller: &mut Controller, stop: &AtomicBool) {
        let before = cycle.checked_sub(1);
        let awaited =
            self.mode == Mode::Lockstep && before.is_some() && before == self.answered_cycle;
        self.take(controller);
        while awaited && self.newest_cycle < before && !stop.load(Ordering::Relaxed) {
            sleep_until(monotonic_ns() + LOOK_AGAIN_NS);
            self.take(controller);
        }
        self.answered_cycle = Some(cycle);
    }

    fn take(&mut self, controller: &mut Controller) {
        while let Some(estimate) = self.reader.take() {
            if estimate
                .header
                .check(self.session, self.joint_count)
                .is_ok()
            {
                self.newest_cycle = Some(estimate.header.cycle);
                controller.take_estimate(estimate);
            }
        }
    }
}
