//! The plant behind the messages of a drive: commands in, samples out, one latch after the other. No clock, no topics.

use shm_types::JOINTS_MAX;
use shm_types::messages::{DriveCommand, DriveMode, DriveSample, Header, PlantTruth, Readings};

use crate::latch::CommandLatch;
use crate::{DriveState, Plant, PlantCommand, PlantMode};

/// Emulated drives and the arm they move.
#[derive(Debug)]
pub struct EmulatedDrives {
    session: u64,
    joint_count: usize,
    plant: Plant,
    latch: CommandLatch,
    acted: Option<DriveCommand>,
    commands_missed: u32,
    cycle: u64,
}

impl EmulatedDrives {
    /// Drives of the run `session` at latch 0.
    pub fn new(plant: Plant, session: u64, joint_count: usize) -> Self {
        Self {
            session,
            joint_count,
            plant,
            latch: CommandLatch::default(),
            acted: None,
            commands_missed: 0,
            cycle: 0,
        }
    }

    /// The latch they stand at.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// Takes a command; one of another run or robot is dropped.
    pub fn take(&mut self, command: DriveCommand) {
        if command.header.check(self.session, self.joint_count).is_ok() {
            self.latch.push(command);
        }
    }

    /// Whether the interval up to the next latch is settled: the command that acts in it has come.
    pub fn is_settled(&self) -> bool {
        self.cycle == 0 || self.latch.has(self.cycle - 1)
    }

    /// Moves on to the next latch with the command that acts until then.
    pub fn advance(&mut self) {
        let (command, fresh) = self.latch.acting_in(self.cycle);
        let fresh = fresh || self.cycle == 0;
        self.commands_missed = if fresh {
            0
        } else {
            self.commands_missed.saturating_add(1)
        };
        let plant_command = command.as_ref().and_then(plant_command);
        self.plant.step(&PlantCommand {
            fresh,
            ..plant_command.unwrap_or(BRAKED)
        });
        self.acted = command;
        self.cycle += 1;
    }

    /// What the sensors latched, and what is true, at the latch the drives stand at.
    pub fn measure(&self, latched_at_ns: u64) -> (DriveSample, PlantTruth) {
        let header = Header {
            session: self.session,
            cycle: self.cycle,
            measured_at_ns: latched_at_ns,
            joint_count: self.joint_count as u64,
        };
        let sample = self.plant.sample();
        let readings = Readings {
            motor_position_rad: sample.motor_position_rad,
            motor_velocity_rad_s: sample.motor_velocity_rad_s,
            link_position_rad: sample.link_position_rad,
            motor_torque_nm: sample.motor_torque_nm,
            joint_torque_nm: sample.joint_torque_nm,
            ..Readings::default()
        };
        let stopped = sample
            .drive
            .iter()
            .any(|drive| matches!(drive, DriveState::Watchdog { .. }));
        let mode = match &self.acted {
            _ if stopped => DriveMode::Damping as u32,
            Some(command) => command.mode,
            None => DriveMode::Braked as u32,
        };
        let truth = self.plant.truth();
        (
            DriveSample {
                header,
                readings,
                commands_missed: self.commands_missed,
                mode,
                ..DriveSample::default()
            },
            PlantTruth {
                header,
                link_position_rad: truth.link_position_rad,
                link_velocity_rad_s: truth.link_velocity_rad_s,
                joint_torque_nm: truth.joint_torque_nm,
                friction_torque_nm: truth.friction_torque_nm,
            },
        )
    }
}

/// Brakes closed.
const BRAKED: PlantCommand = PlantCommand {
    fresh: true,
    mode: PlantMode::Braked,
    motor_torque_nm: [0.0; JOINTS_MAX],
    joint_velocity_rad_s: [0.0; JOINTS_MAX],
};

/// What a drive makes of a command; `None` if it knows no such mode or a number is none.
fn plant_command(command: &DriveCommand) -> Option<PlantCommand> {
    let mode = match DriveMode::from_raw(command.mode)? {
        DriveMode::Braked => PlantMode::Braked,
        DriveMode::Damping => PlantMode::Damping,
        DriveMode::Torque => PlantMode::Torque,
        DriveMode::Velocity => PlantMode::Velocity,
        // No emulated drive closes a position loop.
        DriveMode::Position | DriveMode::Impedance => return None,
    };
    let finite = |values: &[f64; JOINTS_MAX]| values.iter().all(|value| value.is_finite());
    (finite(&command.motor_torque_nm) && finite(&command.joint_velocity_rad_s)).then_some(
        PlantCommand {
            fresh: true,
            mode,
            motor_torque_nm: command.motor_torque_nm,
            joint_velocity_rad_s: command.joint_velocity_rad_s,
        },
    )
}
