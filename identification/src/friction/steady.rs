//! One friction value per stretch of constant velocity.

use joint_model::friction::Direction;
use recording::{Recording, Signal};
use robot::Robot;
use serde::Serialize;

use crate::IdentificationError;
use crate::steady_motion::constant::{
    FrictionRow, Span, SteadyMotion, same_speed, whole_revolutions,
};

/// How long a velocity loop takes to settle, with room: at 1500 Hz with the filter of PA10-05 (200 Hz) a step of the
/// reference has decayed after a few hundredths of a second, the torsion of a loaded gear a little later.
pub const SETTLING_S: f64 = 0.25;

/// Friction at one constant velocity, joint side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SteadyMeasurement {
    /// Mean velocity by the motor encoder.
    pub velocity_rad_s: f64,
    /// The velocity asked for.
    pub reference_rad_s: f64,
    /// Mean over the angle of `N·T_motor - T_gravity`: the sign of the motion where friction opposes it, as in eq (7).
    pub friction_nm: f64,
    /// Standard deviation over the rows: position-dependent friction and noise.
    pub std_nm: f64,
    /// Counts the measurements at this velocity from zero, in the order of the recordings.
    pub trial: usize,
    /// Whole motor revolutions averaged over; zero where less than one fitted and the mean holds a part of one.
    pub motor_revolutions: usize,
    /// Mean gravity torque subtracted.
    pub load_nm: f64,
    /// Length of the rows used.
    pub duration_s: f64,
    /// Which of the recordings, from zero.
    pub recording: usize,
}

impl SteadyMeasurement {
    /// Direction of the motion asked for.
    #[must_use]
    pub fn direction(&self) -> Direction {
        Direction::of(self.reference_rad_s)
    }

    /// Magnitude of the measured velocity.
    #[must_use]
    pub fn speed_rad_s(&self) -> f64 {
        self.velocity_rad_s.abs()
    }

    /// Friction that opposes the motion, positive in either direction.
    #[must_use]
    pub fn level_nm(&self) -> f64 {
        self.friction_nm * self.direction().sign()
    }
}

/// Measures the friction of `joint` wherever its reference velocity is constant and not zero.
///
/// The first and last `settling_s` of each stretch are dropped ([`SETTLING_S`]), and so is a stretch that leaves less
/// than `settling_s`. What is left is cut to whole motor revolutions where one fits, so that position-dependent
/// friction averages out. Gravity is that of the robot's rigid bodies at the positions of all motors. A stretch whose
/// measured velocity is not within half of the reference is left out: the joint was held up.
///
/// # Errors
/// [`IdentificationError`], naming joint and signal: no such joint or signal, values missing, nothing constant long
/// enough, a joint that never moved, a motor torque or position of reversed sign.
pub fn measure_steady(
    recordings: &[Recording],
    robot: &Robot,
    joint: &str,
    settling_s: f64,
) -> Result<Vec<SteadyMeasurement>, IdentificationError> {
    let motion = SteadyMotion::new(recordings, robot, joint, settling_s)?;
    let mut measurements: Vec<SteadyMeasurement> = Vec::new();
    for span in motion.spans() {
        let rows = motion.friction_rows(span)?;
        if let Some(measured) = measure(span, &rows, motion.gear_ratio()) {
            let earlier = |other: &&SteadyMeasurement| {
                same_speed(other.reference_rad_s, measured.reference_rad_s)
            };
            let trial = measurements.iter().filter(earlier).count();
            measurements.push(SteadyMeasurement { trial, ..measured });
        }
    }
    motion.check_moved(measurements.len())?;
    check_sign(joint, &measurements)?;
    Ok(measurements)
}

fn measure(span: &Span, rows: &[FrictionRow], gear_ratio: f64) -> Option<SteadyMeasurement> {
    let (rows, motor_revolutions) = whole_revolutions(rows);
    let (first, last) = (rows.first()?, rows.last()?);
    let duration_s = last.time_s - first.time_s;
    let velocity_rad_s =
        (last.motor_position_rad - first.motor_position_rad) / (gear_ratio * duration_s);
    if !span.follows(velocity_rad_s) {
        return None;
    }
    let count = rows.len() as f64;
    let friction_nm = mean_over_angle(rows, |row| row.friction_nm)?;
    let deviation = |row: &FrictionRow| (row.friction_nm - friction_nm).powi(2);
    Some(SteadyMeasurement {
        velocity_rad_s,
        reference_rad_s: span.reference_rad_s,
        friction_nm,
        std_nm: (rows.iter().map(deviation).sum::<f64>() / count).sqrt(),
        trial: 0,
        motor_revolutions,
        load_nm: mean_over_angle(rows, |row| row.load_nm)?,
        duration_s,
        recording: span.recording,
    })
}

/// Work over travel. The joint is slower where friction is higher, by as much as its velocity loop lets it, so the mean over
/// time would count high friction twice; and over whole revolutions at one velocity no energy is left in rotor or gear.
fn mean_over_angle(rows: &[FrictionRow], value: impl Fn(&FrictionRow) -> f64) -> Option<f64> {
    let travel_rad = rows.last()?.motor_position_rad - rows.first()?.motor_position_rad;
    let work = rows.windows(2).map(|pair| {
        let step_rad = pair[1].motor_position_rad - pair[0].motor_position_rad;
        0.5 * (value(&pair[0]) + value(&pair[1])) * step_rad
    });
    let mean = work.sum::<f64>() / travel_rad;
    mean.is_finite().then_some(mean)
}

/// Friction that pushes is a torque of the wrong sign. The mean of both directions tells, because a wrong mass in the
/// robot file adds to one what it takes from the other.
fn check_sign(joint: &str, measurements: &[SteadyMeasurement]) -> Result<(), IdentificationError> {
    let mean_level_nm = |direction: Direction| {
        let of_direction = measurements.iter().filter(|m| m.direction() == direction);
        let levels_nm: Vec<f64> = of_direction.map(SteadyMeasurement::level_nm).collect();
        (!levels_nm.is_empty()).then(|| levels_nm.iter().sum::<f64>() / levels_nm.len() as f64)
    };
    let positive_nm = mean_level_nm(Direction::Positive);
    let negative_nm = mean_level_nm(Direction::Negative);
    let mean_nm = positive_nm.zip(negative_nm).map(|(a, b)| 0.5 * (a + b));
    match mean_nm {
        Some(mean_nm) if mean_nm < 0.0 => Err(IdentificationError::ReversedSign {
            joint: joint.to_owned(),
            signal: Signal::MotorTorqueNm,
            evidence: format!(
                "friction would push with {:.3} Nm, the mean of both directions",
                -mean_nm
            ),
        }),
        _ => Ok(()),
    }
}
