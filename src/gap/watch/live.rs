//! The running loop, through the relay: one thread takes messages as they come, the other watches and diagnoses.

use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use realtime::clock::monotonic_ns;
use realtime::process::user_id;
use robot::Robot;
use services::relay::{Assembler, CycleMessages};
use shm_types::bus::{Bus, BusError, Reader};
use shm_types::instance::{Instance, RunConfig};
use shm_types::messages::{LoopStatus, SensorSample};
use shm_types::topics;

use super::{Told, Watched};
use crate::cli::GapWatchArguments;
use crate::error::CliError;
use crate::monitor::{running, stay_off_the_loops_core};
use crate::run::stop_on_signals;

/// Between two looks at the topics, which hold 43 ms of messages.
const POLL: Duration = Duration::from_millis(10);
/// Between two looks at whether the run has ended.
const ALIVE_NS: u64 = 500_000_000;

/// Watches until the run ends or somebody presses Ctrl-C.
///
/// # Errors
/// [`CliError::Input`] if there is no such instance.
pub fn along_instance(arguments: &GapWatchArguments, told: &mut Told) -> Result<(), CliError> {
    let instance = Instance::new(&arguments.instance, user_id()).map_err(CliError::input)?;
    let run = running(&instance)?;
    // all threads of the diagnosis are started from here on
    stay_off_the_loops_core(&run);
    let robot = robot::load(arguments.robot.as_ref().unwrap_or(&run.robot));
    let robot = robot.map_err(CliError::input)?;
    let mut feed = Feed::join(instance, &run, robot.joints.len())?;
    let stop = stop_on_signals()?;
    let (cycles, to_watch) = channel();
    let mut watched = Watched::new(robot, run.period_ns, arguments);
    std::thread::scope(|scope| {
        let watching = scope.spawn(move || watch_all(&mut watched, &to_watch, told));
        while !stop.load(Ordering::Relaxed) && feed.drain(|cycle| cycles.send(cycle).is_ok()) {
            std::thread::sleep(POLL);
        }
        drop(cycles);
        watching.join().unwrap_or_else(|_| {
            Err(CliError::Negative(
                "gap watch: the diagnosis ended unexpectedly".to_owned(),
            ))
        })
    })
}

fn watch_all(
    watched: &mut Watched,
    cycles: &Receiver<CycleMessages>,
    told: &mut Told,
) -> Result<(), CliError> {
    for cycle in cycles {
        watched.take(&cycle, told)?;
    }
    Ok(())
}

/// What an observer hears through the relay of a running instance, cycle by cycle.
pub struct Feed {
    instance: Instance,
    session: u64,
    joint_count: usize,
    statuses: Reader<LoopStatus>,
    samples: Reader<SensorSample>,
    assembler: Assembler,
    alive_at_ns: u64,
    _bus: Bus,
}

impl Feed {
    /// Attaches to the running instance of that name; also what it runs, and its robot. The thread keeps off the loop's core from here
    /// on.
    ///
    /// # Errors
    /// [`CliError::Input`] if none runs, or the relay has readers enough.
    pub fn attach(name: &str) -> Result<(Self, RunConfig, Robot), CliError> {
        let instance = Instance::new(name, user_id()).map_err(CliError::input)?;
        let run = running(&instance)?;
        stay_off_the_loops_core(&run);
        let robot = robot::load(&run.robot).map_err(CliError::input)?;
        let feed = Self::join(instance, &run, robot.joints.len())?;
        Ok((feed, run, robot))
    }

    fn join(instance: Instance, run: &RunConfig, joint_count: usize) -> Result<Self, CliError> {
        let bus = Bus::join(&instance).map_err(CliError::input)?;
        let full = |error: BusError| {
            CliError::Input(format!(
                "{error}; the relay serves {} readers at a time, the supervisor among them: close one",
                topics::OBSERVED_STATUS.readers_max
            ))
        };
        Ok(Self {
            session: run.session,
            joint_count,
            statuses: bus.reader(&topics::OBSERVED_STATUS).map_err(full)?,
            samples: bus.reader(&topics::OBSERVED_SAMPLE).map_err(full)?,
            assembler: Assembler::default(),
            alive_at_ns: 0,
            instance,
            _bus: bus,
        })
    }

    /// Hands on every cycle that is whole; `false` once the run has ended or nobody listens.
    pub fn drain(&mut self, mut each: impl FnMut(CycleMessages) -> bool) -> bool {
        while let Some(status) = self.statuses.take() {
            if status.header.check(self.session, self.joint_count).is_ok() {
                self.assembler.add_status(status);
            }
        }
        while let Some(sample) = self.samples.take() {
            let cycle = sample.header.cycle;
            if let Some(sample) = sample.checked(self.session, self.joint_count)
                && let Some(row) = self.assembler.row(cycle)
            {
                row.sample = Some(sample);
            }
        }
        while let Some(cycle) = self.assembler.next_due() {
            if !each(cycle) {
                return false;
            }
        }
        let now_ns = monotonic_ns();
        if now_ns < self.alive_at_ns {
            return true;
        }
        self.alive_at_ns = now_ns + ALIVE_NS;
        let run = self.instance.run_config();
        run.is_ok_and(|run| run.session == self.session)
    }
}
