//! Ours: torsion, torsion rate and motor-side momentum in one extended Kalman filter, with a standard deviation.
//!
//! State, joint side: motor angle over gear ratio `φ` and its rate `ω`, link angle `q` and rate `v`, a friction bias `f` and the
//! torque `w` that acts on the link besides the gear's (gravity, contact, coupling).
//!
//! ```text
//! J ω̇ = N T_m - f_c tanh(ω/ω_0) - f_v ω - f - λ T      φ̇ = ω      λ = 1 - N dθ_ke/dθ_m
//! M v̇ = T + w                                          q̇ = v
//! T    = torsion law(x) + B ẋ,     x = φ - θ_ke(N φ) - q - x_0,     ẋ = λ ω - v
//! ```
//!
//! `f` and `w` wander; `f` wanders fast while the joint is slow, where friction takes any value up to breakaway. Measured are
//! `φ` and `q`, each as uncertain as its encoder's step. So torsion tells the torque at any time, static load included, and the
//! two inertias, with motor torque on one side, tell how torsion can have changed within a sample: the encoders' steps are
//! averaged without delay. Source of the filter: Simon, Optimal State Estimation (2006), section 13.2; measurements one
//! after the other, section 6.1. The torsion law: [`TorsionLaw`]. The standard deviation is that of the filter plus the torsion
//! law's own error as the calibration saw it, moving and standing.
//!
//! Limits: needs both encoders; motor torque may be missing for [`GAP_MAX_CYCLES`](crate::GAP_MAX_CYCLES), then friction's
//! bias would have to take its part. The kinematic error is fixed to the motor encoder's zero. Stiffness that ages is an error in
//! proportion, and the standard deviation does not know of it.

mod kalman;
mod torsion_law;

pub use torsion_law::{Plays, TorsionLaw};

use robot::RobotJoint;
use robot::estimators::FusionParameters;

use crate::kinematic_error::KinematicError;
use crate::{Estimate, GAP_MAX_CYCLES, Missing, Sample, TorqueEstimator};
use kalman::{Covariance, STATES};
use recording::Signal;

const PHI: usize = 0;
const OMEGA: usize = 1;
const LINK: usize = 2;
const LINK_RATE: usize = 3;
const FRICTION: usize = 4;
const WRENCH: usize = 5;

/// `ω_0`: half of a usual encoder's step in a period.
const REVERSAL_RAD_S: f64 = 0.005;
/// Below this speed friction's bias wanders as fast as at rest.
const SLOW_RAD_S: f64 = 0.03;
/// How far friction's bias wanders in a second of motion, Nm/√s.
const FRICTION_WANDER_NM: f64 = 2.0;
/// The same at rest and at reversals: some Nm within 10 ms.
const FRICTION_WANDER_SLOW_NM: f64 = 60.0;
/// How far the torque on the link wanders in a second: gravity of a swinging link changes by 10 Nm/s.
const WRENCH_WANDER_NM: f64 = 10.0;
/// Accelerations that no state has, rad/s/√s.
const RATE_WANDER_RAD_S: f64 = 0.05;

/// One joint's fused estimator.
#[derive(Clone, Debug)]
pub struct Fusion {
    constants: Constants,
    state: [f64; STATES],
    covariance: Covariance,
    plays: Plays,
    newest_cycle: Option<u64>,
    /// The last motor torque, joint side, and its cycle.
    drive: Option<(u64, f64)>,
}

#[derive(Clone, Debug)]
struct Constants {
    law: TorsionLaw,
    kinematic_error: KinematicError,
    zero_rad: f64,
    damping_nm_s_rad: f64,
    coulomb_nm: f64,
    viscous_nm_s_rad: f64,
    rotor_kg_m2: f64,
    link_kg_m2: f64,
    moving_var_nm2: f64,
    resting_var_nm2: f64,
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
    /// [`NoResolution`] without an encoder's step.
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
        let constants = Constants {
            law: TorsionLaw::new(parameters),
            kinematic_error: KinematicError::new(&parameters.kinematic_error),
            zero_rad: parameters.zero_rad,
            damping_nm_s_rad: parameters.damping_nm_s_rad,
            coulomb_nm: parameters.coulomb_nm,
            viscous_nm_s_rad: parameters.viscous_nm_s_rad,
            rotor_kg_m2: joint.rotor_inertia_kg_m2 * joint.gear_ratio.powi(2),
            link_kg_m2: parameters.link_inertia_kg_m2,
            moving_var_nm2: parameters.moving_std_nm.powi(2),
            resting_var_nm2: parameters.resting_std_nm.powi(2),
            gear_ratio: joint.gear_ratio,
            period_s,
            motor_var_rad2: variance(motor_step_rad, noise_rad / joint.gear_ratio),
            link_var_rad2: variance(link_step_rad, noise_rad),
        };
        Ok(Self {
            constants,
            state: [0.0; STATES],
            covariance: Covariance::default(),
            plays: Plays::default(),
            newest_cycle: None,
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

    fn begin(&mut self, sample: &Sample) -> Result<(), Missing> {
        let motor_rad = sample.motor_position_rad()? / self.constants.gear_ratio;
        let link_rad = sample.link_position_rad()?;
        self.state = [motor_rad, 0.0, link_rad, 0.0, 0.0, 0.0];
        // at rest within a slow motion, under any friction and load a joint may have
        self.covariance = Covariance::diagonal([
            self.constants.motor_var_rad2,
            1e-4,
            self.constants.link_var_rad2,
            1e-4,
            10.0,
            100.0,
        ]);
        self.plays = Plays::default();
        Ok(())
    }

    fn advance(&mut self, drive_nm: f64) {
        let constants = &self.constants;
        let step_s = constants.period_s;
        let now = constants.accelerations(&self.state, &self.plays, drive_nm);
        let mut middle = self.state;
        middle[PHI] += 0.5 * step_s * self.state[OMEGA];
        middle[LINK] += 0.5 * step_s * self.state[LINK_RATE];
        middle[OMEGA] += 0.5 * step_s * now.motor_rad_s2;
        middle[LINK_RATE] += 0.5 * step_s * now.link_rad_s2;
        let then = constants.accelerations(&middle, &self.plays, drive_nm);
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
        for (state, variance) in [
            (OMEGA, RATE_WANDER_RAD_S.powi(2)),
            (LINK_RATE, RATE_WANDER_RAD_S.powi(2)),
            (FRICTION, friction_var),
            (WRENCH, WRENCH_WANDER_NM.powi(2)),
        ] {
            self.covariance.widen(state, step_s * variance);
        }
    }

    /// Corrects by what was measured; says which position was not.
    fn correct(&mut self, sample: &Sample) {
        let motor_rad = sample.motor_position_rad / self.constants.gear_ratio;
        for (state, measured_rad, variance_rad2) in [
            (PHI, motor_rad, self.constants.motor_var_rad2),
            (LINK, sample.link_position_rad, self.constants.link_var_rad2),
        ] {
            if measured_rad.is_finite() {
                self.covariance
                    .correct(&mut self.state, state, measured_rad, variance_rad2);
            }
        }
    }

    fn output(&mut self) -> Estimate {
        let constants = &self.constants;
        let gear = constants.gear(&self.state, &self.plays);
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
        // at rest an encoder reads the same step for ever: what it rounds away is no noise that averaging removes
        let rounding_var_nm2 =
            slow * gear.slope_nm_rad.powi(2) * (constants.motor_var_rad2 + constants.link_var_rad2);
        let variance_nm2 = self.covariance.variance_along(&slopes) + rounding_var_nm2 + law_var_nm2;
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
            for _ in 0..cycles {
                self.advance(drive_nm);
            }
            self.correct(sample);
        }
        Ok(self.output())
    }
}

impl Constants {
    fn gear(&self, state: &[f64; STATES], plays: &Plays) -> Gear {
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
            torque_nm: elastic_nm + self.damping_nm_s_rad * rate_rad_s,
            slope_nm_rad,
        }
    }

    fn accelerations(&self, state: &[f64; STATES], plays: &Plays, drive_nm: f64) -> Accelerations {
        let gear = self.gear(state, plays);
        let sign = (state[OMEGA] / REVERSAL_RAD_S).tanh();
        let friction_nm =
            self.coulomb_nm * sign + self.viscous_nm_s_rad * state[OMEGA] + state[FRICTION];
        Accelerations {
            motor_rad_s2: (drive_nm - friction_nm - gear.lever * gear.torque_nm) / self.rotor_kg_m2,
            link_rad_s2: (gear.torque_nm + state[WRENCH]) / self.link_kg_m2,
            friction_nm_s_rad: self.coulomb_nm * (1.0 - sign * sign) / REVERSAL_RAD_S
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
mod testing {
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
            moving_std_nm: 0.0,
            resting_std_nm: 0.0,
        }
    }
}

#[cfg(test)]
mod tests;
