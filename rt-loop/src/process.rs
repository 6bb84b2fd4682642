//! The process around the cycle: clock, shared memory, driver, and the order in which they are used.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use realtime::clock::{monotonic_ns, sleep_until};
use realtime::grant::{Grant, Request, apply};
use realtime::usage::{ThreadUsage, stolen_ns, thread_usage};
use robot::Robot;
use shm_types::bus::{Bus, BusError, Listener, Notifier, Reader, Writer};
use shm_types::instance::{Instance, InstanceError, Mode, RunConfig, Wait};
use shm_types::messages::{
    Command, DriveCommand, DriveMode, DriveSample, Header, Heartbeat, LastCycle, LoopState,
    LoopStatus, SensorSample, Supervision, TorqueEstimate,
};
use shm_types::topics::{self, Role};

use crate::admission::{admits_command, check_sample};
use crate::cycle::{CycleConfig, CycleInput, CycleOutput, CycleState};
use crate::driver::Driver;
use crate::emulator_driver::EmulatorDriver;
use crate::last_cycles::LastCycles;
use crate::limits::JointLimits;
use crate::report::{LOOP_REPORT_FILE, LoopReport, Quantiles, named_counters, overrun_causes};
use crate::statistics::{CycleTimes, Overrun, Statistics};
use crate::status::loop_status;
use crate::supervision::SupervisorWatch;

/// Names `--driver` takes.
pub const DRIVERS: [&str; 1] = ["emulator"];

/// Cycles without a fresh command for which the last torque is held: 10 ms at 1.5 kHz.
const HOLD_CYCLES: u64 = 15;
/// Cycles of damping after that: 100 ms at 1.5 kHz. A joint that gravity pulls falls on slowly while it is damped.
const DAMPING_CYCLES: u64 = 150;
/// Cycles with closed brakes after that: up to 3 s, enough for a service to be started again.
const WAITING_CYCLES: u64 = 4350;
/// Part of the period in which the drives' sample must have come.
const SAMPLE_DEADLINE_PARTS: u64 = 3;
/// In lockstep nobody is late; this long without an answer means that somebody is gone.
const LOCKSTEP_PATIENCE_NS: u64 = 10_000_000_000;
/// In lockstep, how often a waiting loop offers its sample to services that have just been started again.
const LOCKSTEP_OFFER_NS: u64 = 20_000_000;
/// How late an answer is taken whose wake-up was lost.
const RECHECK_NS: u64 = 100_000;
/// A supervisor silent for longer than this is gone, and with it the operator's way to stop the robot. It gives the loop as long.
const SUPERVISOR_SILENCE_NS: u64 = 2_000_000_000;
/// Cycles between heartbeats: 100 ms at 1.5 kHz.
const HEARTBEAT_CYCLES: u64 = 150;
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
    #[error("unknown driver `{name}`; known: {}", DRIVERS.join(", "))]
    UnknownDriver {
        /// As given.
        name: String,
    },
}

/// Runs the loop of `instance` until its cycles are done or `stop` is set, and leaves its report there.
///
/// # Errors
/// [`LoopError`] if it cannot start; once started it runs to its end.
pub fn run(instance: &Instance, stop: &AtomicBool) -> Result<(), LoopError> {
    let run = instance.run_config()?;
    let robot = robot::load(&run.robot)?;
    let bus = Bus::join(instance)?;
    let driver = match run.driver.as_str() {
        "emulator" => EmulatorDriver::open(&bus, run.session)?,
        name => {
            return Err(LoopError::UnknownDriver {
                name: name.to_owned(),
            });
        }
    };
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

/// What the cycle needs to know of a run of this robot.
pub fn cycle_config(run: &RunConfig, robot: &Robot) -> CycleConfig {
    let joints = (0..robot.joints.len())
        .map(|joint| joint_limits(robot, joint))
        .collect();
    CycleConfig {
        session: run.session,
        period_ns: run.period_ns,
        joints,
        joint_names: robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect(),
        hold_cycles: HOLD_CYCLES,
        damping_cycles: DAMPING_CYCLES,
        waiting_cycles: WAITING_CYCLES,
    }
}

/// Without a torque limit in the robot file: as good as none, but finite.
const NO_TORQUE_LIMIT_NM: f64 = 1e6;
/// A torque may go from nothing to its limit in this time.
const FULL_TORQUE_TIME_S: f64 = 0.01;
/// A commanded velocity may go from nothing to its limit in this time.
const FULL_VELOCITY_TIME_S: f64 = 0.1;
/// Without a velocity limit in the robot file.
const NO_VELOCITY_LIMIT_RAD_S: f64 = 1e3;

fn joint_limits(robot: &Robot, index: usize) -> JointLimits {
    let joint = &robot.joints[index];
    let motor_torque_nm = joint.torque_limit_nm.unwrap_or(NO_TORQUE_LIMIT_NM);
    let velocity_rad_s = joint
        .velocity_limit_rad_s
        .unwrap_or(NO_VELOCITY_LIMIT_RAD_S);
    let [position_min_rad, position_max_rad] = joint
        .position_limit_rad
        .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let damping_nm_s_rad = robot
        .control
        .as_ref()
        .map_or(0.0, |control| control.derivative_nm_s_rad[index]);
    JointLimits {
        gear_ratio: joint.gear_ratio,
        motor_torque_nm,
        motor_torque_rate_nm_s: motor_torque_nm / FULL_TORQUE_TIME_S,
        position_min_rad,
        position_max_rad,
        velocity_rad_s,
        acceleration_rad_s2: velocity_rad_s / FULL_VELOCITY_TIME_S,
        damping_nm_s_rad,
    }
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
    statistics: Statistics,
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
    usage: ThreadUsage,
    woke_before_ns: Option<u64>,
    /// Whether the last cycle's work ended after its period: it then has to answer for the periods skipped next.
    overran: bool,
}

/// What happened in one cycle, to be counted.
struct CycleFacts {
    cycle: u64,
    planned_ns: u64,
    skipped: u64,
    times: CycleTimes,
    sample_came: bool,
    command_came: bool,
    was_running: bool,
    limited_joints: u64,
}

/// Those a loop in lockstep waits for beside the drives and the command.
struct LockstepPeers {
    estimate: Reader<TorqueEstimate>,
    estimate_ready: Listener,
    relay_progress: Reader<Heartbeat>,
    relay_cycle: u64,
}

impl<D: Driver> Loop<D> {
    fn new(bus: &Bus, driver: D, run: RunConfig, config: CycleConfig) -> Result<Self, BusError> {
        let lockstep = match run.mode {
            Mode::Realtime => None,
            Mode::Lockstep => Some(LockstepPeers {
                estimate: bus.reader(&topics::TORQUE_ESTIMATE)?,
                estimate_ready: bus.listener(&topics::TORQUE_ESTIMATE_READY, RECHECK_NS)?,
                relay_progress: bus.reader(&topics::RELAY_PROGRESS)?,
                relay_cycle: 0,
            }),
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
            statistics: Statistics::default(),
            sample: bus.writer(&topics::SENSOR_SAMPLE)?,
            sample_ready: bus.notifier(&topics::SENSOR_SAMPLE_READY)?,
            command: bus.reader(&topics::COMMAND)?,
            command_ready: bus.listener(&topics::COMMAND_READY, RECHECK_NS)?,
            status: bus.writer(&topics::LOOP_STATUS)?,
            heartbeat: bus.writer(&Role::Loop.heartbeat())?,
            lockstep,
            usage: ThreadUsage::default(),
            woke_before_ns: None,
            overran: false,
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
        let steal = StealWatch::start();
        let realtime = self.run.mode == Mode::Realtime;
        let held = realtime.then(|| {
            let core = self.run.core_of(Role::Loop);
            apply(&treatment(core))
        });
        let begun_ns = monotonic_ns();
        let epoch_ns = if realtime {
            begun_ns + START_DELAY_NS
        } else {
            0
        };
        self.usage = thread_usage();
        let mut cycle = 0;
        // The drives take their clock from the first command; until then they are braked.
        self.send_brake(cycle, epoch_ns);
        while !stop.load(Ordering::Relaxed) && (self.run.cycles == 0 || cycle < self.run.cycles) {
            let due_ns = epoch_ns + cycle * self.config.period_ns;
            let mut skipped = 0;
            if realtime {
                sleep_until(due_ns);
                skipped = monotonic_ns().saturating_sub(due_ns) / self.config.period_ns;
            }
            cycle += skipped;
            self.cycle(cycle, due_ns, skipped);
            cycle += 1;
        }
        self.send_brake(cycle, epoch_ns + cycle * self.config.period_ns);
        while self.hand_out_last_cycle() {}
        let wall_s = (monotonic_ns() - begun_ns) as f64 * 1e-9;
        let steal_log = steal.finish();
        self.report(held.map(|(grant, _held)| grant), wall_s, cycle, &steal_log)
    }

    /// One cycle. `due_ns` is the instant planned after the last one; `skipped` periods have passed since.
    fn cycle(&mut self, cycle: u64, due_ns: u64, skipped: u64) {
        let planned_ns = due_ns + skipped * self.config.period_ns;
        let lockstep = self.lockstep.is_some();
        let woke_ns = monotonic_ns();
        let read_until_ns = if lockstep {
            woke_ns + LOCKSTEP_PATIENCE_NS
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
        if let Some(asked) = &asked {
            self.await_lockstep_peers(&asked.header);
        }
        let answered_ns = monotonic_ns();
        let input = CycleInput {
            cycle,
            planned_ns,
            sample: sample.as_ref().map_err(|fault| *fault),
            command: command.as_ref(),
            orders: self
                .supervisor
                .orders(std::iter::from_fn(|| self.supervision.take())),
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
        self.count(&CycleFacts {
            cycle,
            planned_ns,
            skipped,
            times,
            sample_came: sample.is_ok(),
            command_came: command.is_some(),
            was_running,
            limited_joints: output.limited_joints,
        });
        let status = self.publish_status(&output, &times);
        self.keep(status, asked, command);
        self.prepare_next(cycle);
    }

    fn ask(&mut self, cycle: u64, sample: &DriveSample) -> SensorSample {
        let message = self.state.sensor_sample(&self.config, cycle, sample);
        self.sample.send(message);
        self.sample_ready.notify();
        message
    }

    /// Waits for the command that answers `asked`; every other one is refused and counted.
    fn await_command(&mut self, asked: &Header, planned_ns: u64) -> Option<Command> {
        let lockstep = self.lockstep.is_some();
        let give_up_at_ns = if lockstep {
            monotonic_ns() + LOCKSTEP_PATIENCE_NS
        } else {
            planned_ns + self.run.command_deadline_ns
        };
        loop {
            while let Some(command) = self.command.take() {
                if admits_command(&command, asked, &mut self.statistics.counters) {
                    return Some(command);
                }
            }
            let now_ns = monotonic_ns();
            if now_ns >= give_up_at_ns {
                return None;
            }
            self.wait_for_command(give_up_at_ns - now_ns);
        }
    }

    fn wait_for_command(&mut self, timeout_ns: u64) {
        if self.lockstep.is_some() {
            if !self.command_ready.wait(timeout_ns.min(LOCKSTEP_OFFER_NS)) {
                self.offer_sample_again();
            }
        } else if self.run.wait == Wait::Spin {
            std::hint::spin_loop();
        } else {
            self.command_ready.wait(timeout_ns);
        }
    }

    /// For a service that was started again since the sample was published.
    fn offer_sample_again(&mut self) {
        self.sample.greet_new_readers();
        self.sample_ready.notify();
    }

    /// In lockstep the cycle ends when the estimator has answered too and the relay is not about to lose messages.
    fn await_lockstep_peers(&mut self, asked: &Header) {
        let give_up_at_ns = monotonic_ns() + LOCKSTEP_PATIENCE_NS;
        loop {
            let Some(peers) = &mut self.lockstep else {
                return;
            };
            let mut answered = false;
            while let Some(estimate) = peers.estimate.take() {
                answered |= estimate.header.answers(asked).is_ok();
            }
            if answered || monotonic_ns() >= give_up_at_ns {
                break;
            }
            if !peers.estimate_ready.wait(LOCKSTEP_OFFER_NS) {
                self.offer_sample_again();
            }
        }
        while let Some(peers) = &mut self.lockstep {
            if let Some(progress) = peers.relay_progress.take_newest() {
                peers.relay_cycle = progress.cycle;
            }
            let behind = asked.cycle.saturating_sub(peers.relay_cycle);
            if behind < topics::RELAY_BUFFER as u64 / 2 || monotonic_ns() >= give_up_at_ns {
                break;
            }
            sleep_until(monotonic_ns() + RELAY_POLL_NS);
        }
    }

    fn write(&mut self, command: &DriveCommand) {
        if self.driver.write(command).is_err() {
            self.statistics.counters.drive_faults += 1;
        }
    }

    fn count(&mut self, facts: &CycleFacts) {
        let usage = thread_usage();
        let page_faults = usage.page_faults - self.usage.page_faults;
        let involuntary_switches = usage.involuntary_switches - self.usage.involuntary_switches;
        self.usage = usage;
        self.statistics.record(&facts.times);
        let started = self.state.state > LoopState::Ready;
        let counters = &mut self.statistics.counters;
        counters.page_faults += page_faults;
        counters.involuntary_switches += involuntary_switches;
        counters.drive_faults += u64::from(!facts.sample_came);
        counters.limited_commands += u64::from(facts.limited_joints.count_ones());
        counters.longest_command_gap_cycles = counters
            .longest_command_gap_cycles
            .max(self.state.cycles_without_command);
        if started && !facts.command_came {
            counters.stale_commands += 1;
            counters.command_gaps += u64::from(facts.was_running);
        }
        counters.skipped_periods += facts.skipped;
        let late = self.lockstep.is_none() && facts.times.finished_after_ns > self.config.period_ns;
        let overslept = if self.overran {
            self.statistics.extend_overrun(facts.skipped);
            0
        } else {
            facts.skipped
        };
        self.overran = started && late;
        let periods = overslept + u64::from(late || !facts.command_came);
        if started && periods > 0 {
            self.statistics.record_overrun(Overrun {
                cycle: facts.cycle,
                planned_ns: facts.planned_ns,
                times: facts.times,
                periods,
                page_faults,
                involuntary_switches,
                command_came: facts.command_came,
                sample_came: facts.sample_came,
            });
        }
    }

    fn publish_status(&mut self, output: &CycleOutput, times: &CycleTimes) -> LoopStatus {
        // Lockstep has no times: two runs must not differ.
        let times = if self.lockstep.is_some() {
            CycleTimes::default()
        } else {
            *times
        };
        let status = loop_status(&self.state, output, &times, &self.statistics.counters);
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
        if cycle.is_multiple_of(HEARTBEAT_CYCLES) {
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
        let statistics = &self.statistics;
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
            counters: named_counters(statistics),
            overrun_causes: overrun_causes(statistics, steal, self.config.period_ns),
        }
    }
}

/// How often a loop in lockstep looks whether the relay has caught up.
const RELAY_POLL_NS: u64 = 200_000;
/// How often the time stolen by the hypervisor is read.
const STEAL_POLL: std::time::Duration = std::time::Duration::from_millis(10);

/// Reads the stolen time beside the loop, on an ordinary thread. Of all cores: what is taken from a service or the
/// emulator makes the loop late just as well.
struct StealWatch {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Vec<(u64, u64)>>,
}

impl StealWatch {
    /// To be started before the caller becomes a real-time thread, whose scheduling its children inherit.
    fn start() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut log: Vec<(u64, u64)> = Vec::new();
            while !stopped.load(Ordering::Relaxed) {
                let stolen = std::fs::read_to_string("/proc/stat")
                    .ok()
                    .and_then(|text| stolen_ns(&text));
                if let Some(stolen) = stolen
                    && log.last().is_none_or(|&(_, before)| before != stolen)
                {
                    log.push((monotonic_ns(), stolen));
                }
                std::thread::sleep(STEAL_POLL);
            }
            log
        });
        Self { stop, thread }
    }

    fn finish(self) -> Vec<(u64, u64)> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap_or_default()
    }
}
