//! The torque estimator's part in the feedforward: slow model error, learned in motion.
//!
//! `T_c' = T_c + (T/τ)·(sat(T_estimate - T_rigid) - T_c)`, fed forward as `gain·T_c`, joint side. The estimate is motor
//! torque less modelled friction and rotor inertia, `T_rigid` the model's torque of the link at the reference of the same
//! cycle; their difference is what the model lacks, a wrong mass and wrong friction alike. Together with the feedback this is an
//! integral action that knows the model: in steady motion a gain `g` leaves `1 - g` of the feedback torque.
//!
//! Why it does not destabilise. With joint inertia `J` (of which the link has `M`), gains `K_p`, `K_d`, the loop is
//! `Jτ s³ + (J - gM + K_d τ) s² + (K_d + K_p τ) s + K_p`, stable for every `g ≤ 1`, `M ≤ J`, `τ` if `K_d² > K_p J`; the PA-10's
//! gains have that, and the joints' own friction damps on top.
//!
//! Bounds. `T_c` stays within half of the friction that the model gives the unloaded joint, so by itself it can neither
//! start nor keep a motion. A joint without modelled friction gets none.
//!
//! When it learns. At standstill friction takes any value up to breakaway and the estimate is off by as much, so
//! `T_c` is held unless the joint moves as desired, both faster than [`SLIDING_RAD_S`]; there is no wind-up at rest and
//! none against a stop. Without an estimate (a joint without motor torque, an estimator that was killed and whose last
//! word is older than [`STALE_CYCLES`]) `T_c` fades with `τ`.
//!
//! Limits. An external force is a model error too and is compensated within the bound: contact gets stiffer. Friction that
//! differs between directions is learned anew after each reversal, within `τ`.

use robot::RobotJoint;
use shm_types::messages::{PerJoint, TorqueEstimate};

/// `τ`. Far below what the position loop does (5 to 25 rad/s on the PA-10), fast enough for friction that changes along
/// the path.
const TIME_CONSTANT_S: f64 = 0.2;
/// Above this velocity the estimator counts friction nearly in full, and the direction is beyond doubt.
pub const SLIDING_RAD_S: f64 = 0.01;
/// The loop's hold time, 10 ms: what is older says nothing about now.
pub const STALE_CYCLES: u64 = 15;
/// Of the unloaded joint's friction.
const BOUND_SHARE: f64 = 0.5;

/// The corrections of all joints.
#[derive(Clone, Debug)]
pub struct Correction {
    gain: f64,
    share_per_cycle: f64,
    bounds_nm: Vec<f64>,
    learned_nm: PerJoint,
    /// The two newest, older one first: one of this cycle may be there already, depending on who was faster.
    estimates: [Option<TorqueEstimate>; 2],
}

/// What the correction is learned from, all of the cycle before, joint side.
#[derive(Clone, Copy, Debug)]
pub struct Lesson<'a> {
    /// The reference's.
    pub desired_velocity_rad_s: &'a PerJoint,
    /// The joints' own, observed.
    pub measured_velocity_rad_s: &'a PerJoint,
    /// What the model says the links take.
    pub modelled_torque_nm: &'a PerJoint,
}

impl Correction {
    /// Nothing learned yet; a gain of 0 never corrects.
    pub fn new(gain: f64, joints: &[RobotJoint], period_s: f64) -> Self {
        Self {
            gain,
            share_per_cycle: -(-period_s / TIME_CONSTANT_S).exp_m1(),
            bounds_nm: joints.iter().map(bound_nm).collect(),
            learned_nm: PerJoint::default(),
            estimates: [None; 2],
        }
    }

    /// Keeps an estimate for later cycles.
    pub fn take(&mut self, estimate: TorqueEstimate) {
        self.estimates = [self.estimates[1], Some(estimate)];
    }

    /// Learns before the command of `cycle`, from the newest estimate of an earlier one: in lockstep always the one before.
    pub fn learn(&mut self, cycle: u64, lesson: &Lesson<'_>) {
        let earlier = self.estimates.iter().rev().flatten();
        let estimate = earlier
            .filter(|estimate| estimate.header.cycle < cycle)
            .find(|estimate| cycle - estimate.header.cycle <= STALE_CYCLES)
            .copied();
        for (joint, bound_nm) in self.bounds_nm.iter().enumerate() {
            let estimate_nm = estimate.map_or(f64::NAN, |found| found.residual.valid_nm(joint)[0]);
            let error_nm = estimate_nm - lesson.modelled_torque_nm[joint];
            let learned_nm = &mut self.learned_nm[joint];
            if !error_nm.is_finite() {
                *learned_nm -= self.share_per_cycle * *learned_nm;
            } else if slides(lesson, joint) {
                let error_nm = error_nm.clamp(-bound_nm, *bound_nm);
                *learned_nm += self.share_per_cycle * (error_nm - *learned_nm);
            }
        }
    }

    /// What to feed forward, joint side; at most the gain times half of the unloaded joint's friction.
    pub fn torque_nm(&self, joint: usize) -> f64 {
        self.gain * self.learned_nm[joint]
    }
}

/// Half of the friction of the unloaded joint, the smaller of its directions.
fn bound_nm(joint: &RobotJoint) -> f64 {
    let friction = joint.steady_friction();
    let drag_nm = |velocity_rad_s| friction.drag_nm(velocity_rad_s, 0.0, 0.0, 0.0).abs();
    BOUND_SHARE * drag_nm(SLIDING_RAD_S).min(drag_nm(-SLIDING_RAD_S))
}

fn slides(lesson: &Lesson<'_>, joint: usize) -> bool {
    let desired_rad_s = lesson.desired_velocity_rad_s[joint];
    let measured_rad_s = lesson.measured_velocity_rad_s[joint];
    desired_rad_s.abs().min(measured_rad_s.abs()) > SLIDING_RAD_S
        && desired_rad_s.signum() == measured_rad_s.signum()
}

#[cfg(test)]
mod tests {
    use shm_types::messages::{Estimates, Header, Validity};

    use super::*;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    fn estimate(cycle: u64, torque_nm: f64) -> TorqueEstimate {
        TorqueEstimate {
            header: Header {
                cycle,
                ..Header::default()
            },
            residual: Estimates {
                torque_nm: [torque_nm; 16],
                validity: [Validity::Valid as u32; 16],
                ..Estimates::default()
            },
            ..TorqueEstimate::default()
        }
    }

    fn learn(correction: &mut Correction, cycle: u64, desired_rad_s: f64, measured_rad_s: f64) {
        correction.learn(
            cycle,
            &Lesson {
                desired_velocity_rad_s: &[desired_rad_s; 16],
                measured_velocity_rad_s: &[measured_rad_s; 16],
                modelled_torque_nm: &[1.0; 16],
            },
        );
    }

    fn pa10(gain: f64) -> Correction {
        Correction::new(
            gain,
            &robot::load("pa10").expect("shipped").joints,
            PERIOD_S,
        )
    }

    /// Two seconds of the same estimate and motion.
    fn after(gain: f64, estimate_nm: f64, desired_rad_s: f64, measured_rad_s: f64) -> Correction {
        let mut correction = pa10(gain);
        for cycle in 0..3000 {
            learn(&mut correction, cycle, desired_rad_s, measured_rad_s);
            correction.take(estimate(cycle, estimate_nm));
        }
        correction
    }

    #[test]
    fn in_motion_the_gains_share_of_the_model_error_is_learned() {
        for gain in [0.0, 0.5, 1.0] {
            let torque_nm = after(gain, 3.0, 0.1, 0.1).torque_nm(1);
            assert!((torque_nm - 2.0 * gain).abs() < 1e-3, "{torque_nm}");
        }
    }

    #[test]
    fn it_never_exceeds_half_of_the_joints_friction() {
        for (joint, drive) in robot::load("pa10")
            .expect("shipped")
            .joints
            .iter()
            .enumerate()
        {
            let friction_nm = drive.steady_friction().drag_nm(0.01, 0.0, 0.0, 0.0);
            for estimate_nm in [1e9, -1e9] {
                let torque_nm = after(1.0, estimate_nm, 0.1, 0.1).torque_nm(joint);
                assert!(torque_nm.abs() <= 0.5 * friction_nm && torque_nm * estimate_nm > 0.0);
            }
        }
    }

    #[test]
    fn at_standstill_and_against_the_desired_motion_nothing_is_learned() {
        for (desired_rad_s, measured_rad_s) in [(0.1, 0.0), (0.0, 0.1), (0.1, -0.1), (0.0, 0.0)] {
            assert_eq!(
                after(1.0, 3.0, desired_rad_s, measured_rad_s).torque_nm(0),
                0.0
            );
        }
    }

    #[test]
    fn without_an_estimate_it_fades() {
        for last_nm in [3.0, f64::NAN] {
            let mut correction = after(1.0, 3.0, 0.1, 0.1);
            correction.take(estimate(3000, last_nm));
            for cycle in 3001 + STALE_CYCLES..6000 {
                learn(&mut correction, cycle, 0.1, 0.1);
            }
            assert!(correction.torque_nm(0).abs() < 1e-4);
        }
    }

    #[test]
    fn the_estimate_of_the_cycle_itself_waits_for_the_next() {
        let (mut early, mut late) = (pa10(1.0), pa10(1.0));
        for correction in [&mut early, &mut late] {
            correction.take(estimate(7, 3.0));
        }
        early.take(estimate(8, 9.0));
        learn(&mut early, 8, 0.1, 0.1);
        learn(&mut late, 8, 0.1, 0.1);
        assert_eq!(early.torque_nm(0), late.torque_nm(0));
        assert!(late.torque_nm(0) > 0.0);
    }
}
