//! Waypoints from a CSV file: `time_s` and a column `JOINT.reference_position_rad` for each joint that moves.
//!
//! Between the waypoints runs a cubic spline with continuous acceleration, at rest at both ends; afterwards the joints
//! hold the last. Time counts from the first row. Joints without a column hold their home position. The other columns
//! of a recording may stay in the file.

use robot::{Place, Robot, RobotError};

use crate::MotionError;
use crate::defaults::home_rad;
use crate::spline;

const REFERENCE: &str = "reference_position_rad";
/// Columns of recordings that say nothing about the reference path.
const OTHER_SIGNALS: [&str; 10] = [
    "reference_velocity_rad_s",
    "command_torque_nm",
    "motor_torque_nm",
    "motor_position_rad",
    "motor_velocity_rad_s",
    "link_position_rad",
    "link_velocity_rad_s",
    "joint_torque_nm",
    "motor_current_a",
    "temperature_c",
];

/// A sum of periods may pass the last waypoint by rounding.
const ROUNDING_S: f64 = 1e-9;

/// A spline per joint.
#[derive(Clone, Debug)]
pub struct Waypoints {
    times_s: Vec<f64>,
    joints: Vec<Path>,
}

#[derive(Clone, Debug)]
enum Path {
    Hold(f64),
    Spline {
        positions_rad: Vec<f64>,
        curvatures_rad_s2: Vec<f64>,
    },
}

impl Waypoints {
    /// Reads the text of a CSV file; `file` is what errors call it.
    pub fn parse(text: &str, file: &str, robot: &Robot) -> Result<Self, RobotError> {
        let place = Place::new(file, "");
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let headings = reader
            .headers()
            .map_err(|error| place.invalid(error.to_string()))?
            .clone();
        let columns = Columns::find(&headings, file, robot)?;
        let mut times_s: Vec<f64> = Vec::new();
        let mut positions_rad: Vec<Vec<f64>> = vec![Vec::new(); columns.joints.len()];
        for (index, row) in reader.records().enumerate() {
            let row = row.map_err(|error| place.invalid(error.to_string()))?;
            let line = row
                .position()
                .map_or(index + 2, |position| position.line() as usize);
            let place = Place {
                line: Some(line),
                ..place.clone()
            };
            let time_s = number(&place, &headings, &row, columns.time)?;
            if let Some(before_s) = times_s.last().filter(|before_s| time_s <= **before_s) {
                return Err(place.invalid(format!(
                    "time_s = {time_s} must be above the row before it, which is {before_s}"
                )));
            }
            times_s.push(time_s);
            for ((column, _), positions_rad) in columns.joints.iter().zip(&mut positions_rad) {
                positions_rad.push(number(&place, &headings, &row, *column)?);
            }
        }
        if times_s.len() < 2 {
            return Err(place.invalid(format!(
                "there are {} rows, give at least 2 waypoints",
                times_s.len()
            )));
        }
        let start_s = times_s[0];
        times_s.iter_mut().for_each(|time_s| *time_s -= start_s);
        let mut joints: Vec<Path> = robot
            .joints
            .iter()
            .map(|joint| Path::Hold(home_rad(joint)))
            .collect();
        for ((_, joint), positions_rad) in columns.joints.into_iter().zip(positions_rad) {
            let at_rest = [0.0; 2];
            let curvatures_rad_s2 = spline::curvatures(&times_s, &positions_rad, at_rest);
            joints[joint] = Path::Spline {
                positions_rad,
                curvatures_rad_s2,
            };
        }
        Ok(Self { times_s, joints })
    }

    /// A spline through the samples of a reference that need not begin or end at rest.
    pub fn sampled(reference: SampledReference, robot: &Robot) -> Result<Self, MotionError> {
        reference.check(robot)?;
        let SampledReference { times_s, joints } = reference;
        let path = |joint: SampledJoint| Path::Spline {
            curvatures_rad_s2: spline::curvatures(
                &times_s,
                &joint.positions_rad,
                joint.end_velocities_rad_s,
            ),
            positions_rad: joint.positions_rad,
        };
        let joints = joints.into_iter().map(path).collect();
        Ok(Self { times_s, joints })
    }

    /// Time of the last waypoint.
    pub fn duration_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or_default()
    }

    /// Number of waypoints.
    pub fn count(&self) -> usize {
        self.times_s.len()
    }

    /// Hands position, velocity and acceleration of every joint to `set`.
    pub fn sample(&self, time_s: f64, mut set: impl FnMut(usize, [f64; 3])) {
        let over = time_s > self.duration_s() + ROUNDING_S;
        let after = self
            .times_s
            .partition_point(|waypoint_s| *waypoint_s <= time_s);
        let left = after.saturating_sub(1).min(self.times_s.len() - 2);
        for (joint, path) in self.joints.iter().enumerate() {
            let values = match path {
                Path::Hold(position_rad) => [*position_rad, 0.0, 0.0],
                Path::Spline { positions_rad, .. } if over => [positions_rad[left + 1], 0.0, 0.0],
                Path::Spline {
                    positions_rad,
                    curvatures_rad_s2,
                } => spline::sample(
                    &self.times_s,
                    positions_rad,
                    curvatures_rad_s2,
                    left,
                    time_s,
                ),
            };
            set(joint, values);
        }
    }
}

/// A reference as a recording holds it: positions at instants, for every joint of the robot in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledReference {
    /// Ascending, the first is 0.
    pub times_s: Vec<f64>,
    /// In the robot's order.
    pub joints: Vec<SampledJoint>,
}

/// One joint of a sampled reference.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledJoint {
    /// One per instant.
    pub positions_rad: Vec<f64>,
    /// At the first and at the last instant.
    pub end_velocities_rad_s: [f64; 2],
}

impl SampledReference {
    fn check(&self, robot: &Robot) -> Result<(), MotionError> {
        let samples = self.times_s.len();
        let ascending = self.times_s.windows(2).all(|pair| pair[0] < pair[1]);
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        let whole = |joint: &SampledJoint| {
            joint.positions_rad.len() == samples
                && finite(&joint.positions_rad)
                && finite(&joint.end_velocities_rad_s)
        };
        let reason = if self.joints.len() != robot.joints.len() {
            format!(
                "it has {} joints, the robot {}",
                self.joints.len(),
                robot.joints.len()
            )
        } else if samples < 2 {
            format!("it has {samples} samples; at least 2 are needed")
        } else if self.times_s[0] != 0.0 || !ascending || !finite(&self.times_s) {
            "its times do not ascend from 0".to_owned()
        } else if let Some(joint) = self.joints.iter().position(|joint| !whole(joint)) {
            format!("{} lacks a sample", robot.joints[joint].name)
        } else {
            return Ok(());
        };
        Err(MotionError::Samples { reason })
    }
}

/// Where time and joints stand in the file.
struct Columns {
    time: usize,
    /// Column and joint index.
    joints: Vec<(usize, usize)>,
}

impl Columns {
    fn find(headings: &csv::StringRecord, file: &str, robot: &Robot) -> Result<Self, RobotError> {
        let place = Place {
            line: Some(1),
            ..Place::new(file, "")
        };
        let mut time = None;
        let mut joints: Vec<(usize, usize)> = Vec::new();
        for (column, heading) in headings.iter().enumerate() {
            let (joint, signal) = heading.rsplit_once('.').unwrap_or(("", heading));
            match (robot.joint_index(joint), signal) {
                (None, "time_s") if joint.is_empty() => time = Some(column),
                (None, "segment") if joint.is_empty() => {}
                (Some(joint), REFERENCE) if joints.iter().any(|(_, earlier)| *earlier == joint) => {
                    return Err(
                        place.invalid(format!("column `{heading}` stands there twice, remove one"))
                    );
                }
                (Some(joint), REFERENCE) => joints.push((column, joint)),
                (Some(_), other) if OTHER_SIGNALS.contains(&other) => {}
                _ => return Err(place.unknown("column", heading, &known_headings(robot))),
            }
        }
        let time = time.ok_or_else(|| place.invalid("column time_s is missing, add it"))?;
        if joints.is_empty() {
            let first = robot.joints.first().map_or("", |joint| &joint.name);
            return Err(place.invalid(format!(
                "no joint moves; add a column such as {first}.{REFERENCE}"
            )));
        }
        Ok(Self { time, joints })
    }
}

fn known_headings(robot: &Robot) -> Vec<String> {
    let own = ["time_s", "segment"].map(str::to_owned);
    own.into_iter()
        .chain(
            robot
                .joints
                .iter()
                .map(|joint| format!("{}.{REFERENCE}", joint.name)),
        )
        .collect()
}

fn number(
    place: &Place,
    headings: &csv::StringRecord,
    row: &csv::StringRecord,
    column: usize,
) -> Result<f64, RobotError> {
    let (heading, cell) = (
        headings.get(column).unwrap_or_default(),
        row.get(column).unwrap_or_default(),
    );
    let value = cell.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| place.invalid(format!("{heading} = {cell:?} must be a finite number")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Reference, Trajectory};

    fn swing(rate_hz: f64, rows: usize) -> SampledReference {
        let times_s: Vec<f64> = (0..rows).map(|row| row as f64 / rate_hz).collect();
        let last_s = times_s[rows - 1];
        let positions_rad = times_s.iter().map(|time_s| 0.3 * time_s.sin()).collect();
        let joints = vec![SampledJoint {
            positions_rad,
            end_velocities_rad_s: [0.3, 0.3 * last_s.cos()],
        }];
        SampledReference { times_s, joints }
    }

    #[test]
    fn a_sampled_reference_gives_back_its_samples_and_their_derivatives() {
        let robot = robot::load("shd17").unwrap();
        let sampled = swing(250.0, 1000);
        let trajectory = Trajectory::sampled(sampled.clone(), &robot).unwrap();
        assert_eq!(trajectory.duration_s(), sampled.times_s.last().copied());
        let mut reference = Reference::default();
        let samples = sampled.times_s.iter().zip(&sampled.joints[0].positions_rad);
        for (time_s, position_rad) in samples {
            trajectory.sample(*time_s, &mut reference);
            assert_eq!(reference.position_rad[0], *position_rad);
            let (velocity, acceleration) = (0.3 * time_s.cos(), -0.3 * time_s.sin());
            assert!((reference.velocity_rad_s[0] - velocity).abs() < 1e-8);
            assert!((reference.acceleration_rad_s2[0] - acceleration).abs() < 1e-5);
        }
    }

    #[test]
    fn samples_that_do_not_fit_are_refused_in_words() {
        let robot = robot::load("shd17").unwrap();
        let refusal = |change: fn(&mut SampledReference)| {
            let mut sampled = swing(250.0, 10);
            change(&mut sampled);
            Trajectory::sampled(sampled, &robot)
                .unwrap_err()
                .to_string()
        };
        assert!(refusal(|sampled| sampled.times_s[5] = 0.0).contains("ascend"));
        assert!(refusal(|sampled| sampled.joints.clear()).contains("0 joints"));
        assert!(refusal(|sampled| sampled.joints[0].positions_rad[3] = f64::NAN).contains("lacks"));
        assert!(refusal(|sampled| sampled.times_s.truncate(1)).contains("1 samples"));
    }
}
