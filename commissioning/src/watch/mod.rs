//! What each step needs to see.

mod brakes;
mod hand;
mod look;
mod sine;
mod stop;
mod torque;

use robot::{Robot, RobotJoint};
use shm_types::JOINTS_MAX;
use shm_types::messages::PerJoint;

use crate::moment::{Moment, Seen};
use crate::step::{Stage, Step};
use crate::verdict::{Finding, Verdict};

pub use sine::small_sine;

/// Looks at moments in the order in which they come, and judges.
pub trait Watch: std::fmt::Debug {
    /// Takes a moment. After a verdict that is not [`Verdict::Waiting`] nothing more is shown to it.
    fn see(&mut self, moment: &Moment) -> Verdict;

    /// What was seen so far, in one short line.
    fn hint(&self) -> String;

    /// What is told where somebody says that what is waited for does not come.
    fn give_up(&self) -> Finding;

    /// Whether the loop is to be stopped now as the operator would: asked after every moment, true once.
    fn wants_stop(&mut self) -> bool {
        false
    }
}

/// What watches a stage. `trajectory` is the [`small_sine`] that is run, for the step that follows one.
pub fn watch(
    stage: Stage,
    robot: &Robot,
    trajectory: Option<motion::Trajectory>,
) -> Box<dyn Watch> {
    let joints = Joints::of(robot);
    let joint = stage.joint.unwrap_or_default();
    match stage.step {
        Step::Scan => Box::new(look::Scan::new(joints)),
        Step::Check => Box::new(look::Check::new(joints)),
        Step::BrakesClosed => Box::new(brakes::Closed::new(joints)),
        Step::BrakesOpen => Box::new(brakes::Open::new(joints)),
        Step::ZeroTorque => Box::new(hand::Moved::new(joints, joint)),
        Step::Sign => Box::new(hand::Turned::new(joints, joint)),
        Step::Limits => Box::new(hand::Reached::new(joints, joint)),
        Step::EmergencyStop => Box::new(stop::Stop::by_switch(joints)),
        Step::OperatorStop => Box::new(stop::Stop::by_operator(joints)),
        Step::FirstTorque => Box::new(torque::FirstTorque::new(joints, joint)),
        Step::Sine => Box::new(sine::Sine::new(joints, joint, trajectory)),
    }
}

/// So long a person may take for what is asked of him. Assumed.
const PERSON_S: f64 = 120.0;

/// What the watches need of a robot.
#[derive(Clone, Debug)]
struct Joints(Vec<Joint>);

#[derive(Clone, Debug)]
struct Joint {
    name: String,
    gear_ratio: f64,
    position_limit_rad: Option<[f64; 2]>,
    motor_torque_limit_nm: Option<f64>,
    velocity_limit_rad_s: Option<f64>,
}

impl Joints {
    fn of(robot: &Robot) -> Self {
        let of = |joint: &RobotJoint| Joint {
            name: joint.name.clone(),
            gear_ratio: joint.gear_ratio,
            position_limit_rad: joint.position_limit_rad,
            motor_torque_limit_nm: joint.torque_limit_nm,
            velocity_limit_rad_s: joint.velocity_limit_rad_s,
        };
        Self(robot.joints.iter().take(JOINTS_MAX).map(of).collect())
    }

    fn count(&self) -> usize {
        self.0.len()
    }

    fn name(&self, joint: usize) -> &str {
        self.0.get(joint).map_or("?", |joint| &joint.name)
    }

    /// Joint side, by the motors' encoders: every robot has them.
    fn positions_rad(&self, seen: &Seen) -> PerJoint {
        let mut positions_rad = [0.0; JOINTS_MAX];
        for (joint, facts) in self.0.iter().enumerate() {
            positions_rad[joint] = seen.readings.motor_position_rad[joint] / facts.gear_ratio;
        }
        positions_rad
    }
}

/// Lowest and highest of what was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    low: f64,
    high: f64,
}

impl Span {
    const NONE: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

    fn add(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    /// 0 where nothing was seen.
    fn width(self) -> f64 {
        (self.high - self.low).max(0.0)
    }
}

/// How far each joint went since it was last asked.
#[derive(Clone, Debug)]
struct Spans([Span; JOINTS_MAX]);

impl Default for Spans {
    fn default() -> Self {
        Self([Span::NONE; JOINTS_MAX])
    }
}

impl Spans {
    fn add(&mut self, joints: &Joints, seen: &Seen) {
        let positions_rad = joints.positions_rad(seen);
        for (span, position_rad) in self.0.iter_mut().zip(positions_rad).take(joints.count()) {
            span.add(position_rad);
        }
    }

    /// The joint that went furthest, `but` one, and how far.
    fn widest(&self, joints: &Joints, but: Option<usize>) -> (usize, f64) {
        let others = (0..joints.count()).filter(|joint| Some(*joint) != but);
        others.fold((0, 0.0), |widest, joint| {
            let width = self.0[joint].width();
            if width > widest.1 {
                (joint, width)
            } else {
                widest
            }
        })
    }
}

/// A joint that goes less than this far rests. Assumed: what a hand that supports an arm lets it tremble by.
const REST_RAD: f64 = 0.01;
/// And for so long.
const REST_S: f64 = 0.3;

/// Waits until no joint moves.
#[derive(Clone, Debug, Default)]
struct Rest {
    spans: Spans,
    since_s: Option<f64>,
}

impl Rest {
    /// Whether all joints have rested up to this moment.
    fn see(&mut self, joints: &Joints, at_s: f64, seen: &Seen) -> bool {
        self.spans.add(joints, seen);
        if self.spans.widest(joints, None).1 > REST_RAD {
            self.spans = Spans::default();
            self.spans.add(joints, seen);
            self.since_s = None;
        }
        at_s - *self.since_s.get_or_insert(at_s) >= REST_S
    }
}

#[cfg(test)]
pub(crate) mod stage {
    //! Moments for tests.

    use super::*;
    use shm_types::drive::{DriveReport, DriveState};
    use shm_types::messages::{ABSENT, LoopState, Readings};

    /// A robot of two joints: gears of 100 and 50, ranges of ±0.5 rad, 0.4 and 0.8 Nm.
    pub fn robot() -> Robot {
        let mut robot = robot::load("shd17").expect("a shipped robot");
        let mut second = robot.joints[0].clone();
        robot.joints[0].position_limit_rad = Some([-0.5, 0.5]);
        robot.joints[0].torque_limit_nm = Some(0.4);
        second.name = "joint2".to_owned();
        second.gear_ratio = 50.0;
        second.position_limit_rad = Some([-0.5, 0.5]);
        second.torque_limit_nm = Some(0.8);
        robot.joints.push(second);
        robot
    }

    /// Both joints where they are said to be, drives and loop too.
    pub fn moment(
        at_s: f64,
        state: LoopState,
        drive: DriveState,
        positions_rad: [f64; 2],
    ) -> Moment {
        let mut readings = Readings {
            link_position_rad: ABSENT,
            ..Readings::default()
        };
        readings.motor_position_rad[0] = 100.0 * positions_rad[0];
        readings.motor_position_rad[1] = 50.0 * positions_rad[1];
        let mut drives = DriveReport::default();
        drives.state[..2].fill(drive as u32);
        Moment {
            at_s,
            state,
            drives,
            motor_torque_nm: [0.0; JOINTS_MAX],
            limited_joints: 0,
            seen: Some(Seen {
                readings,
                motion_time_s: at_s,
            }),
        }
    }

    /// Shows a watch a course of moments, one a millisecond, until it judges; the last verdict.
    pub fn show(
        watch: &mut dyn Watch,
        duration_s: f64,
        mut moment: impl FnMut(f64) -> Moment,
    ) -> Verdict {
        let mut verdict = Verdict::Waiting;
        for step in 0..=(1e3 * duration_s) as u32 {
            verdict = watch.see(&moment(1e-3 * f64::from(step)));
            if verdict != Verdict::Waiting {
                break;
            }
        }
        verdict
    }

    /// The line of a refusal.
    pub fn refused(verdict: Verdict) -> String {
        match verdict {
            Verdict::Refused(finding) => finding.told,
            other => panic!("not refused: {other:?}"),
        }
    }

    /// That of a pass.
    pub fn passed(verdict: Verdict) -> Finding {
        match verdict {
            Verdict::Passed(finding) => finding,
            other => panic!("not passed: {other:?}"),
        }
    }
}
