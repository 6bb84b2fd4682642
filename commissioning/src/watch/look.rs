//! Drives that are only looked at: who answers, and whether it fits the robot file.

use rt_loop::driver::AGE_MAX_CYCLES;
use shm_types::drive::{DriveState, position};

use super::{Joints, Watch};
use crate::moment::Moment;
use crate::verdict::{Finding, Verdict};

/// Drives must have answered for so long: a second of exchanges.
const LOOK_S: f64 = 1.0;
/// A drive may start up for so long; its bus has been brought up before.
const START_UP_S: f64 = 10.0;
/// Samples of all drives may be missing for so long: a machine that is busy has such moments, and the loop sees through longer
/// ones.
const GAP_S: f64 = 0.1;
/// Encoders on both sides of a gear may disagree by this much. As `drivers/ethercat` has it.
const ENCODERS_RAD: f64 = 0.1;

/// Every drive answers, and none is faulted.
#[derive(Debug)]
pub struct Scan {
    joints: Joints,
    begun_s: Option<f64>,
    good_since_s: Option<f64>,
    seen_s: Option<f64>,
    bad: Option<(usize, Bad)>,
}

#[derive(Clone, Copy, Debug)]
enum Bad {
    NotReady,
    Silent { age_cycles: u32 },
}

impl Scan {
    pub fn new(joints: Joints) -> Self {
        Self {
            joints,
            begun_s: None,
            good_since_s: None,
            seen_s: None,
            bad: None,
        }
    }

    fn told(&self) -> Finding {
        let Some((joint, bad)) = self.bad else {
            let told = "no drive has answered for a second; look at supply and cable";
            return Finding::new(0.0, LOOK_S, "s", told);
        };
        let name = self.joints.name(joint);
        match bad {
            Bad::NotReady => Finding::new(
                START_UP_S,
                START_UP_S,
                "s",
                format!(
                    "{name}: its drive is still starting up after {START_UP_S} s; look at its supply"
                ),
            ),
            Bad::Silent { age_cycles } => Finding::new(
                f64::from(age_cycles),
                f64::from(AGE_MAX_CYCLES),
                "cycles",
                format!(
                    "{name}: nothing has come from its drive for {age_cycles} cycles; look at its cable"
                ),
            ),
        }
    }
}

impl Watch for Scan {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let begun_s = *self.begun_s.get_or_insert(moment.at_s);
        let count = self.joints.count();
        let silent = moment.drives.age_cycles[..count]
            .iter()
            .position(|&age| age > AGE_MAX_CYCLES);
        let not_ready = moment
            .drives
            .find(count, |state| state == DriveState::NotReady);
        self.bad = match (silent, not_ready) {
            (Some(joint), _) => Some((
                joint,
                Bad::Silent {
                    age_cycles: moment.drives.age_cycles[joint],
                },
            )),
            (None, Some(joint)) => Some((joint, Bad::NotReady)),
            (None, None) => None,
        };
        if moment.seen.is_some() {
            self.seen_s = Some(moment.at_s);
        }
        let is_gap = self
            .seen_s
            .is_none_or(|seen_s| moment.at_s - seen_s > GAP_S);
        if self.bad.is_some() || is_gap {
            self.good_since_s = None;
        } else {
            let since_s = *self.good_since_s.get_or_insert(moment.at_s);
            if moment.at_s - since_s >= LOOK_S {
                let told =
                    format!("each of {count} drives has answered for {LOOK_S} s, none is faulted");
                return Verdict::Passed(Finding::new(count as f64, count as f64, "drives", told));
            }
        }
        match moment.at_s - begun_s > START_UP_S {
            true => Verdict::Refused(self.told()),
            false => Verdict::Waiting,
        }
    }

    fn hint(&self) -> String {
        match self.bad {
            Some((joint, _)) => format!("{} does not answer yet", self.joints.name(joint)),
            None => "drives answer".to_owned(),
        }
    }

    fn give_up(&self) -> Finding {
        self.told()
    }
}

/// What the drives say fits the robot file.
#[derive(Debug)]
pub struct Check {
    joints: Joints,
    begun_s: Option<f64>,
    widest_rad: f64,
}

impl Check {
    pub fn new(joints: Joints) -> Self {
        Self {
            joints,
            begun_s: None,
            widest_rad: 0.0,
        }
    }

    fn unfit(&mut self, moment: &Moment) -> Option<Finding> {
        let seen = moment.seen.as_ref()?;
        let positions_rad = self.joints.positions_rad(seen);
        for (joint, facts) in self.joints.0.iter().enumerate() {
            let (name, at_rad) = (&facts.name, positions_rad[joint]);
            if facts.motor_torque_limit_nm.is_none() || facts.velocity_limit_rad_s.is_none() {
                let told = format!(
                    "{name}: the robot file gives no torque_limit_nm or no velocity_limit_rad_s; for the first day a tenth of \
                     what the motor can give, and what a person can step back from"
                );
                return Some(Finding::new(f64::NAN, f64::NAN, "", told));
            }
            if let Some([low_rad, high_rad]) = facts.position_limit_rad
                && !(low_rad..=high_rad).contains(&at_rad)
            {
                let (limit_rad, told) = if at_rad > high_rad {
                    (high_rad, "above")
                } else {
                    (low_rad, "below")
                };
                let told = format!(
                    "{name}: it is at {at_rad:.3} rad, {told} its limit {limit_rad:.3}; move it inside, or set the drive's zero"
                );
                return Some(Finding::new(at_rad, limit_rad, "rad", told));
            }
            let validity = moment.drives.position_validity[joint];
            if validity & position::KNOWN != 0 && validity & position::HOMED == 0 {
                let told = format!(
                    "{name}: its drive does not know where the joint is; home it, or set its encoder's offset"
                );
                return Some(Finding::new(f64::from(validity), f64::NAN, "", told));
            }
            let link_rad = seen.readings.link_position_rad[joint];
            if link_rad.is_finite() {
                let apart_rad = (link_rad - at_rad).abs();
                self.widest_rad = self.widest_rad.max(apart_rad);
                if apart_rad > ENCODERS_RAD {
                    let told = format!(
                        "{name}: its motor says {at_rad:.3} rad, its link {link_rad:.3}; set gear_ratio, direction or zero"
                    );
                    return Some(Finding::new(apart_rad, ENCODERS_RAD, "rad", told));
                }
            }
        }
        None
    }
}

impl Watch for Check {
    fn see(&mut self, moment: &Moment) -> Verdict {
        if moment.state.is_latched() {
            return Verdict::Stopped;
        }
        let begun_s = *self.begun_s.get_or_insert(moment.at_s);
        if let Some(finding) = self.unfit(moment) {
            return Verdict::Refused(finding);
        }
        if moment.at_s - begun_s < LOOK_S || moment.seen.is_none() {
            return Verdict::Waiting;
        }
        let apart_rad = self.widest_rad;
        let told = format!(
            "every joint is within its range; encoders on both sides of a gear are {apart_rad:.3} rad apart at most"
        );
        Verdict::Passed(Finding::new(apart_rad, ENCODERS_RAD, "rad", told))
    }

    fn hint(&self) -> String {
        format!("encoders {:.3} rad apart at most", self.widest_rad)
    }

    fn give_up(&self) -> Finding {
        Finding::new(
            0.0,
            LOOK_S,
            "s",
            "no drive has answered; look at supply and cable",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::stage::{moment, passed, refused, robot, show};
    use shm_types::messages::LoopState::{Ready, SafeStop};

    fn resting(at_s: f64) -> Moment {
        moment(at_s, Ready, DriveState::SwitchedOff, [0.1, -0.2])
    }

    #[test]
    fn drives_that_answer_for_a_second_are_there() {
        let mut scan = Scan::new(Joints::of(&robot()));
        let starting = |at_s| match at_s < 2.0 {
            true => moment(at_s, Ready, DriveState::NotReady, [0.0; 2]),
            false => resting(at_s),
        };
        assert_eq!(passed(show(&mut scan, 4.0, starting)).value, 2.0);
        // Every second sample is late: the machine is busy, the drives are there.
        let busy = |at_s: f64| match (at_s * 1e3) as u64 % 2 {
            0 => resting(at_s),
            _ => Moment {
                seen: None,
                ..resting(at_s)
            },
        };
        passed(show(&mut Scan::new(Joints::of(&robot())), 4.0, busy));
    }

    #[test]
    fn a_drive_that_starts_for_ever_is_silent_or_faulted_is_told() {
        let scan = || Scan::new(Joints::of(&robot()));
        let told = refused(show(&mut scan(), 12.0, |at_s| {
            moment(at_s, Ready, DriveState::NotReady, [0.0; 2])
        }));
        assert!(told.contains("joint1") && told.contains("10 s"), "{told}");
        let told = refused(show(&mut scan(), 12.0, |at_s| {
            let mut silent = resting(at_s);
            silent.drives.age_cycles[1] = 900;
            silent
        }));
        assert!(told.contains("joint2") && told.contains("900"), "{told}");
        let nothing = refused(show(&mut scan(), 12.0, |at_s| Moment {
            seen: None,
            ..resting(at_s)
        }));
        assert!(nothing.contains("no drive"), "{nothing}");
        let stopped = show(&mut scan(), 9.0, |at_s| Moment {
            state: SafeStop,
            ..resting(at_s)
        });
        assert_eq!(stopped, Verdict::Stopped);
    }

    #[test]
    fn what_does_not_fit_the_file_is_told_with_its_number() {
        let check = || Check::new(Joints::of(&robot()));
        assert_eq!(passed(show(&mut check(), 2.0, resting)).value, 0.0);
        type Change = (&'static str, fn(&mut Moment));
        let changes: [Change; 4] = [
            ("0.700 rad, above its limit 0.500", |moment| {
                let seen = moment.seen.as_mut().expect("seen");
                seen.readings.motor_position_rad[0] = 70.0;
            }),
            ("joint2: it is at -0.900 rad, below", |moment| {
                let seen = moment.seen.as_mut().expect("seen");
                seen.readings.motor_position_rad[1] = -45.0;
            }),
            ("joint2: its drive does not know", |moment| {
                moment.drives.position_validity[1] = position::KNOWN;
            }),
            ("its motor says -0.200 rad, its link 0.200", |moment| {
                let seen = moment.seen.as_mut().expect("seen");
                seen.readings.link_position_rad[1] = 0.2;
            }),
        ];
        for (wanted, change) in changes {
            let told = refused(show(&mut check(), 2.0, |at_s| {
                let mut changed = resting(at_s);
                change(&mut changed);
                changed
            }));
            assert!(told.contains(wanted), "{told}");
        }
        let mut unlimited = robot();
        unlimited.joints[1].torque_limit_nm = None;
        let told = refused(show(&mut Check::new(Joints::of(&unlimited)), 2.0, resting));
        assert!(told.contains("torque_limit_nm"), "{told}");
    }
}
