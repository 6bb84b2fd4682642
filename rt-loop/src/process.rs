//! The process around the cycle: clock, shared memory, driver, and the order in which they are used.

use std::sync::atomic::{AtomicBool, Ordering};

use realtime::clock::{monotonic_ns, sleep_until};
use realtime::grant::{Grant, Request, apply};
use shm_types::bus::{Bus, BusError, Listener, Notifier, Reader, Writer};
use shm_types::instance::{ControlMode, Instance, InstanceError, Mode, RunConfig, Wait};
use shm_types::messages::{
    Command, DriveCommand, DriveMode, DriveSample, Header, Heartbeat, LastCycle, LoopState,
    LoopStatus, SensorSample, Supervision,
};
use shm_types::topics::{self, Role};

use crate::accounts::{Accounts, CycleFacts};
use crate::admission::{admits_command, check_sample};
use crate::bus_clock;
use crate::config::cycle_config;
use crate::cycle::{CycleConfig, CycleInput, CycleOutput, CycleState};
use crate::driver::{Driver, DriverEntry, Mismatch, OpenContext, OpenError};
use crate::emulator_driver::{EMULATOR, PROCESS};
use crate::last_cycles::LastCycles;
use crate::lockstep::{self, LockstepPeers};
use crate::report::{
    LOOP_REPORT_FILE, LoopReport, Quantiles, explained_overruns, named_counters, overrun_causes,
};
use crate::statistics::CycleTimes;
use crate::status::loop_status;
use crate::steal_watch::StealWatch;
use crate::supervision::SupervisorWatch;

/// The drivers that come with the loop.
pub const DRIVERS: [DriverEntry; 2] = [EMULATOR, PROCESS];

/// Part of the period in which the drives' sample must have come.
const SAMPLE_DEADLINE_PARTS: u64 = 3;
/// How late an answer is taken whose wake-up was lost.
const RECHECK_NS: u64 = 100_000;
/// A supervisor silent for longer than this is gone, and with it the operator's way to stop the robot. It gives the loop as long.
const SUPERVISOR_SILENCE_NS: u64 = 2_000_000_000;
/// Between heartbeats.
const HEARTBEAT_NS: u64 = 100_000_000;
/// SCHED_FIFO priority of the loop: above everything else of the instance.
pub const FIFO_PRIORITY: u8 = 80;
/// From opening the topics to the first cycle.
const START_DELAY_NS: u64 = 20_000_000;

/// Why the loop cannot start.
#[derive(Debug, thiserror::Error)]
pub enum LoopError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// A topic cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The robot file cannot be used.
    #[error(transparent)]
    Robot(#[from] robot::RobotError),
    /// Nobody has written a driver of this name.
    #[error("unknown driver `{name}`; known: {known}")]
    UnknownDriver {
        /// As given.
        name: String,
        /// Those there are.
        known: String,
    },
    /// The driver cannot be opened.
    #[error("driver `{name}`: {source}")]
    Open {
        /// Its name.
        name: &'static str,
        /// Why.
        source: OpenError,
    },
    /// The drives are not those of the robot file.
    #[error("driver `{name}`: {source}")]
    Mismatch {
        /// Its name.
        name: &'static str,
        /// What does not fit.
        source: Mismatch,
    },
}

/// The driver of that name.
///
/// # Errors
/// [`LoopError::UnknownDriver`], with those there are.
pub fn find_driver<'a>(
    drivers: &'a [DriverEntry],
    name: &str,
) -> Result<&'a DriverEntry, LoopError> {
    let names = || drivers.iter().map(|entry| entry.name).collect::<Vec<_>>();
    drivers
        .iter()
        .find(|entry| entry.name == name)
        .ok_or_else(|| LoopError::UnknownDriver {
            name: name.to_owned(),
            known: names().join(", "),
        })
}

/// Opens a driver and holds what its drives are against the robot file.
///
/// # Errors
/// [`LoopError::Open`], [`LoopError::Mismatch`].
pub fn open_driver(
    entry: &DriverEntry,
    context: &OpenContext<'_>,
) -> Result<Box<dyn Driver>, LoopError> {
    let name = entry.name;
    let driver = (entry.open)(context).map_err(|source| LoopError::Open { name, source })?;
    let mode = match context.run.control {
        ControlMode::Torque => DriveMode::Torque,
        ControlMode::Velocity => DriveMode::Velocity,
    };
    driver
        .capabilities()
        .check(context.robot, mode, context.run.period_ns)
        .map_err(|source| LoopError::Mismatch { name, source })?;
    Ok(driver)
}

/// Runs the loop of `instance`, with one of `drivers`, until its cycles are done or `stop` is set, and leaves its report there.
///
/// # Errors
/// [`LoopError`] if it cannot start; once started it runs to its end.
pub fn run(
    instance: &Instance,
    drivers: &[DriverEntry],
    stop: &AtomicBool,
) -> Result<(), LoopError> {
    let run = instance.run_config()?;
    let robot = robot::load(&run.robot)?;
    let bus = Bus::join(instance)?;
    let context = OpenContext {
        run: &run,
        robot: &robot,
        bus: Some(&bus),
    };
    let driver = open_driver(find_driver(drivers, &run.driver)?, &context)?;
    let config = cycle_config(&run, &robot);
    let report = control(&bus, driver, run, config, stop)?;
    instance.write_report(LOOP_REPORT_FILE, &report)?;
    Ok(())
}

/// Runs the loop with a driver of the caller's, on the calling thread, which becomes a real-time thread.
///
/// # Errors
/// [`BusError`] if a topic cannot be opened; once started it runs to its end.
pub fn control<D: Driver>(
    bus: &Bus,
    driver: D,
    run: RunConfig,
    config: CycleConfig,
    stop: &AtomicBool,
) -> Result<LoopReport, BusError> {
    Ok(Loop::new(bus, driver, run, config)?.run(stop))
}

/// What the loop's thread asks of the kernel.
pub fn treatment(core: Option<usize>) -> Request {
    Request {
        fifo_priority: Some(FIFO_PRIORITY),
        core,
        lock_memory: true,
        hold_dma_latency: true,
    }
}

struct Loop<D> {
    driver: D,
    run: RunConfig,
    config: CycleConfig,
    state: CycleState,
    accounts: Accounts,
    sample: Writer<SensorSample>,
    sample_ready: Notifier,
    command: Reader<Command>,
    command_ready: Listener,
    status: Writer<LoopStatus>,
    heartbeat: Writer<Heartbeat>,
    supervision: Reader<Supervision>,
    supervisor: SupervisorWatch,
    last_cycles: LastCycles,
    last_cycles_writer: Writer<LastCycle>,
    lockstep: Option<LockstepPeers>,
    woke_before_ns: Option<u64>,
}

impl<D: Driver> Loop<D> {
    fn new(bus: &Bus, driver: D, run: RunConfig, config: CycleConfig) -> Result<Self, BusError> {
        let recheck_ns = run.recheck_ns(RECHECK_NS);
        let lockstep = match run.mode {
            Mode::Realtime => None,
            Mode::Lockstep => Some(LockstepPeers::open(bus, recheck_ns)?),
        };
        // In lockstep nobody has a clock that the supervisor could miss.
        let silence_cycles_max = match run.mode {
            Mode::Realtime => Some(SUPERVISOR_SILENCE_NS / run.period_ns),
            Mode::Lockstep => None,
        };
        Ok(Self {
            supervision: bus.reader(&topics::SUPERVISION)?,
            supervisor: SupervisorWatch::new(run.session, silence_cycles_max),
            last_cycles: LastCycles::default(),
            last_cycles_writer: bus.writer(&topics::LAST_CYCLES)?,
            driver,
            run,
            config,
            state: CycleState::default(),
            accounts: Accounts::default(),
            sample: bus.writer(&topics::SENSOR_SAMPLE)?,
            sample_ready: bus.notifier(&topics::SENSOR_SAMPLE_READY)?,
            command: bus.reader(&topics::COMMAND)?,
            command_ready: bus.listener(&topics::COMMAND_READY, recheck_ns)?,
            status: bus.writer(&topics::LOOP_STATUS)?,
            heartbeat: bus.writer(&Role::Loop.heartbeat())?,
            lockstep,
            woke_before_ns: None,
        })
    }

    /// Connects to everybody who is there already. Otherwise the first messages would, for milliseconds.
    fn connect(&mut self) {
        self.sample.greet_new_readers();
        self.status.greet_new_readers();
        self.heartbeat.greet_new_readers();
        self.last_cycles_writer.greet_new_readers();
        while self.command.take().is_some() {}
        self.sample_ready.notify();
    }

    fn run(mut self, stop: &AtomicBool) -> LoopReport {
        self.connect();
        let realtime = self.run.mode == Mode::Realtime;
        let core = self.run.core_of(Role::Loop);
        let steal = StealWatch::start(core.filter(|_| realtime), &self.run.cores);
        let held = realtime.then(|| apply(&treatment(core)));
        let begun_ns = monotonic_ns();
        let mut epoch_ns = if realtime {
            begun_ns + START_DELAY_NS
        } else {
            0
        };
        self.accounts.begin();
        let mut cycle = 0;
        // The drives take their clock from the first command; until then they are braked.
        self.send_brake(cycle, epoch_ns);
        while !stop.load(Ordering::Relaxed) && (self.run.cycles == 0 || cycle < self.run.cycles) {
            let due_ns = epoch_ns + cycle * self.config.period_ns;
            let mut skipped = 0;
            if realtime {
                wait_until(due_ns, self.run.wake_early_ns);
                skipped = monotonic_ns().saturating_sub(due_ns) / self.config.period_ns;
            }
            cycle += skipped;
            let sample_came = self.cycle(cycle, due_ns, skipped);
            cycle += 1;
            if realtime && sample_came {
                let later_ns = bus_clock::step_ns(&self.state.bus, self.config.period_ns);
                epoch_ns = epoch_ns.saturating_add_signed(later_ns);
            }
        }
        self.send_brake(cycle, epoch_ns + cycle * self.config.period_ns);
        while self.hand_out_last_cycle() {}
        self.driver.shutdown();
        let wall_s = (monotonic_ns() - begun_ns) as f64 * 1e-9;
        let steal_log = steal.finish();
        self.report(held.map(|(grant, _held)| grant), wall_s, cycle, &steal_log)
    }

    /// One cycle; whether its sample came. `due_ns` is the instant planned after the last one; `skipped` periods have passed since.
    fn cycle(&mut self, cycle: u64, due_ns: u64, skipped: u64) -> bool {
        let planned_ns = due_ns + skipped * self.config.period_ns;
        let woke_ns = monotonic_ns();
        let read_until_ns = if self.lockstep.is_some() {
            woke_ns + lockstep::PATIENCE_NS
        } else {
            planned_ns + self.config.period_ns / SAMPLE_DEADLINE_PARTS
        };
        let (session, joint_count) = (self.config.session, self.config.joint_count());
        let sample = self
            .driver
            .read(cycle, planned_ns, read_until_ns)
            .and_then(|sample| {
                check_sample(&sample, session, cycle, joint_count)?;
                self.state.admit(&self.config, cycle, &sample)?;
                Ok(sample)
            });
        let read_ns = monotonic_ns();
        let asked = sample.as_ref().ok().map(|sample| self.ask(cycle, sample));
        let asked_ns = monotonic_ns();
        let command = asked.and_then(|asked| self.await_command(&asked.header, planned_ns));
        if let (Some(asked), Some(peers)) = (&asked, &mut self.lockstep) {
            peers.wait(&asked.header, || {
                offer_again(&self.sample, &self.sample_ready)
            });
        }
        let answered_ns = monotonic_ns();
        let input = CycleInput {
            cycle,
            planned_ns,
            sample: sample.as_ref().map_err(|fault| *fault),
            command: command.as_ref(),
            orders: self.supervisor.orders(
                std::iter::from_fn(|| self.supervision.take()).take(topics::SUPERVISION.buffer),
            ),
        };
        let was_running = self.state.state == LoopState::Running;
        let output = self.state.step(&self.config, &input);
        let decided_ns = monotonic_ns();
        self.write(&output.drive_command);
        let written_ns = monotonic_ns();
        let times = CycleTimes {
            wakeup_lateness_ns: woke_ns.saturating_sub(due_ns),
            period_ns: self
                .woke_before_ns
                .map_or(0, |before_ns| woke_ns - before_ns),
            compute_ns: (asked_ns - read_ns) + (decided_ns - answered_ns),
            command_latency_ns: if command.is_some() {
                answered_ns - asked_ns
            } else {
                0
            },
            exchange_ns: (read_ns - woke_ns) + (written_ns - decided_ns),
            finished_after_ns: written_ns.saturating_sub(planned_ns),
        };
        self.woke_before_ns = Some(woke_ns);
        let facts = CycleFacts {
            cycle,
            planned_ns,
            skipped,
            times,
            sample_came: sample.is_ok(),
            command_came: command.is_some(),
            was_running,
            started: self.state.state.has_begun(),
            cycles_without_command: self.state.cycles_without_command,
            limited_joints: output.limited_joints,
        };
        let deadline_ns = self.lockstep.is_none().then_some(self.config.period_ns);
        self.accounts.count(&facts, deadline_ns);
        if facts.sample_came {
            self.accounts.count_bus(&self.state.bus);
        }
        let status = self.publish_status(&output, &times);
        self.keep(status, asked, command);
        self.prepare_next(cycle);
        facts.sample_came
    }

    fn ask(&mut self, cycle: u64, sample: &DriveSample) -> SensorSample {
        let message = self.state.sensor_sample(&self.config, cycle, sample);
        self.sample.send(message);
        self.sample_ready.notify();
        message
    }

    /// Waits for the command that answers `asked`; every other one is refused and counted.
    fn await_command(&mut self, asked: &Header, planned_ns: u64) -> Option<Command> {
        let give_up_at_ns = if self.lockstep.is_some() {
            monotonic_ns() + lockstep::PATIENCE_NS
        } else {
            planned_ns + self.run.command_deadline_ns
        };
        loop {
            let taken = self.command.take();
            if let Some(command) = taken
                && admits_command(&command, asked, &mut self.accounts.statistics.counters)
            {
                return Some(command);
            }
            // Looked at after every message: a service that floods its topic must not hold the cycle up.
            let now_ns = monotonic_ns();
            if now_ns >= give_up_at_ns {
                return None;
            }
            if taken.is_none() {
                self.wait_for_command(give_up_at_ns - now_ns);
            }
        }
    }

    fn wait_for_command(&mut self, timeout_ns: u64) {
        if self.lockstep.is_some() {
            if !self.command_ready.wait(timeout_ns.min(lockstep::OFFER_NS)) {
                offer_again(&self.sample, &self.sample_ready);
            }
        } else if self.run.wait == Wait::Spin {
            std::hint::spin_loop();
        } else {
            self.command_ready.wait(timeout_ns);
        }
    }

    fn write(&mut self, command: &DriveCommand) {
        let outcome = self.driver.write(command);
        self.accounts.statistics.counters.unsent_commands += u64::from(outcome.is_err());
        self.state.written(outcome);
    }

    fn publish_status(&mut self, output: &CycleOutput, times: &CycleTimes) -> LoopStatus {
        // Lockstep has no times: two runs must not differ.
        let times = if self.lockstep.is_some() {
            CycleTimes::default()
        } else {
            *times
        };
        let counters = &self.accounts.statistics.counters;
        let status = loop_status(&self.state, output, &times, counters);
        self.status.send(status);
        status
    }

    /// Keeps the cycle for the case that the loop stops, and after a stop hands out one that was kept.
    fn keep(&mut self, status: LoopStatus, asked: Option<SensorSample>, command: Option<Command>) {
        let last = LastCycle {
            status,
            sample: asked.unwrap_or_default(),
            command: command.unwrap_or_default(),
            has_sample: u32::from(asked.is_some()),
            has_command: u32::from(command.is_some()),
            index: 0,
            count: 0,
        };
        self.last_cycles.keep(last, self.state.state.is_latched());
        self.hand_out_last_cycle();
    }

    fn hand_out_last_cycle(&mut self) -> bool {
        let next = self.last_cycles.hand_out();
        next.is_some_and(|cycle| self.last_cycles_writer.send_and_prepare(cycle))
    }

    /// After everything urgent: the middleware's allocations for the next cycle, and now and then a heartbeat.
    fn prepare_next(&mut self, cycle: u64) {
        self.sample.prepare();
        self.status.prepare();
        self.driver.prepare();
        let beat_cycles = HEARTBEAT_NS.div_ceil(self.config.period_ns);
        if cycle.is_multiple_of(beat_cycles) {
            self.heartbeat.send_and_prepare(Heartbeat {
                session: self.config.session,
                process_id: u64::from(std::process::id()),
                sent_at_ns: monotonic_ns(),
                cycle,
            });
        }
    }

    fn send_brake(&mut self, cycle: u64, planned_ns: u64) {
        let header = Header {
            session: self.config.session,
            cycle,
            measured_at_ns: planned_ns,
            joint_count: self.config.joint_count() as u64,
        };
        let brake = DriveCommand {
            header,
            mode: DriveMode::Braked as u32,
            ..DriveCommand::default()
        };
        self.write(&brake);
        self.driver.prepare();
    }

    fn report(
        self,
        grant: Option<Grant>,
        wall_s: f64,
        cycles: u64,
        steal: &[(u64, u64)],
    ) -> LoopReport {
        let statistics = &self.accounts.statistics;
        LoopReport {
            grant,
            final_state: format!("{:?}", self.state.state),
            last_fault: self
                .state
                .fault
                .map(|fault| fault.sentence(&self.config.joint_names)),
            wall_s,
            controlled_s: cycles as f64 * self.config.period_ns as f64 * 1e-9,
            rate_hz: 1e9 / self.config.period_ns as f64,
            wakeup_lateness: Quantiles::of(&statistics.wakeup_lateness_ns),
            period: Quantiles::of(&statistics.period_ns),
            compute: Quantiles::of(&statistics.compute_ns),
            command_latency: Quantiles::of(&statistics.command_latency_ns),
            exchange: Quantiles::of(&statistics.exchange_ns),
            clock_offset: Quantiles::of(&statistics.clock_offset_ns),
            counters: named_counters(statistics),
            overrun_causes: overrun_causes(statistics, steal, self.config.period_ns),
            overruns: explained_overruns(statistics, steal, self.config.period_ns),
        }
    }
}

/// Sleeps until `early_ns` before the instant and watches the clock for the rest, which leaves the kernel that much time to
/// wake the thread late.
fn wait_until(instant_ns: u64, early_ns: u64) {
    sleep_until(instant_ns.saturating_sub(early_ns));
    while monotonic_ns() < instant_ns {
        std::hint::spin_loop();
    }
}

/// Offers the sample to a service that was started again since it was published.
fn offer_again(sample: &Writer<SensorSample>, ready: &Notifier) {
    sample.greet_new_readers();
    ready.notify();
}
