//! What drives are and can do, held against the robot file before anything moves.

use std::time::Duration;

use robot::Robot;
use shm_types::drive::position;
use shm_types::messages::DriveMode;

use crate::driver::WATCHDOG_MAX;

/// What the drives are, as read back from them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Capabilities {
    /// The bus and its master, for people: "EtherCAT on eth0, 7 devices".
    pub bus: String,
    /// Each joint's drive, in the robot's order.
    pub joints: Vec<JointCapabilities>,
    /// Cycles from the latch of a sample to when the command computed from it acts: the robot file's `delay_cycles`. `None`:
    /// as the robot file has it.
    pub latch_to_act_cycles: Option<u32>,
    /// Periods the drives can be run at; empty: any.
    pub periods_ns: Vec<u64>,
    /// Whether the drives act by a clock of their own, which the loop has to follow.
    pub has_clock: bool,
}

/// What one joint's drive is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointCapabilities {
    /// Device, maker's number, firmware, for people.
    pub device: String,
    /// The joint it says it drives, where it can say so: an alias, a name written into it.
    pub joint: Option<String>,
    /// The modes that obey a set-point and that it knows.
    pub modes: Vec<DriveMode>,
    /// Largest torque it can be commanded, motor side.
    pub motor_torque_max_nm: Option<f64>,
    /// Step of a commanded torque, motor side: CiA 402 counts in 0.1 % of rated torque.
    pub motor_torque_step_nm: Option<f64>,
    /// Step of its motor position, motor side.
    pub motor_position_step_rad: Option<f64>,
    /// After so long without a command it stops by itself; `None`: it does not, and the loop does not run with it.
    pub watchdog: Option<Duration>,
    /// Its brake, where it has one.
    pub brake: Option<Brake>,
    /// How a quick stop ends its motion, where it says so.
    pub quick_stop: Option<QuickStop>,
    /// Bits of [`position`]: what its position is worth.
    pub position_validity: u32,
}

/// A holding brake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Brake {
    /// From being told to the shaft being free.
    pub release: Duration,
    /// From being told to the shaft being held.
    pub engage: Duration,
}

/// What a drive does when it is told to stop as fast as it can.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuickStop {
    /// Joint side: how fast it slows down, where it does so on a ramp.
    pub ramp_rad_s2: Option<f64>,
    /// Its own number for the way it stops: CiA 402 object 0x605A.
    pub option: Option<i16>,
}

/// Drives and robot file do not fit together. One line: what is wrong, where, and what to change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct Mismatch(String);

impl Capabilities {
    /// Whether these drives can be run as the robot file says, every joint in `mode`, at this period.
    ///
    /// # Errors
    /// The first [`Mismatch`].
    pub fn check(&self, robot: &Robot, mode: DriveMode, period_ns: u64) -> Result<(), Mismatch> {
        let mismatch = |reason: String| Err(Mismatch(reason));
        let (drives, joints) = (self.joints.len(), robot.joints.len());
        if drives != joints {
            return mismatch(format!(
                "the bus has {drives} drives, the robot {joints} joints; list every drive once in the robot file"
            ));
        }
        if !self.periods_ns.is_empty() && !self.periods_ns.contains(&period_ns) {
            let rates: Vec<String> = self.periods_ns.iter().map(|&period| rate(period)).collect();
            return mismatch(format!(
                "the drives do not run at {} Hz but at {} Hz; choose one with --rate",
                rate(period_ns),
                rates.join(", ")
            ));
        }
        if let (Some(control), Some(cycles)) = (&robot.control, self.latch_to_act_cycles)
            && control.delay_cycles != cycles
        {
            return mismatch(format!(
                "a command acts {cycles} cycles after its sample, the robot file says control.delay_cycles = {}; change that",
                control.delay_cycles
            ));
        }
        let drives = self.joints.iter().zip(&robot.joints);
        for (drive, joint) in drives {
            if let Some(reason) = drive.unfit(joint, mode) {
                return mismatch(format!("{}: {reason}", joint.name));
            }
        }
        Ok(())
    }
}

fn rate(period_ns: u64) -> String {
    format!("{:.0}", 1e9 / period_ns.max(1) as f64)
}

impl JointCapabilities {
    /// Why this drive cannot drive this joint in `mode`.
    fn unfit(&self, joint: &robot::RobotJoint, mode: DriveMode) -> Option<String> {
        if let Some(name) = &self.joint
            && *name != joint.name
        {
            return Some(format!(
                "the drive in its place says it is `{name}`; put the drives in the robot file's order"
            ));
        }
        if !self.modes.contains(&mode) {
            return Some(format!(
                "the drive does not know mode {mode:?}, only {:?}; choose another --control",
                self.modes
            ));
        }
        if let (Some(asked_nm), Some(most_nm)) = (joint.torque_limit_nm, self.motor_torque_max_nm)
            && asked_nm > most_nm
        {
            return Some(format!(
                "torque_limit_nm = {asked_nm} is more than the {most_nm:.3} Nm the drive can be commanded; lower it"
            ));
        }
        match self.watchdog {
            None => Some(
                "the drive does not stop by itself when commands stop; set its watchdog".to_owned(),
            ),
            Some(watchdog) if watchdog > WATCHDOG_MAX => Some(format!(
                "the drive's watchdog waits {} ms, {} ms is the most; set it shorter",
                watchdog.as_millis(),
                WATCHDOG_MAX.as_millis()
            )),
            Some(_)
                if self.position_validity & position::KNOWN != 0
                    && self.position_validity & position::HOMED == 0 =>
            {
                Some(
                    "the drive does not know where the joint is; home it, or set its encoder's offset"
                        .to_owned(),
                )
            }
            Some(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 666_667;

    /// Drives that fit the shipped test joint.
    fn fitting() -> Capabilities {
        Capabilities {
            bus: "bench".to_owned(),
            joints: vec![JointCapabilities {
                device: "drive".to_owned(),
                modes: vec![DriveMode::Torque],
                motor_torque_max_nm: Some(10.0),
                watchdog: Some(Duration::from_millis(20)),
                position_validity: position::KNOWN | position::HOMED,
                ..JointCapabilities::default()
            }],
            latch_to_act_cycles: Some(1),
            periods_ns: vec![2_000_000, PERIOD_NS],
            has_clock: true,
        }
    }

    #[test]
    fn what_does_not_fit_is_told_with_what_to_change() {
        let robot = robot::load("shd17").unwrap();
        let check = |drives: &Capabilities| drives.check(&robot, DriveMode::Torque, PERIOD_NS);
        assert_eq!(check(&fitting()), Ok(()));
        type Change = (&'static str, fn(&mut Capabilities));
        let changes: [Change; 8] = [
            ("2 drives", |drives| {
                drives.joints.push(drives.joints[0].clone())
            }),
            ("500 Hz", |drives| drives.periods_ns = vec![2_000_000]),
            ("delay_cycles", |drives| {
                drives.latch_to_act_cycles = Some(3)
            }),
            ("elbow2", |drives| {
                drives.joints[0].joint = Some("elbow2".to_owned())
            }),
            ("--control", |drives| drives.joints[0].modes.clear()),
            ("lower it", |drives| {
                drives.joints[0].motor_torque_max_nm = Some(1e-3)
            }),
            ("watchdog", |drives| drives.joints[0].watchdog = None),
            ("home it", |drives| {
                drives.joints[0].position_validity = position::KNOWN | position::ABSOLUTE
            }),
        ];
        for (told, change) in changes {
            let mut drives = fitting();
            change(&mut drives);
            let mismatch = check(&drives).unwrap_err().to_string();
            assert!(mismatch.contains(told), "{mismatch}");
        }
        let mut slow = fitting();
        slow.joints[0].watchdog = Some(Duration::from_millis(500));
        assert!(check(&slow).unwrap_err().to_string().contains("500 ms"));
    }
}
