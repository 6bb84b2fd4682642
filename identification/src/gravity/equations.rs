//! One equation for each moving joint in each pose, and the least squares over them.
//!
//! `T_in·N - T_f = T_g(θ) + f_+ or f_- + f_v·θ̇`, with `T_f` the friction that the robot file knows, at the gravity load
//! sought, and for each joint three unknowns for what it does not know: a torque for each direction and one in
//! proportion to velocity. Where every pose is passed both ways this is the mean of both directions, in which friction
//! cancels; unlike the mean it also takes poses passed one way only.

use joint_model::friction::{Direction, SteadyFriction};
use nalgebra::{DMatrix, DVector, SVD};
use robot::Robot;

use super::parameters::Parameters;
use super::poses::{Pose, Reading};
use crate::statistics::{correlated_samples, root_mean_square};

/// Singular values below this share of the largest are rounding.
const ROUNDING: f64 = 1e-10;

/// Residuals below this share of the torques are taken for so much: no measurement is better.
const BEST_ACCURACY: f64 = 1e-6;

/// Load-dependent friction and weights settle in a few rounds.
const ROUNDS: usize = 25;

/// Change of every parameter, in standard deviations of the robot file, at which they have settled.
const SETTLED: f64 = 1e-9;

/// All equations of one joint.
pub(super) struct JointEquations {
    /// Load-dependent friction of the robot file.
    load_friction: SteadyFriction,
    pub position_rad: Vec<f64>,
    readings: Vec<Reading>,
    /// Cell of each equation's pose.
    pub cells: Vec<i64>,
    /// Gravity torque per parameter, in units of the file's tolerance.
    columns: DMatrix<f64>,
    /// Gravity torque of the robot file.
    pub file_nm: DVector<f64>,
}

/// What the data determine of the parameters, in units of the file's tolerance.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// Changes against the file.
    pub change: DVector<f64>,
    /// Orthonormal rows: the directions determined.
    pub seen: DMatrix<f64>,
    /// Standard error along each.
    pub errors: DVector<f64>,
    /// Orthonormal rows: the rest.
    pub unseen: DMatrix<f64>,
}

impl JointEquations {
    pub fn new(joint: usize, poses: &[Pose], robot: &Robot, parameters: &Parameters) -> Self {
        let known = robot.joints[joint].steady_friction();
        let felt: Vec<(&Pose, &Reading)> = poses
            .iter()
            .filter_map(|pose| {
                let reading = pose
                    .readings
                    .iter()
                    .find(|reading| reading.joint == joint)?;
                Some((pose, reading))
            })
            .collect();
        let mut columns = DMatrix::zeros(felt.len(), parameters.count());
        let mut file_nm = DVector::zeros(felt.len());
        for (row, (pose, _)) in felt.iter().enumerate() {
            let (torques, payload_nm) = parameters.torques(&pose.position_rad);
            file_nm[row] = payload_nm[joint];
            for (column, torque) in torques.iter().enumerate() {
                file_nm[row] += torque[joint] * parameters.file[column];
                columns[(row, column)] = torque[joint] * parameters.tolerance[column];
            }
        }
        Self {
            // Its harmonics are in the reading already.
            load_friction: SteadyFriction {
                periodic: Default::default(),
                lookup: None,
                ..known
            },
            position_rad: felt
                .iter()
                .map(|(pose, _)| pose.position_rad[joint])
                .collect(),
            cells: felt.iter().map(|(pose, _)| pose.cell).collect(),
            readings: felt.iter().map(|(_, reading)| (*reading).clone()).collect(),
            columns,
            file_nm,
        }
    }

    pub fn count(&self) -> usize {
        self.readings.len()
    }

    /// Those of the equations that `keep` says by index.
    pub fn only(&self, keep: impl Fn(usize) -> bool) -> Self {
        let rows: Vec<usize> = (0..self.count()).filter(|row| keep(*row)).collect();
        Self {
            load_friction: self.load_friction.clone(),
            position_rad: rows.iter().map(|row| self.position_rad[*row]).collect(),
            cells: rows.iter().map(|row| self.cells[*row]).collect(),
            readings: rows.iter().map(|row| self.readings[*row].clone()).collect(),
            columns: self.columns.select_rows(&rows),
            file_nm: self.file_nm.select_rows(&rows),
        }
    }

    /// Torque times the sign of the motion without the file's gravity, and torque: see
    /// [`check_sign`](crate::slow_motion::check_sign).
    pub fn along_and_torque_nm(&self) -> (Vec<f64>, Vec<f64>) {
        let pairs = self.readings.iter().zip(&self.file_nm);
        pairs
            .map(|(reading, file_nm)| {
                let along_nm = reading.direction.sign() * (reading.torque_nm - file_nm);
                (along_nm, reading.torque_nm)
            })
            .unzip()
    }

    /// Gravity torque with these changes of the parameters.
    pub fn gravity_nm(&self, change: &DVector<f64>) -> DVector<f64> {
        &self.file_nm + &self.columns * change
    }

    /// Measured torque less the friction that the file knows at this gravity torque.
    pub fn without_known_friction_nm(&self, gravity_nm: &DVector<f64>) -> DVector<f64> {
        let rows = self.readings.iter().zip(gravity_nm.iter());
        let remaining = rows.map(|(reading, load_nm)| {
            reading.torque_nm - reading.friction_nm - self.load_part_nm(reading, *load_nm)
        });
        DVector::from_iterator(self.count(), remaining)
    }

    /// By how much load changes friction, about the axis.
    fn load_part_nm(&self, reading: &Reading, load_nm: f64) -> f64 {
        let drag_nm = |load_nm| {
            self.load_friction
                .drag_nm(reading.velocity_rad_s, load_nm, 0.0, 0.0)
        };
        drag_nm(load_nm) - drag_nm(0.0)
    }

    /// How measured torque less known friction answers to gravity torque: 1 where friction knows no load.
    fn slopes(&self, gravity_nm: &DVector<f64>) -> DVector<f64> {
        // Long beside rounding, short beside the regions of Table V.
        const STEP_NM: f64 = 1e-3;
        let rows = self.readings.iter().zip(gravity_nm.iter());
        let slopes = rows.map(|(reading, load_nm)| {
            let part_nm = |step_nm: f64| self.load_part_nm(reading, load_nm + step_nm);
            1.0 + (part_nm(STEP_NM) - part_nm(-STEP_NM)) / (2.0 * STEP_NM)
        });
        DVector::from_iterator(self.count(), slopes)
    }

    /// Columns of the friction that the file does not know: a torque for each direction, and viscous drag.
    fn unknown_friction(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.count(), 3, |row, column| {
            let reading = &self.readings[row];
            match (column, reading.direction) {
                (0, Direction::Positive) | (1, Direction::Negative) => 1.0,
                (2, _) => reading.velocity_rad_s,
                _ => 0.0,
            }
        })
    }

    /// The friction the file does not know, as these residuals show it.
    pub fn fit_friction(&self, residual_nm: &DVector<f64>) -> DVector<f64> {
        least_squares(self.unknown_friction(), residual_nm)
    }

    /// Its torque in each equation.
    pub fn friction_nm(&self, friction: &DVector<f64>) -> DVector<f64> {
        self.unknown_friction() * friction
    }

    /// Residual with these changes of the parameters, and friction as it fits best.
    pub fn residual_nm(&self, change: &DVector<f64>) -> DVector<f64> {
        let gravity_nm = self.gravity_nm(change);
        let residual_nm = self.without_known_friction_nm(&gravity_nm) - gravity_nm;
        let friction = self.fit_friction(&residual_nm);
        &residual_nm - self.friction_nm(&friction)
    }

    /// Derivative of what the parameters explain, as far as friction cannot explain it.
    fn jacobian(&self, change: &DVector<f64>) -> DMatrix<f64> {
        let slopes = self.slopes(&self.gravity_nm(change));
        let mut jacobian = self.columns.clone();
        for mut column in jacobian.column_iter_mut() {
            column.component_mul_assign(&slopes);
        }
        let friction = orthonormal(self.unknown_friction());
        let explained = &friction * (friction.transpose() * &jacobian);
        jacobian - explained
    }

    /// Standard deviation of the noise of one equation, as if successive ones were independent.
    fn noise_nm(&self, residual_nm: &DVector<f64>) -> f64 {
        let count = self.count() as f64;
        let torque_nm = root_mean_square(self.readings.iter().map(|reading| reading.torque_nm));
        let scatter_nm = root_mean_square(residual_nm.iter().copied());
        let persistence = correlated_samples(residual_nm.as_slice());
        let freedom = (1.0 - 3.0 * persistence / count).max(1.0 / count);
        let least_nm = (BEST_ACCURACY * torque_nm).max(f64::MIN_POSITIVE.sqrt());
        (scatter_nm * (persistence / freedom).sqrt()).max(least_nm)
    }
}

/// Solves all equations, each joint weighted by its own noise; Gauss-Newton, because friction may depend on load.
pub(super) fn solve(joints: &[JointEquations], parameters: usize) -> Solution {
    let mut solution = Solution::none(parameters);
    for _ in 0..ROUNDS {
        let next = round(joints, &solution.change);
        let step = (&next.change - &solution.change).amax();
        solution = next;
        if step <= SETTLED {
            break;
        }
    }
    solution
}

/// One round: the linearised equations, solved for the smallest change against the file.
fn round(joints: &[JointEquations], change: &DVector<f64>) -> Solution {
    let equations = joints.iter().map(JointEquations::count).sum();
    let mut matrix = DMatrix::zeros(equations, change.len());
    let mut right = DVector::zeros(equations);
    let mut from = 0;
    for joint in joints {
        let residual_nm = joint.residual_nm(change);
        let jacobian = joint.jacobian(change);
        let weight = joint.noise_nm(&residual_nm).recip();
        let target_nm = residual_nm + &jacobian * change;
        matrix
            .rows_mut(from, joint.count())
            .copy_from(&(jacobian * weight));
        right
            .rows_mut(from, joint.count())
            .copy_from(&(target_nm * weight));
        from += joint.count();
    }
    Solution::of(&matrix, &right)
}

impl Solution {
    fn none(parameters: usize) -> Self {
        Self {
            change: DVector::zeros(parameters),
            seen: DMatrix::zeros(0, parameters),
            errors: DVector::zeros(0),
            unseen: DMatrix::identity(parameters, parameters),
        }
    }

    /// Keeps the directions that the data determine better than the file does: standard error below 1, the file's.
    /// `matrix` and `right` are in units of noise.
    fn of(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Self {
        let parameters = matrix.ncols();
        // Square, so that the decomposition has a row for every direction, seen or not.
        let normal = matrix.clone().qr();
        let (mut triangle, mut turned) = (
            DMatrix::zeros(parameters, parameters),
            DVector::zeros(parameters),
        );
        let filled = parameters.min(matrix.nrows());
        triangle.rows_mut(0, filled).copy_from(&normal.r());
        turned
            .rows_mut(0, filled)
            .copy_from(&(normal.q().transpose() * right));
        let Some((left, values, directions)) = decompose(triangle) else {
            return Self::none(parameters);
        };
        let least = (ROUNDING * values.amax()).max(1.0);
        let (seen, unseen): (Vec<usize>, Vec<usize>) =
            (0..parameters).partition(|index| values[*index] > least);
        let mut change = DVector::zeros(parameters);
        for index in &seen {
            let along = left.column(*index).dot(&turned) / values[*index];
            change += directions.row(*index).transpose() * along;
        }
        Self {
            change,
            errors: DVector::from_iterator(seen.len(), seen.iter().map(|i| values[*i].recip())),
            seen: directions.select_rows(&seen),
            unseen: directions.select_rows(&unseen),
        }
    }

    /// Covariance of all parameters: the data's where they see, the file's own where they do not.
    pub fn covariance(&self) -> DMatrix<f64> {
        let mut weighted = self.seen.clone();
        for (mut row, error) in weighted.row_iter_mut().zip(self.errors.iter()) {
            row *= *error;
        }
        weighted.transpose() * weighted + self.unseen.transpose() * &self.unseen
    }
}

/// Left vectors, values and right vectors; nothing where the matrix is not finite or the iteration does not end.
fn decompose(matrix: DMatrix<f64>) -> Option<(DMatrix<f64>, DVector<f64>, DMatrix<f64>)> {
    const ITERATIONS: usize = 10_000;
    if !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    let svd = SVD::try_new(matrix, true, true, f64::EPSILON, ITERATIONS)?;
    Some((svd.u?, svd.singular_values, svd.v_t?))
}

/// An orthonormal basis of what the columns span.
fn orthonormal(columns: DMatrix<f64>) -> DMatrix<f64> {
    let rows = columns.nrows();
    let Some((left, values, _)) = decompose(columns) else {
        return DMatrix::zeros(rows, 0);
    };
    let least = ROUNDING * values.amax();
    let kept: Vec<usize> = (0..values.len())
        .filter(|index| values[*index] > least)
        .collect();
    left.select_columns(&kept)
}

/// The smallest solution of least squares; zero where there is none.
fn least_squares(matrix: DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    let columns = matrix.ncols();
    let Some((left, values, directions)) = decompose(matrix) else {
        return DVector::zeros(columns);
    };
    let least = ROUNDING * values.amax();
    let mut solution = DVector::zeros(columns);
    for index in (0..values.len()).filter(|index| values[*index] > least) {
        let along = left.column(index).dot(right) / values[index];
        solution += directions.row(index).transpose() * along;
    }
    solution
}
