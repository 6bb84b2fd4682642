//! The emulator as a process: the plant behind the drive's topics, in step with the loop's clock.
//!
//! In real time the plant runs by the wall clock, whether the loop keeps up or not. In lockstep it moves when the
//! command that settles its next interval has come.

use std::sync::atomic::{AtomicBool, Ordering};

use realtime::clock::monotonic_ns;
use realtime::grant::{Request, apply};
use robot::{Injection, Robot};
use shm_types::bus::{Bus, BusError, Listener, Notifier, Reader, Writer};
use shm_types::instance::{Instance, InstanceError, Mode, RunConfig};
use shm_types::messages::{DriveCommand, DriveSample, Heartbeat, PlantTruth};
use shm_types::topics::{self, Role};

use crate::drives::EmulatedDrives;
use crate::{Plant, PlantError, PlantParameters};

/// Below the loop and the controller.
const FIFO_PRIORITY: u8 = 70;
/// Sleeps at most this long: a heartbeat comes at least this often.
const BEAT_NS: u64 = 100_000_000;
/// How late the loop's first command is taken if its wake-up was lost.
const RECHECK_NS: u64 = 1_000_000;

/// Why the emulator cannot work.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The robot or injection file cannot be used.
    #[error(transparent)]
    Robot(#[from] robot::RobotError),
    /// The plant cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A topic cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// Emulates the robot of `instance` until `stop` is set.
///
/// # Errors
/// [`EmulatorError`] if it cannot start.
pub fn run(instance: &Instance, stop: &AtomicBool) -> Result<(), EmulatorError> {
    let run = instance.run_config()?;
    let robot = robot::load(run.plant.as_ref().unwrap_or(&run.robot))?;
    let (injections, pushes, drive_faults) = match &run.inject {
        Some(path) => (
            robot::load_injection(path, &robot)?,
            robot::load_pushes(path, &robot)?,
            robot::load_drive_faults(path, &robot)?,
        ),
        None => (Vec::new(), Vec::new(), Vec::new()),
    };
    let plant = emulated_plant(&robot, &run, &injections)?.with_pushes(pushes);
    let bus = Bus::join(instance)?;
    let mut emulator = Emulator {
        joint_count: robot.joints.len(),
        drives: EmulatedDrives::new(plant, run.session, &robot, run.period_ns)
            .with_faults(drive_faults),
        command: bus.reader(&topics::DRIVE_COMMAND)?,
        command_ready: bus.listener(&topics::DRIVE_COMMAND_READY, run.recheck_ns(RECHECK_NS))?,
        sample: bus.writer(&topics::DRIVE_SAMPLE)?,
        sample_ready: bus.notifier(&topics::DRIVE_SAMPLE_READY)?,
        truth: bus.writer(&topics::PLANT_TRUTH)?,
        heartbeat: bus.writer(&Role::Emulator.heartbeat())?,
        beat_at_ns: 0,
        run,
    };
    let _held = (emulator.run.mode == Mode::Realtime).then(|| {
        apply(&Request {
            fifo_priority: Some(FIFO_PRIORITY),
            core: emulator.run.core_of(Role::Emulator),
            lock_memory: true,
            hold_dma_latency: false,
        })
    });
    emulator.emulate(stop);
    Ok(())
}

/// The plant a run asks for.
///
/// # Errors
/// [`PlantError`].
pub fn emulated_plant(
    robot: &Robot,
    run: &RunConfig,
    injections: &[Injection],
) -> Result<Plant, PlantError> {
    let parameters = PlantParameters::for_robot(robot)?;
    let period_s = run.period_ns as f64 * 1e-9;
    Plant::new(
        robot,
        &parameters,
        injections,
        run.seed,
        &run.initial_position_rad,
        period_s,
    )
}

struct Emulator {
    run: RunConfig,
    joint_count: usize,
    drives: EmulatedDrives,
    command: Reader<DriveCommand>,
    command_ready: Listener,
    sample: Writer<DriveSample>,
    sample_ready: Notifier,
    truth: Writer<PlantTruth>,
    heartbeat: Writer<Heartbeat>,
    beat_at_ns: u64,
}

impl Emulator {
    fn emulate(&mut self, stop: &AtomicBool) {
        let Some(epoch_ns) = self.await_loop(stop) else {
            return;
        };
        let period_ns = self.run.period_ns;
        self.publish(epoch_ns);
        while !stop.load(Ordering::Relaxed) {
            let latch_ns = epoch_ns + self.drives.cycle() * period_ns;
            match self.run.mode {
                // Half a period before the latch: time to spare for the plant, and for a late command none is missed.
                Mode::Realtime => self.wait_until(latch_ns + period_ns / 2, stop),
                Mode::Lockstep => self.wait_for_command(stop),
            }
            if stop.load(Ordering::Relaxed) {
                return;
            }
            self.take_commands();
            self.drives.advance();
            self.publish(latch_ns + period_ns);
        }
    }

    /// The loop's first command tells its clock: the instant of its cycle 0.
    fn await_loop(&mut self, stop: &AtomicBool) -> Option<u64> {
        while !stop.load(Ordering::Relaxed) {
            self.sleep(BEAT_NS);
            if let Some(first) = self.command.take()
                && first
                    .header
                    .check(self.run.session, self.joint_count)
                    .is_ok()
            {
                return Some(
                    first
                        .header
                        .measured_at_ns
                        .saturating_sub(first.header.cycle.saturating_mul(self.run.period_ns)),
                );
            }
        }
        None
    }

    fn wait_until(&mut self, instant_ns: u64, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let now_ns = monotonic_ns();
            if now_ns >= instant_ns {
                return;
            }
            self.beat(now_ns);
            realtime::clock::sleep_until(instant_ns.min(now_ns + BEAT_NS));
        }
    }

    fn wait_for_command(&mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            self.take_commands();
            if self.drives.is_settled() {
                return;
            }
            self.sleep(BEAT_NS);
        }
    }

    fn sleep(&mut self, longest_ns: u64) {
        self.beat(monotonic_ns());
        self.command_ready.wait(longest_ns);
    }

    fn beat(&mut self, now_ns: u64) {
        if now_ns >= self.beat_at_ns {
            let process_id = u64::from(std::process::id());
            self.heartbeat.send_and_prepare(Heartbeat {
                session: self.run.session,
                process_id,
                sent_at_ns: now_ns,
                cycle: 0,
            });
            self.beat_at_ns = now_ns + BEAT_NS;
        }
    }

    fn take_commands(&mut self) {
        while let Some(command) = self.command.take() {
            self.drives.take(command);
        }
    }

    fn publish(&mut self, latched_at_ns: u64) {
        let (sample, truth) = self.drives.measure(latched_at_ns);
        self.truth.send(truth);
        self.sample.send(sample);
        self.sample_ready.notify();
        self.truth.prepare();
        self.sample.prepare();
    }
}
