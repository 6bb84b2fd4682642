//! One equation for each moving joint in each pose, and the least squares over them.
//!
//! `T_in·N - T_f = T_g(θ) + f_+ or f_- + f_v·θ̇ + f_c(T_g)`, with `T_f` the friction that the robot file knows, at the
//! gravity load sought, and for each joint unknowns for what it does not know: a torque for each direction and one in
//! proportion to velocity. Where every pose is passed both ways this is the mean of both directions, in which friction
//! cancels; unlike the mean it also takes poses passed one way only. A joint with Table V has been given it with other
//! gravity than the one sought, so the slopes of its regions are unknowns too (`f_c`); known payloads tell them from
//! gravity, because they change the load by a torque that is no unknown.

use joint_model::friction::{Direction, Sliding, SteadyFriction};
use joint_model::rigid_body::Chain;
use nalgebra::{DMatrix, DVector, RowDVector, SVD};
use robot::Robot;

use super::parameters::Parameters;
use super::poses::{Pose, Reading};
use crate::floor::is_above_floor;
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
    /// What the robot file knows.
    friction: SteadyFriction,
    equations: Vec<Equation>,
    parameters: usize,
}

/// One moving joint in one pose.
#[derive(Clone)]
struct Equation {
    reading: Reading,
    position_rad: f64,
    /// Of its pose.
    cell: i64,
    /// Gravity torque per parameter at each sample of the pose, in units of the file's tolerance.
    columns: DMatrix<f64>,
    /// Gravity torque of the robot file at each sample.
    file_nm: DVector<f64>,
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

impl Equation {
    fn new(joint: usize, pose: &Pose, parameters: &Parameters, payload: &Chain) -> Option<Self> {
        let reading = pose.readings.iter().find(|found| found.joint == joint)?;
        let samples = pose.samples_rad.len();
        let mut columns = DMatrix::zeros(samples, parameters.count());
        let mut file_nm = DVector::zeros(samples);
        let mut payload_nm = vec![0.0; parameters.joints()];
        for (row, position_rad) in pose.samples_rad.iter().enumerate() {
            payload.gravity_torque(position_rad, &mut payload_nm);
            file_nm[row] = payload_nm[joint];
            for (column, torque_nm) in parameters.torques_nm(position_rad, joint).enumerate() {
                file_nm[row] += torque_nm * parameters.file[column];
                columns[(row, column)] = torque_nm * parameters.tolerance[column];
            }
        }
        let position_rad = pose.samples_rad.iter().map(|angles| angles[joint]);
        Some(Self {
            position_rad: position_rad.sum::<f64>() / samples as f64,
            reading: reading.clone(),
            cell: pose.cell,
            columns,
            file_nm,
        })
    }

    /// Gravity torque at each sample.
    fn loads_nm(&self, change: &DVector<f64>) -> DVector<f64> {
        &self.file_nm + &self.columns * change
    }

    /// Mean over the samples of the friction that the file knows at these loads, about the axis.
    fn known_friction_nm(&self, friction: &SteadyFriction, loads_nm: &DVector<f64>) -> f64 {
        let drag_nm = |(load_nm, motor_rad): (&f64, &f64)| {
            friction.drag_nm(self.reading.velocity_rad_s, *load_nm, *motor_rad, 0.0)
        };
        let samples = loads_nm.iter().zip(&self.reading.motor_rad);
        samples.map(drag_nm).sum::<f64>() / loads_nm.len() as f64
    }

    /// Derivative by the parameters of gravity torque and known friction together.
    fn gradient(&self, friction: &SteadyFriction, change: &DVector<f64>) -> RowDVector<f64> {
        // Long beside rounding, short beside the regions of Table V.
        const STEP_NM: f64 = 1e-3;
        let velocity_rad_s = self.reading.velocity_rad_s;
        let slope = |load_nm: f64, motor_rad: f64| {
            let drag_nm = |load_nm| friction.drag_nm(velocity_rad_s, load_nm, motor_rad, 0.0);
            1.0 + (drag_nm(load_nm + STEP_NM) - drag_nm(load_nm - STEP_NM)) / (2.0 * STEP_NM)
        };
        let loads_nm = self.loads_nm(change);
        let samples = loads_nm.iter().zip(&self.reading.motor_rad);
        let slopes = samples.map(|(load_nm, motor_rad)| slope(*load_nm, *motor_rad));
        let slopes = RowDVector::from_iterator(loads_nm.len(), slopes);
        slopes * &self.columns / loads_nm.len() as f64
    }

    /// Whether friction tells of load all through the pose, by the file's gravity.
    fn is_above_floor(&self, friction: &SteadyFriction) -> bool {
        let samples = self.file_nm.iter().zip(&self.reading.motor_rad);
        samples.into_iter().all(|(load_nm, motor_rad)| {
            let level_nm = |load_nm| {
                friction.level_nm(&Sliding {
                    load_nm,
                    motor_position_rad: *motor_rad,
                    ..Sliding::at(self.reading.velocity_rad_s)
                })
            };
            is_above_floor(level_nm(*load_nm), level_nm(0.0))
        })
    }

    /// What may be wrong with the known friction: for each direction a torque and, where the file has Table V, the slope
    /// in each of its regions; and viscous drag.
    fn unknown_friction(&self, friction: &SteadyFriction, loads_nm: &DVector<f64>) -> Vec<f64> {
        let mean_nm = |beyond_nm: f64| {
            let over = loads_nm
                .iter()
                .map(|load_nm| (load_nm - beyond_nm).max(0.0));
            over.sum::<f64>() / loads_nm.len() as f64
        };
        let mut columns = vec![self.reading.velocity_rad_s];
        for direction in [Direction::Positive, Direction::Negative] {
            let here = f64::from(u8::from(self.reading.direction == direction));
            columns.push(here);
            if let Some(table) = &friction.load_torque {
                let [first_nm, second_nm] = table.row(direction).knees_nm;
                columns.push(here * loads_nm.mean());
                columns.push(here * mean_nm(first_nm));
                columns.push(here * mean_nm(second_nm));
            }
        }
        columns
    }
}

impl JointEquations {
    /// Of poses each with the payload that hung at the flange. Where friction is on its floor there is no equation.
    pub fn new(
        joint: usize,
        poses: &[(&Pose, &Chain)],
        robot: &Robot,
        parameters: &Parameters,
    ) -> Self {
        let friction = robot.joints[joint].steady_friction();
        let equations = poses
            .iter()
            .filter_map(|(pose, payload)| Equation::new(joint, pose, parameters, payload))
            .filter(|equation| equation.is_above_floor(&friction));
        Self {
            equations: equations.collect(),
            friction,
            parameters: parameters.count(),
        }
    }

    pub fn count(&self) -> usize {
        self.equations.len()
    }

    pub fn position_rad(&self) -> Vec<f64> {
        let equations = self.equations.iter();
        equations.map(|equation| equation.position_rad).collect()
    }

    /// Those of the equations whose cell `keep` takes.
    pub fn only(&self, keep: impl Fn(i64) -> bool) -> Self {
        let kept = self.equations.iter().filter(|equation| keep(equation.cell));
        Self {
            equations: kept.cloned().collect(),
            friction: self.friction.clone(),
            parameters: self.parameters,
        }
    }

    /// Torque times the sign of the motion without the file's gravity, and torque: see
    /// [`check_sign`](crate::steady_motion::slow::check_sign).
    pub fn along_and_torque_nm(&self) -> (Vec<f64>, Vec<f64>) {
        let pair = |equation: &Equation| {
            let Reading {
                direction,
                torque_nm,
                ..
            } = equation.reading;
            let along_nm = direction.sign() * (torque_nm - equation.file_nm.mean());
            (along_nm, torque_nm)
        };
        self.equations.iter().map(pair).unzip()
    }

    /// One value of each equation.
    fn each(&self, value: impl Fn(&Equation) -> f64) -> DVector<f64> {
        DVector::from_iterator(self.count(), self.equations.iter().map(value))
    }

    /// Gravity torque with these changes of the parameters.
    pub fn gravity_nm(&self, change: &DVector<f64>) -> DVector<f64> {
        self.each(|equation| equation.loads_nm(change).mean())
    }

    /// Measured torque less gravity torque and the friction that the file knows under it.
    pub fn unexplained_nm(&self, change: &DVector<f64>) -> DVector<f64> {
        self.each(|equation| {
            let loads_nm = equation.loads_nm(change);
            let friction_nm = equation.known_friction_nm(&self.friction, &loads_nm);
            equation.reading.torque_nm - friction_nm - loads_nm.mean()
        })
    }

    /// Columns of the friction that the file does not know.
    fn unknown_friction(&self, change: &DVector<f64>) -> DMatrix<f64> {
        let columns = |equation: &Equation| {
            equation.unknown_friction(&self.friction, &equation.loads_nm(change))
        };
        let rows: Vec<Vec<f64>> = self.equations.iter().map(columns).collect();
        let width = rows.first().map_or(0, Vec::len);
        DMatrix::from_fn(rows.len(), width, |row, column| rows[row][column])
    }

    /// The friction the file does not know, as these equations show it.
    pub fn fit_friction(&self, change: &DVector<f64>) -> DVector<f64> {
        least_squares(self.unknown_friction(change), &self.unexplained_nm(change))
    }

    /// Its torque in each equation.
    pub fn friction_nm(&self, friction: &DVector<f64>, change: &DVector<f64>) -> DVector<f64> {
        self.unknown_friction(change) * friction
    }

    /// Residual with these changes of the parameters, and friction as it fits best.
    pub fn residual_nm(&self, change: &DVector<f64>) -> DVector<f64> {
        let friction = self.fit_friction(change);
        self.unexplained_nm(change) - self.friction_nm(&friction, change)
    }

    /// Derivative of what the parameters explain, as far as friction cannot explain it.
    fn jacobian(&self, change: &DVector<f64>) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(self.count(), self.parameters);
        for (row, equation) in self.equations.iter().enumerate() {
            jacobian.set_row(row, &equation.gradient(&self.friction, change));
        }
        let friction = orthonormal(self.unknown_friction(change));
        let explained = &friction * (friction.transpose() * &jacobian);
        jacobian - explained
    }

    /// Standard deviation of the noise of one equation, as if successive ones were independent.
    fn noise_nm(&self, residual_nm: &DVector<f64>, unknown_friction: usize) -> f64 {
        let count = self.count() as f64;
        let torques_nm = self
            .equations
            .iter()
            .map(|equation| equation.reading.torque_nm);
        let torque_nm = root_mean_square(torques_nm);
        let scatter_nm = root_mean_square(residual_nm.iter().copied());
        let persistence = correlated_samples(residual_nm.as_slice());
        let freedom = (1.0 - unknown_friction as f64 * persistence / count).max(1.0 / count);
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
        let unknown_friction = joint.unknown_friction(change).ncols();
        let weight = joint.noise_nm(&residual_nm, unknown_friction).recip();
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
