//! What the joints are asked to do: rich motion, and the poor motion on which some effects cannot be told apart.

use std::f64::consts::TAU;

use motion::{MotionError, SampledJoint, SampledReference, Trajectory};
use robot::Robot;

use crate::random::Random;

/// Distance of the samples that the reference runs through.
const STEP_S: f64 = 0.004;
/// Over this long a multi-sine comes and goes.
const FADE_S: f64 = 1.5;

/// Where and how fast one joint may move.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    pub centre_rad: f64,
    /// To either side of the centre.
    pub reach_rad: f64,
    pub speed_rad_s: f64,
    pub acceleration_rad_s2: f64,
}

/// How the joints move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Course {
    /// Multi-sines, ramps at several speeds with reversals, moves from point to point.
    Rich,
    /// One sine of this frequency.
    Sine { frequency_hz: f64 },
    /// There and back at one speed.
    OneSpeed,
    /// Slow moves, all in one direction.
    OneDirection,
}

impl Course {
    /// A trajectory of that kind for every joint.
    pub fn trajectory(
        self,
        rooms: &[Room],
        duration_s: f64,
        robot: &Robot,
        random: &mut Random,
    ) -> Result<Trajectory, MotionError> {
        let samples = (duration_s / STEP_S).ceil() as usize + 2;
        let joints = rooms.iter().map(|room| SampledJoint {
            positions_rad: self.path(room, samples, random),
            end_velocities_rad_s: [0.0; 2],
        });
        let reference = SampledReference {
            joints: joints.collect(),
            times_s: (0..samples).map(|sample| sample as f64 * STEP_S).collect(),
        };
        Trajectory::sampled(reference, robot)
    }

    fn path(self, room: &Room, samples: usize, random: &mut Random) -> Vec<f64> {
        let mut path = Path {
            room: *room,
            positions_rad: Vec::with_capacity(samples),
            samples,
        };
        match self {
            Self::Rich => path.rich(random),
            Self::Sine { frequency_hz } => path.sine(frequency_hz),
            Self::OneSpeed => path.one_speed(random),
            Self::OneDirection => path.one_direction(random),
        }
        path.positions_rad
    }
}

/// A joint's path as it grows.
struct Path {
    room: Room,
    positions_rad: Vec<f64>,
    samples: usize,
}

impl Path {
    fn at_rad(&self) -> f64 {
        self.positions_rad
            .last()
            .copied()
            .unwrap_or(self.room.centre_rad)
    }

    fn left_s(&self) -> f64 {
        (self.samples - self.positions_rad.len()) as f64 * STEP_S
    }

    fn push(&mut self, duration_s: f64, position_rad: impl Fn(f64) -> f64) {
        let count =
            ((duration_s / STEP_S).ceil() as usize).min(self.samples - self.positions_rad.len());
        let added = (1..=count).map(|sample| position_rad(sample as f64 * STEP_S));
        self.positions_rad.extend(added);
    }

    fn hold(&mut self, duration_s: f64) {
        let at_rad = self.at_rad();
        self.push(duration_s, |_| at_rad);
    }

    /// What is left, at rest.
    fn rest(&mut self) {
        self.hold(self.left_s());
        self.positions_rad.resize(self.samples, self.at_rad());
    }

    /// Pieces of all kinds in random order; what no longer fits is left out.
    fn rich(&mut self, random: &mut Random) {
        self.hold(random.between(0.2, 0.6));
        let mut kinds = [0, 1, 2];
        random.shuffle(&mut kinds);
        let used = 1 + random.index(kinds.len());
        while self.left_s() > 3.0 {
            self.hold(random.between(0.05, 0.3));
            for kind in &kinds[..used] {
                let piece_s = random.between(5.0, 11.0).min(self.left_s());
                match kind {
                    0 => self.multi_sine(piece_s, random),
                    1 => self.ramps(piece_s, random),
                    _ => self.points(piece_s, random),
                }
            }
        }
        self.rest();
    }

    fn target_rad(&self, random: &mut Random) -> f64 {
        self.room.centre_rad + self.room.reach_rad * random.between(-1.0, 1.0)
    }

    /// The quickest smooth move there, slowed down.
    fn move_s(&self, distance_rad: f64, slowness: f64) -> f64 {
        // peaks of the fifth-order move: 1.875 d/T and 5.774 d/T²
        let by_speed_s = 1.875 * distance_rad.abs() / self.room.speed_rad_s;
        let by_force_s = (5.774 * distance_rad.abs() / self.room.acceleration_rad_s2).sqrt();
        slowness * by_speed_s.max(by_force_s).max(0.05)
    }

    fn move_to(&mut self, target_rad: f64, slowness: f64) -> bool {
        let from_rad = self.at_rad();
        let duration_s = self.move_s(target_rad - from_rad, slowness);
        if duration_s > self.left_s() {
            return false;
        }
        self.push(duration_s, |time_s| {
            from_rad + (target_rad - from_rad) * smooth((time_s / duration_s).min(1.0))
        });
        true
    }

    fn points(&mut self, duration_s: f64, random: &mut Random) {
        let until_s = self.left_s() - duration_s;
        while self.left_s() > until_s.max(0.2) {
            let target_rad = self.target_rad(random);
            if !self.move_to(target_rad, random.between(1.0, 2.5)) {
                break;
            }
            self.hold(random.between(0.0, 0.5));
        }
    }

    fn multi_sine(&mut self, duration_s: f64, random: &mut Random) {
        if !self.move_to(self.room.centre_rad, 1.3) || duration_s < 3.0 * FADE_S {
            return;
        }
        let duration_s = duration_s.min(self.left_s());
        let highest_hz = random.between(1.0, 3.0);
        let lines: Vec<[f64; 3]> = (0..8 + random.index(10))
            .map(|_| {
                let frequency_hz = random.magnitude(0.1, highest_hz);
                [
                    1.0 / frequency_hz,
                    TAU * frequency_hz,
                    random.between(0.0, TAU),
                ]
            })
            .collect();
        let shape = |time_s: f64| -> f64 {
            let fade = smooth((time_s / FADE_S).clamp(0.0, 1.0))
                * smooth(((duration_s - time_s) / FADE_S).clamp(0.0, 1.0));
            let sum: f64 = lines
                .iter()
                .map(|[amplitude, rad_s, phase_rad]| amplitude * (rad_s * time_s + phase_rad).sin())
                .sum();
            fade * sum
        };
        let scale = self.scale(duration_s, &shape) * random.between(0.6, 1.0);
        let centre_rad = self.at_rad();
        self.push(duration_s, |time_s| centre_rad + scale * shape(time_s));
    }

    /// How large a shape may be drawn to stay within the room.
    fn scale(&self, duration_s: f64, shape: &dyn Fn(f64) -> f64) -> f64 {
        let count = (duration_s / STEP_S) as usize;
        let values: Vec<f64> = (0..=count).map(|k| shape(k as f64 * STEP_S)).collect();
        let most = |peak: f64, bound: f64| if peak > 0.0 { bound / peak } else { bound };
        let peak = values.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        let slope = values
            .windows(2)
            .fold(0.0, |peak: f64, w| peak.max((w[1] - w[0]).abs() / STEP_S));
        let bend = values.windows(3).fold(0.0, |peak: f64, w| {
            peak.max((w[2] - 2.0 * w[1] + w[0]).abs() / STEP_S.powi(2))
        });
        most(peak, self.room.reach_rad)
            .min(most(slope, self.room.speed_rad_s))
            .min(most(bend, self.room.acceleration_rad_s2))
    }

    /// Forth and back at speeds from slow to fast, in random order.
    fn ramps(&mut self, duration_s: f64, random: &mut Random) {
        let until_s = self.left_s() - duration_s;
        while self.left_s() > until_s.max(0.5) {
            let speed_rad_s = random.magnitude(0.02, 1.0) * self.room.speed_rad_s;
            let out_rad = self.room.centre_rad - self.at_rad();
            let far_rad =
                (speed_rad_s * random.between(1.0, 3.0)).min(self.room.reach_rad + out_rad.abs());
            let inwards = out_rad.signum();
            for direction in [inwards, -inwards] {
                if !self.ramp(direction * far_rad, speed_rad_s) {
                    return;
                }
                if random.chance(0.3) {
                    self.hold(random.between(0.1, 0.4));
                }
            }
        }
    }

    /// A move at constant speed with smooth ends; none if it would lead outside or takes too long.
    fn ramp(&mut self, distance_rad: f64, speed_rad_s: f64) -> bool {
        // the speed rises as 3u² - 2u³, whose peak slope is 1.5
        let rise_s = 1.5 * speed_rad_s / self.room.acceleration_rad_s2;
        let cruise_s = distance_rad.abs() / speed_rad_s - rise_s;
        let end_rad = self.at_rad() + distance_rad;
        let outside = (end_rad - self.room.centre_rad).abs() > self.room.reach_rad * 1.001;
        if cruise_s < 0.0 {
            return !outside && self.move_to(end_rad, 1.0);
        }
        if outside || cruise_s + 2.0 * rise_s > self.left_s() {
            return false;
        }
        let from_rad = self.at_rad();
        let sign = distance_rad.signum();
        let total_s = cruise_s + 2.0 * rise_s;
        let covered_rad = move |time_s: f64| {
            let rising = |t: f64| {
                let u = (t / rise_s).min(1.0);
                speed_rad_s * rise_s * (u.powi(3) - 0.5 * u.powi(4))
            };
            if time_s <= rise_s {
                rising(time_s)
            } else if time_s <= total_s - rise_s {
                speed_rad_s * (time_s - 0.5 * rise_s)
            } else {
                distance_rad.abs() - rising((total_s - time_s).max(0.0))
            }
        };
        self.push(total_s, |time_s| from_rad + sign * covered_rad(time_s));
        true
    }

    /// Around where it stands, for as long as there is time.
    fn sine(&mut self, frequency_hz: f64) {
        let duration_s = self.left_s();
        let shape = |time_s: f64| {
            smooth((time_s / FADE_S).clamp(0.0, 1.0)) * (TAU * frequency_hz * time_s).sin()
        };
        let scale = 0.9 * self.scale(duration_s, &shape);
        let centre_rad = self.at_rad();
        self.push(duration_s, |time_s| centre_rad + scale * shape(time_s));
        self.rest();
    }

    fn one_speed(&mut self, random: &mut Random) {
        let speed_rad_s = random.between(0.2, 0.6) * self.room.speed_rad_s;
        let far_rad = (speed_rad_s * random.between(1.5, 3.0)).min(self.room.reach_rad);
        self.hold(0.3);
        let mut direction = random.sign();
        while self.ramp(direction * far_rad, speed_rad_s) {
            direction = -direction;
        }
        self.rest();
    }

    fn one_direction(&mut self, random: &mut Random) {
        let direction = random.sign();
        self.positions_rad
            .push(self.room.centre_rad - direction * self.room.reach_rad);
        self.hold(0.3);
        // twelve moves share the room
        let far_rad = 2.0 * self.room.reach_rad / 12.0;
        let least_rad_s = far_rad / 2.2;
        let speed_rad_s = least_rad_s * random.between(1.1, 2.0);
        while self.ramp(direction * far_rad, speed_rad_s) {
            self.hold(random.between(0.05, 0.2));
        }
        self.rest();
    }
}

/// From 0 to 1 with no speed and no acceleration at either end.
fn smooth(u: f64) -> f64 {
    u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u)
}
