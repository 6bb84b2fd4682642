//! Starts the processes of an instance, watches them, and leaves nothing behind.

pub mod child;
pub mod janitor;
pub mod last_cycles;
mod operator;

use std::fs::{File, TryLockError};
use std::io::{PipeWriter, Read, Seek, Write};
use std::os::unix::fs::MetadataExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use realtime::cores::{KeptOff, start_on};
use realtime::process::{bind_to_parent, user_id};
use shm_types::bus::{Bus, BusError, Reader};
use shm_types::instance::{Instance, InstanceError, Mode, RunConfig};
use shm_types::messages::{LastCycle, LoopStatus, SensorSample};
use shm_types::roster::{self, Member};
use shm_types::topics::{self, Role};

use crate::drivers;
use child::{Child, Restart, is_broken};
use last_cycles::LastCycles;
use operator::Operator;

/// How long a process may take from its start to its first heartbeat.
const START_PATIENCE: Duration = Duration::from_secs(10);
/// A process silent for longer than this hangs, and is killed.
const SILENCE_MAX: Duration = Duration::from_secs(2);
/// The same in lockstep, where nobody is late: on a busy machine a process may get no core for seconds.
const LOCKSTEP_SILENCE_MAX: Duration = Duration::from_secs(30);
/// For the loop in lockstep, which is silent for as long as one of the others is, and goes on once that one was started again.
const LOCKSTEP_LOOP_SILENCE_MAX: Duration = Duration::from_secs(120);
/// How long a process may take to end when asked to.
const STOP_PATIENCE: Duration = Duration::from_secs(3);
/// Between two looks at the processes.
pub const WATCH_INTERVAL: Duration = Duration::from_millis(5);
/// How often a lock that vanished while it was taken is tried again.
const LOCK_TRIES: usize = 100;

/// Why an instance cannot be started or kept.
#[derive(Debug, thiserror::Error)]
pub enum SupervisorError {
    /// Somebody else runs an instance of this name.
    #[error(
        "instance `{name}` is in use by process {process_id}; stop that one, or choose another name with --instance"
    )]
    Occupied {
        /// The instance.
        name: String,
        /// Who holds it, as far as known.
        process_id: String,
    },
    /// The instance's directory cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The instance's topics cannot be read.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A process cannot be started.
    #[error("cannot start {what}: {source}")]
    Start {
        /// Which one.
        what: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A process ended during start-up, or gave no sign of life.
    #[error("{role} {reason}")]
    NotReady {
        /// Which one.
        role: &'static str,
        /// What it did instead.
        reason: String,
    },
    /// The loop does not begin with these drives; it has said why.
    #[error("loop refused the drives; the line above says what to change")]
    Refused,
    /// A process that a run cannot go on without is gone.
    #[error("{role} ended: {reason}")]
    Lost {
        /// Which one.
        role: &'static str,
        /// How.
        reason: String,
    },
}

/// A running instance. Dropping it without [`stop`](Self::stop) leaves the rest to the janitor.
#[derive(Debug)]
pub struct Supervisor {
    instance: Instance,
    janitor: std::process::Child,
    life_line: PipeWriter,
    children: Vec<Child>,
    bus: Bus,
    status: Reader<LoopStatus>,
    operator: Operator,
    last_cycles: LastCycles,
    restarts: Vec<Restart>,
    begun: Instant,
    config: RunConfig,
    _kept_off: Option<KeptOff>,
    _lock: File,
}

impl Supervisor {
    /// Takes the instance, removes what an earlier run may have left, and starts every process but the loop.
    ///
    /// # Errors
    /// [`SupervisorError`]; whatever was started is stopped again.
    pub fn start(instance: &Instance, config: &RunConfig) -> Result<Self, SupervisorError> {
        let lock = take_lock(instance)?;
        // First of all: from here on nothing that is made is left, whenever this process is killed.
        let (life_line, janitor) = start_janitor(instance, &lock)?;
        instance.wipe()?;
        instance.make_directory()?;
        instance.write_run_config(config)?;
        let bus = Bus::join(instance)?;
        let status = bus.reader(&topics::OBSERVED_STATUS)?;
        let operator = Operator::open(&bus, config.session)?;
        let last_cycles = LastCycles::open(&bus, config)?;
        let mut supervisor = Self {
            operator,
            last_cycles,
            instance: instance.clone(),
            janitor,
            life_line,
            children: Vec::new(),
            bus,
            status,
            restarts: Vec::new(),
            begun: Instant::now(),
            config: config.clone(),
            // Two hundred looks a second at five processes would hold up the loop's wake-ups.
            _kept_off: config
                .core_of(Role::Loop)
                .filter(|_| config.mode == Mode::Realtime)
                .and_then(|core| KeptOff::core(core, &config.cores)),
            _lock: lock,
        };
        let services = Role::ALL.into_iter().filter(|role| match role {
            Role::Loop => false,
            Role::Emulator => drivers::is_emulated(&config.driver),
            Role::Estimator | Role::Feedforward | Role::Relay => true,
        });
        let started = supervisor.start_all(services);
        match started.and_then(|()| supervisor.await_ready()) {
            Ok(()) => Ok(supervisor),
            Err(error) => {
                // The reason why it did not start is worth more than how it stopped.
                let _ = supervisor.stop();
                supervisor.leave();
                Err(error)
            }
        }
    }

    fn start_all(&mut self, roles: impl Iterator<Item = Role>) -> Result<(), SupervisorError> {
        for role in roles {
            self.spawn(role)?;
        }
        Ok(())
    }

    /// Starts the loop; from now on the robot moves.
    ///
    /// # Errors
    /// [`SupervisorError`].
    pub fn start_loop(&mut self) -> Result<(), SupervisorError> {
        self.spawn(Role::Loop)?;
        self.begun = Instant::now();
        Ok(())
    }

    fn spawn(&mut self, role: Role) -> Result<(), SupervisorError> {
        // The topic admits one reader: the predecessor's has to go first.
        self.children.retain(|child| child.role() != role);
        let heartbeat = self.bus.reader(&role.heartbeat())?;
        let start_error = |source| SupervisorError::Start {
            what: role.name(),
            source,
        };
        let cores = self.config.start_cores(role);
        let process =
            spawn_process(&self.instance, role, &self.life_line, cores).map_err(start_error)?;
        let process_id = process.id();
        self.children.push(Child::new(role, process, heartbeat));
        writeln!(self.life_line, "{process_id}").map_err(start_error)?;
        roster::write(&self.instance, &self.members())?;
        Ok(())
    }

    fn members(&self) -> Vec<Member> {
        let member = |child: &Child| {
            let role = child.role().name();
            let ends = || self.restarts.iter().filter(|restart| restart.role == role);
            Member {
                role: role.to_owned(),
                process_id: child.process_id(),
                started_at_ns: child.started_at_ns(),
                restarts: ends().count() as u64,
                last_end: ends().next_back().map(|restart| restart.reason.clone()),
            }
        };
        self.children.iter().map(member).collect()
    }

    fn await_ready(&mut self) -> Result<(), SupervisorError> {
        let begun = Instant::now();
        loop {
            let mut waiting = None;
            for child in &mut self.children {
                if let Some(ended) = child.ended() {
                    return Err(SupervisorError::NotReady {
                        role: child.role().name(),
                        reason: format!("ended at its start ({ended})"),
                    });
                }
                child.listen();
                if !child.is_ready() {
                    waiting = Some(child.role().name());
                }
            }
            let Some(role) = waiting else { return Ok(()) };
            if begun.elapsed() > START_PATIENCE {
                let reason = format!(
                    "gave no sign of life within {} s of its start",
                    START_PATIENCE.as_secs()
                );
                return Err(SupervisorError::NotReady { role, reason });
            }
            std::thread::sleep(WATCH_INTERVAL);
        }
    }

    /// Looks after the processes once: passes the operator's orders on, restarts services that ended or hang. `true` while the loop runs.
    ///
    /// # Errors
    /// [`SupervisorError::Lost`] if the emulator is gone, or a service ends again and again.
    pub fn watch(&mut self) -> Result<bool, SupervisorError> {
        self.operator.pass_on();
        let mut to_restart = Vec::new();
        for child in &mut self.children {
            child.listen();
            if child.is_ready()
                && let Some(restart) = self
                    .restarts
                    .iter_mut()
                    .rev()
                    .find(|restart| restart.role == child.role().name())
                && restart.back_after_ms.is_none()
            {
                restart.back_after_ms = child.ready_after().map(|after| after.as_secs_f64() * 1e3);
            }
            let reason = match child.ended() {
                Some(ended) => ended,
                None => {
                    // A loop that only starts is missed by nobody: the joints are braked.
                    let starts = child.role() == Role::Loop && !child.is_ready();
                    let silence_max = silence_max(self.config.mode, child.role());
                    let patience = match starts {
                        true => START_PATIENCE.max(silence_max),
                        false => silence_max,
                    };
                    if !child.is_silent(patience) {
                        continue;
                    }
                    child.kill();
                    format!("silent for {} s", patience.as_secs())
                }
            };
            match child.role() {
                Role::Loop => {
                    return if reason == "exit code 0" {
                        Ok(false)
                    } else if reason == "exit code 2" && !child.is_ready() {
                        Err(SupervisorError::Refused)
                    } else {
                        Err(lost(child, reason))
                    };
                }
                Role::Emulator => return Err(lost(child, reason)),
                role if is_broken(&self.restarts, role, &reason) => {
                    return Err(lost(child, reason));
                }
                role @ (Role::Estimator | Role::Feedforward | Role::Relay) => {
                    to_restart.push((role, reason))
                }
            }
        }
        for (role, reason) in to_restart {
            let at_s = self.begun.elapsed().as_secs_f64();
            self.restarts.push(Restart {
                role: role.name().to_owned(),
                at_s,
                reason,
                back_after_ms: None,
            });
            self.spawn(role)?;
        }
        Ok(true)
    }

    /// The loop's newest status, if there is one since the last look.
    pub fn newest_status(&self) -> Option<LoopStatus> {
        self.status.take_newest()
    }

    /// The loop's oldest status that was not looked at yet.
    pub fn next_status(&self) -> Option<LoopStatus> {
        self.status.take()
    }

    /// The loop's samples, as observers hear them.
    ///
    /// # Errors
    /// [`BusError`] if observers have all the places.
    pub fn samples(&self) -> Result<Reader<SensorSample>, BusError> {
        self.bus.reader(&topics::OBSERVED_SAMPLE)
    }

    /// Stops the loop, as an operator's order does, at the next [`watch`](Self::watch).
    pub fn emergency_stop(&mut self) {
        self.operator.emergency_stop();
    }

    /// The number of a stop, from 1, and the loop's last cycles before it, once they are all there.
    pub fn last_cycles(&mut self) -> Option<(usize, Vec<LastCycle>)> {
        self.last_cycles.take()
    }

    /// Services that ended during the run and were started again.
    pub fn restarts(&self) -> &[Restart] {
        &self.restarts
    }

    /// Stops everything in order: the loop brakes, the services end, the relay closes the recording.
    ///
    /// # Errors
    /// [`SupervisorError::Lost`] for the first process that had to be killed.
    pub fn stop(&mut self) -> Result<(), SupervisorError> {
        let mut outcome = Ok(());
        for role in [
            Role::Loop,
            Role::Feedforward,
            Role::Estimator,
            Role::Emulator,
            Role::Relay,
        ] {
            let Some(child) = self.children.iter_mut().find(|child| child.role() == role) else {
                continue;
            };
            if !child.stop(STOP_PATIENCE) && outcome.is_ok() {
                outcome = Err(lost(
                    child,
                    format!(
                        "did not stop within {} s and was killed",
                        STOP_PATIENCE.as_secs()
                    ),
                ));
            }
        }
        self.children.clear();
        outcome
    }

    /// Leaves the instance: reads are over, the janitor wipes it. Waits until that is done.
    pub fn leave(self) {
        let Self {
            mut janitor,
            life_line,
            bus,
            status,
            operator,
            last_cycles,
            children,
            ..
        } = self;
        drop((children, status, operator, last_cycles, bus, life_line));
        let _ = janitor.wait();
    }
}

fn silence_max(mode: Mode, role: Role) -> Duration {
    match (mode, role) {
        (Mode::Realtime, _) => SILENCE_MAX,
        (Mode::Lockstep, Role::Loop) => LOCKSTEP_LOOP_SILENCE_MAX,
        (Mode::Lockstep, _) => LOCKSTEP_SILENCE_MAX,
    }
}

fn lost(child: &Child, reason: String) -> SupervisorError {
    SupervisorError::Lost {
        role: child.role().name(),
        reason,
    }
}

/// Takes the instance's lock. The janitor of an earlier run may remove the file between opening and locking it: then
/// what was locked is no longer the file of that name, and the next try makes a new one.
fn take_lock(instance: &Instance) -> Result<File, SupervisorError> {
    let path = instance.lock_file();
    let file_error = |source| InstanceError::File {
        path: path.clone(),
        source,
    };
    let mut tries = 0;
    loop {
        tries += 1;
        instance.make_parent(user_id())?;
        let mut file = match File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
        {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && tries < LOCK_TRIES => {
                continue;
            }
            opened => opened.map_err(file_error)?,
        };
        match file.try_lock() {
            Ok(()) => (),
            Err(TryLockError::WouldBlock) => {
                let mut process_id = String::new();
                file.read_to_string(&mut process_id).map_err(file_error)?;
                let process_id = process_id.trim().to_owned();
                return Err(SupervisorError::Occupied {
                    name: instance.name().to_owned(),
                    process_id,
                });
            }
            Err(TryLockError::Error(source)) => return Err(file_error(source).into()),
        }
        let locked = file.metadata().map_err(file_error)?.ino();
        if std::fs::metadata(&path).is_ok_and(|named| named.ino() == locked) || tries >= LOCK_TRIES
        {
            file.set_len(0).map_err(file_error)?;
            file.rewind().map_err(file_error)?;
            write!(file, "{}", std::process::id()).map_err(file_error)?;
            return Ok(file);
        }
    }
}

fn start_janitor(
    instance: &Instance,
    lock: &File,
) -> Result<(PipeWriter, std::process::Child), SupervisorError> {
    let start = || {
        let (life_end, life_line) = std::io::pipe()?;
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args(["process", "janitor", "--instance", instance.name()])
            .stdin(life_end)
            // Not written to: it is the lock, shared with this process.
            .stdout(lock.try_clone()?);
        // Ctrl-C in a terminal is for the supervisor.
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        Ok((life_line, command.spawn()?))
    };
    start().map_err(|source| SupervisorError::Start {
        what: "janitor",
        source,
    })
}

fn spawn_process(
    instance: &Instance,
    role: Role,
    life_line: &PipeWriter,
    cores: &[usize],
) -> std::io::Result<std::process::Child> {
    let mut command = Command::new(std::env::current_exe()?);
    command
        .args(["process", role.name(), "--instance", instance.name()])
        // Not read from: held open, so that the janitor sees the last process end.
        .stdin(Stdio::from(life_line.try_clone()?))
        .stdout(Stdio::null());
    bind_to_parent(&mut command);
    start_on(&mut command, cores.to_vec());
    command.spawn()
}
