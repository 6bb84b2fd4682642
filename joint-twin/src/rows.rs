//! What is compared, sample by sample, and what makes a sample less sure than another.

use joint_model::friction::Sliding;

use super::Piece;
use crate::joint::JointModel;
use crate::observe::{Channel, SPREAD_S};
use crate::signal::rounding::Rounding;
use crate::signal::smooth::derivative;
use crate::simulate::Between;
use crate::stretch::JointStretch;
use crate::vibration::Vibration;

/// No robot's torque is controlled as slowly as this.
const SLOWEST_LOOP_HZ: f64 = 200.0;
/// Of a bend from sample to sample, what a torque may have been off in between: a corner halfway between two is off by half.
const BEND: f64 = 0.25;

/// One sample of one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Index of the stretch.
    pub stretch: usize,
    /// What is compared.
    pub channel: Channel,
    /// Since the recording began.
    pub time_s: f64,
    /// Joint side.
    pub position_rad: f64,
    /// Joint side.
    pub velocity_rad_s: f64,
    /// Joint side.
    pub acceleration_rad_s2: f64,
    /// Torque of the rigid bodies.
    pub load_nm: f64,
    /// Motor side.
    pub motor_angle_rad: f64,
    /// Largest torque that accelerates rotor and link, and of the other joints' motion, within what the low-pass sees.
    pub inertial_nm: f64,
    /// Largest torque that nobody can know of how the other joints' links swing where no encoder shows it.
    pub unseen_nm: f64,
    /// Torque that swings the rotor above the band, beyond what is usual of the recording or beyond its friction, whichever is more.
    pub vibrating_nm: f64,
    /// How far dry friction falls, without load and by the robot file, because the joint gets faster within what the low-pass sees.
    pub falling_nm: f64,
    /// Largest torque that the drive may have made between two samples beside what a line from one to the other tells, where they come
    /// more slowly than any loop.
    pub aliased_nm: f64,
    /// What rounding of the encoders adds where it beats with the samples: no noise that differs from sample to sample.
    pub beating_nm: f64,
}

fn largest_around(values: &[f64], k: usize, around: usize) -> f64 {
    values[k.saturating_sub(around)..(k + around + 1).min(values.len())]
        .iter()
        .map(|value| value.abs())
        .fold(0.0, f64::max)
}

/// Torque that swings the rotor: what is unusual of it, or more than dry friction where the robot file tells any.
fn vibrating_nm(vibration: &Vibration, nominal: &JointModel, dry_nm: f64, k: usize) -> f64 {
    let inertia_kg_m2 = nominal.rotor_inertia_kg_m2;
    let unusual_nm = inertia_kg_m2 * vibration.unusual_rad_s2[k];
    if dry_nm > 0.0 {
        unusual_nm.max(inertia_kg_m2 * vibration.acceleration_rad_s2[k] - dry_nm)
    } else {
        unusual_nm
    }
}

/// How much less a friction is at the fastest velocity near a sample than at the slowest.
fn fall_around(velocity_rad_s: &[f64], level_nm: &[f64], k: usize, around: usize) -> f64 {
    let near = k.saturating_sub(around)..(k + around + 1).min(velocity_rad_s.len());
    let speed = |k: &usize| velocity_rad_s[*k].abs();
    let slowest = near.clone().min_by(|a, b| speed(a).total_cmp(&speed(b)));
    let fastest = near.max_by(|a, b| speed(a).total_cmp(&speed(b)));
    match (slowest, fastest) {
        (Some(slowest), Some(fastest)) => (level_nm[slowest] - level_nm[fastest]).max(0.0),
        _ => 0.0,
    }
}

/// How far the drive's torque may be off the lines between its samples, sample by sample: nothing where each lasts until the next, or
/// where they come so fast that what bends a line is noise, of which not every robot file speaks.
fn aliased_nm(joint: &JointStretch, nominal: &JointModel) -> Vec<f64> {
    let is_slow = 1.0 / joint.drive.period_s < SLOWEST_LOOP_HZ;
    if joint.drive.between == Between::Line && is_slow {
        let noise_nm = nominal.gear_ratio * nominal.torque_noise_nm;
        off_lines_nm(&joint.torque_nm, noise_nm)
    } else {
        vec![0.0; joint.samples()]
    }
}

/// The same of torques with so much noise, which bends a line by six times its variance.
fn off_lines_nm(torque_nm: &[f64], noise_nm: f64) -> Vec<f64> {
    let last = torque_nm.len().saturating_sub(1);
    (0..torque_nm.len())
        .map(|k| {
            let [before, after] = [k.saturating_sub(1), (k + 1).min(last)].map(|k| torque_nm[k]);
            let bend_nm = before - 2.0 * torque_nm[k] + after;
            BEND * (bend_nm.powi(2) - 6.0 * noise_nm.powi(2)).max(0.0).sqrt()
        })
        .collect()
}

pub(super) fn rows(pieces: &[Piece<'_>], channels: &[Channel], nominal: &JointModel) -> Vec<Row> {
    let mut rows = Vec::new();
    for (stretch, piece) in pieces.iter().enumerate() {
        let drive = &piece.joint.drive;
        let load = &piece.joint.load;
        let acceleration_rad_s2 = derivative(&load.velocity_rad_s, drive.period_s);
        let around = (SPREAD_S / drive.period_s) as usize;
        let moving_nm: Vec<f64> = acceleration_rad_s2
            .iter()
            .zip(&load.inertia_kg_m2)
            .zip(&load.coupling_nm)
            .map(|((acceleration_rad_s2, inertia_kg_m2), coupling_nm)| {
                let inertia_kg_m2 = nominal.rotor_inertia_kg_m2 + inertia_kg_m2;
                inertia_kg_m2 * acceleration_rad_s2.abs() + coupling_nm.abs()
            })
            .collect();
        let aliased_nm = aliased_nm(piece.joint, nominal);
        let unloaded_nm: Vec<f64> = load
            .velocity_rad_s
            .iter()
            .map(|velocity_rad_s| nominal.friction.level_nm(&Sliding::at(*velocity_rad_s)))
            .collect();
        let beating = |channel: Channel, k: usize| {
            let velocity_rad_s = load.velocity_rad_s[k];
            let of = |step_rad: f64, noise_rad: f64| {
                let rounding = Rounding {
                    step_rad,
                    noise_rad,
                    steps_hz: velocity_rad_s.abs() / step_rad,
                };
                rounding.beating_rad(1.0 / drive.period_s, piece.band.cutoff_hz)
            };
            let ratio = nominal.gear_ratio;
            let noise_rad = nominal.position_noise_rad;
            let motor_rad = of(nominal.motor_resolution_rad / ratio, noise_rad / ratio);
            let link_rad = of(nominal.link_resolution_rad, noise_rad);
            match channel {
                Channel::Torsion => nominal.stiffness_nm_rad * motor_rad.hypot(link_rad),
                Channel::Motor | Channel::Link => {
                    let bandwidth_rad_s = std::f64::consts::TAU * piece.band.cutoff_hz;
                    let own_nm = (nominal.rotor_inertia_kg_m2 + load.inertia_kg_m2[k])
                        * bandwidth_rad_s.powi(2)
                        * motor_rad;
                    own_nm.hypot(piece.joint.others_rounding_nm[k])
                }
                Channel::Drive => 0.0,
            }
        };
        for &channel in channels {
            rows.extend(piece.kept.iter().map(|row| {
                let k = row * piece.band.stride();
                Row {
                    stretch,
                    channel,
                    time_s: drive.start_s + k as f64 * drive.period_s,
                    position_rad: load.position_rad[k],
                    velocity_rad_s: load.velocity_rad_s[k],
                    acceleration_rad_s2: acceleration_rad_s2[k],
                    load_nm: load.torque_nm[k],
                    motor_angle_rad: nominal.gear_ratio * drive.motor_rad[k],
                    inertial_nm: largest_around(&moving_nm, k, around),
                    unseen_nm: largest_around(&piece.joint.unseen_nm, k, around),
                    vibrating_nm: vibrating_nm(&piece.vibration, nominal, unloaded_nm[k], k),
                    falling_nm: fall_around(&load.velocity_rad_s, &unloaded_nm, k, around),
                    aliased_nm: largest_around(&aliased_nm, k, around),
                    beating_nm: beating(channel, k),
                }
            }));
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_falls_as_far_as_the_joint_gets_faster_near_a_sample() {
        // Stribeck's: 2 Nm at rest, 1 Nm beyond 0.1 rad/s
        let level_nm = |velocity_rad_s: f64| 1.0 + (1.0 - 10.0 * velocity_rad_s.abs()).max(0.0);
        let velocity_rad_s: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k) - 0.2).collect();
        let levels_nm: Vec<f64> = velocity_rad_s.iter().map(|v| level_nm(*v)).collect();
        let fall_nm = |k: usize| fall_around(&velocity_rad_s, &levels_nm, k, 5);
        assert!((fall_nm(20) - 0.5).abs() < 1e-9, "{}", fall_nm(20));
        assert_eq!(fall_nm(80), 0.0);
        // what rises does not fall
        let rising_nm: Vec<f64> = levels_nm.iter().map(|level| -level).collect();
        assert_eq!(fall_around(&velocity_rad_s, &rising_nm, 20, 5), 0.0);
    }

    #[test]
    fn a_torque_between_two_samples_is_in_doubt_where_it_bends() {
        let line: Vec<f64> = (0..9).map(|k| 0.5 * f64::from(k)).collect();
        assert!(
            off_lines_nm(&line, 0.0)[1..8]
                .iter()
                .all(|off| *off < 1e-12)
        );
        // a push of 2 Nm that one sample shows may have lasted for twice as long or not at all
        let mut pushed = line.clone();
        pushed[4] += 2.0;
        let off_nm = off_lines_nm(&pushed, 0.0);
        assert!((off_nm[4] - 1.0).abs() < 1e-12 && (off_nm[3] - 0.5).abs() < 1e-12);
        // a bend within the noise is none
        assert_eq!(off_lines_nm(&pushed, 2.0), [0.0; 9]);
    }
}
