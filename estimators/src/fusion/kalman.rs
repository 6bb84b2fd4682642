//! The covariance of the fused estimator, changed in place by the few entries that each step touches.
//!
//! A transition `F = I + e_i rᵀ` changes row and column `i` only: `P ← F P Fᵀ` in two passes over one row. The filter's
//! transition is a product of a few of these, velocities first, then positions.

/// States of the filter.
pub const STATES: usize = 6;

/// A symmetric, positive matrix.
#[derive(Clone, Debug, Default)]
pub struct Covariance([[f64; STATES]; STATES]);

impl Covariance {
    /// Independent states with these variances.
    pub fn diagonal(variances: [f64; STATES]) -> Self {
        let mut matrix = Self::default();
        for (state, variance) in variances.into_iter().enumerate() {
            matrix.0[state][state] = variance;
        }
        matrix
    }

    /// `x_i ← x_i + rᵀ x`.
    pub fn turn(&mut self, changed: usize, row: [f64; STATES]) {
        let mut added = [0.0; STATES];
        for (weight, from) in row.iter().zip(&self.0) {
            for (sum, value) in added.iter_mut().zip(from) {
                *sum += weight * value;
            }
        }
        let own: f64 = row
            .iter()
            .zip(&added)
            .map(|(weight, sum)| weight * sum)
            .sum();
        let diagonal = self.0[changed][changed] + 2.0 * added[changed] + own;
        for (other, sum) in added.into_iter().enumerate() {
            self.0[changed][other] += sum;
            self.0[other][changed] = self.0[changed][other];
        }
        self.0[changed][changed] = diagonal;
    }

    /// `x_i ← x_i + share·x_j`.
    pub fn follow(&mut self, changed: usize, followed: usize, share: f64) {
        let mut row = [0.0; STATES];
        row[followed] = share;
        self.turn(changed, row);
    }

    /// Adds process noise to a state.
    pub fn widen(&mut self, state: usize, variance: f64) {
        self.0[state][state] += variance;
    }

    /// Takes a measurement of one state.
    pub fn correct(
        &mut self,
        state: &mut [f64; STATES],
        measured: usize,
        value: f64,
        variance: f64,
    ) {
        let row = self.0[measured];
        let gain = row.map(|covariance| covariance / (row[measured] + variance));
        let innovation = value - state[measured];
        for (value, gain) in state.iter_mut().zip(gain) {
            *value += gain * innovation;
        }
        for (values, gain) in self.0.iter_mut().zip(gain) {
            for (value, covariance) in values.iter_mut().zip(row) {
                *value -= gain * covariance;
            }
        }
    }

    /// Variance of `sᵀ x`.
    pub fn variance_along(&self, slopes: &[f64; STATES]) -> f64 {
        let along = |row: &[f64; STATES]| -> f64 {
            row.iter()
                .zip(slopes)
                .map(|(value, slope)| value * slope)
                .sum()
        };
        let variance: f64 = self
            .0
            .iter()
            .zip(slopes)
            .map(|(row, slope)| slope * along(row))
            .sum();
        variance.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `F P Fᵀ` written out.
    fn product(
        f: &[[f64; STATES]; STATES],
        p: &[[f64; STATES]; STATES],
    ) -> [[f64; STATES]; STATES] {
        let mut result = [[0.0; STATES]; STATES];
        for (i, row) in result.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                for (k, middle) in p.iter().enumerate() {
                    for (l, entry) in middle.iter().enumerate() {
                        *value += f[i][k] * entry * f[j][l];
                    }
                }
            }
        }
        result
    }

    fn some() -> Covariance {
        let mut covariance = Covariance::diagonal([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        covariance.turn(2, [0.1, -0.2, 0.0, 0.3, 0.4, -0.5]);
        covariance
    }

    #[test]
    fn a_turn_is_the_product_of_the_matrices() {
        let row = [0.3, -0.1, 0.7, 0.0, 0.2, 0.5];
        let mut f = [[0.0; STATES]; STATES];
        for (i, line) in f.iter_mut().enumerate() {
            line[i] = 1.0;
        }
        for (value, weight) in f[1].iter_mut().zip(row) {
            *value += weight;
        }
        let mut covariance = some();
        let expected = product(&f, &covariance.0);
        covariance.turn(1, row);
        for (found, expected) in covariance.0.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_measurement_halves_what_is_as_uncertain_as_itself() {
        let mut covariance = Covariance::diagonal([4.0; STATES]);
        let mut state = [0.0; STATES];
        covariance.correct(&mut state, 2, 6.0, 4.0);
        assert_eq!(state, [0.0, 0.0, 3.0, 0.0, 0.0, 0.0]);
        assert_eq!(covariance.0[2][2], 2.0);
        let mut along = [0.0; STATES];
        along[2] = 3.0;
        assert_eq!(covariance.variance_along(&along), 18.0);
    }
}
