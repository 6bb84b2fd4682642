//! The menu of experiments: paths of joints that each bring out something else.
//!
//! Each is made for the room a joint has, [`Room`], and lasts as long as it is asked to; joints that take part move at the
//! same time, the others hold.

use std::f64::consts::TAU;

use motion::{SampledJoint, SampledReference};

/// Distance of the waypoints.
pub const STEP_S: f64 = 0.02;
/// Over this long a chirp comes and goes.
const FADE_S: f64 = 1.5;
/// Rest before and after everything.
const REST_S: f64 = 0.5;
/// Lowest and highest frequency of the chirps.
const LOW_HZ: [f64; 2] = [0.05, 0.5];
const HIGH_HZ: [f64; 2] = [0.5, 5.0];
/// Part of the speed a joint may have, of slow ramps from creeping to brisk.
const RAMP_SPEEDS: [f64; 5] = [0.02, 0.05, 0.12, 0.3, 0.7];
/// How long a slow ramp lasts one way.
const RAMP_S: f64 = 2.5;
/// Of the speed, in sweeps over the whole range.
const SWEEP_SPEEDS: [f64; 3] = [0.15, 0.35, 0.8];
/// Speed and reach of reversals at a pose, as parts of the joint's.
const REVERSAL_SPEED: f64 = 0.1;
const REVERSAL_REACH: f64 = 0.06;
/// How long it reverses at one pose before it goes to the other.
const REVERSAL_S: f64 = 5.0;
/// Part of the time at the beginning, and again at the end, of a warm repeat.
const REPEATED: f64 = 0.25;

/// Where and how fast one joint may move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    pub centre_rad: f64,
    /// To either side of the centre.
    pub reach_rad: f64,
    pub speed_rad_s: f64,
    pub acceleration_rad_s2: f64,
    /// Where the joint carries least and most.
    pub light_rad: f64,
    pub heavy_rad: f64,
}

impl Room {
    /// The same with speed and acceleration times a factor.
    pub fn slower(self, factor: f64) -> Self {
        Self {
            speed_rad_s: factor * self.speed_rad_s,
            acceleration_rad_s2: factor * self.acceleration_rad_s2,
            ..self
        }
    }
}

/// An experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Experiment {
    SlowRamps,
    Sweeps,
    LowChirp,
    HighChirp,
    Reversals,
    Points,
    WarmRepeat,
    Mixture,
}

impl Experiment {
    pub const ALL: [Self; 8] = [
        Self::SlowRamps,
        Self::Sweeps,
        Self::LowChirp,
        Self::HighChirp,
        Self::Reversals,
        Self::Points,
        Self::WarmRepeat,
        Self::Mixture,
    ];

    /// As people are told.
    pub fn name(self) -> &'static str {
        match self {
            Self::SlowRamps => "slow ramps at five speeds, with reversals",
            Self::Sweeps => "sweeps over the whole range at three speeds",
            Self::LowChirp => "a chirp of low frequencies",
            Self::HighChirp => "a chirp of high frequencies",
            Self::Reversals => "reversals at the least and at the greatest load",
            Self::Points => "moves from point to point",
            Self::WarmRepeat => "sweeps, brisk motion, and the same sweeps warm",
            Self::Mixture => "sweeps, slow ramps and a chirp of high frequencies",
        }
    }

    /// The reference: one room for each joint of the robot, none where it holds.
    pub fn reference(self, rooms: &[Seat], duration_s: f64) -> SampledReference {
        let samples = (duration_s / STEP_S).ceil() as usize + 1;
        let joints = rooms.iter().map(|seat| SampledJoint {
            positions_rad: match seat {
                Seat::Holds(position_rad) => vec![*position_rad; samples],
                Seat::Moves(room) => Path::of(self, room, samples),
            },
            end_velocities_rad_s: [0.0; 2],
        });
        SampledReference {
            joints: joints.collect(),
            times_s: (0..samples).map(|k| k as f64 * STEP_S).collect(),
        }
    }
}

/// What a joint does in an experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seat {
    Holds(f64),
    Moves(Room),
}

/// A joint's path as it grows.
struct Path<'a> {
    room: &'a Room,
    positions_rad: Vec<f64>,
    samples: usize,
}

impl<'a> Path<'a> {
    fn of(experiment: Experiment, room: &'a Room, samples: usize) -> Vec<f64> {
        let mut path = Path {
            room,
            positions_rad: vec![room.centre_rad],
            samples,
        };
        path.hold(REST_S);
        let whole_s = path.left_s() - REST_S;
        match experiment {
            Experiment::SlowRamps => path.ramps(whole_s),
            Experiment::Sweeps => path.sweeps(whole_s),
            Experiment::LowChirp => path.chirp(whole_s, LOW_HZ),
            Experiment::HighChirp => path.chirp(whole_s, HIGH_HZ),
            Experiment::Reversals => path.reversals(whole_s),
            Experiment::Points => path.points(whole_s),
            Experiment::WarmRepeat => {
                path.sweeps(REPEATED * whole_s);
                path.points((1.0 - 2.0 * REPEATED) * whole_s);
                path.sweeps(REPEATED * whole_s);
            }
            Experiment::Mixture => {
                path.sweeps(0.4 * whole_s);
                path.ramps(0.3 * whole_s);
                path.chirp(0.3 * whole_s, HIGH_HZ);
            }
        }
        path.hold(f64::INFINITY);
        path.positions_rad
    }

    fn at_rad(&self) -> f64 {
        let last = self.positions_rad.last();
        last.copied().unwrap_or(self.room.centre_rad)
    }

    fn left_s(&self) -> f64 {
        (self.samples - self.positions_rad.len()) as f64 * STEP_S
    }

    fn push(&mut self, duration_s: f64, position_rad: impl Fn(f64) -> f64) {
        let wanted = (duration_s / STEP_S).ceil().min(self.samples as f64) as usize;
        let count = wanted.min(self.samples - self.positions_rad.len());
        let added = (1..=count).map(|sample| position_rad(sample as f64 * STEP_S));
        self.positions_rad.extend(added);
    }

    fn hold(&mut self, duration_s: f64) {
        let at_rad = self.at_rad();
        self.push(duration_s, |_| at_rad);
    }

    /// From rest to rest at a cruising speed; `false`, and nothing done, if it would not be over by then.
    fn go(&mut self, target_rad: f64, speed_rad_s: f64, until_left_s: f64) -> bool {
        let from_rad = self.at_rad();
        let distance_rad = (target_rad - from_rad).abs();
        // the speed rises as 3u² - 2u³, whose steepest slope is 1.5
        let least_rise_s = 1.5 * speed_rad_s / self.room.acceleration_rad_s2;
        let rise_s = least_rise_s.max(2.0 * STEP_S);
        // a short way is gone more slowly, with the same rise
        let speed_rad_s = speed_rad_s.min(distance_rad / rise_s);
        if speed_rad_s <= 0.0 {
            return true;
        }
        let total_s = distance_rad / speed_rad_s + rise_s;
        if total_s > self.left_s() - until_left_s {
            return false;
        }
        let sign = (target_rad - from_rad).signum();
        let rising_rad = |time_s: f64| {
            let u = (time_s / rise_s).clamp(0.0, 1.0);
            speed_rad_s * rise_s * (u.powi(3) - 0.5 * u.powi(4))
        };
        self.push(total_s, |time_s| {
            let covered_rad = if time_s < rise_s {
                rising_rad(time_s)
            } else if time_s < total_s - rise_s {
                speed_rad_s * (time_s - 0.5 * rise_s)
            } else {
                distance_rad - rising_rad(total_s - time_s)
            };
            from_rad + sign * covered_rad
        });
        true
    }

    fn go_to_centre(&mut self, until_left_s: f64) {
        self.go(
            self.room.centre_rad,
            0.5 * self.room.speed_rad_s,
            until_left_s,
        );
    }

    /// There and back about the centre, from creeping to brisk and again, at speeds that no time is lost for.
    fn ramps(&mut self, duration_s: f64) {
        let until_s = self.left_s() - duration_s;
        self.go_to_centre(until_s);
        for part in RAMP_SPEEDS.iter().cycle() {
            let speed_rad_s = part * self.room.speed_rad_s;
            let far_rad = (0.5 * RAMP_S * speed_rad_s).min(self.room.reach_rad);
            let ends = [far_rad, -far_rad].map(|far_rad| self.room.centre_rad + far_rad);
            if !ends.iter().all(|end| self.go(*end, speed_rad_s, until_s)) {
                return;
            }
        }
    }

    fn sweeps(&mut self, duration_s: f64) {
        let until_s = self.left_s() - duration_s;
        for part in SWEEP_SPEEDS.iter().rev().cycle() {
            let ends = [1.0, -1.0].map(|side| self.room.centre_rad + side * self.room.reach_rad);
            for end in ends {
                // what is too slow for the time that is left is gone faster
                let speeds = [*part, 1.0].map(|part| part * self.room.speed_rad_s);
                if !speeds.iter().any(|speed| self.go(end, *speed, until_s)) {
                    return;
                }
            }
        }
    }

    /// The frequency rises in proportion to itself; amplitude as far as reach, speed and acceleration allow.
    fn chirp(&mut self, duration_s: f64, [low_hz, high_hz]: [f64; 2]) {
        let until_s = self.left_s() - duration_s;
        self.go_to_centre(until_s);
        let duration_s = self.left_s() - until_s;
        let growth = (high_hz / low_hz).ln();
        let (centre_rad, room) = (self.room.centre_rad, self.room);
        self.push(duration_s, |time_s| {
            let hz = low_hz * (growth * time_s / duration_s).exp();
            let phase_rad = TAU * (hz - low_hz) * duration_s / growth;
            let fade = smooth(time_s / FADE_S) * smooth((duration_s - time_s) / FADE_S);
            let by_speed_rad = room.speed_rad_s / (TAU * hz);
            let by_force_rad = room.acceleration_rad_s2 / (TAU * hz).powi(2);
            let most_rad = room.reach_rad.min(by_speed_rad).min(by_force_rad);
            centre_rad + 0.8 * fade * most_rad * phase_rad.sin()
        });
    }

    fn reversals(&mut self, duration_s: f64) {
        let until_s = self.left_s() - duration_s;
        let room = *self.room;
        let far_rad = REVERSAL_REACH * room.reach_rad;
        for pose_rad in [room.light_rad, room.heavy_rad].iter().cycle() {
            if !self.go(*pose_rad, 0.6 * room.speed_rad_s, until_s) {
                return;
            }
            let leave_s = self.left_s() - REVERSAL_S;
            let mut side = (room.centre_rad - pose_rad).signum() * far_rad;
            while self.go(
                pose_rad + side,
                REVERSAL_SPEED * room.speed_rad_s,
                leave_s.max(until_s),
            ) {
                side = if side == 0.0 { far_rad } else { 0.0 };
            }
        }
    }

    /// Targets that fill the range evenly, at full speed, with rests.
    fn points(&mut self, duration_s: f64) {
        /// The golden ratio's fraction: multiples of it never come close to one another.
        const STEP: f64 = 0.618_033_988_749_895;
        let until_s = self.left_s() - duration_s;
        for k in 1_u32.. {
            let part = 2.0 * (f64::from(k) * STEP).fract() - 1.0;
            let target_rad = self.room.centre_rad + part * self.room.reach_rad;
            if !self.go(target_rad, self.room.speed_rad_s, until_s) {
                return;
            }
            self.hold(0.3_f64.min(self.left_s() - until_s));
        }
    }
}

/// From 0 to 1 with no speed and no acceleration at either end.
fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: Room = Room {
        centre_rad: 0.2,
        reach_rad: 1.0,
        speed_rad_s: 2.0,
        acceleration_rad_s2: 8.0,
        light_rad: 0.2,
        heavy_rad: 1.1,
    };

    #[test]
    fn every_experiment_keeps_to_its_room_and_to_its_time() {
        for experiment in Experiment::ALL {
            let seats = [Seat::Moves(ROOM), Seat::Holds(0.7)];
            let reference = experiment.reference(&seats, 30.0);
            assert_eq!(reference.times_s.len(), 1501);
            assert_eq!(reference.joints[1].positions_rad, vec![0.7; 1501]);
            let path = &reference.joints[0].positions_rad;
            assert_eq!(path.len(), 1501);
            let inside =
                |x: &f64| (x - ROOM.centre_rad).abs() < ROOM.reach_rad * (1.0 + 1e-9) + 1e-9;
            assert!(path.iter().all(inside), "{experiment:?}");
            let fastest = path
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs() / STEP_S)
                .fold(0.0, f64::max);
            assert!(
                fastest < 1.02 * ROOM.speed_rad_s,
                "{experiment:?} {fastest}"
            );
            assert!(
                fastest > 0.05 * ROOM.speed_rad_s,
                "{experiment:?} {fastest}"
            );
            let hardest = path
                .windows(3)
                .map(|w| (w[2] - 2.0 * w[1] + w[0]).abs() / STEP_S.powi(2))
                .fold(0.0, f64::max);
            assert!(
                hardest < 1.1 * ROOM.acceleration_rad_s2,
                "{experiment:?} {hardest}"
            );
        }
    }

    #[test]
    fn a_warm_repeat_goes_the_same_way_again() {
        let seats = [Seat::Moves(ROOM)];
        let reference = Experiment::WarmRepeat.reference(&seats, 40.0);
        let path = &reference.joints[0].positions_rad;
        let highest = |part: &[f64]| part.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert_eq!(highest(&path[..500]), highest(&path[1500..]));
    }
}
