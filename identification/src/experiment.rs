//! The papers' identification motions: PA10-05, section IV. One joint moves, the others hold.

use std::f64::consts::TAU;

use motion::{JointEntry, TrajectoryFile, TrajectoryKind, TrapezoidEntry};
use robot::RobotJoint;

use crate::friction::SETTLING_S;
use crate::stiffness::Payload;

/// Speeds of PA10-05, section IV-B1: 0.02 to 0.1 rad/s in steps of 0.02, 0.1 to 0.4 in steps of 0.1.
pub const FRICTION_SPEEDS_RAD_S: [f64; 8] = [0.02, 0.04, 0.06, 0.08, 0.1, 0.2, 0.3, 0.4];
/// Trials of PA10-05 at each speed and in each direction: 80 measurements a joint.
pub const FRICTION_TRIALS: u32 = 5;
/// Speed of PA10-05, section IV-B2, for position-dependent friction.
pub const PERIODIC_SPEED_RAD_S: f64 = 0.01;

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
pub fn friction_experiments(
    joint: &RobotJoint,
    speeds_rad_s: &[f64],
    trials: u32,
) -> Vec<Experiment> {
    let limit_rad_s = joint.velocity_limit_rad_s.unwrap_or(f64::INFINITY);
    speeds_rad_s
        .iter()
        .filter(|&&speed_rad_s| speed_rad_s < limit_rad_s)
        .map(|&speed_rad_s| {
            let name = format!("friction-{}-{speed_rad_s:.3}", joint.name);
            there_and_back(name, joint, speed_rad_s, 1.0, trials)
        })
        .collect()
}

/// Slow motion over several motor revolutions, there and back.
#[must_use]
pub fn periodic_experiment(joint: &RobotJoint) -> Experiment {
    let name = format!("periodic-{}", joint.name);
    there_and_back(name, joint, PERIODIC_SPEED_RAD_S, PERIODIC_REVOLUTIONS, 1)
}

/// A slow sweep there and back with each of [`PAYLOADS_KG`].
#[must_use]
pub fn stiffness_experiments(joint: &RobotJoint) -> Vec<Experiment> {
    let [low_rad, high_rad] = joint
        .position_limit_rad
        .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let start_rad = (low_rad + LIMIT_MARGIN_RAD).max(-SWEEP_RAD);
    let distance_rad = (high_rad - LIMIT_MARGIN_RAD).min(SWEEP_RAD) - start_rad;
    let move_s = distance_rad / SWEEP_SPEED_RAD_S + SWEEP_SPEED_RAD_S / ACCELERATION_RAD_S2;
    PAYLOADS_KG
        .iter()
        .map(|&mass_kg| Experiment {
            name: format!("stiffness-{}-{mass_kg:.1}kg", joint.name),
            joint: joint.name.clone(),
            trajectory: one_joint(TrapezoidEntry {
                name: joint.name.clone(),
                start_rad: Some(start_rad),
                distance_rad: Some(distance_rad),
                speed_rad_s: Some(SWEEP_SPEED_RAD_S),
                acceleration_rad_s2: Some(ACCELERATION_RAD_S2),
                dwell_s: Some(DWELL_S),
            }),
            duration_s: 2.0 * (move_s + DWELL_S),
            payload: Payload {
                mass_kg,
                centre_m: PAYLOAD_CENTRE_M,
            },
        })
        .collect()
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
    let distance_rad = wanted_rad.min(range_rad);
    let move_s = distance_rad / speed_rad_s + speed_rad_s / ACCELERATION_RAD_S2;
    Experiment {
        name,
        joint: joint.name.clone(),
        trajectory: one_joint(TrapezoidEntry {
            name: joint.name.clone(),
            start_rad: None,
            distance_rad: Some(distance_rad),
            speed_rad_s: Some(speed_rad_s),
            acceleration_rad_s2: Some(ACCELERATION_RAD_S2),
            dwell_s: Some(DWELL_S),
        }),
        duration_s: f64::from(times) * 2.0 * (move_s + DWELL_S),
        payload: Payload {
            mass_kg: 0.0,
            centre_m: PAYLOAD_CENTRE_M,
        },
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn the_protocol_of_the_paper_can_be_run_by_its_arm() {
        let robot = robot::load("pa10").unwrap();
        for joint in &robot.joints {
            let mut experiments =
                friction_experiments(joint, &FRICTION_SPEEDS_RAD_S, FRICTION_TRIALS);
            assert_eq!(experiments.len(), 8);
            experiments.push(periodic_experiment(joint));
            experiments.extend(stiffness_experiments(joint));
            for experiment in experiments {
                experiment
                    .trajectory
                    .build(&experiment.name, &robot)
                    .unwrap();
                assert!(experiment.duration_s > 5.0 && experiment.duration_s < 300.0);
            }
        }
    }

    #[test]
    fn a_joint_is_not_asked_for_more_than_it_can() {
        let mut joint = robot::load("pa10").unwrap().joints[0].clone();
        joint.velocity_limit_rad_s = Some(0.15);
        assert_eq!(
            friction_experiments(&joint, &FRICTION_SPEEDS_RAD_S, 5).len(),
            5
        );
        joint.position_limit_rad = Some([-0.1, 0.1]);
        let JointEntry::Trapezoid(entry) = &periodic_experiment(&joint).trajectory.joints[0] else {
            panic!("a trapezoid");
        };
        assert!((entry.distance_rad.unwrap() - 0.16).abs() < 1e-12);
    }
}
