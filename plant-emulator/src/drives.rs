//! The plant behind the messages of a drive: commands in, samples out, one latch after the other. No clock, no topics.

use robot::{DriveFaultInjection, Robot, RobotJoint};
use shm_types::JOINTS_MAX;
use shm_types::drive::{BusReport, DriveReport, DriveState as DriveStateTold, position, warning};
use shm_types::messages::{
    DriveCommand, DriveMode, DriveRequest, DriveSample, Header, PlantTruth, Readings,
};

use crate::cia402::{Action, Asked, BrakeCycles, Machine};
use crate::latch::CommandLatch;
use crate::{DriveState, Plant, PlantCommand, PlantMode, PlantSample};

/// Emulated drives and the arm they move.
#[derive(Debug)]
pub struct EmulatedDrives {
    session: u64,
    joint_count: usize,
    period_ns: u64,
    plant: Plant,
    machines: Vec<Machine>,
    /// Cycles since each joint's readings were latched.
    age_cycles: [u32; JOINTS_MAX],
    faults: Vec<DriveFaultInjection>,
    latch: CommandLatch,
    acted: Option<DriveCommand>,
    commands_missed: u32,
    commands_lost: u64,
    cycle: u64,
}

impl EmulatedDrives {
    /// Drives of `robot` in the run `session` at latch 0, with its brakes.
    pub fn new(plant: Plant, session: u64, robot: &Robot, period_ns: u64) -> Self {
        let cycles = |time_s: f64| (time_s * 1e9 / period_ns as f64).round() as u32;
        let brake = |joint: &RobotJoint| {
            joint
                .brake
                .map_or(BrakeCycles::default(), |brake| BrakeCycles {
                    release: cycles(brake.release_s),
                    engage: cycles(brake.engage_s),
                })
        };
        let machines = robot.joints.iter().map(|joint| Machine::new(brake(joint)));
        Self {
            session,
            joint_count: robot.joints.len(),
            period_ns,
            plant,
            machines: machines.collect(),
            age_cycles: [0; JOINTS_MAX],
            faults: Vec::new(),
            latch: CommandLatch::default(),
            acted: None,
            commands_missed: 0,
            commands_lost: 0,
            cycle: 0,
        }
    }

    /// The same with faults of the drives' own, each at its time.
    #[must_use]
    pub fn with_faults(mut self, faults: Vec<DriveFaultInjection>) -> Self {
        self.faults = faults;
        self
    }

    /// The latch they stand at.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The arm behind them.
    pub fn plant(&self) -> &Plant {
        &self.plant
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
        self.commands_lost += u64::from(!fresh);
        self.trip();
        let asked = command.as_ref().and_then(plant_command).unwrap_or(BRAKED);
        let request = command.map_or(DriveRequest::None, |command| {
            DriveRequest::from_raw(command.request).unwrap_or_default()
        });
        let acting = self.acting(asked, request, fresh);
        self.plant.step(&acting);
        for (age, fresh) in self.age_cycles.iter_mut().zip(self.plant.sample().fresh) {
            *age = if fresh { 0 } else { age.saturating_add(1) };
        }
        self.acted = command;
        self.cycle += 1;
    }

    /// Lets the drives' faults happen whose time has come.
    fn trip(&mut self) {
        let (now, period_s) = (self.cycle, self.period_ns as f64 * 1e-9);
        let cycles = |time_s: f64| (time_s / period_s).round() as u64;
        for fault in &self.faults {
            if cycles(fault.start_s) == now {
                self.machines[fault.joint].trip(fault.error_code, cycles(fault.cause_s));
            }
        }
    }

    /// What each drive makes of the command, in the state it is in.
    fn acting(&mut self, asked: PlantCommand, request: DriveRequest, fresh: bool) -> PlantCommand {
        let mut acting = PlantCommand { fresh, ..asked };
        let stopped = self.plant.sample().drive;
        let asked = Asked {
            obeys: matches!(asked.mode, PlantMode::Torque | PlantMode::Velocity),
            damps: asked.mode == PlantMode::Damping,
            enable: request == DriveRequest::Enable,
            reset: request == DriveRequest::ResetFault,
        };
        for (joint, machine) in self.machines.iter_mut().enumerate() {
            let has_stopped = matches!(stopped[joint], DriveState::Watchdog { .. });
            acting.joint_mode[joint] = match machine.advance(asked, has_stopped) {
                Action::Obey => None,
                Action::Brake => Some(PlantMode::Braked),
                Action::Damp => Some(PlantMode::Damping),
                Action::Hold => {
                    acting.joint_velocity_rad_s[joint] = 0.0;
                    Some(PlantMode::Velocity)
                }
            };
        }
        acting
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
        let (drives, mode) = self.report(&sample);
        let truth = self.plant.truth();
        (
            DriveSample {
                header,
                readings,
                commands_missed: self.commands_missed,
                mode: mode as u32,
                drives,
                bus: BusReport {
                    frames_lost: self.commands_lost,
                    ..BusReport::default()
                },
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

    /// How each drive is, and what they do together: the gravest.
    fn report(&self, sample: &PlantSample) -> (DriveReport, DriveMode) {
        let asked = self.acted.and_then(|acted| DriveMode::from_raw(acted.mode));
        let mut together = asked.unwrap_or_default();
        let mut report = DriveReport {
            age_cycles: self.age_cycles,
            ..DriveReport::default()
        };
        for (joint, machine) in self.machines.iter().enumerate() {
            let mode = match sample.drive[joint] {
                DriveState::Torque => DriveMode::Torque,
                DriveState::Velocity => DriveMode::Velocity,
                DriveState::Damping | DriveState::Watchdog { .. } => DriveMode::Damping,
                DriveState::Holding | DriveState::Braked => DriveMode::Braked,
            };
            // The brake closes under a drive that holds.
            let is_stopped =
                !machine.is_obeying() || matches!(sample.drive[joint], DriveState::Watchdog { .. });
            if is_stopped && together.obeys() {
                together = match mode {
                    DriveMode::Damping => DriveMode::Damping,
                    _ => DriveMode::Braked,
                };
            }
            report.state[joint] = match sample.drive[joint] {
                DriveState::Watchdog { .. } if machine.is_obeying() => DriveStateTold::QuickStop,
                _ => machine.state(),
            } as u32;
            report.mode[joint] = mode as u32;
            report.status_word[joint] = machine.status_word();
            report.error_code[joint] = machine.error_code();
            report.warnings[joint] = match sample.torque_limited[joint] {
                true => warning::LIMITED,
                false => 0,
            };
            report.position_validity[joint] =
                position::KNOWN | position::HOMED | position::ABSOLUTE | position::MULTI_TURN;
        }
        (report, together)
    }
}

/// Brakes closed.
const BRAKED: PlantCommand = PlantCommand {
    fresh: true,
    mode: PlantMode::Braked,
    joint_mode: [None; JOINTS_MAX],
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
            joint_mode: [None; JOINTS_MAX],
            motor_torque_nm: command.motor_torque_nm,
            joint_velocity_rad_s: command.joint_velocity_rad_s,
        },
    )
}
