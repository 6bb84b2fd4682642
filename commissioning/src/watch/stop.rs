//! Stops, tried while nothing moves: by the switch, and by the operator's order.

use rt_loop::driver::AGE_MAX_CYCLES;
use shm_types::drive::DriveState;
use shm_types::messages::LoopState;

use super::{Joints, PERSON_S, Rest, Spans, Watch};
use crate::moment::Moment;
use crate::verdict::{Finding, Verdict};

/// The loop's answer to the operator's order is there within this time: a look of the supervisor (5 ms) and a cycle, and as much
/// again as a busy machine takes. `flexspline monitor` waits as long.
const ANSWER_S: f64 = 0.5;
/// Drives are off within this time of the loop's stop. The longest watchdog that the loop runs with is 0.1 s; brakes engage within
/// some tenths.
const OFF_S: f64 = 0.5;
/// A loop whose drives fall silent holds, damps and waits for 3 s before it stops for good.
const SILENT_S: f64 = 5.0;
/// A supported joint moves by less than this when its drive lets go. As for brakes that open.
const SINK_RAD: f64 = 0.05;

/// Who is to stop it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum By {
    Switch,
    Operator,
}

/// The loop stops, and its drives are off.
#[derive(Debug)]
pub struct Stop {
    joints: Joints,
    by: By,
    rest: Rest,
    first_s: Option<f64>,
    /// The loop runs and the arm rests: a stop may come.
    armed_s: Option<f64>,
    ordered_s: Option<f64>,
    /// The loop no longer runs.
    left_s: Option<f64>,
    /// The loop has stopped for good.
    stopped_s: Option<f64>,
    spans: Spans,
}

impl Stop {
    /// By the switch that is wired to the drives or their supply.
    pub fn by_switch(joints: Joints) -> Self {
        Self::new(joints, By::Switch)
    }

    /// By the operator's order.
    pub fn by_operator(joints: Joints) -> Self {
        Self::new(joints, By::Operator)
    }

    fn new(joints: Joints, by: By) -> Self {
        Self {
            joints,
            by,
            rest: Rest::default(),
            first_s: None,
            armed_s: None,
            ordered_s: None,
            left_s: None,
            stopped_s: None,
            spans: Spans::default(),
        }
    }

    /// A drive that obeys although it should not.
    fn still_on(&self, moment: &Moment) -> Option<usize> {
        (0..self.joints.count()).find(|&joint| {
            let silent = moment.drives.age_cycles[joint] > AGE_MAX_CYCLES;
            let on = matches!(
                moment.drives.state_of(joint),
                DriveState::Enabled | DriveState::Enabling
            );
            on && !silent
        })
    }

    fn before(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            // Not what was waited for: nobody had been asked yet.
            return Verdict::Stopped;
        }
        let first_s = *self.first_s.get_or_insert(moment.at_s);
        if moment.state == LoopState::Running
            && let Some(seen) = &moment.seen
            && self.rest.see(&self.joints, moment.at_s, seen)
        {
            self.armed_s = Some(moment.at_s);
        }
        match moment.at_s - first_s > PERSON_S {
            true => Verdict::Refused(self.give_up()),
            false => Verdict::Waiting,
        }
    }

    fn armed(&mut self, moment: &Moment, armed_s: f64) -> Verdict {
        if let Some(seen) = &moment.seen {
            self.spans.add(&self.joints, seen);
        }
        if moment.state == LoopState::Running {
            // Some cycles without a sample were not the stop that is waited for.
            (self.left_s, self.stopped_s) = (None, None);
            let (since_s, limit_s) = match (self.by, self.ordered_s) {
                (By::Operator, Some(ordered_s)) => (moment.at_s - ordered_s, ANSWER_S),
                _ => (moment.at_s - armed_s, PERSON_S),
            };
            return match since_s > limit_s {
                true => Verdict::Refused(self.give_up()),
                false => Verdict::Waiting,
            };
        }
        let left_s = *self.left_s.get_or_insert(moment.at_s);
        if moment.state == LoopState::Faulted {
            return Verdict::Stopped;
        }
        if moment.state == LoopState::SafeStop {
            self.stopped_s.get_or_insert(moment.at_s);
        }
        let Some(stopped_s) = self.stopped_s else {
            let waited_s = moment.at_s - left_s;
            let told = format!(
                "the loop left its running state and had not stopped for safety {waited_s:.1} s later"
            );
            return match waited_s > SILENT_S {
                true => Verdict::Refused(Finding::new(waited_s, SILENT_S, "s", told)),
                false => Verdict::Waiting,
            };
        };
        self.stopped(moment, left_s, stopped_s)
    }

    fn stopped(&self, moment: &Moment, left_s: f64, stopped_s: f64) -> Verdict {
        let (after_s, since_s) = (moment.at_s - left_s, moment.at_s - stopped_s);
        let (sunk, sunk_rad) = self.spans.widest(&self.joints, None);
        if sunk_rad > SINK_RAD {
            let told = format!(
                "{}: it moved by {sunk_rad:.3} rad at the stop, more than {SINK_RAD}; look at its brake, or support the arm",
                self.joints.name(sunk)
            );
            return Verdict::Refused(Finding::new(sunk_rad, SINK_RAD, "rad", told));
        }
        if let Some(joint) = self.still_on(moment) {
            let told = format!(
                "{}: its drive is still {} {since_s:.2} s after the loop has stopped",
                self.joints.name(joint),
                moment.drives.state_of(joint).name()
            );
            return match since_s > OFF_S {
                true => Verdict::Refused(Finding::new(since_s, OFF_S, "s", told)),
                false => Verdict::Waiting,
            };
        }
        let told = format!(
            "every drive was off {after_s:.3} s after the loop left its running state; no joint moved by more than {sunk_rad:.4} rad"
        );
        Verdict::Passed(Finding::new(after_s, OFF_S, "s", told))
    }
}

impl Watch for Stop {
    fn see(&mut self, moment: &Moment) -> Verdict {
        match self.armed_s {
            Some(armed_s) => self.armed(moment, armed_s),
            None => self.before(moment),
        }
    }

    fn hint(&self) -> String {
        match (self.armed_s, self.left_s, self.by) {
            (None, _, _) => "wait: the arm is not at rest yet".to_owned(),
            (Some(_), None, By::Switch) => "PRESS THE EMERGENCY STOP".to_owned(),
            (Some(_), None, By::Operator) => "the stop was asked for".to_owned(),
            (Some(_), Some(_), _) => "stopping".to_owned(),
        }
    }

    fn give_up(&self) -> Finding {
        let (asked, limit_s) = match self.by {
            By::Switch => ("the emergency stop", PERSON_S),
            By::Operator => ("the operator's stop", ANSWER_S),
        };
        let told = match self.armed_s {
            None => "the arm never came to rest without torque; support it".to_owned(),
            Some(_) => format!(
                "the loop went on: {asked} has not stopped it within {limit_s} s; look at its wiring, and do not go on without"
            ),
        };
        Finding::new(f64::INFINITY, limit_s, "s", told)
    }

    fn wants_stop(&mut self) -> bool {
        let Some(armed_s) = self.armed_s else {
            return false;
        };
        let asks = self.by == By::Operator && self.ordered_s.is_none();
        if asks {
            self.ordered_s = Some(armed_s);
        }
        asks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::stage::{moment, passed, refused, robot, show};
    use shm_types::drive::DriveState::{Enabled, SwitchedOff};
    use shm_types::messages::LoopState::{Damping, Faulted, Running, SafeStop};

    fn switch() -> Stop {
        Stop::by_switch(Joints::of(&robot()))
    }

    /// Runs for a second, then this.
    fn then(after: impl Fn(f64) -> Moment) -> impl FnMut(f64) -> Moment {
        move |at_s| match at_s < 1.0 {
            true => moment(at_s, Running, Enabled, [0.1, 0.2]),
            false => after(at_s),
        }
    }

    #[test]
    fn a_stop_that_switches_the_drives_off_is_passed_with_its_time() {
        let stops = then(|at_s| {
            let drive = if at_s < 1.2 { Enabled } else { SwitchedOff };
            moment(at_s, SafeStop, drive, [0.1, 0.2])
        });
        let finding = passed(show(&mut switch(), 3.0, stops));
        assert!((finding.value - 0.2).abs() < 0.002, "{finding:?}");
    }

    #[test]
    fn a_supply_that_is_cut_is_silence_and_counts_too() {
        let silent = then(|at_s| {
            let state = if at_s < 4.1 { Damping } else { SafeStop };
            let mut silent = moment(at_s, state, Enabled, [0.1, 0.2]);
            silent.drives.age_cycles[..2].fill(800);
            silent.seen = None;
            silent
        });
        passed(show(&mut switch(), 6.0, silent));
    }

    #[test]
    fn cycles_without_a_sample_before_the_stop_are_not_the_stop() {
        let holds_before = then(|at_s| {
            let (state, drive) = match at_s {
                0.0..1.01 => (Damping, Enabled),
                1.01..9.0 => (Running, Enabled),
                _ => (SafeStop, SwitchedOff),
            };
            moment(at_s, state, drive, [0.1, 0.2])
        });
        let finding = passed(show(&mut switch(), 12.0, holds_before));
        assert!(finding.value < 0.01, "{finding:?}");
    }

    #[test]
    fn a_switch_that_does_nothing_is_refused() {
        let told = refused(show(&mut switch(), 123.0, |at_s| {
            moment(at_s, Running, Enabled, [0.1, 0.2])
        }));
        assert!(told.contains("the loop went on"), "{told}");
    }

    #[test]
    fn drives_that_stay_on_a_joint_that_falls_and_a_loop_that_only_waits_are_refused() {
        let stays_on = then(|at_s| {
            let mut on = moment(at_s, SafeStop, SwitchedOff, [0.1, 0.2]);
            on.drives.state[1] = Enabled as u32;
            on
        });
        let told = refused(show(&mut switch(), 3.0, stays_on));
        assert!(
            told.contains("joint2") && told.contains("still enabled"),
            "{told}"
        );
        let falls = then(|at_s| moment(at_s, SafeStop, Enabled, [0.1 - 0.2 * (at_s - 1.0), 0.2]));
        let told = refused(show(&mut switch(), 3.0, falls));
        assert!(
            told.contains("joint1") && told.contains("moved by"),
            "{told}"
        );
        let waits = then(|at_s| moment(at_s, Damping, SwitchedOff, [0.1, 0.2]));
        let told = refused(show(&mut switch(), 9.0, waits));
        assert!(told.contains("had not stopped"), "{told}");
        let broken = then(|at_s| moment(at_s, Faulted, SwitchedOff, [0.1, 0.2]));
        assert_eq!(show(&mut switch(), 3.0, broken), Verdict::Stopped);
        let too_early = |at_s| moment(at_s, SafeStop, SwitchedOff, [0.1, 0.2]);
        assert_eq!(show(&mut switch(), 3.0, too_early), Verdict::Stopped);
    }

    #[test]
    fn the_operators_order_is_given_once_the_arm_rests_and_must_be_followed_at_once() {
        let mut watch = Stop::by_operator(Joints::of(&robot()));
        let mut ordered_s = None;
        let mut verdict = Verdict::Waiting;
        for step in 0..3000 {
            let at_s = 1e-3 * f64::from(step);
            verdict = watch.see(&moment(at_s, Running, Enabled, [0.1, 0.2]));
            if watch.wants_stop() {
                assert!(ordered_s.replace(at_s).is_none(), "asked for once");
            }
            if verdict != Verdict::Waiting {
                break;
            }
        }
        assert!(
            ordered_s.is_some_and(|at_s| (0.3..0.4).contains(&at_s)),
            "{ordered_s:?}"
        );
        let told = refused(verdict);
        assert!(
            told.contains("operator's stop") && told.contains("0.5 s"),
            "{told}"
        );
        assert!(!switch().wants_stop());
    }
}
