//! The papers' identification motions: PA10-05, section IV. One joint moves, the others hold.

use std::f64::consts::TAU;

use motion::{HoldEntry, JointEntry, TrajectoryFile, TrajectoryKind, TrapezoidEntry};
use robot::{Robot, RobotJoint};

use crate::Payload;
use crate::friction::SETTLING_S;
use crate::sweep_pose::SweepPose;

/// The speeds of one of the papers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Protocol {
    /// Speeds at which friction is measured, both ways.
    pub friction_rad_s: &'static [f64],
    /// Speed of the slow motion for position-dependent friction.
    pub periodic_rad_s: f64,
}

/// PA10-05, section IV-B: 0.02 to 0.1 rad/s in steps of 0.02, 0.1 to 0.4 in steps of 0.1; slow motion at 0.01 rad/s.
pub const PA10_2005: Protocol = Protocol {
    friction_rad_s: &[0.02, 0.04, 0.06, 0.08, 0.1, 0.2, 0.3, 0.4],
    periodic_rad_s: 0.01,
};

/// PA10-03: "from 0.005 rad/s to 0.5 rad/s in increments of 0.05", read as 0.005 and then the multiples of 0.05; the
/// look-up table for Coulomb friction at 0.005 rad/s.
pub const PA10_2003: Protocol = Protocol {
    friction_rad_s: &[0.005, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5],
    periodic_rad_s: 0.005,
};

/// Trials of PA10-05 at each speed and in each direction: 80 measurements a joint. PA10-03 tells none.
pub const FRICTION_TRIALS: u32 = 5;

/// Speeds that no protocol fits: between those of both, from slow to fast.
pub const HELD_OUT_RAD_S: [f64; 3] = [0.03, 0.15, 0.35];
/// A held-out motion begins at this share of a joint's range and covers as much as the next says: off the places where
/// friction was measured, and under load where gravity loads the joint.
const HELD_OUT_START_SHARE: f64 = 0.1;
const HELD_OUT_RANGE_SHARE: f64 = 0.4;

/// Payloads of PA10-05 (0 and 4.5 kg) and PA10-03 (2.3 kg too).
pub const PAYLOADS_KG: [f64; 3] = [0.0, 2.3, 4.5];

/// Sweeps of the stiffness experiment reach this far to either side of upright, as in PA10-03.
const SWEEP_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// PA10-03 sweeps at 0.01 rad/s; five times that takes a minute a sweep, and friction is known at any speed.
const SWEEP_SPEED_RAD_S: f64 = 0.05;
/// Distance that a sweep keeps from the joint's limits.
const LIMIT_MARGIN_RAD: f64 = 0.05;
/// Centre of a payload beyond the flange, along the last joint's axis.
const PAYLOAD_CENTRE_M: [f64; 3] = [0.0, 0.0, 0.05];

/// Rest at either end of a move.
const DWELL_S: f64 = 0.5;
const ACCELERATION_RAD_S2: f64 = 2.0;
/// Of a motor revolution more than the whole ones: where the first begins is arbitrary.
const SPARE_REVOLUTIONS: f64 = 0.1;
/// Motor revolutions of the slow motion. Spectral lines are then this many to a cycle per revolution.
const PERIODIC_REVOLUTIONS: f64 = 8.0;
/// Share of a joint's range that an experiment uses at most.
const RANGE_SHARE: f64 = 0.8;

/// One motion to record, in velocity mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Names its files.
    pub name: String,
    /// The joint that moves.
    pub joint: String,
    /// What the arm does.
    pub trajectory: TrajectoryFile,
    /// How long.
    pub duration_s: f64,
    /// What hangs at the flange.
    pub payload: Payload,
}

/// Constant velocities there and back, one experiment a speed. Speeds above a joint's limit are left out.
#[must_use]
pub fn friction_experiments(joint: &RobotJoint, protocol: Protocol) -> Vec<Experiment> {
    possible(joint, protocol.friction_rad_s)
        .map(|speed_rad_s| {
            let name = format!("friction-{}-{speed_rad_s:.3}", joint.name);
            there_and_back(name, joint, speed_rad_s, 1.0, FRICTION_TRIALS)
        })
        .collect()
}

/// Slow motion over several motor revolutions, there and back.
#[must_use]
pub fn periodic_experiment(joint: &RobotJoint, protocol: Protocol) -> Experiment {
    let name = format!("periodic-{}", joint.name);
    there_and_back(
        name,
        joint,
        protocol.periodic_rad_s,
        PERIODIC_REVOLUTIONS,
        1,
    )
}

/// Motions that are recorded to test what was identified, and never fitted.
#[must_use]
pub fn held_out_experiments(joint: &RobotJoint) -> Vec<Experiment> {
    let [low_rad, high_rad] = joint.position_limit_rad.unwrap_or([-SWEEP_RAD, SWEEP_RAD]);
    let start_rad = low_rad + HELD_OUT_START_SHARE * (high_rad - low_rad);
    let distance_rad = (HELD_OUT_RANGE_SHARE * (high_rad - low_rad)).min(1.0);
    possible(joint, &HELD_OUT_RAD_S)
        .map(|speed_rad_s| {
            let name = format!("held-out-{}-{speed_rad_s:.3}", joint.name);
            let motion = Move {
                start_rad: Some(start_rad),
                distance_rad,
                speed_rad_s,
            };
            motion.experiment(name, joint, 1, Payload::default())
        })
        .collect()
}

/// The speeds that the joint may go at.
fn possible(joint: &RobotJoint, speeds_rad_s: &[f64]) -> impl Iterator<Item = f64> {
    let limit_rad_s = joint.velocity_limit_rad_s.unwrap_or(f64::INFINITY);
    let speeds_rad_s = speeds_rad_s.iter().copied();
    speeds_rad_s.filter(move |speed_rad_s| *speed_rad_s < limit_rad_s)
}

/// A slow sweep there and back with each of [`PAYLOADS_KG`], as far as the drive can lift it by what the robot file knows.
/// Other joints bend where gravity would not load this one otherwise.
#[must_use]
pub fn stiffness_experiments(robot: &Robot, joint: &RobotJoint) -> Vec<Experiment> {
    let [low_rad, high_rad] = joint
        .position_limit_rad
        .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let widest_rad = [
        (low_rad + LIMIT_MARGIN_RAD).max(-SWEEP_RAD),
        (high_rad - LIMIT_MARGIN_RAD).min(SWEEP_RAD),
    ];
    let payloads = PAYLOADS_KG.map(|mass_kg| Payload {
        mass_kg,
        centre_m: PAYLOAD_CENTRE_M,
    });
    let pose = SweepPose::new(robot, joint, widest_rad, &payloads[payloads.len() - 1]);
    payloads
        .into_iter()
        .map(|payload| {
            let name = format!("stiffness-{}-{:.1}kg", joint.name, payload.mass_kg);
            let liftable_rad = pose
                .as_ref()
                .and_then(|pose| pose.liftable_rad(&payload, widest_rad, SWEEP_SPEED_RAD_S));
            let [start_rad, end_rad] = liftable_rad.unwrap_or(widest_rad);
            let sweep = Move {
                start_rad: Some(start_rad),
                distance_rad: end_rad - start_rad,
                speed_rad_s: SWEEP_SPEED_RAD_S,
            };
            let mut experiment = sweep.experiment(name, joint, 1, payload);
            let bent = pose.iter().flat_map(SweepPose::bent);
            experiment
                .trajectory
                .joints
                .extend(bent.map(|(name, position_rad)| {
                    JointEntry::Hold(HoldEntry {
                        name: name.to_owned(),
                        position_rad: Some(position_rad),
                    })
                }));
            experiment
        })
        .collect()
}

/// From rest to rest at one speed.
struct Move {
    /// Home if not given.
    start_rad: Option<f64>,
    distance_rad: f64,
    speed_rad_s: f64,
}

impl Move {
    /// There and back, so many times.
    fn experiment(
        &self,
        name: String,
        joint: &RobotJoint,
        times: u32,
        payload: Payload,
    ) -> Experiment {
        let move_s = self.distance_rad / self.speed_rad_s + self.speed_rad_s / ACCELERATION_RAD_S2;
        Experiment {
            name,
            joint: joint.name.clone(),
            trajectory: one_joint(TrapezoidEntry {
                name: joint.name.clone(),
                start_rad: self.start_rad,
                distance_rad: Some(self.distance_rad),
                speed_rad_s: Some(self.speed_rad_s),
                acceleration_rad_s2: Some(ACCELERATION_RAD_S2),
                dwell_s: Some(DWELL_S),
            }),
            duration_s: f64::from(times) * 2.0 * (move_s + DWELL_S),
            payload,
        }
    }
}

fn one_joint(entry: TrapezoidEntry) -> TrajectoryFile {
    TrajectoryFile {
        kind: TrajectoryKind::Hold,
        joints: vec![JointEntry::Trapezoid(entry)],
        ..TrajectoryFile::default()
    }
}

fn there_and_back(
    name: String,
    joint: &RobotJoint,
    speed_rad_s: f64,
    motor_revolutions: f64,
    times: u32,
) -> Experiment {
    let revolution_rad = TAU / joint.gear_ratio.abs();
    let ramps_rad = speed_rad_s * speed_rad_s / ACCELERATION_RAD_S2;
    // Settling is dropped at both ends, and at least as long a stretch must be left.
    let steady_rad = ((motor_revolutions + SPARE_REVOLUTIONS) * revolution_rad)
        .max(1.5 * SETTLING_S * speed_rad_s);
    let wanted_rad = ramps_rad + steady_rad + 2.0 * SETTLING_S * speed_rad_s;
    let range_rad = joint
        .position_limit_rad
        .map_or(f64::INFINITY, |[low, high]| RANGE_SHARE * (high - low));
    let motion = Move {
        start_rad: None,
        distance_rad: wanted_rad.min(range_rad),
        speed_rad_s,
    };
    motion.experiment(name, joint, times, Payload::default())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn the_protocol_of_the_paper_can_be_run_by_its_arm() {
        let robot = robot::load("pa10").unwrap();
        for joint in &robot.joints {
            let mut experiments = friction_experiments(joint, PA10_2005);
            assert_eq!(experiments.len(), 8);
            experiments.push(periodic_experiment(joint, PA10_2005));
            experiments.extend(stiffness_experiments(&robot, joint));
            experiments.extend(held_out_experiments(joint));
            experiments.extend(friction_experiments(joint, PA10_2003));
            experiments.push(periodic_experiment(joint, PA10_2003));
            for experiment in experiments {
                experiment
                    .trajectory
                    .build(&experiment.name, &robot)
                    .unwrap();
                assert!(experiment.duration_s > 5.0 && experiment.duration_s < 450.0);
            }
        }
    }

    #[test]
    fn no_sweep_asks_for_more_torque_than_the_drive_has() {
        let robot = robot::load("pa10").unwrap();
        let reach_rad = |joint: usize| -> Vec<f64> {
            let plan = stiffness_experiments(&robot, &robot.joints[joint]);
            let reach_rad = |experiment: &Experiment| match &experiment.trajectory.joints[0] {
                JointEntry::Trapezoid(entry) => entry.distance_rad.unwrap(),
                _ => panic!("a trapezoid"),
            };
            plan.iter().map(reach_rad).collect()
        };
        // The elbow's 100 Nm lift the bare forearm and 40 Nm of friction, but no payload beside.
        let elbow_rad = reach_rad(3);
        assert_eq!(elbow_rad[0], 2.0 * SWEEP_RAD);
        assert!(elbow_rad[1] < elbow_rad[0] && elbow_rad[2] < elbow_rad[1]);
        assert!(elbow_rad[2] > 0.5, "{elbow_rad:?}");
        assert_eq!(reach_rad(0), [2.0 * SWEEP_RAD; 3]);
    }

    #[test]
    fn a_joint_is_not_asked_for_more_than_it_can() {
        let mut joint = robot::load("pa10").unwrap().joints[0].clone();
        joint.velocity_limit_rad_s = Some(0.15);
        assert_eq!(friction_experiments(&joint, PA10_2005).len(), 5);
        assert_eq!(held_out_experiments(&joint).len(), 1);
        joint.position_limit_rad = Some([-0.1, 0.1]);
        let JointEntry::Trapezoid(entry) =
            &periodic_experiment(&joint, PA10_2005).trajectory.joints[0]
        else {
            panic!("a trapezoid");
        };
        assert!((entry.distance_rad.unwrap() - 0.16).abs() < 1e-12);
    }
}
