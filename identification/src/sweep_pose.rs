//! Where an arm waits while one of its joints sweeps.
//!
//! Torque over gravity load can be seen only where gravity loads the joint. PA10-05 mounted its arm on a wall for joints 1, 3
//! and 5 and on a pedestal for the others; here other joints bend instead, at most two of them by a right angle, where
//! that gives the sweep clearly more gravity torque than the arm at home. A vertical axis at the base keeps none.

use std::f64::consts::FRAC_PI_2;

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::Chain;
use motion::{Reference, TrajectoryFile, TrajectoryKind};
use robot::{Robot, RobotJoint};

use crate::Payload;
use crate::loaded_arm::loaded_chain;

/// Share of its torque limit that a drive is asked for at most: the arm is not quite as its file says, and what is left moves
/// it.
const TORQUE_SHARE: f64 = 0.85;
/// Angles tried along a sweep.
const STEPS: u32 = 90;
/// The same where only the range of gravity torque is wanted: it is a sine.
const COARSE_STEPS: u32 = 8;
/// So many times the gravity torque's range are worth bending another joint.
const WORTH_BENDING: f64 = 1.2;
/// A range of gravity torque below this is none.
const NO_RANGE_NM: f64 = 1e-6;

/// Where the other joints wait, and where the sweeping one starts from.
#[derive(Clone, Debug)]
pub(crate) struct SweepPose<'a> {
    robot: &'a Robot,
    joint: usize,
    home_rad: [f64; JOINTS_MAX],
    position_rad: [f64; JOINTS_MAX],
}

impl<'a> SweepPose<'a> {
    /// The pose for sweeps of a joint over `range_rad`, in which every drive can hold the heaviest payload. None if the
    /// robot cannot hold still.
    pub fn new(
        robot: &'a Robot,
        joint: &RobotJoint,
        range_rad: [f64; 2],
        heaviest: &Payload,
    ) -> Option<Self> {
        let home_rad = home_rad(robot)?;
        let mut best = Self {
            robot,
            joint: robot.joint_index(&joint.name)?,
            home_rad,
            position_rad: home_rad,
        };
        let (bare, loaded) = (
            loaded_chain(robot, &Payload::default()).ok()?,
            loaded_chain(robot, heaviest).ok()?,
        );
        let mut best_nm = best.gravity_range_nm(&bare, range_rad).max(NO_RANGE_NM);
        for bent in best.bendings() {
            let pose = Self {
                position_rad: bent,
                ..best.clone()
            };
            let range_nm = pose.gravity_range_nm(&bare, range_rad);
            if range_nm > WORTH_BENDING * best_nm && pose.can_hold(&loaded, range_rad) {
                (best, best_nm) = (pose, range_nm);
            }
        }
        Some(best)
    }

    /// The joints that wait away from home, and where.
    pub fn bent(&self) -> impl Iterator<Item = (&str, f64)> {
        let joints = self.robot.joints.iter().enumerate();
        joints.filter_map(|(index, joint)| {
            let position_rad = self.position_rad[index];
            let away = index != self.joint && position_rad != self.home_rad[index];
            away.then_some((joint.name.as_str(), position_rad))
        })
    }

    /// The part of a range, about where the joint waits, in which the drive has torque to spare for gravity and friction in
    /// both directions. None where the file knows no torque limit, or knows it to be too small even there.
    pub fn liftable_rad(
        &self,
        payload: &Payload,
        [low_rad, high_rad]: [f64; 2],
        speed_rad_s: f64,
    ) -> Option<[f64; 2]> {
        let joint = &self.robot.joints[self.joint];
        let limit_nm = limit_nm(joint)?;
        let chain = loaded_chain(self.robot, payload).ok()?;
        let friction = joint.steady_friction();
        let needed_nm = |angle_rad: f64| {
            let load_nm = self.gravity_nm(&chain, angle_rad)[self.joint];
            let moving_nm =
                |velocity_rad_s| load_nm + friction.drag_nm(velocity_rad_s, load_nm, 0.0, 0.0);
            moving_nm(speed_rad_s)
                .abs()
                .max(moving_nm(-speed_rad_s).abs())
        };
        let home_rad = self.home_rad[self.joint];
        let reach_rad = |end_rad: f64| {
            steps(home_rad, end_rad, STEPS)
                .take_while(|angle_rad| needed_nm(*angle_rad) <= limit_nm)
                .last()
        };
        Some([reach_rad(low_rad)?, reach_rad(high_rad)?])
    }

    /// Home with one other joint bent, then with two.
    fn bendings(&self) -> Vec<[f64; JOINTS_MAX]> {
        let others = || (0..self.robot.joints.len()).filter(|other| *other != self.joint);
        let bend = |from: [f64; JOINTS_MAX], other: usize| {
            [FRAC_PI_2, -FRAC_PI_2]
                .into_iter()
                .filter_map(move |turn_rad| {
                    let mut bent = from;
                    bent[other] += turn_rad;
                    self.is_allowed(other, bent[other]).then_some(bent)
                })
        };
        let once: Vec<_> = others()
            .flat_map(|other| bend(self.home_rad, other))
            .collect();
        let twice = others().flat_map(|first| {
            bend(self.home_rad, first).flat_map(move |bent| {
                others()
                    .filter(move |second| *second > first)
                    .flat_map(move |second| bend(bent, second))
            })
        });
        let twice: Vec<_> = twice.collect();
        once.into_iter().chain(twice).collect()
    }

    fn is_allowed(&self, joint: usize, position_rad: f64) -> bool {
        self.robot.joints[joint]
            .position_limit_rad
            .is_none_or(|[low, high]| (low..=high).contains(&position_rad))
    }

    fn gravity_nm(&self, chain: &Chain, angle_rad: f64) -> [f64; JOINTS_MAX] {
        let mut position_rad = self.position_rad;
        position_rad[self.joint] = angle_rad;
        let (count, mut gravity_nm) = (self.robot.joints.len(), [0.0; JOINTS_MAX]);
        chain.gravity_torque(&position_rad[..count], &mut gravity_nm[..count]);
        gravity_nm
    }

    fn gravity_range_nm(&self, chain: &Chain, [low_rad, high_rad]: [f64; 2]) -> f64 {
        let torques_nm = steps(low_rad, high_rad, COARSE_STEPS)
            .map(|angle_rad| self.gravity_nm(chain, angle_rad)[self.joint]);
        let (least_nm, most_nm) = torques_nm
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), nm| {
                (least.min(nm), most.max(nm))
            });
        most_nm - least_nm
    }

    /// Whether the other drives can hold their joints all along the sweep.
    fn can_hold(&self, chain: &Chain, [low_rad, high_rad]: [f64; 2]) -> bool {
        steps(low_rad, high_rad, COARSE_STEPS).all(|angle_rad| {
            let gravity_nm = self.gravity_nm(chain, angle_rad);
            let mut joints = self.robot.joints.iter().zip(&gravity_nm).enumerate();
            joints.all(|(index, (joint, nm))| {
                index == self.joint || limit_nm(joint).is_none_or(|limit_nm| nm.abs() <= limit_nm)
            })
        })
    }
}

/// What a drive is asked for at most, joint side.
fn limit_nm(joint: &RobotJoint) -> Option<f64> {
    Some(TORQUE_SHARE * joint.torque_limit_nm? * joint.gear_ratio.abs())
}

fn home_rad(robot: &Robot) -> Option<[f64; JOINTS_MAX]> {
    let waiting = TrajectoryFile {
        kind: TrajectoryKind::Hold,
        ..TrajectoryFile::default()
    };
    let mut pose = Reference::default();
    waiting.build("hold", robot).ok()?.sample(0.0, &mut pose);
    Some(pose.position_rad)
}

fn steps(from_rad: f64, to_rad: f64, count: u32) -> impl Iterator<Item = f64> {
    (0..=count).map(move |step| from_rad + (to_rad - from_rad) * f64::from(step) / f64::from(count))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    const SWEEP_RAD: [f64; 2] = [-FRAC_PI_2, FRAC_PI_2];
    const HEAVIEST: Payload = Payload {
        mass_kg: 4.5,
        centre_m: [0.0, 0.0, 0.05],
    };

    #[test]
    fn joints_bend_only_where_upright_shows_no_gravity() {
        let robot = robot::load("pa10").unwrap();
        let bent = |joint: usize| {
            let pose = SweepPose::new(&robot, &robot.joints[joint], SWEEP_RAD, &HEAVIEST).unwrap();
            pose.bent().count()
        };
        // A vertical axis has no gravity whatever bends beyond it.
        assert_eq!(bent(0), 0);
        for upright_suffices in [1, 3, 5] {
            assert_eq!(bent(upright_suffices), 0, "joint{}", upright_suffices + 1);
        }
        for needs_bending in [2, 4] {
            assert_eq!(bent(needs_bending), 2, "joint{}", needs_bending + 1);
        }
    }

    #[test]
    fn every_drive_can_hold_the_pose() {
        let robot = robot::load("pa10").unwrap();
        let chain = loaded_chain(&robot, &HEAVIEST).unwrap();
        for joint in &robot.joints {
            let pose = SweepPose::new(&robot, joint, SWEEP_RAD, &HEAVIEST).unwrap();
            let home = pose.bent().count() == 0;
            assert!(home || pose.can_hold(&chain, SWEEP_RAD), "{}", joint.name);
        }
    }
}
