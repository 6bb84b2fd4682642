//! Effects of the list at the shapes that come nearest to a law on no list: a name has as much in common with a law as its own law can
//! be made to have, whatever shape was drawn first.

use std::f64::consts::FRAC_PI_2;

use robot::{Effect, LateSide};

/// Time constants over which friction that drifts is held against a law: a part of a recording of 30 s, up to most of it.
const FADES_S: [f64; 5] = [1.0, 2.5, 6.0, 12.0, 25.0];

/// How far a second spring's rest is from the first's: any other place will do.
const ELSEWHERE_RAD: f64 = 0.5;

/// Harmonics of a law that repeats which names are held against: a robot file writes so many of a kinematic error.
const HARMONICS: [f64; 3] = [1.0, 2.0, 3.0];

/// An effect at its own shape and at others. What is in one set adds up: the effect at a shape of its own again, at whatever sizes.
/// `waves`: how often a law repeats in a turn of the motor.
pub(crate) fn shapes(effect: Effect, waves: Option<f64>) -> Vec<Vec<Effect>> {
    let of_law = || waves.map(|waves| HARMONICS.map(|harmonic| harmonic * waves));
    let quarters = |cycles: f64, pair: &dyn Fn(f64, f64) -> Effect| {
        vec![pair(cycles, 0.0), pair(cycles, FRAC_PI_2)]
    };
    let at_waves = |own: f64, pair: &dyn Fn(f64, f64) -> Effect| {
        let all = [own].into_iter().chain(of_law().into_iter().flatten());
        all.map(|cycles| quarters(cycles, pair)).collect()
    };
    match effect {
        Effect::TorqueRipple {
            amplitude_nm,
            cycles_per_motor_rev,
            ..
        } => at_waves(cycles_per_motor_rev, &|cycles_per_motor_rev, phase_rad| {
            Effect::TorqueRipple {
                amplitude_nm,
                cycles_per_motor_rev,
                phase_rad,
            }
        }),
        Effect::PositionDependentFriction {
            amplitude_nm,
            cycles_per_motor_rev,
            ..
        } => at_waves(cycles_per_motor_rev, &|cycles_per_motor_rev, phase_rad| {
            Effect::PositionDependentFriction {
                amplitude_nm,
                cycles_per_motor_rev,
                phase_rad,
            }
        }),
        Effect::KinematicError {
            amplitude_rad,
            cycles_per_motor_rev,
            ..
        } => {
            let error = |cycles: f64, phase_rad: f64| {
                Effect::kinematic_error(amplitude_rad, cycles, phase_rad)
            };
            let own = quarters(cycles_per_motor_rev, &error);
            // its harmonics are one name
            let all = of_law().map(|all| all.map(|cycles| quarters(cycles, &error)).concat());
            [own].into_iter().chain(all).collect()
        }
        // an encoder shows the same after a turn of its own shaft, not after the law's
        Effect::EncoderEccentricity {
            amplitude_rad,
            cycles_per_rev,
            side,
            ..
        } => vec![
            [0.0, FRAC_PI_2]
                .map(|phase_rad| Effect::EncoderEccentricity {
                    amplitude_rad,
                    cycles_per_rev,
                    phase_rad,
                    side,
                })
                .to_vec(),
        ],
        Effect::GravityTorque { sin_nm, cos_nm } => {
            let nm = sin_nm.hypot(cos_nm);
            let of = |sin_nm: f64, cos_nm: f64| Effect::GravityTorque { sin_nm, cos_nm };
            vec![vec![of(nm, 0.0), of(0.0, nm)]]
        }
        Effect::JointSpring {
            stiffness_nm_rad,
            rest_rad,
        } => vec![
            [rest_rad, rest_rad + ELSEWHERE_RAD]
                .map(|rest_rad| Effect::JointSpring {
                    stiffness_nm_rad,
                    rest_rad,
                })
                .to_vec(),
        ],
        Effect::BaseTilt {
            roll_rad,
            pitch_rad,
        } if roll_rad != 0.0 => {
            let angle_rad = roll_rad.hypot(pitch_rad);
            let of = |roll_rad: f64, pitch_rad: f64| Effect::BaseTilt {
                roll_rad,
                pitch_rad,
            };
            vec![vec![of(angle_rad, 0.0), of(0.0, angle_rad)]]
        }
        Effect::ThermalFrictionDrift {
            change_nm: Some(_), ..
        } => {
            let over = |time_constant_s: f64| {
                let mut other = effect;
                if let Effect::ThermalFrictionDrift {
                    time_constant_s: own,
                    ..
                } = &mut other
                {
                    *own = Some(time_constant_s);
                }
                vec![other]
            };
            FADES_S.map(over).to_vec()
        }
        // a delay shows where the torques that come with the encoders do not wait for them
        Effect::SensorDelay { delay_s, side } => {
            let late = [LateSide::Both, LateSide::Motor, LateSide::Link].map(Some);
            let sides = [side].into_iter().chain(late);
            let of = |side| vec![Effect::SensorDelay { delay_s, side }];
            sides.map(of).collect()
        }
        _ => vec![vec![effect]],
    }
}

/// The product of two signals whose every value counts.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Part of one signal's square that others, at the sizes that fit best, have in common with it, by this product.
pub(crate) fn common(
    of: &[f64],
    others: &[Vec<f64>],
    product: impl Fn(&[f64], &[f64]) -> f64,
) -> f64 {
    let whole = product(of, of);
    let mut apart: Vec<Vec<f64>> = Vec::new();
    for other in others {
        let mut own = other.clone();
        for before in &apart {
            let share = product(&own, before) / product(before, before);
            own.iter_mut()
                .zip(before)
                .for_each(|(x, y)| *x -= share * y);
        }
        // what is the same as another adds nothing
        if product(&own, &own) > SAME * product(other, other) {
            apart.push(own);
        }
    }
    let parts = apart
        .iter()
        .map(|own| product(of, own).powi(2) / product(own, own));
    parts.sum::<f64>() / whole.max(f64::MIN_POSITIVE)
}

/// Part of a signal's square below which what others leave of it is rounding and noise.
const SAME: f64 = 1e-6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_of_any_phase_is_common_with_both_its_quarters() {
        let wave = |phase_rad: f64| -> Vec<f64> {
            (0..1000)
                .map(|k| (0.01 * f64::from(k) * std::f64::consts::TAU + phase_rad).sin())
                .collect()
        };
        let quarters = [wave(0.0), wave(FRAC_PI_2)];
        assert!((common(&wave(0.7), &quarters, dot) - 1.0).abs() < 1e-9);
        assert!((common(&wave(0.7), &quarters[..1], dot) - 0.7_f64.cos().powi(2)).abs() < 1e-3);
        // the same twice is once
        let twice = [wave(0.0), wave(0.0)];
        assert!((common(&wave(0.7), &twice, dot) - 0.585).abs() < 1e-2);
    }

    #[test]
    fn a_ripple_is_held_against_a_law_where_that_repeats() {
        let ripple = Effect::TorqueRipple {
            amplitude_nm: 1.0,
            cycles_per_motor_rev: 6.0,
            phase_rad: 1.0,
        };
        let cycles: Vec<f64> = shapes(ripple, Some(0.7))
            .iter()
            .flatten()
            .filter_map(|effect| match effect {
                Effect::TorqueRipple {
                    cycles_per_motor_rev,
                    ..
                } => Some(*cycles_per_motor_rev),
                _ => None,
            })
            .collect();
        let of_law = HARMONICS.map(|harmonic| harmonic * 0.7);
        let all = [6.0].into_iter().chain(of_law);
        let each: Vec<f64> = all.flat_map(|cycles| [cycles, cycles]).collect();
        assert_eq!(cycles, each);
        // a kinematic error's harmonics are one name
        let error = Effect::kinematic_error(1e-4, 2.0, 0.0);
        let together: Vec<usize> = shapes(error, Some(0.7)).iter().map(Vec::len).collect();
        assert_eq!(together, [2, 6]);
    }
}
