//! The drives between loop and arm: the emulator's own, or a bus with its driver and virtual drives, in virtual time.

use rt_loop::bus_clock;
use rt_loop::driver::{DriveFault, Driver};
use shm_types::messages::{DriveCommand, DriveSample, Header, PlantTruth};
use twin::Drives;
use virtual_drives::VirtualDrives;

/// Part of the period in which the drives' sample must have come, and after which a command is there, as in a run.
const SAMPLE_DEADLINE_PARTS: u64 = 3;

/// A bus under a twin. The twin's clock begins at zero, the bus was opened before.
pub struct OnBus {
    drives: Box<dyn VirtualDrives>,
    period_ns: u64,
    /// When cycle 0 was on the bus's clock, as far as the loop has followed that.
    epoch_ns: u64,
    joint_count: usize,
}

impl OnBus {
    /// Drives that were just opened, told to keep their brakes closed.
    pub fn new(
        mut drives: Box<dyn VirtualDrives>,
        session: u64,
        joint_count: usize,
        period_ns: u64,
    ) -> Self {
        let header = Header {
            session,
            joint_count: joint_count as u64,
            ..Header::default()
        };
        // one that is not sent is a watchdog's business
        let _ = drives.write(&DriveCommand {
            header,
            ..DriveCommand::default()
        });
        Self {
            epoch_ns: drives.now_ns(),
            drives,
            period_ns,
            joint_count,
        }
    }
}

impl Drives for OnBus {
    fn measure(
        &mut self,
        cycle: u64,
        planned_ns: u64,
    ) -> (Result<DriveSample, DriveFault>, PlantTruth) {
        let on_bus_ns = self.epoch_ns + planned_ns;
        self.drives.pass_until(on_bus_ns);
        let deadline_ns = on_bus_ns + self.period_ns / SAMPLE_DEADLINE_PARTS;
        let latched = self.drives.read(cycle, on_bus_ns, deadline_ns);
        let truth = self.drives.truth();
        self.drives.pass_until(deadline_ns);
        let header = Header {
            session: 0,
            cycle,
            measured_at_ns: planned_ns,
            joint_count: self.joint_count as u64,
        };
        let truth = PlantTruth {
            header,
            link_position_rad: truth.link_position_rad,
            link_velocity_rad_s: truth.link_velocity_rad_s,
            joint_torque_nm: truth.joint_torque_nm,
            friction_torque_nm: truth.friction_torque_nm,
        };
        let latched = latched.map(|mut latched| {
            let later_ns = bus_clock::step_ns(&latched.bus, self.period_ns);
            self.epoch_ns = self.epoch_ns.saturating_add_signed(later_ns);
            latched.header.measured_at_ns = planned_ns;
            latched
        });
        (latched, truth)
    }

    fn take(&mut self, command: DriveCommand) -> Result<(), DriveFault> {
        self.drives.write(&command)
    }

    fn advance(&mut self) {
        self.drives.prepare();
    }
}
