//! The gear's stiffness over the calibration's, from what the motor has to do, slowly.
//!
//! Over short spans of motion `mean(N T_m) - J Δω/Δt = k·mean(λ T) + c·sgn ω + v·ω + l·sgn ω·|T| + o`: what the drive gives beyond
//! the rotor's inertia goes through the gear, `T` by the torsion law at the calibration's stiffness, or into friction. Friction
//! turns with the direction of motion and the gear's torque does not, so both ways under load tell them apart, friction that
//! grows with load included; neither a payload nor the link's bodies are in it. The five coefficients are followed by
//! recursive least squares with forgetting, as a Kalman filter whose states wander (Ljung, System Identification, 2nd ed., 1999,
//! section 11.3).
//!
//! Limits: a torque constant that is off counts as stiffness; a joint that only moves one way, or only without load, learns
//! nothing and keeps what it has. Friction's errors along the motor angle must average out: some seconds of motion. Friction that
//! depends on load otherwise than by its magnitude, as PA10-05's Table V has it, looks like stiffness; the calibration sees
//! that on its own recording, where nothing has changed, and such a joint's stiffness is not followed.

use super::Constants;

/// Samples in a span: 7 ms.
const SPAN_SAMPLES: u32 = 10;
/// Slower than this friction does not slide surely.
const SLIDING_RAD_S: f64 = 0.05;
/// Spans of which friction's errors are alike: a fifth of a second.
const ALIKE_SPANS: f64 = 30.0;
/// How far stiffness may have changed since the calibration: SD, section I, names ageing; a tenth is much.
const STIFFNESS_STD: f64 = 0.1;
/// How far it wanders in a span: 1 % in two minutes of motion.
const STIFFNESS_WANDER: f64 = 7e-5;
/// The same of Coulomb friction, viscous friction, friction per load, and the offset between directions.
const OTHERS_STD: [f64; 4] = [1.0, 2.0, 0.1, 0.5];
/// Of these, what a span changes: warming takes minutes.
const OTHERS_WANDER: f64 = 1e-3;
/// Torque that the law leaves unexplained at first, and how fast that is learned.
const LEFT_BEGIN_NM: f64 = 0.5;
const LEFT_SHARE: f64 = 0.01;

const TERMS: usize = 5;

/// One sample as the filter has it.
pub(super) struct Moment {
    /// Over the gear ratio.
    pub motor_rad_s: f64,
    /// Motor torque, joint side.
    pub drive_nm: f64,
    /// What of it goes through the gear by the torsion law.
    pub gear_nm: f64,
}

/// One gear's stiffness.
#[derive(Clone, Debug)]
pub(super) struct Stiffness {
    rotor_kg_m2: f64,
    period_s: f64,
    /// `k - 1`, and friction's coefficients beyond the calibrated ones.
    state: [f64; TERMS],
    covariance: [[f64; TERMS]; TERMS],
    coulomb_nm: f64,
    viscous_nm_s_rad: f64,
    left_var_nm2: f64,
    span: Span,
    is_followed: bool,
}

/// Sums over the samples of a span.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    samples: u32,
    begin_rad_s: f64,
    velocity_rad_s: f64,
    drive_nm: f64,
    gear_nm: f64,
}

impl Stiffness {
    /// One that stays the calibration's, for sure, if it is not to be followed.
    pub fn new(constants: &Constants, is_followed: bool) -> Self {
        let friction = [constants.coulomb_nm, constants.viscous_nm_s_rad];
        let mut made = Self::of(constants.rotor_kg_m2, constants.period_s, friction);
        made.is_followed = is_followed;
        if !is_followed {
            made.covariance[0][0] = 0.0;
        }
        made
    }

    fn of(rotor_kg_m2: f64, period_s: f64, [coulomb_nm, viscous_nm_s_rad]: [f64; 2]) -> Self {
        let mut covariance = [[0.0; TERMS]; TERMS];
        covariance[0][0] = STIFFNESS_STD.powi(2);
        for (term, std) in OTHERS_STD.into_iter().enumerate() {
            covariance[term + 1][term + 1] = std * std;
        }
        Self {
            rotor_kg_m2,
            period_s,
            state: [0.0; TERMS],
            covariance,
            coulomb_nm,
            viscous_nm_s_rad,
            left_var_nm2: LEFT_BEGIN_NM.powi(2),
            span: Span::default(),
            is_followed: true,
        }
    }

    /// `k`.
    pub fn factor(&self) -> f64 {
        1.0 + self.state[0]
    }

    /// Of `k`.
    pub fn variance(&self) -> f64 {
        self.covariance[0][0]
    }

    /// Samples are missing: the span begins anew, what was learned stays.
    pub fn pause(&mut self) {
        self.span = Span::default();
    }

    /// Takes a sample; at the end of a span learns from it.
    pub fn take(&mut self, moment: Moment) {
        if !self.is_followed {
            return;
        }
        let span = &mut self.span;
        if span.samples == 0 {
            span.begin_rad_s = moment.motor_rad_s;
        } else {
            span.velocity_rad_s += moment.motor_rad_s;
            span.drive_nm += moment.drive_nm;
            span.gear_nm += moment.gear_nm;
        }
        span.samples += 1;
        if span.samples <= SPAN_SAMPLES {
            return;
        }
        let [count, end_rad_s] = [f64::from(SPAN_SAMPLES), moment.motor_rad_s];
        let span = std::mem::take(span);
        let velocity_rad_s = span.velocity_rad_s / count;
        if span.begin_rad_s.abs().min(end_rad_s.abs()) < SLIDING_RAD_S
            || span.begin_rad_s * end_rad_s < 0.0
        {
            return;
        }
        let acceleration_rad_s2 = (end_rad_s - span.begin_rad_s) / (count * self.period_s);
        let gear_nm = span.gear_nm / count;
        let sign = velocity_rad_s.signum();
        let known_nm = self.rotor_kg_m2 * acceleration_rad_s2
            + gear_nm
            + self.coulomb_nm * sign
            + self.viscous_nm_s_rad * velocity_rad_s;
        let row = [gear_nm, sign, velocity_rad_s, sign * gear_nm.abs(), 1.0];
        self.learn(row, span.drive_nm / count - known_nm);
    }

    fn learn(&mut self, row: [f64; TERMS], left_nm: f64) {
        for (term, line) in self.covariance.iter_mut().enumerate() {
            let wander = if term == 0 {
                STIFFNESS_WANDER
            } else {
                OTHERS_WANDER
            };
            line[term] += wander * wander;
        }
        let along = self.covariance.map(|line| dot(&line, &row));
        let miss_nm = left_nm - dot(&self.state, &row);
        let own_nm2 = dot(&along, &row);
        self.left_var_nm2 += LEFT_SHARE * (miss_nm * miss_nm - self.left_var_nm2);
        let variance_nm2 = own_nm2 + ALIKE_SPANS * self.left_var_nm2;
        for (term, line) in self.covariance.iter_mut().enumerate() {
            let gain = along[term] / variance_nm2;
            self.state[term] += gain * miss_nm;
            for (value, other) in line.iter_mut().zip(along) {
                *value -= gain * other;
            }
        }
    }
}

fn dot(a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    const PERIOD_S: f64 = 1.0 / 1500.0;
    const ROTOR_KG_M2: f64 = 0.114;

    fn calibrated() -> Stiffness {
        Stiffness::of(ROTOR_KG_M2, PERIOD_S, [2.0, 1.0])
    }

    /// A minute of swings at two frequencies: what drives them through a gear of this stiffness, with friction that grows with
    /// load by a share.
    fn swing(stiffness: &mut Stiffness, factor: f64, load_share: f64, coulomb_nm: f64) {
        for cycle in 0..90_000 {
            let phase = TAU * f64::from(cycle) * PERIOD_S;
            let motor_rad_s = (0.7 * phase).cos() + 0.3 * (0.31 * phase).cos();
            let acceleration_rad_s2 =
                -TAU * (0.7 * (0.7 * phase).sin() + 0.3 * 0.31 * (0.31 * phase).sin());
            let torque_nm = 6.0 * (0.7 * phase).sin() + 2.0 * (0.31 * phase).sin();
            let friction_nm = motor_rad_s.signum() * (coulomb_nm + load_share * torque_nm.abs());
            stiffness.take(Moment {
                motor_rad_s,
                drive_nm: ROTOR_KG_M2 * acceleration_rad_s2
                    + torque_nm
                    + friction_nm
                    + 1.3 * motor_rad_s,
                gear_nm: torque_nm / factor,
            });
        }
    }

    #[test]
    fn a_softer_gear_is_found_whatever_friction_has_become() {
        for (factor, load_share, coulomb_nm) in [
            (0.9, 0.0, 2.0),
            (0.9, 0.08, 1.2),
            (1.1, 0.05, 2.5),
            (1.0, 0.1, 3.0),
        ] {
            let mut stiffness = calibrated();
            swing(&mut stiffness, factor, load_share, coulomb_nm);
            let [found, std] = [stiffness.factor(), stiffness.variance().sqrt()];
            assert!((found - factor).abs() < 0.005, "{found} {factor}");
            assert!(std < 0.02, "{std}");
        }
    }

    #[test]
    fn one_span_by_hand() {
        // 14 Nm of the drive at 1 rad/s, through a gear at 10 Nm and calibrated friction of 2 + 1 Nm: 1 Nm is left.
        // Its row is (10, 1, 1, 10, 1), the prior 0.01, 1, 4, 0.01, 0.25: of k's own 1 Nm² and 6.25 Nm² of the others'.
        // Left over at first 0.25 + 0.01 (1 - 0.25) = 0.2575 Nm², alike for 30 spans: 7.725. k gains 0.01·10/(7.25 + 7.725).
        let mut stiffness = calibrated();
        for _ in 0..=SPAN_SAMPLES {
            stiffness.take(Moment {
                motor_rad_s: 1.0,
                drive_nm: 14.0,
                gear_nm: 10.0,
            });
        }
        let expected = 1.0 + 0.1 / 14.975;
        assert!((stiffness.factor() - expected).abs() < 1e-6);
        // and its variance falls by 0.1²/14.975
        let expected = 0.01 - 0.01 / 14.975;
        assert!((stiffness.variance() - expected).abs() < 1e-6);
    }

    #[test]
    fn at_rest_and_creeping_nothing_is_learned() {
        let mut stiffness = calibrated();
        for _ in 0..15_000 {
            stiffness.take(Moment {
                motor_rad_s: 0.5 * SLIDING_RAD_S,
                drive_nm: 9.0,
                gear_nm: 5.0,
            });
        }
        assert_eq!(stiffness.factor(), 1.0);
        assert_eq!(stiffness.variance(), STIFFNESS_STD.powi(2));
    }
}
