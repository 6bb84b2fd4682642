//! A loop that does no more than call the driver, in virtual time.
#![allow(dead_code, reason = "every test file uses another part of this module")]

use rt_loop::bus_clock;
use rt_loop::driver::DriveFault;
use shm_types::drive::DriveState;
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, DriveSample};
use virtual_drives::VirtualDrives;

pub const PERIOD_NS: u64 = 666_667;

/// Drives at their cycles.
pub struct Loop {
    pub bus: Box<dyn VirtualDrives>,
    pub cycle: u64,
    epoch_ns: u64,
    pub command: DriveCommand,
    pub errors: Vec<DriveFault>,
    pub last: DriveSample,
}

impl Loop {
    pub fn new(bus: Box<dyn VirtualDrives>) -> Self {
        Self {
            epoch_ns: bus.now_ns(),
            bus,
            cycle: 0,
            command: DriveCommand::default(),
            errors: Vec::new(),
            last: DriveSample::default(),
        }
    }

    /// One cycle; whether its command was sent.
    pub fn cycle(&mut self) -> Result<(), DriveFault> {
        let planned_ns = self.epoch_ns + self.cycle * PERIOD_NS;
        self.bus.pass_until(planned_ns);
        match self
            .bus
            .read(self.cycle, planned_ns, planned_ns + PERIOD_NS / 3)
        {
            Ok(sample) => {
                let later_ns = bus_clock::step_ns(&sample.bus, PERIOD_NS);
                self.epoch_ns = self.epoch_ns.saturating_add_signed(later_ns);
                self.last = sample;
            }
            Err(fault) => self.errors.push(fault),
        }
        self.bus.pass_until(planned_ns + PERIOD_NS / 4);
        let written = self.bus.write(&self.command);
        self.bus.prepare();
        self.cycle += 1;
        written
    }

    pub fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle().expect("it is sent");
        }
    }

    /// Goes on until something is told; after how many cycles.
    pub fn until(&mut self, what: &str, reached: impl Fn(&DriveSample) -> bool) -> usize {
        for count in 0..5000 {
            self.cycle().expect("it is sent");
            if reached(&self.last) {
                return count;
            }
        }
        panic!("never {what}: {:?}, {:?}", self.last.drives, self.errors);
    }

    pub fn until_all(&mut self, joints: usize, state: DriveState) -> usize {
        self.until(state.name(), |sample| {
            (0..joints).all(|joint| sample.drives.state_of(joint) == state)
        })
    }

    pub fn enable(&mut self, joints: usize, mode: DriveMode) {
        self.until_all(joints, DriveState::SwitchedOff);
        self.command.mode = mode as u32;
        self.command.request = DriveRequest::Enable as u32;
        self.until_all(joints, DriveState::Enabled);
        self.command.request = DriveRequest::None as u32;
    }

    /// Asks for brakes, then for a reset.
    pub fn stop_and_reset(&mut self, after_cycles: usize) {
        self.command.mode = DriveMode::Braked as u32;
        self.command.request = DriveRequest::QuickStop as u32;
        self.cycles(after_cycles);
        self.command.request = DriveRequest::ResetFault as u32;
    }
}
