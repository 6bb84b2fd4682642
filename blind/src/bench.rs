//! Runs of a rig on its trajectory: what is recorded, and the disturbance torque it shows.

use motion::{Reference, Trajectory};
use plant_emulator::{Disturbance, Plant, PlantParameters};
use recording::JointCycle;
use robot::{Injection, Robot};
use services::relay::{CycleMessages, record_row};
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};

use crate::BlindError;
use crate::disturbance::{Columns, disturbances_nm};

/// 1.5 kHz.
pub(crate) const PERIOD_NS: u64 = 666_667;

/// A rig with its trajectory.
pub(crate) struct Bench<'a> {
    pub robot: &'a Robot,
    pub trajectory: &'a Trajectory,
    pub duration_s: f64,
}

/// What the plant of a run is.
pub(crate) struct Setup<'a> {
    /// Whose values it has: the robot file's, which the controller has too, or others.
    pub body: &'a Robot,
    /// What it has beside them.
    pub plant: &'a PlantParameters,
    pub injections: &'a [Injection],
    /// The joint it acts on, and the law.
    pub disturbance: Option<(usize, Box<dyn Disturbance>)>,
    pub seed: u64,
}

/// One run as a recording has it: row after row, joint after joint.
pub(crate) struct Run {
    joints: usize,
    pub cells: Vec<JointCycle>,
}

impl Bench<'_> {
    /// # Errors
    /// [`BlindError`], also when the loop stopped for safety.
    pub fn run(&self, setup: Setup<'_>) -> Result<Run, BlindError> {
        let joints = self.robot.joints.len();
        let mut start = Reference::default();
        self.trajectory.sample(0.0, &mut start);
        let config = config(self.duration_s, setup.seed, &start.position_rad[..joints]);
        let mut plant = Plant::new(
            setup.body,
            setup.plant,
            setup.injections,
            setup.seed,
            &config.initial_position_rad,
            PERIOD_NS as f64 * 1e-9,
        )?;
        if let Some((joint, disturbance)) = setup.disturbance {
            plant.disturb(joint, disturbance)?;
        }
        let mut cells = Vec::with_capacity(config.cycles as usize * joints);
        let (mut row, mut truth) = (Vec::new(), Vec::new());
        twin::simulate_plant(
            &config,
            self.robot,
            plant,
            self.trajectory.clone(),
            |messages| {
                // what only an emulator or this program's own estimators could know is left out
                let seen = CycleMessages {
                    truth: None,
                    estimate: None,
                    ..*messages
                };
                record_row(&seen, joints, &mut row, &mut truth);
                cells.extend_from_slice(&row);
                true
            },
        )?;
        Ok(Run { joints, cells })
    }

    /// The torque that disturbed each joint.
    ///
    /// # Errors
    /// [`BlindError::Filter`], never at this rate.
    pub fn disturbances_nm(&self, run: &Run) -> Result<Vec<Vec<f64>>, BlindError> {
        let joints = self.robot.joints.iter().enumerate();
        let columns: Vec<Columns> = joints
            .map(|(joint, file)| Columns {
                motor_rad: run.column(joint, |cell| {
                    cell.motor_position_rad.map(|x| x / file.gear_ratio)
                }),
                torque_nm: run.column(joint, |cell| {
                    cell.motor_torque_nm.map(|x| x * file.gear_ratio)
                }),
            })
            .collect();
        let rate_hz = 1e9 / PERIOD_NS as f64;
        Ok(disturbances_nm(self.robot, &columns, rate_hz)?)
    }
}

impl Run {
    /// One signal of one joint; a sample that is not there repeats the one before.
    fn column(&self, joint: usize, value: impl Fn(&JointCycle) -> Option<f64>) -> Vec<f64> {
        let mut last = 0.0;
        let rows = self.cells.chunks_exact(self.joints);
        rows.map(|row| {
            last = value(&row[joint]).unwrap_or(last);
            last
        })
        .collect()
    }

    /// Row by row.
    pub fn rows(&self) -> impl Iterator<Item = &[JointCycle]> {
        self.cells.chunks_exact(self.joints)
    }
}

fn config(duration_s: f64, seed: u64, start_rad: &[f64]) -> RunConfig {
    RunConfig {
        session: 1,
        robot: String::new(),
        driver: String::new(),
        trajectory: String::new(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: (duration_s * 1e9 / PERIOD_NS as f64).round() as u64,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed,
        inject: None,
        record: None,
        estimators: Vec::new(),
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: start_rad.to_vec(),
    }
}

/// Root mean square of a series.
pub(crate) fn rms(of: &[f64]) -> f64 {
    let sum: f64 = of.iter().map(|x| x * x).sum();
    (sum / of.len().max(1) as f64).sqrt()
}

/// Root mean square of the difference of two series.
pub(crate) fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    rms(&differences)
}
