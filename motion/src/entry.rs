//! The `[[joint]]` tables of trajectory files: what one joint does, with defaults from the robot.

use robot::{Place, Robot, RobotError, RobotJoint};
use serde::{Deserialize, Serialize};

use crate::defaults::{home_rad, speed_rad_s, spread_phase_rad, swing_rad};
use crate::even_waypoints::EvenWaypoints;
use crate::joint_motion::JointMotion;
use crate::multi_sine::{LINES_MAX, MULTIPLE_MAX, MultiSine, Recipe};
use crate::trapezoid::Trapezoid;

/// One `[[joint]]` of a trajectory file. What is left out takes the robot's defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JointEntry {
    /// Stays.
    Hold(HoldEntry),
    /// Swings at one frequency.
    Sine(SineEntry),
    /// Swings at many frequencies.
    MultiSine(MultiSineEntry),
    /// Moves from rest to rest.
    Trapezoid(TrapezoidEntry),
    /// Runs through points.
    Waypoints(WaypointsEntry),
}

/// A joint that stays where it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HoldEntry {
    /// The joint.
    pub name: String,
    /// Default: home, which is zero or the middle of the joint's range.
    pub position_rad: Option<f64>,
}

/// `centre + amplitude·sin(2π·frequency·t + phase)`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SineEntry {
    /// The joint.
    pub name: String,
    /// Default: home.
    pub centre_rad: Option<f64>,
    /// Default: 0.3, less near a limit.
    pub amplitude_rad: Option<f64>,
    /// Default: 0.1.
    pub frequency_hz: Option<f64>,
    /// Default: the joints spread over the circle.
    pub phase_rad: Option<f64>,
}

/// Sines at all multiples of `1/period_s` within the band, each of about the same speed, at random phases.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MultiSineEntry {
    /// The joint.
    pub name: String,
    /// Default: home.
    pub centre_rad: Option<f64>,
    /// Largest distance from the centre. Default: 0.5, less near a limit.
    pub amplitude_rad: Option<f64>,
    /// Largest speed; the amplitude shrinks to keep it. Default: 0.4, or half the joint's limit.
    pub speed_rad_s: Option<f64>,
    /// Lowest and highest frequency. Default: 0.05 to 0.8.
    pub band_hz: Option<[f64; 2]>,
    /// Default: 20.
    pub period_s: Option<f64>,
    /// Chooses the phases. Default: 0.
    pub seed: Option<u64>,
}

/// A move with trapezoidal velocity, once, or there and back for ever.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrapezoidEntry {
    /// The joint.
    pub name: String,
    /// Default: such that the move is centred on home.
    pub start_rad: Option<f64>,
    /// Its sign is the direction. Default: 1.0, less near a limit where the start is left out too.
    pub distance_rad: Option<f64>,
    /// Default: 0.1.
    pub speed_rad_s: Option<f64>,
    /// Default: 1.0.
    pub acceleration_rad_s2: Option<f64>,
    /// Makes the move repeat, resting that long at either end. Default: one move.
    pub dwell_s: Option<f64>,
}

/// A spline through points at even times, at rest at both ends; the joint then holds the last.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaypointsEntry {
    /// The joint.
    pub name: String,
    /// Between two points.
    pub step_s: f64,
    /// At least two.
    pub positions_rad: Vec<f64>,
}

impl JointEntry {
    /// The joint.
    pub fn name(&self) -> &str {
        match self {
            Self::Hold(entry) => &entry.name,
            Self::Sine(entry) => &entry.name,
            Self::MultiSine(entry) => &entry.name,
            Self::Trapezoid(entry) => &entry.name,
            Self::Waypoints(entry) => &entry.name,
        }
    }

    /// Checks the entry and makes the motion of the joint with this index; `file` is what errors call it.
    pub(crate) fn motion(
        &self,
        file: &str,
        index: usize,
        robot: &Robot,
    ) -> Result<JointMotion, RobotError> {
        let place = Place::new(file, format!("joint `{}`", self.name()));
        let joint = &robot.joints[index];
        match self {
            Self::Hold(entry) => entry.motion(&place, joint),
            Self::Sine(entry) => entry.motion(&place, joint, spread_phase_rad(index, robot)),
            Self::MultiSine(entry) => entry.motion(&place, joint, index),
            Self::Trapezoid(entry) => entry.motion(&place, joint),
            Self::Waypoints(entry) => entry.motion(&place),
        }
    }
}

impl HoldEntry {
    fn motion(&self, place: &Place, joint: &RobotJoint) -> Result<JointMotion, RobotError> {
        number(place, "position_rad", self.position_rad, Must::BeFinite)?;
        let position_rad = self.position_rad.unwrap_or_else(|| home_rad(joint));
        Ok(JointMotion::Hold { position_rad })
    }
}

impl SineEntry {
    fn motion(
        &self,
        place: &Place,
        joint: &RobotJoint,
        usual_phase_rad: f64,
    ) -> Result<JointMotion, RobotError> {
        number(place, "centre_rad", self.centre_rad, Must::BeFinite)?;
        number(
            place,
            "amplitude_rad",
            self.amplitude_rad,
            Must::NotBeNegative,
        )?;
        number(place, "frequency_hz", self.frequency_hz, Must::BeFrequency)?;
        number(place, "phase_rad", self.phase_rad, Must::BeFinite)?;
        let centre_rad = self.centre_rad.unwrap_or_else(|| home_rad(joint));
        let usual_rad = || swing_rad(joint, centre_rad, 0.3);
        Ok(JointMotion::Sine {
            centre_rad,
            amplitude_rad: self.amplitude_rad.unwrap_or_else(usual_rad),
            frequency_hz: self.frequency_hz.unwrap_or(0.1),
            phase_rad: self.phase_rad.unwrap_or(usual_phase_rad),
        })
    }
}

impl MultiSineEntry {
    fn motion(
        &self,
        place: &Place,
        joint: &RobotJoint,
        index: usize,
    ) -> Result<JointMotion, RobotError> {
        number(place, "centre_rad", self.centre_rad, Must::BeFinite)?;
        number(
            place,
            "amplitude_rad",
            self.amplitude_rad,
            Must::NotBeNegative,
        )?;
        number(place, "speed_rad_s", self.speed_rad_s, Must::NotBeNegative)?;
        number(place, "period_s", self.period_s, Must::BePeriod)?;
        let centre_rad = self.centre_rad.unwrap_or_else(|| home_rad(joint));
        let usual_rad = || swing_rad(joint, centre_rad, 0.5);
        let recipe = Recipe {
            centre_rad,
            amplitude_rad: self.amplitude_rad.unwrap_or_else(usual_rad),
            speed_rad_s: self.speed_rad_s.unwrap_or_else(|| speed_rad_s(joint)),
            band_hz: self.band_hz.unwrap_or([0.05, 0.8]),
            period_s: self.period_s.unwrap_or(20.0),
            seed: self.seed.unwrap_or(0),
        };
        let motion = MultiSine::new(&recipe, index as u64).map(JointMotion::MultiSine);
        motion.ok_or_else(|| {
            let ([low, high], step) = (recipe.band_hz, 1.0 / recipe.period_s);
            place.invalid(format!(
                "band_hz = [{low}, {high}] must hold 1 to {LINES_MAX} multiples of 1/period_s = {step} Hz, \
                 none above {} Hz",
                f64::from(MULTIPLE_MAX) * step
            ))
        })
    }
}

impl TrapezoidEntry {
    fn motion(&self, place: &Place, joint: &RobotJoint) -> Result<JointMotion, RobotError> {
        number(place, "start_rad", self.start_rad, Must::BeFinite)?;
        number(place, "distance_rad", self.distance_rad, Must::BeFinite)?;
        number(place, "speed_rad_s", self.speed_rad_s, Must::BePositive)?;
        number(
            place,
            "acceleration_rad_s2",
            self.acceleration_rad_s2,
            Must::BePositive,
        )?;
        number(place, "dwell_s", self.dwell_s, Must::NotBeNegative)?;
        let home_rad = home_rad(joint);
        let usual_rad = match self.start_rad {
            Some(_) => 1.0,
            None => 2.0 * swing_rad(joint, home_rad, 0.5),
        };
        let distance_rad = self.distance_rad.unwrap_or(usual_rad);
        Ok(JointMotion::Trapezoid(Trapezoid::new(
            self.start_rad.unwrap_or(home_rad - distance_rad / 2.0),
            distance_rad,
            self.speed_rad_s.unwrap_or(0.1),
            self.acceleration_rad_s2.unwrap_or(1.0),
            self.dwell_s,
        )))
    }
}

impl WaypointsEntry {
    fn motion(&self, place: &Place) -> Result<JointMotion, RobotError> {
        number(place, "step_s", Some(self.step_s), Must::BePeriod)?;
        for position_rad in &self.positions_rad {
            number(place, "positions_rad", Some(*position_rad), Must::BeFinite)?;
        }
        let motion = EvenWaypoints::new(&self.positions_rad, self.step_s);
        motion.map(JointMotion::Waypoints).ok_or_else(|| {
            place.invalid(format!(
                "positions_rad has {} points, give at least 2",
                self.positions_rad.len()
            ))
        })
    }
}

/// What a number in a trajectory file must be.
#[derive(Clone, Copy)]
pub(crate) enum Must {
    BeFinite,
    BePositive,
    NotBeNegative,
    BeFrequency,
    BePeriod,
}

/// Checks a number that may be absent.
pub(crate) fn number(
    place: &Place,
    key: &str,
    value: Option<f64>,
    must: Must,
) -> Result<(), RobotError> {
    let Some(value) = value else { return Ok(()) };
    let (holds, rule) = match must {
        Must::BeFinite => (true, "must be a finite number"),
        Must::BePositive => (value > 0.0, "must be above zero and finite"),
        Must::NotBeNegative => (value >= 0.0, "must be zero or above and finite"),
        Must::BeFrequency => (
            (1e-4..=1000.0).contains(&value),
            "must be from 0.0001 to 1000",
        ),
        Must::BePeriod => (
            (1e-3..=10_000.0).contains(&value),
            "must be from 0.001 to 10000",
        ),
    };
    if holds && value.is_finite() {
        return Ok(());
    }
    Err(place.invalid(format!("{key} = {value} {rule}")))
}
