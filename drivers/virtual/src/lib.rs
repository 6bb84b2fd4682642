//! Drivers and the virtual drives they are for, back to back in virtual time: no socket, no port, no clock of a machine.
//!
//! The drivers are those of a run, from the first frame that finds the drives to the last; so are the virtual drives. Only
//! the cable between them is memory, and time goes on only when somebody waits or [`VirtualDrives::pass_until`] is called.
#![forbid(unsafe_code)]

mod emulator;
mod ethercat;
mod moteus;

use std::fmt;

use plant_emulator::PlantTruth;
use robot::Robot;
use rt_loop::driver::{Driver, OpenError};
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};

pub use ethercat_emulator::Fault as EthercatFault;
pub use moteus_emulator::FaultKind as MoteusFault;

/// What stands behind a driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The emulator's drives, which take the loop's messages.
    Emulator,
    /// Virtual CiA 402 drives on EtherCAT, a slave for each joint.
    Ethercat,
    /// Virtual moteus drives, two on a bus at most.
    Moteus,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Emulator, Self::Ethercat, Self::Moteus];

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Emulator => "emulator",
            Self::Ethercat => "EtherCAT",
            Self::Moteus => "moteus",
        }
    }
}

/// Why there are no virtual drives.
#[derive(Debug, thiserror::Error)]
pub enum VirtualError {
    /// The plant cannot be built.
    #[error(transparent)]
    Plant(#[from] plant_emulator::PlantError),
    /// The slaves cannot be built.
    #[error(transparent)]
    Ethercat(#[from] ethercat_emulator::SetupError),
    /// The bench of moteus drives cannot be built.
    #[error(transparent)]
    Moteus(#[from] moteus_emulator::BenchError),
    /// The driver does not open.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// What breaks on a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BusFault {
    /// On EtherCAT.
    Ethercat(EthercatFault),
    /// On a bus of moteus drives, for so long.
    Moteus(MoteusFault, u64),
}

/// What goes over a cable is changed on its way, either way: a frame of EtherCAT, a line to a port, or what is read from one at
/// once.
pub struct Noise(pub Change);

/// Changes what goes over a cable.
pub type Change = Box<dyn FnMut(&mut Vec<u8>) + Send>;

impl fmt::Debug for Noise {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Noise")
    }
}

/// A run on drives and nothing else: no service, no recording.
pub fn run_config(joints: usize, period_ns: u64) -> RunConfig {
    RunConfig {
        session: 1,
        robot: String::new(),
        driver: String::new(),
        trajectory: String::new(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        mode: Mode::Realtime,
        period_ns,
        cycles: 0,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        estimators: Vec::new(),
        command_deadline_ns: period_ns,
        cores: Vec::new(),
        initial_position_rad: vec![0.0; joints],
    }
}

/// A driver with its virtual drives.
pub trait VirtualDrives: Driver {
    /// The robot as it truly is.
    fn truth(&self) -> PlantTruth;

    /// Whether a joint's drive follows the torque it was told, as against stopping or holding by itself, or doing nothing.
    fn is_driven(&self, joint: usize) -> bool;

    /// Where the clock stands.
    fn now_ns(&self) -> u64;

    /// Lets time pass up to an instant; one that is past changes nothing.
    fn pass_until(&mut self, until_ns: u64);

    /// Breaks something now. What is of another bus does nothing.
    fn break_now(&mut self, fault: BusFault);
}

/// Drives of a kind for a robot standing where the run begins, opened by their driver. The drives' tables of the robot file
/// are replaced by those of the virtual drives, but for how they stop.
///
/// # Errors
/// [`VirtualError`].
pub fn open(
    kind: Kind,
    robot: &Robot,
    run: &RunConfig,
) -> Result<Box<dyn VirtualDrives>, VirtualError> {
    open_broken(kind, robot, run, None)
}

/// As [`open`], with noise on everything that goes over the cable. The emulator's drives have no cable.
///
/// # Errors
/// [`VirtualError`].
pub fn open_noisy(
    kind: Kind,
    robot: &Robot,
    run: &RunConfig,
    noise: Noise,
) -> Result<Box<dyn VirtualDrives>, VirtualError> {
    Ok(match kind {
        Kind::Emulator => Box::new(emulator::Emulated::new(robot, run)?),
        Kind::Ethercat => Box::new(ethercat::Ethercat::open(robot, run, None, Some(noise))?),
        Kind::Moteus => Box::new(moteus::Moteus::open(robot, run, None, Some(noise))?),
    })
}

/// As [`open`], with something that is broken already when the driver begins to look for its drives. What is of another bus
/// does nothing.
///
/// # Errors
/// [`VirtualError`].
pub fn open_broken(
    kind: Kind,
    robot: &Robot,
    run: &RunConfig,
    broken: Option<BusFault>,
) -> Result<Box<dyn VirtualDrives>, VirtualError> {
    Ok(match kind {
        Kind::Emulator => Box::new(emulator::Emulated::new(robot, run)?),
        Kind::Ethercat => Box::new(ethercat::Ethercat::open(robot, run, broken, None)?),
        Kind::Moteus => Box::new(moteus::Moteus::open(robot, run, broken, None)?),
    })
}
