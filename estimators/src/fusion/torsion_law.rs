//! Torque over torsion as the fused estimator has it: a stiffening spring and a hysteresis of play elements.
//!
//! `T = sgn(x) Σ_i k_i max(|x| - x_i, 0) + Σ_j h_j (x - p_j) + B ẋ`, `x` the torsion less its zero and the kinematic error. The first
//! sum is any odd, piecewise linear spring; the second is Prandtl and Ishlinskii's model of hysteresis, springs `h_j` that slip
//! over their plays `r_j`: `|x - p_j| ≤ r_j`. Source: Visintin, Differential Models of Hysteresis (1994), section III.2; Brokate,
//! Sprekels, Hysteresis and Phase Transitions (1996), section 2.3. All coefficients but the kinematic error enter linearly.

use arrayvec::ArrayVec;
use robot::estimators::{FusionParameters, TERMS_MAX};

/// The law of one gear; the plays' state is the caller's.
#[derive(Clone, Debug)]
pub struct TorsionLaw {
    /// `x_i`, `k_i`.
    springs: ArrayVec<[f64; 2], TERMS_MAX>,
    /// `r_j`, `h_j`.
    plays: ArrayVec<[f64; 2], TERMS_MAX>,
}

/// `p_j`: where each play element stands.
pub type Plays = [f64; TERMS_MAX];

impl TorsionLaw {
    /// The law with these parameters.
    pub fn new(parameters: &FusionParameters) -> Self {
        let pairs = |places: &[f64], stiffnesses: &[f64]| {
            let pairs = places.iter().zip(stiffnesses);
            pairs.take(TERMS_MAX).map(|(a, b)| [*a, *b]).collect()
        };
        Self {
            springs: pairs(&parameters.knees_rad, &parameters.stiffness_steps_nm_rad),
            plays: pairs(&parameters.plays_rad, &parameters.play_stiffnesses_nm_rad),
        }
    }

    /// Torque and its slope at a torsion, with the plays where they were left.
    pub fn torque_and_slope(&self, torsion_rad: f64, plays: &Plays) -> (f64, f64) {
        let size_rad = torsion_rad.abs();
        let (mut torque_nm, mut slope_nm_rad) = (0.0, 0.0);
        for [knee_rad, step_nm_rad] in &self.springs {
            if size_rad > *knee_rad || *knee_rad == 0.0 {
                torque_nm += step_nm_rad * (size_rad - knee_rad);
                slope_nm_rad += step_nm_rad;
            }
        }
        torque_nm = torque_nm.copysign(torque_nm * torsion_rad);
        for ([half_width_rad, stiffness_nm_rad], at_rad) in self.plays.iter().zip(plays) {
            let stretch_rad = torsion_rad - at_rad;
            torque_nm += stiffness_nm_rad * stretch_rad.clamp(-half_width_rad, *half_width_rad);
            if stretch_rad.abs() < *half_width_rad {
                slope_nm_rad += stiffness_nm_rad;
            }
        }
        (torque_nm, slope_nm_rad)
    }

    /// Lets the plays slip to where this torsion drags them.
    pub fn drag(&self, torsion_rad: f64, plays: &mut Plays) {
        for ([half_width_rad, _], at_rad) in self.plays.iter().zip(plays) {
            *at_rad = at_rad.clamp(torsion_rad - half_width_rad, torsion_rad + half_width_rad);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fusion::testing::parameters;

    fn path(law: &TorsionLaw, torsions: &[f64]) -> Vec<f64> {
        let mut plays = Plays::default();
        torsions
            .iter()
            .map(|torsion_rad| {
                let (torque_nm, _) = law.torque_and_slope(*torsion_rad, &plays);
                law.drag(*torsion_rad, &mut plays);
                torque_nm
            })
            .collect()
    }

    #[test]
    fn by_hand_on_the_virgin_curve() {
        let law = TorsionLaw::new(&parameters());
        // knees 0 and 2e-4 with 5000 and 3000, play 1e-4 with 1000
        let found = path(&law, &[5e-5, 1e-4, 3e-4]);
        let expected = [
            5000.0 * 5e-5 + 1000.0 * 5e-5,
            5000.0 * 1e-4 + 1000.0 * 1e-4,
            5000.0 * 3e-4 + 3000.0 * 1e-4 + 1000.0 * 1e-4,
        ];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn the_law_is_odd_and_its_slope_is_its_derivative() {
        let law = TorsionLaw::new(&parameters());
        let there = [1e-4, 4e-4, 1e-4, -2e-4, 3e-4];
        let (up, down) = (path(&law, &there), path(&law, &there.map(|x| -x)));
        for (up, down) in up.iter().zip(&down) {
            assert!((up + down).abs() < 1e-12);
        }
        let plays = [2e-5; TERMS_MAX];
        for torsion_rad in [-3e-4, -5e-5, 0.0, 3e-5, 2.5e-4] {
            let (before, slope) = law.torque_and_slope(torsion_rad, &plays);
            let after = law.torque_and_slope(torsion_rad + 1e-9, &plays).0;
            assert!(((after - before) / 1e-9 - slope).abs() < 1.0);
        }
    }

    #[test]
    fn a_closed_loop_takes_energy() {
        let law = TorsionLaw::new(&parameters());
        let steps = 4000;
        let torsion = |k: usize| 4e-4 * (std::f64::consts::TAU * k as f64 / steps as f64).sin();
        let torsions: Vec<f64> = (0..=2 * steps).map(torsion).collect();
        let torques = path(&law, &torsions);
        let spent_j: f64 = (steps..2 * steps)
            .map(|k| 0.5 * (torques[k] + torques[k + 1]) * (torsions[k + 1] - torsions[k]))
            .sum();
        // a slipping play of half width r spends 4 h r (a - r) in a loop of half width a
        let expected_j = 4.0 * 1000.0 * 1e-4 * (4e-4 - 1e-4);
        assert!((spent_j / expected_j - 1.0).abs() < 0.01, "{spent_j}");
    }
}
