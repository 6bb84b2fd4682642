//! Effects of the list at the shapes that come nearest to a law on no list: a name has as much in common with a law as its own law can
//! be made to have, whatever shape was drawn first.

use std::f64::consts::FRAC_PI_2;

use robot::{Effect, LateSide};

/// Time constants over which friction that drifts is held against a law: a part of a recording of 30 s, up to most of it.
const FADES_S: [f64; 5] = [1.0, 2.5, 6.0, 12.0, 25.0];

/// How far a second spring's rest is from the first's: any other place will do.
const ELSEWHERE_RAD: f64 = 0.5;

/// An effect at its own shape and at others. What is in one set adds up: the effect at a shape of its own again, at whatever sizes.
/// `waves`: how often a law repeats in a turn of the motor.
pub(crate) fn shapes(effect: Effect, waves: Option<f64>) -> Vec<Vec<Effect>> {
    let at_waves = |own: f64, pair: &dyn Fn(f64, f64) -> Effect| {
        let all = [own].into_iter().chain(waves);
        all.map(|cycles| vec![pair(cycles, 0.0), pair(cycles, FRAC_PI_2)])
            .collect()
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
        } => at_waves(cycles_per_motor_rev, &|cycles_per_motor_rev, phase_rad| {
            Effect::kinematic_error(amplitude_rad, cycles_per_motor_rev, phase_rad)
        }),
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

/// Part of one signal's square that others, at the sizes that fit best, have in common with it.
pub(crate) fn common(of: &[f64], others: &[Vec<f64>]) -> f64 {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
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
        assert!((common(&wave(0.7), &quarters) - 1.0).abs() < 1e-9);
        assert!((common(&wave(0.7), &quarters[..1]) - 0.7_f64.cos().powi(2)).abs() < 1e-3);
        // the same twice is once
        assert!((common(&wave(0.7), &[wave(0.0), wave(0.0)]) - 0.585).abs() < 1e-2);
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
        assert_eq!(cycles, [6.0, 6.0, 0.7, 0.7]);
    }
}
