//! External torque: what pushes a link from outside, from the fused joint torque and the rigid bodies.
//!
//! `T_ext = M(q) q̈ + C(q, q̇) q̇ + g(q) - T_j`, positive about the joint's axis. Position and joint torque go through the same
//! low-pass, and velocity and acceleration are differences of the smoothed position about one instant, so that every term is
//! late by the same time and none is differentiated alone. Inverse dynamics takes the place of De Luca's momentum observer
//! (De Luca, Albu-Schäffer, Haddadin, Hirzinger, Collision detection and safe reaction, IROS 2006): its residual is this
//! torque through a low-pass.
//!
//! The variance is the sum of the fused estimate's own, of the bodies' tolerance in the robot file, link by link through
//! inverse dynamics, and of what the encoders' steps leave in the acceleration. A contact is a torque beyond
//! [`DETECTION_SIGMAS`] of it, and ends below half of that.
//!
//! Limits: joints whose robot file has the fused estimator calibrated; a payload the robot file does not know is a push
//! that stays; the bodies behind a joint whose link has no encoder are taken to move as its motor does. Late by 6 ms.

use arrayvec::ArrayVec;
use joint_model::JOINTS_MAX;
use joint_model::filter::Butterworth;
use joint_model::rigid_body::{Chain, ChainError};
use robot::{Robot, RobotJoint};

use crate::{Estimate, EstimatorError, GAP_MAX_CYCLES, Sample};

/// Above what arms are pushed with (a blow of 10 ms has half of its energy below), where the encoders' steps still count
/// less than the joint torque's own error.
const CUTOFF_HZ: f64 = 40.0;
/// A blow must stand out from the errors of many hours, which are no white noise: measured, not computed.
pub const DETECTION_SIGMAS: f64 = 5.0;
/// Of the threshold: below this a contact is over.
const RELEASE_SHARE: f64 = 0.5;
/// Filters and the fused estimator have forgotten how they began.
const SETTLING_S: f64 = 0.25;

/// What pushes a joint's link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct External {
    /// About the joint's axis, joint side.
    pub torque_nm: f64,
    /// One standard deviation, the model's tolerance included.
    pub std_nm: f64,
    /// Beyond the threshold, or not yet back below half of it.
    pub is_contact: bool,
}

impl External {
    /// From this magnitude on it is a contact.
    pub fn threshold_nm(&self) -> f64 {
        DETECTION_SIGMAS * self.std_nm
    }
}

/// The external torques of one arm.
#[derive(Clone, Debug)]
pub struct ExternalTorque {
    chain: Chain,
    /// The chain with one link heavier by its tolerance, link by link.
    heavier: ArrayVec<Chain, JOINTS_MAX>,
    /// What that changes about the torques; one link is taken anew each cycle.
    tolerances_nm: [[f64; JOINTS_MAX]; JOINTS_MAX],
    joints: ArrayVec<Joint, JOINTS_MAX>,
    newest_cycle: Option<u64>,
    settling_cycles: u64,
    period_s: f64,
}

/// One joint's smoothed signals.
#[derive(Clone, Debug)]
struct Joint {
    gear_ratio: f64,
    has_link_encoder: bool,
    position_rad: Smoothed,
    torque_nm: Smoothed,
    /// Of the newest fused torque.
    torque_var_nm2: f64,
    /// Of what the encoder's steps make of an acceleration.
    step_var_nm2: f64,
    is_contact: bool,
}

/// The arm's motion at one instant.
struct Motion {
    position_rad: [f64; JOINTS_MAX],
    velocity_rad_s: [f64; JOINTS_MAX],
    acceleration_rad_s2: [f64; JOINTS_MAX],
}

impl ExternalTorque {
    /// An observer with the robot file's bodies and their tolerance.
    ///
    /// # Errors
    /// [`EstimatorError`] if the control period is too long for its filter, or the bodies are too light for their tolerance.
    pub fn new(robot: &Robot, period_s: f64) -> Result<Self, EstimatorError> {
        let filter = Butterworth::design(2, CUTOFF_HZ, 1.0 / period_s)
            .map_err(EstimatorError::ExternalFilter)?;
        let noise_gain = acceleration_noise_gain(filter.clone(), period_s);
        let joints = robot.joints.iter();
        Ok(Self {
            heavier: heavier_chains(robot).map_err(EstimatorError::Bodies)?,
            chain: robot.chain.clone(),
            tolerances_nm: [[0.0; JOINTS_MAX]; JOINTS_MAX],
            joints: joints
                .take(JOINTS_MAX)
                .map(|joint| Joint::new(joint, &filter, noise_gain))
                .collect(),
            newest_cycle: None,
            settling_cycles: (SETTLING_S / period_s).ceil() as u64,
            period_s,
        })
    }

    /// The external torque of each joint whose fused torque is there, after one more sample of every joint.
    ///
    /// A cycle in which a joint's position is missing gives none; the next one bridges it.
    pub fn estimate(
        &mut self,
        samples: &[Sample],
        fused: &[Option<Estimate>],
    ) -> [Option<External>; JOINTS_MAX] {
        let mut found = [None; JOINTS_MAX];
        let Some(cycle) = self.take(samples, fused) else {
            return found;
        };
        let motion = self.motion();
        let modelled_nm = self.torques_nm(&self.chain, &motion);
        self.refresh_tolerance(cycle, &motion, &modelled_nm);
        for (index, joint) in self.joints.iter_mut().enumerate() {
            let Some(torque_nm) = joint.torque_nm.settled(self.settling_cycles) else {
                joint.is_contact = false;
                continue;
            };
            let links = self.tolerances_nm.iter();
            let model_var_nm2: f64 = links.map(|torques_nm| torques_nm[index].powi(2)).sum();
            let variance_nm2 = joint.torque_var_nm2 + joint.step_var_nm2 + model_var_nm2;
            found[index] = Some(joint.judge(modelled_nm[index] - torque_nm, variance_nm2.sqrt()));
        }
        found
    }

    /// Takes the samples if every joint has its position; the cycle, then.
    fn take(&mut self, samples: &[Sample], fused: &[Option<Estimate>]) -> Option<u64> {
        let cycle = samples.first()?.cycle;
        let position = |(joint, sample): (&Joint, &Sample)| joint.position_rad(sample);
        let all = self.joints.iter().zip(samples);
        if all
            .map(position)
            .any(|position_rad| !position_rad.is_finite())
        {
            return None;
        }
        let cycles = match self.newest_cycle.replace(cycle) {
            Some(before) => cycle.saturating_sub(before),
            None => u64::MAX,
        };
        for ((joint, sample), fused) in self.joints.iter_mut().zip(samples).zip(fused) {
            let position_rad = joint.position_rad(sample);
            joint.position_rad.take(position_rad, cycles);
            match fused {
                Some(fused) => {
                    joint.torque_nm.take(fused.torque_nm, cycles);
                    joint.torque_var_nm2 = fused.std_nm.map_or(0.0, |std_nm| std_nm * std_nm);
                }
                None => joint.torque_nm.begin_again(),
            }
        }
        (cycles > 0).then_some(cycle)
    }

    fn motion(&self) -> Motion {
        let mut motion = Motion {
            position_rad: [0.0; JOINTS_MAX],
            velocity_rad_s: [0.0; JOINTS_MAX],
            acceleration_rad_s2: [0.0; JOINTS_MAX],
        };
        let step_s = self.period_s;
        for (index, joint) in self.joints.iter().enumerate() {
            let [before, now, after] = joint.position_rad.newest;
            motion.position_rad[index] = now;
            motion.velocity_rad_s[index] = (after - before) / (2.0 * step_s);
            motion.acceleration_rad_s2[index] = (after - 2.0 * now + before) / (step_s * step_s);
        }
        motion
    }

    fn torques_nm(&self, chain: &Chain, motion: &Motion) -> [f64; JOINTS_MAX] {
        let count = self.joints.len();
        let mut torque_nm = [0.0; JOINTS_MAX];
        chain.inverse_dynamics(
            &motion.position_rad[..count],
            &motion.velocity_rad_s[..count],
            &motion.acceleration_rad_s2[..count],
            &mut torque_nm[..count],
        );
        torque_nm
    }

    /// One link a cycle: what its tolerance changes depends on pose and acceleration, which seven cycles hardly change.
    fn refresh_tolerance(&mut self, cycle: u64, motion: &Motion, modelled_nm: &[f64; JOINTS_MAX]) {
        let count = self.heavier.len();
        if count == 0 {
            return;
        }
        let link = (cycle % count as u64) as usize;
        let heavier_nm = self.torques_nm(&self.heavier[link], motion);
        for (joint, change_nm) in self.tolerances_nm[link].iter_mut().enumerate() {
            *change_nm = heavier_nm[joint] - modelled_nm[joint];
        }
    }
}

impl Joint {
    fn new(joint: &RobotJoint, filter: &Butterworth, noise_gain: f64) -> Self {
        let link_step_rad = joint.link_encoder_resolution_rad;
        let motor_step_rad = joint.motor_encoder_resolution_rad.unwrap_or(0.0) / joint.gear_ratio;
        let step_rad = link_step_rad.unwrap_or(motor_step_rad);
        let fusion = joint
            .estimators
            .as_ref()
            .and_then(|known| known.fusion.as_ref());
        let inertia_kg_m2 = fusion.map_or(0.0, |fusion| fusion.link_inertia_kg_m2);
        // a value rounded to a step is uniformly distributed over it
        let variance_rad2 = step_rad * step_rad / 12.0 + joint.position_noise_rad.powi(2);
        Self {
            gear_ratio: joint.gear_ratio,
            has_link_encoder: link_step_rad.is_some(),
            position_rad: Smoothed::new(filter.clone()),
            torque_nm: Smoothed::new(filter.clone()),
            torque_var_nm2: 0.0,
            step_var_nm2: (inertia_kg_m2 * noise_gain).powi(2) * variance_rad2,
            is_contact: false,
        }
    }

    fn position_rad(&self, sample: &Sample) -> f64 {
        if self.has_link_encoder {
            sample.link_position_rad
        } else {
            sample.motor_position_rad / self.gear_ratio
        }
    }

    fn judge(&mut self, torque_nm: f64, std_nm: f64) -> External {
        let share = if self.is_contact { RELEASE_SHARE } else { 1.0 };
        self.is_contact = torque_nm.abs() > share * DETECTION_SIGMAS * std_nm;
        External {
            torque_nm,
            std_nm,
            is_contact: self.is_contact,
        }
    }
}

/// A signal through the low-pass, and its three newest outputs.
#[derive(Clone, Debug)]
struct Smoothed {
    filter: Butterworth,
    input: f64,
    newest: [f64; 3],
    /// Since it began.
    age_cycles: Option<u64>,
}

impl Smoothed {
    fn new(filter: Butterworth) -> Self {
        Self {
            filter,
            input: 0.0,
            newest: [0.0; 3],
            age_cycles: None,
        }
    }

    fn begin_again(&mut self) {
        self.age_cycles = None;
    }

    /// Takes the value that so many cycles have led to. Held instead of bridged, a lost one would look like a jolt.
    fn take(&mut self, value: f64, cycles: u64) {
        match &mut self.age_cycles {
            Some(age_cycles) if cycles <= GAP_MAX_CYCLES => {
                *age_cycles += cycles;
                for cycle in 1..=cycles {
                    let share = cycle as f64 / cycles as f64;
                    let between = self.input + share * (value - self.input);
                    self.newest = [self.newest[1], self.newest[2], self.filter.step(between)];
                }
            }
            _ => {
                self.filter.reset(value);
                self.newest = [value; 3];
                self.age_cycles = Some(0);
            }
        }
        self.input = value;
    }

    /// The output of one cycle ago, about which differences are taken.
    fn settled(&self, settling_cycles: u64) -> Option<f64> {
        let age_cycles = self.age_cycles?;
        (age_cycles >= settling_cycles).then_some(self.newest[1])
    }
}

/// Standard deviation of the smoothed second difference of white noise, per that of the noise.
fn acceleration_noise_gain(mut filter: Butterworth, period_s: f64) -> f64 {
    const RESPONSE: usize = 1000;
    filter.reset(0.0);
    let mut newest = [0.0; 3];
    let mut squares = 0.0;
    for cycle in 0..RESPONSE {
        let impulse = if cycle == 0 { 1.0 } else { 0.0 };
        newest = [newest[1], newest[2], filter.step(impulse)];
        squares += ((newest[2] - 2.0 * newest[1] + newest[0]) / (period_s * period_s)).powi(2);
    }
    squares.sqrt()
}

/// Mass and centre, both uncertain in proportion, change gravity alike: one factor stands for both.
fn heavier_chains(robot: &Robot) -> Result<ArrayVec<Chain, JOINTS_MAX>, ChainError> {
    let tolerance = &robot.tolerance;
    let relative = tolerance
        .of("mass_kg")
        .hypot(tolerance.of("centre_of_mass_m"));
    let links = 0..robot.chain.joint_count().min(JOINTS_MAX);
    links
        .map(|link| robot.chain.with_heavier_link(link, 1.0 + relative))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    /// The single joint, as if its fused estimator were calibrated.
    fn observer() -> (ExternalTorque, Robot) {
        let robot = robot::load("shd17").unwrap();
        (ExternalTorque::new(&robot, PERIOD_S).unwrap(), robot)
    }

    fn position_rad(time_s: f64) -> f64 {
        0.5 * (5.0 * time_s).sin()
    }

    fn sample(cycle: u64) -> Sample {
        let link_position_rad = position_rad(cycle as f64 * PERIOD_S);
        Sample {
            cycle,
            motor_position_rad: 100.0 * link_position_rad,
            link_position_rad,
            motor_torque_nm: f64::NAN,
            load_nm: 0.0,
        }
    }

    /// What the link needs, less what pushes it.
    fn fused(robot: &Robot, cycle: u64, push_nm: f64) -> Option<Estimate> {
        let time_s = cycle as f64 * PERIOD_S;
        let mut torque_nm = [0.0];
        robot.chain.inverse_dynamics(
            &[position_rad(time_s)],
            &[2.5 * (5.0 * time_s).cos()],
            &[-12.5 * (5.0 * time_s).sin()],
            &mut torque_nm,
        );
        Some(Estimate {
            torque_nm: torque_nm[0] - push_nm,
            std_nm: Some(0.1),
        })
    }

    #[test]
    fn what_the_bodies_explain_is_no_push_and_the_rest_is_even_with_samples_lost() {
        let (mut observer, robot) = observer();
        for cycle in (0..3000).filter(|cycle| cycle % 7 != 3) {
            let push_nm = if cycle < 1500 { 0.0 } else { 2.0 };
            let found = observer.estimate(&[sample(cycle)], &[fused(&robot, cycle, push_nm)]);
            // settled after a quarter of a second, and after the low-pass has swung out
            if (600..1500).contains(&cycle) || cycle > 1575 {
                let found = found[0].unwrap();
                assert!(
                    (found.torque_nm - push_nm).abs() < 0.02,
                    "{cycle} {found:?}"
                );
                assert_eq!(found.is_contact, push_nm > 0.0);
            }
        }
    }

    #[test]
    fn the_link_by_hand() {
        // about the joint: 0.03345 + 1.841·0.3717² = 0.28780 kg m², and 1.841·9.81·0.3717 = 6.7130 Nm of gravity
        let gravity_nm = |rad: f64| 6.7130 * rad.sin();
        // at 2 rad/s² from -0.3 rad on, while the gear carries 1.5 Nm too little of gravity; all 6.3 ms late
        let position_rad = |time_s: f64| -0.3 + time_s * time_s;
        let (mut observer, _) = observer();
        for cycle in 0..900 {
            let time_s = cycle as f64 * PERIOD_S;
            let moving = Sample {
                link_position_rad: position_rad(time_s),
                ..sample(cycle)
            };
            let torque = Estimate::bare(gravity_nm(position_rad(time_s)) - 1.5);
            if let Some(found) = observer.estimate(&[moving], &[Some(torque)])[0] {
                let expected_nm = 0.28780 * 2.0 + 1.5;
                assert!((found.torque_nm - expected_nm).abs() < 2e-3, "{found:?}");
            }
        }
    }

    #[test]
    fn the_threshold_follows_the_estimate_and_the_bodies_tolerance() {
        let (mut observer, robot) = observer();
        let mut found = None;
        for cycle in 0..600 {
            let at_rest = Sample {
                link_position_rad: 1.0,
                ..sample(cycle)
            };
            found = observer.estimate(&[at_rest], &[fused(&robot, 0, 0.0)])[0];
        }
        // 2 % of mass and of centre each, of 1.841·9.81·0.3717·sin 1 Nm
        let gravity_nm = 1.841 * 9.81 * 0.3717 * 1.0_f64.sin();
        let expected_nm = 0.1_f64.hypot(0.02 * 2.0_f64.sqrt() * gravity_nm);
        let found = found.unwrap();
        assert!((found.std_nm - expected_nm).abs() < 1e-3, "{found:?}");
        assert_eq!(found.threshold_nm(), DETECTION_SIGMAS * found.std_nm);
    }

    #[test]
    fn a_contact_ends_well_below_where_it_began() {
        let (mut observer, _) = observer();
        let joint = &mut observer.joints[0];
        let told =
            [4.9, 5.1, 4.0, 2.6, 2.4, 4.9].map(|sigmas| joint.judge(-sigmas, 1.0).is_contact);
        assert_eq!(told, [false, true, true, true, false, false]);
    }

    #[test]
    fn without_a_fused_torque_there_is_none_and_after_one_it_settles_anew() {
        let (mut observer, robot) = observer();
        let mut settled = 0;
        for cycle in 0..1200 {
            let torque = fused(&robot, cycle, 0.0).filter(|_| cycle != 600);
            let found = observer.estimate(&[sample(cycle)], &[torque]);
            settled += usize::from(found[0].is_some());
        }
        assert_eq!(settled, (600 - 375) + (1200 - 601 - 375));
    }
}
