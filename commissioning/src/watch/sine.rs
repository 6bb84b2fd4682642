//! A small sine of one joint, the others held.

use motion::{HoldEntry, JointEntry, Reference, SineEntry, Trajectory, TrajectoryFile};
use robot::Robot;
use shm_types::messages::LoopState;

use super::{Joints, Spans, Watch};
use crate::moment::Moment;
use crate::verdict::{Finding, Verdict};

/// Three degrees: seen by eye, and no joint is hurt by it. docs/commissioning.md has the same.
const AMPLITUDE_RAD: f64 = 0.05;
/// At most 0.06 rad/s.
const FREQUENCY_HZ: f64 = 0.2;
/// From rest to the whole sine.
const SOFT_START_S: f64 = 2.0;
/// Judged over so many whole periods.
const PERIODS: f64 = 2.0;
/// A joint that stands has 0, one that follows has 1. Assumed: low gains against friction leave more than half.
const GAIN: std::ops::RangeInclusive<f64> = 0.5..=1.5;
/// A joint this far from its reference is let go at once: four times what it is to swing. Assumed.
const AWAY_RAD: f64 = 0.2;
/// What another joint may move by meanwhile. Assumed: held at low gains.
const OTHERS_RAD: f64 = 0.1;
/// Of the cycles, those in which the loop had to limit the joint's torque. Assumed.
const LIMITED_SHARE: f64 = 0.01;
/// The loop gives drives 3 s to be enabled.
const PATIENCE_S: f64 = 10.0;

/// One joint swings about where it stands, the others are held where they stand.
pub fn small_sine(robot: &Robot, joint: usize, positions_rad: &[f64]) -> TrajectoryFile {
    let of = |(index, name): (usize, &str)| {
        let here_rad = positions_rad.get(index).copied();
        match index == joint {
            true => JointEntry::Sine(SineEntry {
                name: name.to_owned(),
                centre_rad: here_rad,
                amplitude_rad: Some(AMPLITUDE_RAD),
                frequency_hz: Some(FREQUENCY_HZ),
                phase_rad: Some(0.0),
            }),
            false => JointEntry::Hold(HoldEntry {
                name: name.to_owned(),
                position_rad: here_rad,
            }),
        }
    };
    TrajectoryFile {
        soft_start_s: Some(SOFT_START_S),
        joints: robot
            .joint_names()
            .into_iter()
            .enumerate()
            .map(of)
            .collect(),
        ..TrajectoryFile::default()
    }
}

/// The joint follows, the others stay.
#[derive(Debug)]
pub struct Sine {
    joints: Joints,
    joint: usize,
    trajectory: Option<Trajectory>,
    first_s: Option<f64>,
    spans: Spans,
    error: Error,
    fit: Fit,
    cycles: u32,
    limited: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Error {
    now_rad: f64,
    largest_rad: f64,
}

/// Least squares of where the joint is over where it should be.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    count: f64,
    reference: f64,
    position: f64,
    reference_squared: f64,
    product: f64,
}

impl Fit {
    fn add(&mut self, reference: f64, position: f64) {
        self.count += 1.0;
        self.reference += reference;
        self.position += position;
        self.reference_squared += reference * reference;
        self.product += reference * position;
    }

    /// What the joint goes for what it should go; 0 where nothing was asked of it.
    fn gain(&self) -> f64 {
        let spread = self.reference_squared - self.reference * self.reference / self.count;
        let common = self.product - self.reference * self.position / self.count;
        if spread > 0.0 { common / spread } else { 0.0 }
    }
}

impl Sine {
    pub fn new(joints: Joints, joint: usize, trajectory: Option<Trajectory>) -> Self {
        Self {
            joints,
            joint,
            trajectory,
            first_s: None,
            spans: Spans::default(),
            error: Error::default(),
            fit: Fit::default(),
            cycles: 0,
            limited: 0,
        }
    }

    fn add(&mut self, moment: &Moment) -> Option<Verdict> {
        let (seen, trajectory) = (moment.seen.as_ref()?, self.trajectory.as_ref()?);
        let time_s = seen.motion_time_s;
        let mut reference = Reference::default();
        trajectory.sample(time_s, &mut reference);
        let position_rad = self.joints.positions_rad(seen)[self.joint];
        let reference_rad = reference.position_rad[self.joint];
        self.spans.add(&self.joints, seen);
        self.cycles += 1;
        self.limited += u32::from(moment.limited_joints >> self.joint & 1 == 1);
        self.error.now_rad = reference_rad - position_rad;
        self.error.largest_rad = self.error.largest_rad.max(self.error.now_rad.abs());
        let name = self.joints.name(self.joint);
        if self.error.now_rad.abs() > AWAY_RAD {
            let away_rad = self.error.now_rad;
            let told = format!(
                "{name}: it was {away_rad:+.3} rad from its reference after {time_s:.2} s; look at gains, sign and load"
            );
            return Some(Verdict::Refused(Finding::new(
                away_rad.abs(),
                AWAY_RAD,
                "rad",
                told,
            )));
        }
        let (other, other_rad) = self.spans.widest(&self.joints, Some(self.joint));
        if other_rad > OTHERS_RAD {
            let told = format!(
                "{}: it moved by {other_rad:.3} rad while {name} swung; it is not held",
                self.joints.name(other)
            );
            return Some(Verdict::Refused(Finding::new(
                other_rad, OTHERS_RAD, "rad", told,
            )));
        }
        if time_s >= SOFT_START_S {
            self.fit.add(reference_rad, position_rad);
        }
        (time_s >= SOFT_START_S + PERIODS / FREQUENCY_HZ).then(|| self.judged())
    }

    fn judged(&self) -> Verdict {
        let name = self.joints.name(self.joint);
        let limited = f64::from(self.limited) / f64::from(self.cycles.max(1));
        let (gain, largest_rad) = (self.fit.gain(), self.error.largest_rad);
        if limited > LIMITED_SHARE {
            let told = format!(
                "{name}: its torque was at a limit in {:.1} % of the cycles; raise torque_limit_nm, or lower the load",
                100.0 * limited
            );
            return Verdict::Refused(Finding::new(limited, LIMITED_SHARE, "", told));
        }
        if !GAIN.contains(&gain) {
            let told = format!(
                "{name}: it went {gain:.2} of what it should, {} to {} are wanted, and was up to {largest_rad:.3} rad away; look at gains \
                 and friction",
                GAIN.start(),
                GAIN.end()
            );
            return Verdict::Refused(Finding::new(gain, *GAIN.start(), "", told));
        }
        let told = format!(
            "{name}: it went {gain:.2} of what it should, and was up to {largest_rad:.4} rad away"
        );
        Verdict::Passed(Finding::new(gain, *GAIN.start(), "", told))
    }
}

impl Watch for Sine {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let first_s = *self.first_s.get_or_insert(moment.at_s);
        let verdict = match moment.state {
            LoopState::Running => self.add(moment),
            _ => None,
        };
        if let Some(verdict) = verdict {
            return verdict;
        }
        // Where the trajectory waits for commands that do not come.
        let longest_s = PATIENCE_S + SOFT_START_S + PERIODS / FREQUENCY_HZ;
        match moment.at_s - first_s > longest_s {
            true => Verdict::Refused(self.give_up()),
            false => Verdict::Waiting,
        }
    }

    fn hint(&self) -> String {
        format!(
            "{}: {:+.4} rad from its reference",
            self.joints.name(self.joint),
            self.error.now_rad
        )
    }

    fn give_up(&self) -> Finding {
        let told = format!(
            "{}: the sine was not finished; it was up to {:.4} rad away",
            self.joints.name(self.joint),
            self.error.largest_rad
        );
        Finding::new(self.error.largest_rad, AWAY_RAD, "rad", told)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::watch::stage::{moment, passed, refused, show};
    use shm_types::drive::DriveState::Enabled;
    use shm_types::messages::LoopState::{Holding, Running, SafeStop};

    /// The sine of joint 1 of a robot that stands at 0.2 rad.
    fn trajectory() -> Trajectory {
        let robot = robot::load("shd17").expect("shipped");
        let file = small_sine(&robot, 0, &[0.2]);
        file.build("sine", &robot).expect("within limits")
    }

    fn watch() -> Sine {
        Sine::new(
            Joints::of(&crate::watch::stage::robot()),
            0,
            Some(trajectory()),
        )
    }

    /// A joint that goes this much of what it should, and is that far away.
    fn follows(gain: f64, offset_rad: f64) -> impl FnMut(f64) -> Moment {
        let trajectory = trajectory();
        move |at_s| {
            let mut reference = Reference::default();
            trajectory.sample(at_s, &mut reference);
            let swing_rad = reference.position_rad[0] - 0.2;
            moment(
                at_s,
                Running,
                Enabled,
                [0.2 + offset_rad + gain * swing_rad, 0.1],
            )
        }
    }

    #[test]
    fn a_sine_is_small_slow_and_about_where_the_joint_stands() {
        let (trajectory, mut reference) = (trajectory(), Reference::default());
        let (mut furthest_rad, mut fastest_rad_s) = (0.0_f64, 0.0_f64);
        for step in 0..12_000 {
            trajectory.sample(1e-3 * f64::from(step), &mut reference);
            furthest_rad = furthest_rad.max((reference.position_rad[0] - 0.2).abs());
            fastest_rad_s = fastest_rad_s.max(reference.velocity_rad_s[0].abs());
        }
        assert!(
            (furthest_rad - AMPLITUDE_RAD).abs() < 1e-3,
            "{furthest_rad}"
        );
        assert!(
            fastest_rad_s < 1.01 * AMPLITUDE_RAD * TAU * FREQUENCY_HZ,
            "{fastest_rad_s}"
        );
    }

    #[test]
    fn a_joint_that_follows_passes_with_its_share() {
        let finding = passed(show(&mut watch(), 20.0, follows(0.9, 0.03)));
        assert!((finding.value - 0.9).abs() < 1e-6, "{finding:?}");
    }

    #[test]
    fn a_joint_that_stands_swings_against_or_runs_away_is_refused() {
        for gain in [0.0, -1.0, 0.4, 1.6] {
            let told = refused(show(&mut watch(), 20.0, follows(gain, 0.0)));
            assert!(told.contains(&format!("{gain:.2} of what")), "{told}");
        }
        let runs_away = |at_s: f64| moment(at_s, Running, Enabled, [0.2 + 0.5 * at_s, 0.1]);
        let told = refused(show(&mut watch(), 20.0, runs_away));
        assert!(
            told.contains("joint1") && told.contains("from its reference after 0.4"),
            "{told}"
        );
    }

    #[test]
    fn limited_torque_another_joint_a_stop_and_waiting_are_not_passed() {
        let mut course = follows(1.0, 0.0);
        let told = refused(show(&mut watch(), 20.0, |at_s| Moment {
            limited_joints: u64::from(at_s < 0.5),
            ..course(at_s)
        }));
        assert!(told.contains("at a limit"), "{told}");
        let mut course = follows(1.0, 0.0);
        let told = refused(show(&mut watch(), 20.0, |at_s| {
            let mut other = course(at_s);
            other
                .seen
                .as_mut()
                .expect("seen")
                .readings
                .motor_position_rad[1] = 50.0 * 0.05 * at_s;
            other
        }));
        assert!(
            told.contains("joint2") && told.contains("not held"),
            "{told}"
        );
        let waits = |at_s| moment(at_s, Holding, Enabled, [0.2, 0.1]);
        let told = refused(show(&mut watch(), 30.0, waits));
        assert!(told.contains("not finished"), "{told}");
        let stops = |at_s| moment(at_s, SafeStop, Enabled, [0.2, 0.1]);
        assert_eq!(show(&mut watch(), 1.0, stops), Verdict::Stopped);
    }
}
