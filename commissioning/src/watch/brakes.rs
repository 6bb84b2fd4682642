//! Brakes that hold, and brakes that open.

use shm_types::drive::DriveState;
use shm_types::messages::LoopState;

use super::{Joints, Spans, Watch};
use crate::moment::Moment;
use crate::verdict::{Finding, Verdict};

/// For so long somebody leans on the joints.
const LEAN_S: f64 = 3.0;
/// A held joint gives by less than this, joint side. Assumed: more than a gear's twist and the play of a holding brake, which
/// makers give as up to a degree of the motor.
const GIVE_RAD: f64 = 0.02;
/// After the brakes have opened the arm is watched for so long.
const OPEN_S: f64 = 1.5;
/// A supported joint moves by less than this. Assumed.
const SINK_RAD: f64 = 0.05;
/// The loop itself gives drives 3 s to be enabled; what waits longer than this waits for commands.
const PATIENCE_S: f64 = 10.0;

/// With the brakes closed no joint gives.
#[derive(Debug)]
pub struct Closed {
    joints: Joints,
    begun_s: Option<f64>,
    spans: Spans,
}

impl Closed {
    pub fn new(joints: Joints) -> Self {
        Self {
            joints,
            begun_s: None,
            spans: Spans::default(),
        }
    }

    fn given(&self) -> Finding {
        let (joint, given_rad) = self.spans.widest(&self.joints, None);
        let name = self.joints.name(joint);
        let told = match given_rad > GIVE_RAD {
            true => format!(
                "{name}: it gave by {given_rad:.3} rad with its brake closed, more than {GIVE_RAD}; look at the brake, or support \
                 the arm where there is none"
            ),
            false => format!("no joint gave by more than {given_rad:.4} rad ({name})"),
        };
        Finding::new(given_rad, GIVE_RAD, "rad", told)
    }
}

impl Watch for Closed {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let Some(seen) = &moment.seen else {
            return Verdict::Waiting;
        };
        let begun_s = *self.begun_s.get_or_insert(moment.at_s);
        self.spans.add(&self.joints, seen);
        let given = self.given();
        if given.value > GIVE_RAD {
            return Verdict::Refused(given);
        }
        match moment.at_s - begun_s >= LEAN_S {
            true => Verdict::Passed(given),
            false => Verdict::Waiting,
        }
    }

    fn hint(&self) -> String {
        let (joint, given_rad) = self.spans.widest(&self.joints, None);
        format!("{} gave by {given_rad:.4} rad", self.joints.name(joint))
    }

    fn give_up(&self) -> Finding {
        self.given()
    }
}

/// Every drive is enabled with its brake open, and no joint sinks.
#[derive(Debug)]
pub struct Open {
    joints: Joints,
    first_s: Option<f64>,
    asked_s: Option<f64>,
    running_s: Option<f64>,
    spans: Spans,
    off: Option<usize>,
}

impl Open {
    pub fn new(joints: Joints) -> Self {
        Self {
            joints,
            first_s: None,
            asked_s: None,
            running_s: None,
            spans: Spans::default(),
            off: None,
        }
    }

    fn not_open(&self, waited_s: f64) -> Finding {
        let name = self.joints.name(self.off.unwrap_or_default());
        let told = format!(
            "{name}: its drive was not enabled, or its brake not open, within {waited_s:.1} s"
        );
        Finding::new(waited_s, PATIENCE_S, "s", told)
    }
}

impl Watch for Open {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let first_s = *self.first_s.get_or_insert(moment.at_s);
        self.off = moment.drives.find(self.joints.count(), |state| {
            !matches!(state, DriveState::Unknown | DriveState::Enabled)
        });
        if moment.state == LoopState::Enabling {
            self.asked_s.get_or_insert(moment.at_s);
        }
        if moment.state != LoopState::Running {
            self.running_s = None;
            self.spans = Spans::default();
            let waited_s = moment.at_s - first_s;
            return match waited_s > PATIENCE_S {
                true => Verdict::Refused(self.not_open(waited_s)),
                false => Verdict::Waiting,
            };
        }
        let running_s = *self.running_s.get_or_insert(moment.at_s);
        if let Some(seen) = &moment.seen {
            self.spans.add(&self.joints, seen);
        }
        let (joint, sunk_rad) = self.spans.widest(&self.joints, None);
        if sunk_rad > SINK_RAD {
            let told = format!(
                "{}: it moved by {sunk_rad:.3} rad once its brake was open, more than {SINK_RAD}; support it",
                self.joints.name(joint)
            );
            return Verdict::Refused(Finding::new(sunk_rad, SINK_RAD, "rad", told));
        }
        if moment.at_s - running_s < OPEN_S {
            return Verdict::Waiting;
        }
        let opened_s = running_s - self.asked_s.unwrap_or(running_s);
        let told = format!(
            "every brake was open {opened_s:.3} s after it was asked for; no joint moved by more than {sunk_rad:.4} rad"
        );
        Verdict::Passed(Finding::new(opened_s, PATIENCE_S, "s", told))
    }

    fn hint(&self) -> String {
        match self.off {
            Some(joint) => format!("{} is not enabled yet", self.joints.name(joint)),
            None => "brakes are open".to_owned(),
        }
    }

    fn give_up(&self) -> Finding {
        let (joint, sunk_rad) = self.spans.widest(&self.joints, None);
        let told = format!(
            "given up; {} moved by {sunk_rad:.3} rad",
            self.joints.name(joint)
        );
        Finding::new(sunk_rad, SINK_RAD, "rad", told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::stage::{moment, passed, refused, robot, show};
    use shm_types::messages::LoopState::{Enabling, Faulted, Ready, Running};

    #[test]
    fn a_brake_that_gives_is_told_by_joint() {
        let closed = || Closed::new(Joints::of(&robot()));
        let rests = |at_s| moment(at_s, Ready, DriveState::SwitchedOff, [0.1, 0.2]);
        assert_eq!(passed(show(&mut closed(), 4.0, rests)).value, 0.0);
        let told = refused(show(&mut closed(), 4.0, |at_s| {
            moment(
                at_s,
                Ready,
                DriveState::SwitchedOff,
                [0.1, 0.2 - 0.02 * at_s],
            )
        }));
        assert!(
            told.contains("joint2") && told.contains("0.020 rad"),
            "{told}"
        );
        assert_eq!(
            show(&mut closed(), 4.0, |at_s| moment(
                at_s,
                Faulted,
                DriveState::Fault,
                [0.0; 2]
            )),
            Verdict::Stopped
        );
    }

    #[test]
    fn brakes_that_open_are_told_with_their_time() {
        let mut open = Open::new(Joints::of(&robot()));
        let course = |at_s: f64| match at_s {
            ..0.1 => moment(at_s, Ready, DriveState::SwitchedOff, [0.1, 0.2]),
            0.1..0.35 => moment(at_s, Enabling, DriveState::Enabling, [0.1, 0.2]),
            _ => moment(at_s, Running, DriveState::Enabled, [0.1, 0.2 + 0.01 * at_s]),
        };
        let finding = passed(show(&mut open, 4.0, course));
        assert!((finding.value - 0.25).abs() < 0.002, "{finding:?}");
    }

    #[test]
    fn a_brake_that_stays_closed_and_a_joint_that_sinks_are_told() {
        let open = || Open::new(Joints::of(&robot()));
        let told = refused(show(&mut open(), 11.0, |at_s| {
            let mut waiting = moment(at_s, Enabling, DriveState::Enabled, [0.0; 2]);
            waiting.drives.state[1] = DriveState::Enabling as u32;
            waiting
        }));
        assert!(told.contains("joint2") && told.contains("brake"), "{told}");
        let told = refused(show(&mut open(), 4.0, |at_s| {
            moment(at_s, Running, DriveState::Enabled, [-0.1 * at_s, 0.0])
        }));
        assert!(
            told.contains("joint1") && told.contains("support"),
            "{told}"
        );
    }
}
