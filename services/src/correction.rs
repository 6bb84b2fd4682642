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
            let estimate_nm = estimate.map_or(f64::NAN, |found| found.residual_torque_nm[joint]);
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
