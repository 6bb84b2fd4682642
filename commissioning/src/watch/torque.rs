//! The first torque of a joint: it must move the joint in its own direction.

use services::by_hand::{NUDGE_END_RAD, NUDGE_S};
use shm_types::messages::LoopState;

use super::{Joints, Spans, Watch};
use crate::moment::Moment;
use crate::verdict::{Finding, Verdict};

/// A joint has moved, and the torque that is sent has moved it. Half of what ends the torque.
const MOVED_RAD: f64 = NUDGE_END_RAD / 2.0;
/// What another joint may move by meanwhile. Assumed: an arm that is held at one link swings at others.
const OTHERS_RAD: f64 = 0.1;
/// The loop gives drives 3 s to be enabled.
const PATIENCE_S: f64 = 10.0;

/// Torque and motion have one direction.
#[derive(Debug)]
pub struct FirstTorque {
    joints: Joints,
    joint: usize,
    first_s: Option<f64>,
    begun: Option<(f64, f64)>,
    spans: Spans,
    gone_rad: f64,
    torque_nm: f64,
}

impl FirstTorque {
    pub fn new(joints: Joints, joint: usize) -> Self {
        Self {
            joints,
            joint,
            first_s: None,
            begun: None,
            spans: Spans::default(),
            gone_rad: 0.0,
            torque_nm: 0.0,
        }
    }

    fn judged(&self) -> Verdict {
        let (name, gone_rad, torque_nm) =
            (self.joints.name(self.joint), self.gone_rad, self.torque_nm);
        let (other, other_rad) = self.spans.widest(&self.joints, Some(self.joint));
        if other_rad > OTHERS_RAD {
            let told = format!(
                "{}: it moved by {other_rad:.3} rad while {name} got {torque_nm:+.4} Nm; the drives of the two are exchanged, or it is \
                 not supported",
                self.joints.name(other)
            );
            return Verdict::Refused(Finding::new(other_rad, OTHERS_RAD, "rad", told));
        }
        if gone_rad.abs() < MOVED_RAD {
            return Verdict::Waiting;
        }
        if torque_nm == 0.0 {
            let told = format!(
                "{name}: it moved by {gone_rad:+.3} rad without torque; support the arm so that nothing moves"
            );
            return Verdict::Refused(Finding::new(gone_rad, MOVED_RAD, "rad", told));
        }
        if gone_rad * torque_nm < 0.0 {
            let told = format!(
                "{name}: {torque_nm:+.4} Nm at the motor moved it by {gone_rad:+.3} rad; the sign of its torque is wrong: exchange two \
                 phases and calibrate again, or set the drive's direction"
            );
            return Verdict::Refused(Finding::new(gone_rad, MOVED_RAD, "rad", told));
        }
        let told =
            format!("{name}: {torque_nm:+.4} Nm at the motor moved it by {gone_rad:+.3} rad");
        Verdict::Passed(Finding::new(torque_nm, self.limit_nm(), "Nm", told))
    }

    fn limit_nm(&self) -> f64 {
        let joint = self.joints.0.get(self.joint);
        joint
            .and_then(|joint| joint.motor_torque_limit_nm)
            .unwrap_or(0.0)
    }
}

impl Watch for FirstTorque {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let first_s = *self.first_s.get_or_insert(moment.at_s);
        if let Some(seen) = &moment.seen
            && moment.state == LoopState::Running
        {
            let position_rad = self.joints.positions_rad(seen)[self.joint];
            let (_, begun_at_rad) = *self.begun.get_or_insert((moment.at_s, position_rad));
            self.spans.add(&self.joints, seen);
            self.gone_rad = position_rad - begun_at_rad;
            // The torque that moved it is the last there was: it ends once the joint has moved.
            let sent_nm = moment.motor_torque_nm[self.joint];
            if sent_nm != 0.0 {
                self.torque_nm = sent_nm;
            }
            let verdict = self.judged();
            if verdict != Verdict::Waiting {
                return verdict;
            }
        }
        let over = match self.begun {
            Some((begun_s, _)) => moment.at_s - begun_s > NUDGE_S,
            None => moment.at_s - first_s > PATIENCE_S,
        };
        match over {
            true => Verdict::Refused(self.give_up()),
            false => Verdict::Waiting,
        }
    }

    fn hint(&self) -> String {
        format!(
            "{}: {:+.4} Nm, moved by {:+.4} rad",
            self.joints.name(self.joint),
            self.torque_nm,
            self.gone_rad
        )
    }

    fn give_up(&self) -> Finding {
        let limit_nm = self.limit_nm();
        let name = self.joints.name(self.joint);
        let told = match self.begun {
            None => format!("{name}: its drive was not enabled within {PATIENCE_S} s"),
            Some(_) => format!(
                "{name}: torque up to {limit_nm} Nm either way moved it by {:.4} rad only; its brake is closed, a phase is open, it is \
                 held, or torque_limit_nm is less than its friction",
                self.gone_rad.abs()
            ),
        };
        Finding::new(self.gone_rad.abs(), MOVED_RAD, "rad", told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::stage::{moment, passed, refused, robot, show};
    use shm_types::drive::DriveState::Enabled;
    use shm_types::messages::LoopState::{Enabling, Running, SafeStop};

    /// Torque from half a second on, motion half a second later.
    fn nudged(torque_nm: f64, speed_rad_s: f64) -> impl FnMut(f64) -> Moment {
        move |at_s| {
            let gone_rad = speed_rad_s * (at_s - 1.0).max(0.0);
            let mut nudged = moment(at_s, Running, Enabled, [0.0, 0.3 + gone_rad]);
            nudged.motor_torque_nm[1] = if at_s < 0.5 { 0.0 } else { torque_nm };
            nudged
        }
    }

    #[test]
    fn torque_and_motion_of_one_sign_pass_and_of_two_do_not() {
        let watch = || FirstTorque::new(Joints::of(&robot()), 1);
        for torque_nm in [0.2, -0.2] {
            let finding = passed(show(
                &mut watch(),
                6.0,
                nudged(torque_nm, 0.1 * torque_nm.signum()),
            ));
            assert_eq!((finding.value, finding.limit), (torque_nm, 0.8));
            let told = refused(show(
                &mut watch(),
                6.0,
                nudged(torque_nm, -0.1 * torque_nm.signum()),
            ));
            assert!(
                told.contains("joint2") && told.contains("sign of its torque is wrong"),
                "{told}"
            );
        }
    }

    #[test]
    fn a_joint_that_does_not_move_moves_by_itself_or_moves_another_is_refused() {
        let watch = || FirstTorque::new(Joints::of(&robot()), 1);
        let told = refused(show(&mut watch(), 6.0, nudged(0.8, 0.0)));
        assert!(
            told.contains("up to 0.8 Nm") && told.contains("0.0000 rad"),
            "{told}"
        );
        let told = refused(show(&mut watch(), 6.0, nudged(0.0, 0.1)));
        assert!(told.contains("without torque"), "{told}");
        let told = refused(show(&mut watch(), 6.0, |at_s| {
            let mut other = nudged(0.2, 0.0)(at_s);
            other
                .seen
                .as_mut()
                .expect("seen")
                .readings
                .motor_position_rad[0] = 10.0 * at_s;
            other
        }));
        assert!(
            told.contains("joint1") && told.contains("exchanged"),
            "{told}"
        );
    }

    #[test]
    fn a_drive_that_is_never_enabled_and_a_stop_end_it() {
        let watch = || FirstTorque::new(Joints::of(&robot()), 0);
        let told = refused(show(&mut watch(), 11.0, |at_s| {
            moment(at_s, Enabling, Enabled, [0.0; 2])
        }));
        assert!(told.contains("not enabled"), "{told}");
        let stopped = |at_s| moment(at_s, SafeStop, Enabled, [0.0; 2]);
        assert_eq!(show(&mut watch(), 1.0, stopped), Verdict::Stopped);
    }
}
