//! Stretches of constant reference velocity, and friction in their rows.

use std::f64::consts::TAU;
use std::ops::Range;

use joint_model::JOINTS_MAX;
use recording::{Recording, Signal};
use robot::{Robot, RobotJoint};

use super::{check_measured, joint_index};
use crate::IdentificationError;

/// How far a reference may vary and still count as constant, relative to itself: rounding in a log of four digits.
const CONSTANT: f64 = 1e-3;

/// How far the measured velocity may be from the reference, relative to it.
const FOLLOWS: f64 = 0.5;

/// A joint slower than this part of the slowest reference stood still: what moves is noise of the encoder.
const AT_REST: f64 = 0.01;

/// How far references may differ and still be one speed, relative to each other.
const SAME_SPEED: f64 = 0.01;

/// Whether two references ask for one velocity, direction included.
pub(crate) fn same_speed(a_rad_s: f64, b_rad_s: f64) -> bool {
    (a_rad_s - b_rad_s).abs() <= SAME_SPEED * a_rad_s.abs().max(b_rad_s.abs())
}

/// A stretch of rows with constant reference velocity, without its settling.
#[derive(Clone, Debug)]
pub(crate) struct Span {
    /// Index of the recording.
    pub recording: usize,
    /// Its rows.
    pub rows: Range<usize>,
    /// The velocity asked for, joint side; not zero.
    pub reference_rad_s: f64,
}

impl Span {
    /// Whether the joint really moved as asked.
    pub fn follows(&self, velocity_rad_s: f64) -> bool {
        (velocity_rad_s / self.reference_rad_s - 1.0).abs() <= FOLLOWS
    }
}

/// One row: where the motor was and what friction cost there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrictionRow {
    pub time_s: f64,
    /// Before the gear.
    pub motor_position_rad: f64,
    /// `N·T_motor - T_gravity` about the joint's axis: eq (5) without `T_c`.
    pub friction_nm: f64,
    /// Gravity torque that was subtracted.
    pub load_nm: f64,
}

/// The constant-velocity motion of one joint in some recordings.
pub(crate) struct SteadyMotion<'a> {
    recordings: &'a [Recording],
    robot: &'a Robot,
    index: usize,
    spans: Vec<Span>,
}

impl<'a> SteadyMotion<'a> {
    pub fn new(
        recordings: &'a [Recording],
        robot: &'a Robot,
        joint: &str,
        settling_s: f64,
    ) -> Result<Self, IdentificationError> {
        let index = joint_index(robot, joint)?;
        let mut spans = Vec::new();
        for (number, recording) in recordings.iter().enumerate() {
            let reference_rad_s = recording.signal(joint, Signal::ReferenceVelocityRadS)?;
            spans.extend(constant_spans(recording, reference_rad_s, settling_s).map(
                |(rows, reference_rad_s)| Span {
                    recording: number,
                    rows,
                    reference_rad_s,
                },
            ));
        }
        let motion = Self {
            recordings,
            robot,
            index,
            spans,
        };
        motion.check_any(settling_s)?;
        motion.check_direction()?;
        Ok(motion)
    }

    pub fn spans(&self) -> &[Span] {
        &self.spans
    }

    pub fn gear_ratio(&self) -> f64 {
        self.drive().gear_ratio
    }

    /// What the robot file says about the joint.
    pub fn drive(&self) -> &'a RobotJoint {
        &self.robot.joints[self.index]
    }

    /// Friction in the rows of a span. Rows without a value are left out, up to half of them.
    pub fn friction_rows(&self, span: &Span) -> Result<Vec<FrictionRow>, IdentificationError> {
        let recording = &self.recordings[span.recording];
        let torque_nm = recording.signal(self.joint(), Signal::MotorTorqueNm)?;
        let positions = self
            .robot
            .joints
            .iter()
            .map(|joint| recording.signal(&joint.name, Signal::MotorPositionRad))
            .collect::<Result<Vec<_>, _>>()?;
        let torque_of = (self.joint(), Signal::MotorTorqueNm, torque_nm);
        let position_of = self.robot.joints.iter().zip(&positions);
        let position_of = position_of
            .map(|(joint, values)| (joint.name.as_str(), Signal::MotorPositionRad, *values));
        for (joint, signal, values) in [torque_of].into_iter().chain(position_of) {
            check_measured(joint, signal, values, span.rows.clone(), &recording.time_s)?;
        }
        let row = |row: usize| self.friction_row(recording.time_s[row], row, torque_nm, &positions);
        Ok(span.rows.clone().filter_map(row).collect())
    }

    fn friction_row(
        &self,
        time_s: f64,
        row: usize,
        torque_nm: &[f64],
        positions: &[&[f64]],
    ) -> Option<FrictionRow> {
        let count = self.robot.joints.len();
        let mut position_rad = [0.0; JOINTS_MAX];
        for ((angle_rad, motor_rad), joint) in position_rad
            .iter_mut()
            .zip(positions)
            .zip(&self.robot.joints)
        {
            *angle_rad = motor_rad.get(row)? / joint.gear_ratio;
        }
        let mut gravity_nm = [0.0; JOINTS_MAX];
        self.robot
            .chain
            .gravity_torque(&position_rad[..count], &mut gravity_nm[..count]);
        let load_nm = gravity_nm[self.index];
        let friction_nm = torque_nm.get(row)? * self.gear_ratio() - load_nm;
        (time_s.is_finite() && friction_nm.is_finite()).then(|| FrictionRow {
            time_s,
            motor_position_rad: positions[self.index][row],
            friction_nm,
            load_nm,
        })
    }

    /// That there is anything to measure.
    fn check_any(&self, settling_s: f64) -> Result<(), IdentificationError> {
        if !self.spans.is_empty() {
            return Ok(());
        }
        let signal = Signal::ReferenceVelocityRadS;
        let (mut rows, mut missing, mut most_rad_s) = (0, 0, 0.0_f64);
        for recording in self.recordings {
            let reference_rad_s = recording.signal(self.joint(), signal)?;
            rows += reference_rad_s.len();
            missing += reference_rad_s.iter().filter(|v| !v.is_finite()).count();
            most_rad_s = reference_rad_s
                .iter()
                .fold(most_rad_s, |most, v| most.max(v.abs()));
        }
        if 2 * missing > rows {
            return Err(IdentificationError::NotMeasured {
                joint: self.joint().to_owned(),
                signal,
                missing,
                rows,
                from_s: self.recordings[0].time_s.first().copied().unwrap_or(0.0),
            });
        }
        if rows > 0 && most_rad_s == 0.0 {
            return Err(self.never_moved(signal, 0.0));
        }
        Err(IdentificationError::TooShort {
            joint: self.joint().to_owned(),
            signal,
            what: "s at one velocity after settling",
            found: 0.0,
            needed: settling_s,
        })
    }

    /// That the motor moved, and forward where the reference is positive.
    fn check_direction(&self) -> Result<(), IdentificationError> {
        let (mut travelled_rad, mut asked_rad, mut most_rad_s) = (0.0, 0.0, 0.0_f64);
        for span in &self.spans {
            let recording = &self.recordings[span.recording];
            let position_rad = recording.signal(self.joint(), Signal::MotorPositionRad)?;
            let Some((duration_s, motor_rad)) = travel(&recording.time_s, position_rad, span)
            else {
                continue;
            };
            let moved_rad = motor_rad / self.gear_ratio();
            travelled_rad += moved_rad * span.reference_rad_s.signum();
            asked_rad += span.reference_rad_s.abs() * duration_s;
            most_rad_s = most_rad_s.max(moved_rad.abs() / duration_s);
        }
        if travelled_rad < -FOLLOWS * asked_rad {
            return Err(IdentificationError::ReversedSign {
                joint: self.joint().to_owned(),
                signal: Signal::MotorPositionRad,
                evidence: format!(
                    "the joint travelled {travelled_rad:.3} rad along a reference of {asked_rad:.3} rad"
                ),
            });
        }
        let speeds = self.spans.iter().map(|span| span.reference_rad_s.abs());
        if asked_rad > 0.0 && most_rad_s < AT_REST * speeds.fold(f64::INFINITY, f64::min) {
            return Err(self.never_moved(Signal::MotorPositionRad, most_rad_s));
        }
        Ok(())
    }

    /// That at least one span was followed.
    pub fn check_moved(&self, followed: usize) -> Result<(), IdentificationError> {
        if followed > 0 {
            return Ok(());
        }
        Err(IdentificationError::TooShort {
            joint: self.joint().to_owned(),
            signal: Signal::MotorPositionRad,
            what: "stretches within half of the reference velocity",
            found: 0.0,
            needed: 1.0,
        })
    }

    fn never_moved(&self, signal: Signal, most_rad_s: f64) -> IdentificationError {
        IdentificationError::NeverMoved {
            joint: self.joint().to_owned(),
            signal,
            most_rad_s,
        }
    }

    fn joint(&self) -> &str {
        &self.robot.joints[self.index].name
    }
}

/// Rows and velocity of each stretch of constant reference, settling dropped at both ends.
fn constant_spans<'a>(
    recording: &'a Recording,
    reference_rad_s: &'a [f64],
    settling_s: f64,
) -> impl Iterator<Item = (Range<usize>, f64)> + 'a {
    let constant = |a: &f64, b: &f64| (a - b).abs() <= CONSTANT * a.abs();
    recording.segments().into_iter().flat_map(move |segment| {
        let mut spans = Vec::new();
        let mut start = segment.start;
        while start < segment.end.min(reference_rad_s.len()) {
            let first_rad_s = reference_rad_s[start];
            let rest = &reference_rad_s[start..segment.end.min(reference_rad_s.len())];
            let length = rest
                .iter()
                .take_while(|v| constant(&first_rad_s, v))
                .count();
            if first_rad_s != 0.0 && length > 1 {
                let settled = settled(&recording.time_s, start..start + length, settling_s);
                let mean_rad_s = rest[..length].iter().sum::<f64>() / length as f64;
                spans.extend(settled.map(|rows| (rows, mean_rad_s)));
            }
            start += length.max(1);
        }
        spans
    })
}

/// The rows without their settling, where they last at least as long as it.
fn settled(time_s: &[f64], rows: Range<usize>, settling_s: f64) -> Option<Range<usize>> {
    let times_s = &time_s[rows.clone()];
    let (from_s, to_s) = (times_s.first()? + settling_s, times_s.last()? - settling_s);
    let start = rows.start + times_s.iter().position(|t| *t >= from_s)?;
    let end = rows.start + times_s.iter().rposition(|t| *t <= to_s)? + 1;
    let long_enough =
        end > start + 1 && time_s[end - 1] > time_s[start] && to_s - from_s >= settling_s;
    long_enough.then_some(start..end)
}

/// Time and motor angle between the first and last measured position of a span.
fn travel(time_s: &[f64], position_rad: &[f64], span: &Span) -> Option<(f64, f64)> {
    let measured = |row: &usize| position_rad.get(*row).is_some_and(|p| p.is_finite());
    let first = span.rows.clone().find(measured)?;
    let last = span.rows.clone().rev().find(measured)?;
    let duration_s = time_s[last] - time_s[first];
    (duration_s > 0.0).then(|| (duration_s, position_rad[last] - position_rad[first]))
}

/// The rows cut to whole motor revolutions, and how many; all rows and zero where there is less than one.
pub(crate) fn whole_revolutions(rows: &[FrictionRow]) -> (&[FrictionRow], usize) {
    let turned_rad = |row: &FrictionRow| {
        (row.motor_position_rad - rows.first().map_or(0.0, |first| first.motor_position_rad)).abs()
    };
    let revolutions = rows
        .last()
        .map_or(0.0, |last| (turned_rad(last) / TAU).floor());
    let end = rows
        .iter()
        .position(|row| turned_rad(row) >= revolutions * TAU);
    match end {
        Some(end) if revolutions >= 1.0 => (&rows[..=end], revolutions as usize),
        _ => (rows, 0),
    }
}
