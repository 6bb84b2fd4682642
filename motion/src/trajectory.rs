//! Trajectories: every joint's reference as a pure function of time.

use joint_model::JOINTS_MAX;
use robot::Robot;

use crate::MotionError;
use crate::joint_motion::JointMotion;
use crate::lemniscate::{LEMNISCATE_PERIOD_S, Lemniscate};
use crate::soft_start::path_time;
use crate::waypoints::{SampledReference, Waypoints};

/// What the joints are asked to do at one instant, joint side. Zero beyond the robot's joints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reference {
    /// Positions.
    pub position_rad: [f64; JOINTS_MAX],
    /// Velocities.
    pub velocity_rad_s: [f64; JOINTS_MAX],
    /// Accelerations.
    pub acceleration_rad_s2: [f64; JOINTS_MAX],
}

/// Every joint's reference as a pure function of time.
#[derive(Clone, Debug)]
pub struct Trajectory {
    motion: Motion,
    joint_count: usize,
    soft_start_s: f64,
    duration_s: Option<f64>,
}

#[derive(Clone, Debug)]
pub(crate) enum Motion {
    Lemniscate(Box<Lemniscate>),
    Joints(Vec<JointMotion>),
    Waypoints(Waypoints),
}

impl Motion {
    /// Whether every joint starts with zero velocity by itself.
    pub(crate) fn starts_at_rest(&self) -> bool {
        match self {
            Self::Lemniscate(_) => false,
            Self::Joints(joints) => joints.iter().all(JointMotion::starts_at_rest),
            Self::Waypoints(_) => true,
        }
    }

    /// After this path time nothing new happens.
    fn horizon_s(&self) -> f64 {
        match self {
            Self::Lemniscate(_) => LEMNISCATE_PERIOD_S,
            Self::Joints(joints) => joints
                .iter()
                .map(JointMotion::horizon_s)
                .fold(0.0, f64::max),
            Self::Waypoints(waypoints) => waypoints.duration_s(),
        }
    }

    /// Path time at which every joint has come to its final rest, if it does.
    fn end_s(&self) -> Option<f64> {
        let end_s = match self {
            Self::Lemniscate(_) => None,
            Self::Joints(joints) => joints
                .iter()
                .map(JointMotion::end_s)
                .try_fold(0.0, |end, next| Some(next?.max(end))),
            Self::Waypoints(waypoints) => Some(waypoints.duration_s()),
        };
        end_s.filter(|end_s| *end_s > 0.0)
    }
}

impl Trajectory {
    /// Puts a soft start before the motion and checks the robot's limits over all of it.
    pub(crate) fn new(
        motion: Motion,
        soft_start_s: f64,
        duration_s: Option<f64>,
        robot: &Robot,
    ) -> Result<Self, MotionError> {
        robot.check_fits_loop()?;
        let end_s = motion.end_s().map(|end_s| end_s + soft_start_s / 2.0);
        let trajectory = Self {
            motion,
            joint_count: robot.joints.len(),
            soft_start_s,
            duration_s: duration_s.or(end_s),
        };
        trajectory.check(robot)?;
        Ok(trajectory)
    }

    /// Follows a reference that was recorded, and checks the robot's limits over all of it.
    ///
    /// # Errors
    /// [`MotionError::Samples`], or the limit that would be passed.
    pub fn sampled(reference: SampledReference, robot: &Robot) -> Result<Self, MotionError> {
        let waypoints = Waypoints::sampled(reference, robot)?;
        Self::new(Motion::Waypoints(waypoints), 0.0, None, robot)
    }

    /// Writes the reference at `time_s`. Before zero that is the start.
    pub fn sample(&self, time_s: f64, reference: &mut Reference) {
        let time_s = if time_s.is_finite() {
            time_s.max(0.0)
        } else {
            0.0
        };
        let path = path_time(time_s, self.soft_start_s);
        *reference = Reference::default();
        let mut set = |joint: usize, [position_rad, slope, curvature]: [f64; 3]| {
            reference.position_rad[joint] = position_rad;
            reference.velocity_rad_s[joint] = slope * path.rate;
            reference.acceleration_rad_s2[joint] =
                curvature * path.rate * path.rate + slope * path.rate_change_1_s;
        };
        match &self.motion {
            Motion::Lemniscate(lemniscate) => {
                let joints = lemniscate.sample(path.time_s);
                joints
                    .into_iter()
                    .enumerate()
                    .for_each(|(joint, values)| set(joint, values));
            }
            Motion::Joints(joints) => {
                joints
                    .iter()
                    .enumerate()
                    .for_each(|(joint, motion)| set(joint, motion.sample(path.time_s)));
            }
            Motion::Waypoints(waypoints) => waypoints.sample(path.time_s, set),
        }
    }

    /// Number of joints that move or hold.
    pub fn joint_count(&self) -> usize {
        self.joint_count
    }

    /// When the motion is over, or as long as its file says; `None` where it goes on for ever.
    pub fn duration_s(&self) -> Option<f64> {
        self.duration_s
    }

    /// Length of the soft start; 0 for none. Path time is then `soft_start/2` behind the clock.
    pub fn soft_start_s(&self) -> f64 {
        self.soft_start_s
    }

    /// Are all joints within the robot's limits, all the time?
    fn check(&self, robot: &Robot) -> Result<(), MotionError> {
        const CHECKS: usize = 10_000;
        let checks = match &self.motion {
            Motion::Waypoints(waypoints) => CHECKS.max(4 * waypoints.count()),
            _ => CHECKS,
        };
        let span_s = self.motion.horizon_s() + self.soft_start_s;
        let mut reference = Reference::default();
        for check in 0..=checks {
            let time_s = span_s * check as f64 / checks as f64;
            self.sample(time_s, &mut reference);
            check_limits(robot, time_s, &reference)?;
        }
        Ok(())
    }
}

fn check_limits(robot: &Robot, time_s: f64, reference: &Reference) -> Result<(), MotionError> {
    for (index, joint) in robot.joints.iter().enumerate() {
        let (position_rad, velocity_rad_s) = (
            reference.position_rad[index],
            reference.velocity_rad_s[index],
        );
        let [low_rad, high_rad] = joint.position_limit_rad.unwrap_or([f64::MIN, f64::MAX]);
        if !(low_rad..=high_rad).contains(&position_rad) {
            let joint = joint.name.clone();
            return Err(MotionError::PositionLimit {
                joint,
                time_s,
                position_rad,
                low_rad,
                high_rad,
            });
        }
        let limit_rad_s = joint.velocity_limit_rad_s.unwrap_or(f64::MAX);
        if velocity_rad_s.is_nan() || velocity_rad_s.abs() > limit_rad_s {
            return Err(MotionError::VelocityLimit {
                joint: joint.name.clone(),
                time_s,
                velocity_rad_s,
                limit_rad_s,
            });
        }
    }
    Ok(())
}
