//! The emulator's drives: the plant goes on by the loop's clock, whether commands come or not.

use plant_emulator::drives::EmulatedDrives;
use plant_emulator::process::emulated_plant;
use plant_emulator::{DriveState, PlantError, PlantTruth};
use robot::Robot;
use rt_loop::driver::{Capabilities, DriveFault, Driver};
use shm_types::instance::RunConfig;
use shm_types::messages::{DriveCommand, DriveSample};

use crate::{BusFault, VirtualDrives};

/// The emulated drives as a driver.
#[derive(Debug)]
pub struct Emulated {
    drives: EmulatedDrives,
    now_ns: u64,
}

impl Emulated {
    /// Drives of a run.
    pub fn new(robot: &Robot, run: &RunConfig) -> Result<Self, PlantError> {
        let plant = emulated_plant(robot, run, &[])?;
        Ok(Self {
            drives: EmulatedDrives::new(plant, run.session, robot, run.period_ns),
            now_ns: 0,
        })
    }
}

impl Driver for Emulated {
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    fn read(&mut self, cycle: u64, planned_ns: u64, _: u64) -> Result<DriveSample, DriveFault> {
        while self.drives.cycle() < cycle {
            self.drives.advance();
        }
        Ok(self.drives.measure(planned_ns).0)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        self.drives.take(*command);
        Ok(())
    }
}

impl VirtualDrives for Emulated {
    fn truth(&self) -> PlantTruth {
        self.drives.plant().truth()
    }

    fn is_driven(&self, joint: usize) -> bool {
        self.drives.plant().sample().drive.get(joint) == Some(&DriveState::Torque)
    }

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn pass_until(&mut self, until_ns: u64) {
        self.now_ns = self.now_ns.max(until_ns);
    }

    fn break_now(&mut self, _: BusFault) {}
}
