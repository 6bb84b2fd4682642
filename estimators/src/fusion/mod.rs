//! Ours: torsion, torsion rate and motor-side momentum in one extended Kalman filter, with a standard deviation.
//!
//! State, joint side: motor angle over gear ratio `φ` and its rate `ω`, link angle `q` and rate `v`, a friction bias `f` and the
//! torque `w` that acts on the link besides gear and gravity: contact, coupling, the torsion law's error.
//!
//! ```text
//! J ω̇ = N T_m - f_c tanh(ω/ω_0) - f_v ω - f - λ T      φ̇ = ω      λ = 1 - N dθ_ke/dθ_m
//! M v̇ = T - g + w                                      q̇ = v
//! T    = k·torsion law(x) + B ẋ,     x = φ - θ_ke(N φ) - q - x_0,     ẋ = λ ω - v
//! ```
//!
//! `f` wanders; `f` wanders fast while the joint is slow, where friction takes any value up to breakaway. While gear and
//! gravity explain the link's motion, `w` stays about as small as the calibration saw it (a process of Ornstein and
//! Uhlenbeck); what goes beyond is a contact or a payload, and `w` wanders freely. Measured are `φ` and `q`, each as uncertain as
//! its encoder's step, and the less new the longer the reading has not changed, which in turn says that the rate is small. So
//! torsion tells the torque at any time; the two inertias, with motor torque on one side, tell how torsion can have changed within
//! a sample, so that the encoders' steps are averaged without delay; at rest gravity tells what a step has rounded away.
//! `k`, the gear's stiffness over the calibration's, is followed slowly beside the filter where the calibration found that
//! possible: [`stiffness`]. Source of the
//! filter: Simon, Optimal State Estimation (2006), section 13.2; measurements one after the other, section 6.1. The torsion law:
//! [`TorsionLaw`]. The standard deviation is that of the filter and of `k`, plus the torsion law's own error as the calibration saw
//! it, moving and standing.
//!
//! Limits: needs both encoders; motor torque may be missing for [`GAP_MAX_CYCLES`](crate::GAP_MAX_CYCLES), then friction's
//! bias would have to take its part. The kinematic error is fixed to the motor encoder's zero. A push or a payload of less than
//! three times `free_std_nm` may be taken for the torsion law's error.

mod kalman;
mod stiffness;
mod torsion_law;

pub use torsion_law::{Plays, TorsionLaw};

use robot::RobotJoint;
use robot::estimators::FusionParameters;

use crate::kinematic_error::KinematicError;
use crate::{Estimate, GAP_MAX_CYCLES, Missing, Sample, TorqueEstimator};
use kalman::{Covariance, STATES};
use recording::Signal;
use stiffness::{Moment, Stiffness};

const PHI: usize = 0;
const OMEGA: usize = 1;
const LINK: usize = 2;
const LINK_RATE: usize = 3;
const FRICTION: usize = 4;
const WRENCH: usize = 5;

/// `ω_0` at least: half of a usual encoder's step in a period.
const REVERSAL_MIN_RAD_S: f64 = 0.005;
/// Of the velocity that Coulomb friction takes from the rotor in a period, `ω_0` at least: with less, a step overshoots.
const REVERSAL_PERIODS: f64 = 2.0;
/// Below this speed friction's bias wanders as fast as at rest.
const SLOW_RAD_S: f64 = 0.03;
/// How far friction's bias wanders in a second of motion, Nm/√s.
const FRICTION_WANDER_NM: f64 = 2.0;
/// The same at rest and at reversals: some Nm within 10 ms.
const FRICTION_WANDER_SLOW_NM: f64 = 60.0;
/// How far the torque on the link wanders in a second of contact.
const WRENCH_WANDER_NM: f64 = 10.0;
/// How long the torque on a free link stays alike: as long as a torsion law's error, a swing's tenth.
const FREE_TIME_S: f64 = 0.1;
/// Of the free link's torque: beyond this it is a contact.
const FREE_SIGMAS: f64 = 3.0;
/// Accelerations that no state has, rad/s/√s.
const RATE_WANDER_RAD_S: f64 = 0.05;
/// The same at rest, where encoders tell too little to take it back.
const RATE_WANDER_SLOW_RAD_S: f64 = 0.005;

/// A reading gets no less new after so many samples, 1 s: it still says where the joint is.
const STALE_SAMPLES: u32 = 1500;
/// A reading that repeats although the joint must have passed so many steps was not taken anew: its sample was lost on the way.
const FROZEN_STEPS: f64 = 5.0;
/// For so many samples in a row; then the joint is taken to have stopped.
const FROZEN_SAMPLES_MAX: u32 = 3;
/// A reading that has not changed for so many samples, 10 ms, says that the rate is below a step in that time.
const STANDING_SAMPLES: u32 = 15;

/// One joint's fused estimator.
#[derive(Clone, Debug)]
pub struct Fusion {
    constants: Constants,
    state: [f64; STATES],
    covariance: Covariance,
    stiffness: Stiffness,
    plays: Plays,
    newest_cycle: Option<u64>,
    readings: [Reading; 2],
    /// The last motor torque, joint side, and its cycle.
    drive: Option<(u64, f64)>,
}

/// An encoder's newest value, and for how many samples it has been the same.
#[derive(Clone, Copy, Debug, Default)]
struct Reading {
    value_rad: f64,
    repeated: u32,
}

#[derive(Clone, Debug)]
struct Constants {
    law: TorsionLaw,
    kinematic_error: KinematicError,
    zero_rad: f64,
    damping_nm_s_rad: f64,
    coulomb_nm: f64,
    viscous_nm_s_rad: f64,
    /// `ω_0`.
    reversal_rad_s: f64,
    rotor_kg_m2: f64,
    link_kg_m2: f64,
    moving_var_nm2: f64,
    resting_var_nm2: f64,
    gravity_share: f64,
    free_var_nm2: f64,
    gear_ratio: f64,
    period_s: f64,
    /// Variances of the two encoders, joint side.
    motor_var_rad2: f64,
    link_var_rad2: f64,
}

/// What the joint lacks for the fused estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the robot file has no {0}, which the fused estimator weighs the encoder by")]
pub struct NoResolution(pub &'static str);

/// The gear at one state: kinematics, torque and slopes.
struct Gear {
    lever: f64,
    torsion_rad: f64,
    torque_nm: f64,
    slope_nm_rad: f64,
    /// Of the torsion law alone, at the calibration's stiffness.
    elastic_nm: f64,
}

/// What acts on both sides in a step, joint side.
#[derive(Clone, Copy)]
struct Forces {
    drive_nm: f64,
    /// Gravity of the link.
    load_nm: f64,
    /// Over the calibration's.
    stiffness: f64,
}

/// How fast the two velocities change.
struct Accelerations {
    motor_rad_s2: f64,
    link_rad_s2: f64,
    /// Of friction over velocity.
    friction_nm_s_rad: f64,
    gear: Gear,
}

impl Fusion {
    /// An estimator with these parameters; rotor inertia and encoder steps are the robot file's.
    ///
    /// # Errors
    /// `NoResolution` without an encoder's step.
    pub fn new(
        parameters: &FusionParameters,
        joint: &RobotJoint,
        period_s: f64,
    ) -> Result<Self, NoResolution> {
        let motor_step_rad = joint
            .motor_encoder_resolution_rad
            .ok_or(NoResolution("motor_encoder_resolution_rad"))?
            / joint.gear_ratio;
        let link_step_rad = joint
            .link_encoder_resolution_rad
            .ok_or(NoResolution("link_encoder_resolution_rad"))?;
        // a value rounded to a step is uniformly distributed over it
        let variance =
            |step_rad: f64, noise_rad: f64| step_rad * step_rad / 12.0 + noise_rad * noise_rad;
        let noise_rad = joint.position_noise_rad;
        let rotor_kg_m2 = joint.reflected_inertia_kg_m2();
        let constants = Constants {
            law: TorsionLaw::new(parameters),
            kinematic_error: KinematicError::new(&parameters.kinematic_error),
            zero_rad: parameters.zero_rad,
            damping_nm_s_rad: parameters.damping_nm_s_rad,
            coulomb_nm: parameters.coulomb_nm,
            viscous_nm_s_rad: parameters.viscous_nm_s_rad,
            reversal_rad_s: REVERSAL_MIN_RAD_S
                .max(REVERSAL_PERIODS * parameters.coulomb_nm * period_s / rotor_kg_m2),
            rotor_kg_m2,
            link_kg_m2: parameters.link_inertia_kg_m2,
            moving_var_nm2: parameters.moving_std_nm.powi(2),
            resting_var_nm2: parameters.resting_std_nm.powi(2),
            gravity_share: parameters.gravity_share,
            free_var_nm2: parameters.free_std_nm.powi(2),
            gear_ratio: joint.gear_ratio,
            period_s,
            motor_var_rad2: variance(motor_step_rad, noise_rad / joint.gear_ratio),
            link_var_rad2: variance(link_step_rad, noise_rad),
        };
        Ok(Self {
            state: [0.0; STATES],
            covariance: Covariance::default(),
            stiffness: Stiffness::new(&constants, parameters.follows_stiffness),
            constants,
            plays: Plays::default(),
            newest_cycle: None,
            readings: [Reading::default(); 2],
            drive: None,
        })
    }

    /// Motor angle over gear ratio, link angle and their rates, as the filter has them.
    pub fn motion(&self) -> Motion {
        Motion {
            motor_rad: self.state[PHI],
            motor_rad_s: self.state[OMEGA],
            link_rad: self.state[LINK],
            link_rad_s: self.state[LINK_RATE],
        }
    }

    /// Stiffness over the calibration's, as far as it is known.
    pub(crate) fn stiffness_factor(&self) -> f64 {
        self.stiffness.factor()
    }

    fn begin(&mut self, sample: &Sample) -> Result<(), Missing> {
        let motor_rad = sample.motor_position_rad()? / self.constants.gear_ratio;
        let link_rad = sample.link_position_rad()?;
        self.state = [motor_rad, 0.0, link_rad, 0.0, 0.0, 0.0];
        // at rest within a slow motion, under any friction and contact a joint may have
        self.covariance = Covariance::diagonal([
            self.constants.motor_var_rad2,
            1e-4,
            self.constants.link_var_rad2,
            1e-4,
            10.0,
            100.0,
        ]);
        self.stiffness.pause();
        self.plays = Plays::default();
        Ok(())
    }

    fn advance(&mut self, drive_nm: f64, load_nm: f64) {
        let constants = &self.constants;
        let step_s = constants.period_s;
        let forces = Forces {
            drive_nm,
            load_nm,
            stiffness: self.stiffness.factor(),
        };
        let now = constants.accelerations(&self.state, &self.plays, forces);
        let mut middle = self.state;
        middle[PHI] += 0.5 * step_s * self.state[OMEGA];
        middle[LINK] += 0.5 * step_s * self.state[LINK_RATE];
        middle[OMEGA] += 0.5 * step_s * now.motor_rad_s2;
        middle[LINK_RATE] += 0.5 * step_s * now.link_rad_s2;
        let then = constants.accelerations(&middle, &self.plays, forces);
        self.state[PHI] += step_s * middle[OMEGA];
        self.state[LINK] += step_s * middle[LINK_RATE];
        self.state[OMEGA] += step_s * then.motor_rad_s2;
        self.state[LINK_RATE] += step_s * then.link_rad_s2;
        self.covariance.turn(
            OMEGA,
            constants.motor_row(&then).map(|slope| step_s * slope),
        );
        self.covariance.turn(
            LINK_RATE,
            constants.link_row(&then).map(|slope| step_s * slope),
        );
        self.covariance.follow(PHI, OMEGA, step_s);
        self.covariance.follow(LINK, LINK_RATE, step_s);
        let slow = slowness(self.state[OMEGA]);
        let friction_var = FRICTION_WANDER_NM.powi(2) + slow * FRICTION_WANDER_SLOW_NM.powi(2);
        let rate_var =
            slow * RATE_WANDER_SLOW_RAD_S.powi(2) + (1.0 - slow) * RATE_WANDER_RAD_S.powi(2);
        let stiffness_var = self.stiffness.variance();
        let mut wrench_var = WRENCH_WANDER_NM.powi(2);
        if constants.is_free(self.state[WRENCH], then.gear.elastic_nm, stiffness_var) {
            let fading = -step_s / FREE_TIME_S;
            self.state[WRENCH] += fading * self.state[WRENCH];
            self.covariance.follow(WRENCH, WRENCH, fading);
            wrench_var = 2.0 * constants.free_var_nm2 / FREE_TIME_S;
        }
        for (state, variance) in [
            (OMEGA, rate_var),
            (LINK_RATE, rate_var),
            (FRICTION, friction_var),
            (WRENCH, wrench_var),
        ] {
            self.covariance.widen(state, step_s * variance);
        }
    }

    /// Corrects by what was measured; says which position was not.
    fn correct(&mut self, sample: &Sample) {
        let motor_rad = sample.motor_position_rad / self.constants.gear_ratio;
        let measured = [
            (PHI, motor_rad, self.constants.motor_var_rad2),
            (LINK, sample.link_position_rad, self.constants.link_var_rad2),
        ];
        for ((state, measured_rad, step_var_rad2), reading) in
            measured.into_iter().zip(&mut self.readings)
        {
            if !measured_rad.is_finite() {
                continue;
            }
            let staleness = reading.staleness(measured_rad);
            // variance of a value rounded to a step: a twelfth of its square
            let passed_steps2 = (measured_rad - self.state[state]).powi(2) / (12.0 * step_var_rad2);
            if reading.may_be_frozen() && passed_steps2 > FROZEN_STEPS.powi(2) {
                continue;
            }
            let variance_rad2 = step_var_rad2 * staleness;
            self.covariance
                .correct(&mut self.state, state, measured_rad, variance_rad2);
            if reading.repeated >= STANDING_SAMPLES {
                // a step, uniformly distributed, in the time; the same news in every sample
                let time_s = staleness * self.constants.period_s;
                let rate_var = 12.0 * step_var_rad2 / (time_s * time_s) * staleness;
                self.covariance
                    .correct(&mut self.state, state + 1, 0.0, rate_var);
            }
        }
    }

    fn learn_stiffness(&mut self, drive_nm: f64) {
        let gear = self.constants.gear(&self.state, &self.plays, 1.0);
        self.stiffness.take(Moment {
            motor_rad_s: self.state[OMEGA],
            drive_nm,
            gear_nm: gear.lever * gear.torque_nm,
        });
    }

    fn output(&mut self) -> Estimate {
        let constants = &self.constants;
        let gear = constants.gear(&self.state, &self.plays, self.stiffness.factor());
        constants.law.drag(gear.torsion_rad, &mut self.plays);
        let damping = constants.damping_nm_s_rad;
        let slopes = [
            gear.lever * gear.slope_nm_rad,
            gear.lever * damping,
            -gear.slope_nm_rad,
            -damping,
            0.0,
            0.0,
        ];
        let slow = slowness(self.state[OMEGA]);
        let law_var_nm2 =
            slow * constants.resting_var_nm2 + (1.0 - slow) * constants.moving_var_nm2;
        let stiffness_var_nm2 = self.stiffness.variance() * gear.elastic_nm * gear.elastic_nm;
        let variance_nm2 =
            self.covariance.variance_along(&slopes) + stiffness_var_nm2 + law_var_nm2;
        Estimate {
            torque_nm: gear.torque_nm,
            std_nm: Some(variance_nm2.sqrt()),
        }
    }

    /// Motor torque, joint side: the newest, if it is not too old.
    fn drive_nm(&mut self, sample: &Sample) -> Result<f64, Missing> {
        if sample.motor_torque_nm.is_finite() {
            let drive_nm = self.constants.gear_ratio * sample.motor_torque_nm;
            self.drive = Some((sample.cycle, drive_nm));
        }
        self.drive
            .filter(|(cycle, _)| sample.cycle.saturating_sub(*cycle) <= GAP_MAX_CYCLES)
            .map(|(_, drive_nm)| drive_nm)
            .ok_or(Missing(Signal::MotorTorqueNm))
    }
}

impl TorqueEstimator for Fusion {
    fn estimate(&mut self, sample: &Sample) -> Result<Estimate, Missing> {
        let link_rad = sample.link_position_rad()?;
        let motor_rad = sample.motor_position_rad()? / self.constants.gear_ratio;
        let drive_nm = self.drive_nm(sample)?;
        let cycles = self
            .newest_cycle
            .map_or(u64::MAX, |newest| sample.cycle.saturating_sub(newest));
        self.newest_cycle = Some(sample.cycle);
        let is_lost = !(self.state[PHI] - motor_rad).is_finite()
            || !(self.state[LINK] - link_rad).is_finite();
        if cycles > GAP_MAX_CYCLES || is_lost {
            self.begin(sample)?;
        } else {
            let load_nm = self.constants.gravity_share * sample.load_nm;
            for _ in 0..cycles {
                self.advance(drive_nm, load_nm);
            }
            self.correct(sample);
            self.learn_stiffness(drive_nm);
        }
        Ok(self.output())
    }
}

impl Constants {
    fn gear(&self, state: &[f64; STATES], plays: &Plays, stiffness: f64) -> Gear {
        let (error_rad, slope) = self
            .kinematic_error
            .error_and_slope(state[PHI] * self.gear_ratio);
        // `θ_ke` is what torsion reads without torque, so it is taken off
        let lever = 1.0 - self.gear_ratio * slope;
        let torsion_rad = state[PHI] - error_rad - state[LINK] - self.zero_rad;
        let (elastic_nm, slope_nm_rad) = self.law.torque_and_slope(torsion_rad, plays);
        let rate_rad_s = lever * state[OMEGA] - state[LINK_RATE];
        Gear {
            lever,
            torsion_rad,
            torque_nm: stiffness * elastic_nm + self.damping_nm_s_rad * rate_rad_s,
            slope_nm_rad: stiffness * slope_nm_rad,
            elastic_nm,
        }
    }

    /// Do gear and gravity explain the link's motion? What stiffness may have changed is no contact.
    fn is_free(&self, wrench_nm: f64, elastic_nm: f64, stiffness_var: f64) -> bool {
        let expected_nm2 = self.free_var_nm2 + stiffness_var * elastic_nm * elastic_nm;
        wrench_nm * wrench_nm < FREE_SIGMAS.powi(2) * expected_nm2
    }

    fn accelerations(&self, state: &[f64; STATES], plays: &Plays, forces: Forces) -> Accelerations {
        let gear = self.gear(state, plays, forces.stiffness);
        let sign = (state[OMEGA] / self.reversal_rad_s).tanh();
        let friction_nm =
            self.coulomb_nm * sign + self.viscous_nm_s_rad * state[OMEGA] + state[FRICTION];
        Accelerations {
            motor_rad_s2: (forces.drive_nm - friction_nm - gear.lever * gear.torque_nm)
                / self.rotor_kg_m2,
            link_rad_s2: (gear.torque_nm - forces.load_nm + state[WRENCH]) / self.link_kg_m2,
            friction_nm_s_rad: self.coulomb_nm * (1.0 - sign * sign) / self.reversal_rad_s
                + self.viscous_nm_s_rad,
            gear,
        }
    }

    /// Derivatives of `ω̇` by the state.
    fn motor_row(&self, at: &Accelerations) -> [f64; STATES] {
        let (lever, slope) = (at.gear.lever, at.gear.slope_nm_rad);
        let damping = self.damping_nm_s_rad;
        [
            -lever * lever * slope,
            -(at.friction_nm_s_rad + lever * lever * damping),
            lever * slope,
            lever * damping,
            -1.0,
            0.0,
        ]
        .map(|torque| torque / self.rotor_kg_m2)
    }

    /// Derivatives of `v̇` by the state.
    fn link_row(&self, at: &Accelerations) -> [f64; STATES] {
        let (lever, slope) = (at.gear.lever, at.gear.slope_nm_rad);
        let damping = self.damping_nm_s_rad;
        [lever * slope, lever * damping, -slope, -damping, 0.0, 1.0]
            .map(|torque| torque / self.link_kg_m2)
    }
}

impl Reading {
    /// It has just begun to repeat.
    fn may_be_frozen(&self) -> bool {
        (1..=FROZEN_SAMPLES_MAX).contains(&self.repeated)
    }

    /// By how much less a reading tells the longer it stays: what an encoder rounds away is no noise that averaging removes.
    fn staleness(&mut self, value_rad: f64) -> f64 {
        self.repeated = if value_rad == self.value_rad {
            self.repeated.saturating_add(1)
        } else {
            0
        };
        self.value_rad = value_rad;
        1.0 + f64::from(self.repeated.min(STALE_SAMPLES))
    }
}

/// A joint's motion as the filter has it.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Motor angle over gear ratio.
    pub motor_rad: f64,
    /// Its rate.
    pub motor_rad_s: f64,
    /// After the gear.
    pub link_rad: f64,
    /// Its rate.
    pub link_rad_s: f64,
}

/// 1 at rest, 0 in motion.
fn slowness(velocity_rad_s: f64) -> f64 {
    (-(velocity_rad_s / SLOW_RAD_S).powi(2)).exp()
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use robot::estimators::KinematicErrorTable;

    pub fn parameters() -> FusionParameters {
        FusionParameters {
            zero_rad: 0.0,
            kinematic_error: KinematicErrorTable::default(),
            knees_rad: vec![0.0, 2e-4],
            stiffness_steps_nm_rad: vec![5000.0, 3000.0],
            plays_rad: vec![1e-4],
            play_stiffnesses_nm_rad: vec![1000.0],
            damping_nm_s_rad: 1.0,
            coulomb_nm: 2.0,
            viscous_nm_s_rad: 1.0,
            link_inertia_kg_m2: 0.29,
            gravity_share: 1.0,
            free_std_nm: 0.1,
            moving_std_nm: 0.0,
            resting_std_nm: 0.0,
            follows_stiffness: true,
        }
    }
}

#[cfg(test)]
mod tests;
