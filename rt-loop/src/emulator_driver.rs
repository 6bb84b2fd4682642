//! Drives in another process, the emulator or one of somebody else's: commands out and samples in over shared memory.

use realtime::clock::monotonic_ns;
use shm_types::bus::{Bus, BusError, Listener, Notifier, Reader, Writer};
use shm_types::instance::RunConfig;
use shm_types::messages::{DriveCommand, DriveMode, DriveSample};
use shm_types::topics;

use std::time::Duration;

use crate::driver::{
    Behind, Capabilities, DriveFault, Driver, DriverEntry, JointCapabilities, OpenContext,
    OpenError,
};

/// The emulator is at most a few latches ahead of a loop that is late; a sample further ahead is nonsense.
const AHEAD_MAX_CYCLES: u64 = 16;
/// Cycles without a command after which emulated drives stop by themselves, as `PlantParameters::watchdog_cycles` has it.
const WATCHDOG_CYCLES: u64 = 15;
/// How late a sample is taken whose wake-up was lost.
const RECHECK_NS: u64 = 100_000;

/// The plant emulator of the same instance.
pub const EMULATOR: DriverEntry = DriverEntry {
    name: "emulator",
    summary: "the emulated robot, which comes with it",
    behind: Behind::Emulator,
    open,
};

fn open(context: &OpenContext<'_>) -> Result<Box<dyn Driver>, OpenError> {
    let bus = context
        .bus
        .ok_or_else(|| OpenError::Setting("this driver is only there in a run".to_owned()))?;
    let driver = EmulatorDriver::open(bus, context.run)?;
    Ok(Box::new(driver))
}

/// Talks to the emulator process of the same instance.
#[derive(Debug)]
pub struct EmulatorDriver {
    session: u64,
    joint_count: usize,
    watchdog: Duration,
    command: CommandWriter,
    command_ready: Notifier,
    sample: Reader<DriveSample>,
    sample_ready: Listener,
    newest: Option<DriveSample>,
}

struct CommandWriter(Writer<DriveCommand>);

impl std::fmt::Debug for CommandWriter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Writer<DriveCommand>")
    }
}

impl EmulatorDriver {
    /// Opens the drive's topics for `run`.
    ///
    /// # Errors
    /// [`BusError`], also when another loop commands this drive.
    pub fn open(bus: &Bus, run: &RunConfig) -> Result<Self, BusError> {
        let command = bus.writer(&topics::DRIVE_COMMAND)?;
        let command_ready = bus.notifier(&topics::DRIVE_COMMAND_READY)?;
        let sample = bus.reader(&topics::DRIVE_SAMPLE)?;
        // Connects now to an emulator that is there already: the first exchange would take milliseconds.
        command.greet_new_readers();
        command_ready.notify();
        Ok(Self {
            session: run.session,
            joint_count: run.initial_position_rad.len(),
            watchdog: Duration::from_nanos(run.period_ns.saturating_mul(WATCHDOG_CYCLES)),
            command: CommandWriter(command),
            command_ready,
            sample,
            sample_ready: bus.listener(&topics::DRIVE_SAMPLE_READY, run.recheck_ns(RECHECK_NS))?,
            newest: None,
        })
    }

    /// Takes samples up to `cycle`; later ones stay in the queue, because the emulator may be one latch ahead. What is of
    /// another run, out of order or far ahead is dropped: kept, it would hide what comes after it.
    fn take_up_to(&mut self, cycle: u64) {
        while self.newest.is_none_or(|sample| sample.header.cycle < cycle) {
            let Some(sample) = self.sample.take() else {
                return;
            };
            let header = sample.header;
            let ours = header.session == self.session
                && header.cycle <= cycle.saturating_add(AHEAD_MAX_CYCLES);
            if ours
                && self
                    .newest
                    .is_none_or(|newest| newest.header.cycle < header.cycle)
            {
                self.newest = Some(sample);
            }
        }
    }
}

impl Driver for EmulatorDriver {
    fn capabilities(&self) -> Capabilities {
        let joint = JointCapabilities {
            device: "emulated drive".to_owned(),
            modes: vec![DriveMode::Torque, DriveMode::Velocity],
            watchdog: Some(self.watchdog),
            ..JointCapabilities::default()
        };
        Capabilities {
            bus: "shared memory".to_owned(),
            joints: vec![joint; self.joint_count],
            ..Capabilities::default()
        }
    }

    fn read(
        &mut self,
        cycle: u64,
        _planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        loop {
            self.take_up_to(cycle);
            match self.newest {
                Some(sample) if sample.header.cycle == cycle => return Ok(sample),
                Some(sample) if sample.header.cycle > cycle => {
                    return Err(DriveFault::ForeignSample);
                }
                _ => (),
            }
            let now_ns = monotonic_ns();
            if now_ns >= give_up_at_ns {
                return Err(match self.newest {
                    Some(sample) => DriveFault::StaleSample {
                        age_cycles: cycle - sample.header.cycle,
                    },
                    None => DriveFault::NoSample,
                });
            }
            self.sample_ready.wait(give_up_at_ns - now_ns);
        }
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        if !self.command.0.send(*command) {
            return Err(DriveFault::NotSent);
        }
        self.command_ready.notify();
        Ok(())
    }

    fn prepare(&mut self) {
        self.command.0.prepare();
    }
}
