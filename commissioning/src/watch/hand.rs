//! Joints that are moved by hand, without torque.

use shm_types::messages::{LoopState, PerJoint};

use super::{Joints, PERSON_S, Rest, Spans, Watch};
use crate::moment::{Moment, Seen};
use crate::verdict::{Finding, Verdict};

/// A joint that a hand has moved has gone this far. Assumed: six degrees, more than leaning on it does.
const MOVED_RAD: f64 = 0.1;
/// Of a joint's range, where that is so small that this is less.
const MOVED_SHARE: f64 = 0.25;
/// What other joints may move by, of what this one moves by: an arm that is held at one link swings at others.
const OTHERS_SHARE: f64 = 0.5;
/// The end of a range is reached this near to it. Assumed: a degree.
const REACHED_RAD: f64 = 0.02;
/// Motion on both sides of a gear agrees within this share: what a wrong ratio is beyond and a twisted gear is not.
const SIDES_SHARE: f64 = 0.2;

/// Waits for the arm to be still with no torque, and keeps where it was then.
#[derive(Debug, Default)]
struct Beginning {
    first_s: Option<f64>,
    rest: Rest,
    at: Option<(f64, PerJoint, PerJoint)>,
}

impl Beginning {
    /// What is seen now, and motor and link position of every joint when it began, once it has.
    fn see<'a>(
        &mut self,
        joints: &Joints,
        moment: &'a Moment,
    ) -> Option<(&'a Seen, PerJoint, PerJoint)> {
        let seen = moment.seen.as_ref()?;
        if moment.state == LoopState::Running
            && self.at.is_none()
            && self.rest.see(joints, moment.at_s, seen)
        {
            let here_rad = joints.positions_rad(seen);
            self.at = Some((moment.at_s, here_rad, seen.readings.link_position_rad));
        }
        self.at
            .map(|(_, motor_rad, link_rad)| (seen, motor_rad, link_rad))
    }

    /// Seconds since the first moment.
    fn waited_s(&mut self, moment: &Moment) -> f64 {
        moment.at_s - *self.first_s.get_or_insert(moment.at_s)
    }
}

/// A verdict as long as somebody may take for it.
fn in_time(waited_s: f64, verdict: Verdict, watch: &impl Watch) -> Verdict {
    match verdict {
        Verdict::Waiting if waited_s > PERSON_S => Verdict::Refused(watch.give_up()),
        verdict => verdict,
    }
}

fn wanted_rad(joints: &Joints, joint: usize) -> f64 {
    let range = joints
        .0
        .get(joint)
        .and_then(|joint| joint.position_limit_rad);
    let range_rad = range.map_or(f64::INFINITY, |[low_rad, high_rad]| high_rad - low_rad);
    MOVED_RAD.min(MOVED_SHARE * range_rad)
}

/// This joint moves, and no other.
#[derive(Debug)]
pub struct Moved {
    joints: Joints,
    joint: usize,
    wanted_rad: f64,
    beginning: Beginning,
    spans: Spans,
}

impl Moved {
    pub fn new(joints: Joints, joint: usize) -> Self {
        Self {
            wanted_rad: wanted_rad(&joints, joint),
            joints,
            joint,
            beginning: Beginning::default(),
            spans: Spans::default(),
        }
    }

    fn judged(&self) -> Verdict {
        let moved_rad = self.spans.0[self.joint].width();
        let (other, other_rad) = self.spans.widest(&self.joints, Some(self.joint));
        let (name, other_name) = (self.joints.name(self.joint), self.joints.name(other));
        if other_rad >= self.wanted_rad && moved_rad < OTHERS_SHARE * other_rad {
            let told = format!(
                "{other_name} was seen to move by {other_rad:.3} rad and {name} by {moved_rad:.3}; the drives of the two are \
                 exchanged, or another joint was moved"
            );
            return Verdict::Refused(Finding::new(moved_rad, self.wanted_rad, "rad", told));
        }
        if moved_rad < self.wanted_rad || other_rad > OTHERS_SHARE * moved_rad {
            return Verdict::Waiting;
        }
        let told = format!(
            "{name}: moved by hand by {moved_rad:.3} rad, no other by more than {other_rad:.3}"
        );
        Verdict::Passed(Finding::new(moved_rad, self.wanted_rad, "rad", told))
    }
}

impl Watch for Moved {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let waited_s = self.beginning.waited_s(moment);
        if let Some((seen, ..)) = self.beginning.see(&self.joints, moment) {
            self.spans.add(&self.joints, seen);
        }
        in_time(waited_s, self.judged(), self)
    }

    fn hint(&self) -> String {
        let moved_rad = self.spans.0[self.joint].width();
        format!(
            "{}: {moved_rad:.3} of {:.3} rad",
            self.joints.name(self.joint),
            self.wanted_rad
        )
    }

    fn give_up(&self) -> Finding {
        let moved_rad = self.spans.0[self.joint].width();
        let name = self.joints.name(self.joint);
        let told = match self.beginning.at {
            None => format!("{name}: the arm never came to rest without torque; support it"),
            Some(_) => format!(
                "{name}: it was seen to move by {moved_rad:.3} rad, {:.3} are wanted; its brake is closed, its encoder dead, or \
                 another joint was meant",
                self.wanted_rad
            ),
        };
        Finding::new(moved_rad, self.wanted_rad, "rad", told)
    }
}

/// Turned in the positive direction, the position rises.
#[derive(Debug)]
pub struct Turned {
    joints: Joints,
    joint: usize,
    wanted_rad: f64,
    beginning: Beginning,
    turned_rad: f64,
}

impl Turned {
    pub fn new(joints: Joints, joint: usize) -> Self {
        Self {
            wanted_rad: wanted_rad(&joints, joint),
            joints,
            joint,
            beginning: Beginning::default(),
            turned_rad: 0.0,
        }
    }

    fn judged(&self, link_rad: f64) -> Verdict {
        let (name, turned_rad) = (self.joints.name(self.joint), self.turned_rad);
        if turned_rad.abs() < self.wanted_rad {
            return Verdict::Waiting;
        }
        if turned_rad < 0.0 {
            let told = format!(
                "{name}: turned in its positive direction, its position went by {turned_rad:.3} rad; its direction is wrong: set \
                 `reversed` for its drive, or turn `axis` round"
            );
            return Verdict::Refused(Finding::new(turned_rad, self.wanted_rad, "rad", told));
        }
        if link_rad.is_finite() && (link_rad / turned_rad - 1.0).abs() > SIDES_SHARE {
            let told = format!(
                "{name}: its motor turned by {turned_rad:.3} rad at the joint, its link encoder says {link_rad:.3}; set gear_ratio, or \
                 the direction of the encoder that is wrong"
            );
            return Verdict::Refused(Finding::new(link_rad, turned_rad, "rad", told));
        }
        let told =
            format!("{name}: its position rose by {turned_rad:.3} rad in its positive direction");
        Verdict::Passed(Finding::new(turned_rad, self.wanted_rad, "rad", told))
    }
}

impl Watch for Turned {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let waited_s = self.beginning.waited_s(moment);
        let mut verdict = Verdict::Waiting;
        if let Some((seen, motor_rad, link_rad)) = self.beginning.see(&self.joints, moment) {
            self.turned_rad = self.joints.positions_rad(seen)[self.joint] - motor_rad[self.joint];
            let link_turned_rad =
                seen.readings.link_position_rad[self.joint] - link_rad[self.joint];
            verdict = self.judged(link_turned_rad);
        }
        in_time(waited_s, verdict, self)
    }

    fn hint(&self) -> String {
        format!(
            "{}: {:+.3} of {:+.3} rad",
            self.joints.name(self.joint),
            self.turned_rad,
            self.wanted_rad
        )
    }

    fn give_up(&self) -> Finding {
        let told = format!(
            "{}: it was seen to turn by {:.3} rad, {:.3} are wanted",
            self.joints.name(self.joint),
            self.turned_rad,
            self.wanted_rad
        );
        Finding::new(self.turned_rad, self.wanted_rad, "rad", told)
    }
}

/// Both ends of the range are reached.
#[derive(Debug)]
pub struct Reached {
    joints: Joints,
    joint: usize,
    beginning: Beginning,
    spans: Spans,
}

impl Reached {
    pub fn new(joints: Joints, joint: usize) -> Self {
        Self {
            joints,
            joint,
            beginning: Beginning::default(),
            spans: Spans::default(),
        }
    }

    fn range_rad(&self) -> Option<[f64; 2]> {
        self.joints
            .0
            .get(self.joint)
            .and_then(|joint| joint.position_limit_rad)
    }

    /// By how much the nearer miss of both ends misses, and that end.
    fn missed(&self, [low_rad, high_rad]: [f64; 2]) -> (f64, f64) {
        let span = self.spans.0[self.joint];
        let (low_missed_rad, high_missed_rad) = (span.low - low_rad, high_rad - span.high);
        match low_missed_rad > high_missed_rad {
            true => (low_missed_rad, low_rad),
            false => (high_missed_rad, high_rad),
        }
    }
}

impl Watch for Reached {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let name = self.joints.name(self.joint).to_owned();
        let Some(range_rad) = self.range_rad() else {
            let told =
                format!("{name}: the robot file gives it no limits, so there are none to reach");
            return Verdict::Passed(Finding::new(0.0, 0.0, "rad", told));
        };
        let waited_s = self.beginning.waited_s(moment);
        if moment.state == LoopState::Running
            && let Some(seen) = &moment.seen
        {
            self.spans.add(&self.joints, seen);
        }
        let (missed_rad, _) = self.missed(range_rad);
        if missed_rad <= REACHED_RAD {
            let span = self.spans.0[self.joint];
            let told = format!(
                "{name}: turned by hand from {:.3} to {:.3} rad; its range is {:.3} to {:.3}",
                span.low, span.high, range_rad[0], range_rad[1]
            );
            return Verdict::Passed(Finding::new(missed_rad, REACHED_RAD, "rad", told));
        }
        in_time(waited_s, Verdict::Waiting, self)
    }

    fn hint(&self) -> String {
        let (span, [low_rad, high_rad]) = (
            self.spans.0[self.joint],
            self.range_rad()
                .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
        );
        format!(
            "{}: {:.3} to {:.3} of {low_rad:.3} to {high_rad:.3} rad",
            self.joints.name(self.joint),
            span.low,
            span.high
        )
    }

    fn give_up(&self) -> Finding {
        let range_rad = self
            .range_rad()
            .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let (missed_rad, end_rad) = self.missed(range_rad);
        let told = format!(
            "{}: it came no nearer to {end_rad:.3} rad than {missed_rad:.3}; a stop is before its limit: set position_limit_rad inside \
             the stops",
            self.joints.name(self.joint)
        );
        Finding::new(missed_rad, REACHED_RAD, "rad", told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::stage::{moment, passed, refused, robot, show};
    use shm_types::drive::DriveState::Enabled;
    use shm_types::messages::LoopState::{Faulted, Running};

    /// Rests for a second, then goes there within another.
    fn turns(at_s: f64, to_rad: [f64; 2]) -> Moment {
        let share = (at_s - 1.0).clamp(0.0, 1.0);
        moment(at_s, Running, Enabled, to_rad.map(|rad| share * rad))
    }

    #[test]
    fn a_joint_that_is_moved_by_hand_is_seen() {
        let mut moved = Moved::new(Joints::of(&robot()), 0);
        let finding = passed(show(&mut moved, 3.0, |at_s| turns(at_s, [-0.2, 0.01])));
        assert!((finding.value - 0.1).abs() < 0.001, "{finding:?}");
    }

    #[test]
    fn exchanged_drives_and_a_joint_that_stands_are_told() {
        let moved = || Moved::new(Joints::of(&robot()), 0);
        let told = refused(show(&mut moved(), 3.0, |at_s| turns(at_s, [0.01, 0.2])));
        assert!(
            told.contains("joint2 was seen") && told.contains("exchanged"),
            "{told}"
        );
        let told = refused(show(&mut moved(), 121.0, |at_s| turns(at_s, [0.03, 0.0])));
        assert!(told.contains("joint1") && told.contains("0.030"), "{told}");
        let falls = |at_s| moment(at_s, Running, Enabled, [0.1 * at_s, 0.0]);
        let told = refused(show(&mut moved(), 121.0, falls));
        assert!(told.contains("never came to rest"), "{told}");
        let stopped = |at_s| moment(at_s, Faulted, Enabled, [0.0; 2]);
        assert_eq!(show(&mut moved(), 3.0, stopped), Verdict::Stopped);
    }

    #[test]
    fn where_both_joints_move_neither_is_taken_for_the_other() {
        let mut moved = Moved::new(Joints::of(&robot()), 0);
        let verdict = show(&mut moved, 3.0, |at_s| turns(at_s, [0.2, 0.15]));
        assert_eq!(verdict, Verdict::Waiting);
    }

    #[test]
    fn a_joint_of_a_small_range_needs_less() {
        let mut small = robot();
        small.joints[0].position_limit_rad = Some([-0.1, 0.1]);
        let mut moved = Moved::new(Joints::of(&small), 0);
        let finding = passed(show(&mut moved, 3.0, |at_s| turns(at_s, [0.06, 0.0])));
        assert!((finding.limit - 0.05).abs() < 1e-12);
    }

    #[test]
    fn the_sign_of_a_turn_is_told_and_so_is_a_wrong_ratio() {
        let turned = || Turned::new(Joints::of(&robot()), 1);
        let finding = passed(show(&mut turned(), 3.0, |at_s| turns(at_s, [0.0, 0.2])));
        assert!(finding.value >= 0.1);
        let told = refused(show(&mut turned(), 3.0, |at_s| turns(at_s, [0.0, -0.2])));
        assert!(
            told.contains("joint2") && told.contains("-0.100") && told.contains("reversed"),
            "{told}"
        );
        let with_link = |link_share: f64| {
            move |at_s: f64| {
                let mut turning = turns(at_s, [0.0, 0.2]);
                let share = (at_s - 1.0).clamp(0.0, 1.0);
                let seen = turning.seen.as_mut().expect("seen");
                seen.readings.link_position_rad[1] = 0.3 + link_share * share * 0.2;
                turning
            }
        };
        passed(show(&mut turned(), 3.0, with_link(1.02)));
        for wrong in [-1.0, 0.5, 2.0, 0.0] {
            let told = refused(show(&mut turned(), 3.0, with_link(wrong)));
            assert!(told.contains("gear_ratio"), "{told}");
        }
    }

    #[test]
    fn both_ends_must_be_reached() {
        let reached = || Reached::new(Joints::of(&robot()), 0);
        let swings = |by_rad: f64| {
            move |at_s: f64| moment(at_s, Running, Enabled, [by_rad * at_s.sin(), 0.0])
        };
        let finding = passed(show(&mut reached(), 7.0, swings(0.49)));
        assert!(finding.value <= 0.02, "{finding:?}");
        let told = refused(show(&mut reached(), 121.0, swings(0.4)));
        assert!(
            told.contains("0.100") && told.contains("position_limit_rad"),
            "{told}"
        );
        let one_end = |at_s: f64| moment(at_s, Running, Enabled, [(0.1 * at_s).min(0.5), 0.0]);
        let told = refused(show(&mut reached(), 121.0, one_end));
        assert!(told.contains("-0.500"), "{told}");
        let mut endless = robot();
        endless.joints[0].position_limit_rad = None;
        passed(show(
            &mut Reached::new(Joints::of(&endless), 0),
            1.0,
            one_end,
        ));
    }
}
