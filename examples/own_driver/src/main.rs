//! Flexspline with a driver of your own: `run`, `faults`, `doctor` and all the rest know it by its name.
//!
//! ```sh
//! cd examples/own_driver
//! cargo run --release -- doctor --driver mine --robot shd17 --no-probe
//! cargo run --release -- run --driver mine --robot shd17 --duration 5s
//! cargo run --release -- faults --driver mine --robot shd17 --short
//! ```
//!
//! The bus of this one is a plant emulator in the driver's own process; put yours in its place.

use std::process::ExitCode;
use std::time::Duration;

use flexspline::driver::{
    Behind, Capabilities, DriveFault, Driver, DriverEntry, JointCapabilities, OpenContext,
    OpenError,
};
use flexspline::drive::position;
use flexspline::messages::{DriveCommand, DriveMode, DriveSample};
use plant_emulator::drives::EmulatedDrives;
use plant_emulator::process::emulated_plant;

const MINE: DriverEntry = DriverEntry {
    name: "mine",
    summary: "an arm on a bus of your own",
    behind: Behind::Hardware,
    open: MyBus::open,
};

fn main() -> ExitCode {
    flexspline::main_with(&[MINE])
}

struct MyBus {
    drives: EmulatedDrives,
    joints: Vec<JointCapabilities>,
}

impl MyBus {
    /// Finds the drives and reads back what they are. The `drive` table of the robot file is this driver's: here it has one
    /// key, `watchdog_ms`.
    fn open(context: &OpenContext<'_>) -> Result<Box<dyn Driver>, OpenError> {
        let table = context.robot.drive.clone().unwrap_or_default();
        let watchdog_ms = match table.get("watchdog_ms") {
            None => 10,
            Some(value) => value
                .as_integer()
                .and_then(|ms| u64::try_from(ms).ok())
                .ok_or_else(|| {
                    OpenError::Setting(format!(
                        "drive.watchdog_ms = {value} in the robot file must be a whole number of milliseconds"
                    ))
                })?,
        };
        let plant = emulated_plant(context.robot, context.run, &[])
            .map_err(|error| OpenError::Hardware(error.to_string()))?;
        let joint = |joint: &str| JointCapabilities {
            device: "my drive, firmware 1.0".to_owned(),
            joint: Some(joint.to_owned()),
            modes: vec![DriveMode::Torque, DriveMode::Velocity],
            watchdog: Some(Duration::from_millis(watchdog_ms)),
            position_validity: position::KNOWN | position::HOMED,
            ..JointCapabilities::default()
        };
        let names = context.robot.joint_names();
        let (session, period_ns) = (context.run.session, context.run.period_ns);
        Ok(Box::new(Self {
            drives: EmulatedDrives::new(plant, session, context.robot, period_ns),
            joints: names.into_iter().map(joint).collect(),
        }))
    }
}

impl Driver for MyBus {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            bus: "my bus".to_owned(),
            joints: self.joints.clone(),
            latch_to_act_cycles: Some(1),
            ..Capabilities::default()
        }
    }

    /// What was latched for this cycle: here, the plant is moved on to it.
    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        _give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        while self.drives.cycle() < cycle {
            self.drives.advance();
        }
        Ok(self.drives.measure(planned_ns).0)
    }

    /// Acts from the next latch on.
    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        self.drives.take(*command);
        Ok(())
    }
}
