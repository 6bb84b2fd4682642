//! The emulator as a process: the plant behind the drive's topics, in step with the loop's clock.
//!
//! In real time the plant runs by the wall clock, whether the loop keeps up or not. In lockstep it moves when the
//! command that settles its next interval has come.

use std::sync::atomic::{AtomicBool, Ordering};

use realtime::clock::monotonic_ns;
use realtime::grant::{Request, apply};
use robot::{Injection, Robot};
use shm_types::JOINTS_MAX;
use shm_types::bus::{Bus, BusError, Listener, Notifier, Reader, Writer};
use shm_types::instance::{Instance, InstanceError, Mode, RunConfig};
use shm_types::messages::{
    DriveCommand, DriveMode, DriveSample, Header, Heartbeat, PlantTruth, Readings,
};
use shm_types::topics::{self, Role};

use crate::latch::CommandLatch;
use crate::{DriveState, Plant, PlantCommand, PlantError, PlantMode, PlantParameters};

/// Below the loop and the controller.
const FIFO_PRIORITY: u8 = 70;
/// Sleeps at most this long: a heartbeat comes at least this often.
const BEAT_NS: u64 = 100_000_000;
/// How late a command is taken in lockstep whose wake-up was lost.
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
    let robot = robot::load(&run.robot)?;
    let injections = match &run.inject {
        Some(path) => robot::load_injection(path, &robot)?,
        None => Vec::new(),
    };
    let plant = emulated_plant(&robot, &run, &injections)?;
    let bus = Bus::join(instance)?;
    let mut emulator = Emulator {
        joint_count: robot.joints.len(),
        plant,
        latch: CommandLatch::default(),
        command: bus.reader(&topics::DRIVE_COMMAND)?,
        command_ready: bus.listener(&topics::DRIVE_COMMAND_READY, RECHECK_NS)?,
        sample: bus.writer(&topics::DRIVE_SAMPLE)?,
        sample_ready: bus.notifier(&topics::DRIVE_SAMPLE_READY)?,
        truth: bus.writer(&topics::PLANT_TRUTH)?,
        heartbeat: bus.writer(&Role::Emulator.heartbeat())?,
        beat_at_ns: 0,
        commands_missed: 0,
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
    plant: Plant,
    latch: CommandLatch,
    command: Reader<DriveCommand>,
    command_ready: Listener,
    sample: Writer<DriveSample>,
    sample_ready: Notifier,
    truth: Writer<PlantTruth>,
    heartbeat: Writer<Heartbeat>,
    beat_at_ns: u64,
    commands_missed: u32,
}

impl Emulator {
    fn emulate(&mut self, stop: &AtomicBool) {
        let Some(epoch_ns) = self.await_loop(stop) else {
            return;
        };
        let period_ns = self.run.period_ns;
        self.publish(0, epoch_ns, None);
        let mut cycle = 0;
        while !stop.load(Ordering::Relaxed) {
            match self.run.mode {
                // Half a period before the latch: time to spare for the plant, and for a late command none is missed.
                Mode::Realtime => {
                    self.wait_until(epoch_ns + cycle * period_ns + period_ns / 2, stop)
                }
                Mode::Lockstep => self.wait_for_command(cycle, stop),
            }
            if stop.load(Ordering::Relaxed) {
                return;
            }
            self.take_commands();
            let (command, fresh) = self.latch.acting_in(cycle);
            self.commands_missed = if fresh || cycle == 0 {
                0
            } else {
                self.commands_missed.saturating_add(1)
            };
            self.advance(command.as_ref(), fresh || cycle == 0);
            cycle += 1;
            self.publish(cycle, epoch_ns + cycle * period_ns, command.as_ref());
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
                        .saturating_sub(first.header.cycle * self.run.period_ns),
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

    /// In lockstep the interval from latch `cycle` on is settled by the command of the cycle before.
    fn wait_for_command(&mut self, cycle: u64, stop: &AtomicBool) {
        while cycle > 0 && !stop.load(Ordering::Relaxed) {
            self.take_commands();
            if self.latch.has(cycle - 1) {
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
            if command
                .header
                .check(self.run.session, self.joint_count)
                .is_ok()
            {
                self.latch.push(command);
            }
        }
    }

    fn advance(&mut self, command: Option<&DriveCommand>, fresh: bool) {
        let plant_command = command
            .and_then(plant_command)
            .unwrap_or(PlantCommand { fresh, ..BRAKED });
        self.plant.step(&PlantCommand {
            fresh,
            ..plant_command
        });
    }

    fn publish(&mut self, cycle: u64, latched_at_ns: u64, acted: Option<&DriveCommand>) {
        let header = Header {
            session: self.run.session,
            cycle,
            measured_at_ns: latched_at_ns,
            joint_count: self.joint_count as u64,
        };
        let truth = self.plant.truth();
        self.truth.send(PlantTruth {
            header,
            link_position_rad: truth.link_position_rad,
            link_velocity_rad_s: truth.link_velocity_rad_s,
            joint_torque_nm: truth.joint_torque_nm,
            friction_torque_nm: truth.friction_torque_nm,
        });
        let sample = self.plant.sample();
        let readings = Readings {
            motor_position_rad: sample.motor_position_rad,
            motor_velocity_rad_s: sample.motor_velocity_rad_s,
            link_position_rad: sample.link_position_rad,
            motor_torque_nm: sample.motor_torque_nm,
            joint_torque_nm: sample.joint_torque_nm,
            ..Readings::default()
        };
        let stopped = sample
            .drive
            .iter()
            .any(|drive| matches!(drive, DriveState::Watchdog { .. }));
        let mode = match acted {
            _ if stopped => DriveMode::Damping as u32,
            Some(command) => command.mode,
            None => DriveMode::Braked as u32,
        };
        self.sample.send(DriveSample {
            header,
            readings,
            commands_missed: self.commands_missed,
            mode,
        });
        self.sample_ready.notify();
        self.truth.prepare();
        self.sample.prepare();
    }
}

/// Brakes closed.
const BRAKED: PlantCommand = PlantCommand {
    fresh: true,
    mode: PlantMode::Braked,
    motor_torque_nm: [0.0; JOINTS_MAX],
    joint_velocity_rad_s: [0.0; JOINTS_MAX],
};

/// What a drive makes of a command; `None` if it knows no such mode or a number is none.
fn plant_command(command: &DriveCommand) -> Option<PlantCommand> {
    let mode = match DriveMode::from_raw(command.mode)? {
        DriveMode::Braked => PlantMode::Braked,
        DriveMode::Damping => PlantMode::Damping,
        DriveMode::Torque => PlantMode::Torque,
        DriveMode::Velocity => PlantMode::Velocity,
    };
    let finite = |values: &[f64; JOINTS_MAX]| values.iter().all(|value| value.is_finite());
    (finite(&command.motor_torque_nm) && finite(&command.joint_velocity_rad_s)).then_some(
        PlantCommand {
            fresh: true,
            mode,
            motor_torque_nm: command.motor_torque_nm,
            joint_velocity_rad_s: command.joint_velocity_rad_s,
        },
    )
}
