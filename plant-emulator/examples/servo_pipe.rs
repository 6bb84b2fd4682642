//! A hobby servo's own position controller with the nominal plant of a robot file, for programs in other languages: they
//! write lines, they read positions.
//!
//! ```text
//! cargo run --release -p plant-emulator --example servo_pipe -- servo.toml 0.005
//! ```
//! The robot file has one joint, with the servo's armature as its rotor inertia and a gear ratio of 1; the other argument is
//! the time between two rows. Lines on standard input, all at the joint side:
//!
//! - `begin START_RAD GAIN_NM_RAD VOLTAGE_NM CURRENT_NM BACK_EMF_NM_S_RAD`: a new run from rest. The servo drives
//!   `clip(GAIN·(goal - q)) - BACK_EMF·q̇`, clipped by the supply to `VOLTAGE` either way and before that, if it limits its
//!   current, to where the sum is within `CURRENT` (`inf` if not).
//! - `GOAL_RAD ON`: one row. `ON` is 1, or 0 where the motor is switched off: then it gives no torque and does not brake.
//!   Answered by a line with the angle that the encoder shows at the beginning of the row.
//!
//! The servo takes its encoder once a millisecond. `benches/real/bam_rollout.py` uses this.

use std::error::Error;
use std::io::{BufRead, Write};

use plant_emulator::{Plant, PlantCommand, PlantMode, PlantParameters};
use robot::Robot;

const SERVO_S: f64 = 1e-3;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(robot), Some(row_s)) = (arguments.next(), arguments.next()) else {
        return Err("give a robot file and the time between two rows in seconds".into());
    };
    let robot = robot::load(&robot)?;
    let row_s: f64 = row_s.parse()?;
    let cycles = (row_s / SERVO_S).round().max(1.0) as usize;
    let mut run: Option<Run> = None;
    let mut output = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        if let Some(values) = line.strip_prefix("begin ") {
            run = Some(Run::begin(&robot, values, row_s / cycles as f64)?);
            continue;
        }
        let run = run.as_mut().ok_or("the first line must be `begin …`")?;
        let [goal_rad, on] = numbers(&line)?;
        writeln!(output, "{:.9}", run.encoder_rad())?;
        for _ in 0..cycles {
            run.advance(goal_rad, on > 0.5);
        }
    }
    output.flush()?;
    Ok(())
}

fn numbers<const N: usize>(line: &str) -> Result<[f64; N], Box<dyn Error>> {
    let values = line
        .split_whitespace()
        .map(str::parse)
        .collect::<Result<Vec<f64>, _>>()?;
    let found = values.len();
    values
        .try_into()
        .map_err(|_| format!("`{line}` has {found} numbers, {N} are wanted").into())
}

struct Servo {
    gain_nm_rad: f64,
    voltage_nm: f64,
    current_nm: f64,
    back_emf_nm_s_rad: f64,
}

impl Servo {
    fn torque_nm(&self, error_rad: f64, velocity_rad_s: f64) -> f64 {
        let back_emf_nm = self.back_emf_nm_s_rad * velocity_rad_s;
        let asked_nm = (self.gain_nm_rad * error_rad)
            .max(back_emf_nm - self.current_nm)
            .min(back_emf_nm + self.current_nm);
        asked_nm.max(-self.voltage_nm).min(self.voltage_nm) - back_emf_nm
    }
}

struct Run {
    servo: Servo,
    plant: Plant,
    gear_ratio: f64,
}

impl Run {
    fn begin(robot: &Robot, values: &str, period_s: f64) -> Result<Self, Box<dyn Error>> {
        let [
            start_rad,
            gain_nm_rad,
            voltage_nm,
            current_nm,
            back_emf_nm_s_rad,
        ] = numbers(values)?;
        let [joint] = &robot.joints[..] else {
            return Err("the robot file must have one joint".into());
        };
        let parameters = PlantParameters::nominal(robot);
        Ok(Self {
            servo: Servo {
                gain_nm_rad,
                voltage_nm,
                current_nm,
                back_emf_nm_s_rad,
            },
            plant: Plant::new(robot, &parameters, &[], 1, &[start_rad], period_s)?,
            gear_ratio: joint.gear_ratio,
        })
    }

    fn encoder_rad(&self) -> f64 {
        self.plant.sample().motor_position_rad[0] / self.gear_ratio
    }

    fn advance(&mut self, goal_rad: f64, is_on: bool) {
        let velocity_rad_s = self.plant.truth().motor_velocity_rad_s[0] / self.gear_ratio;
        let mut command = PlantCommand {
            mode: PlantMode::Torque,
            ..PlantCommand::default()
        };
        if is_on {
            let error_rad = goal_rad - self.encoder_rad();
            command.motor_torque_nm[0] =
                self.servo.torque_nm(error_rad, velocity_rad_s) / self.gear_ratio;
        }
        self.plant.step(&command);
    }
}
