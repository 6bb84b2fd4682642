//! Xia's Gaussian process: trained on the compliance model's error, then written down on a grid.
//!
//! Training costs the cube of the points, so the recording's rows are gathered into cells of the plane of compliance torque
//! and motor torque, and each cell is one point: its mean. The kernel is the squared exponential, its size and width by maximum
//! likelihood (Rasmussen, Williams, Gaussian Processes for Machine Learning, 2006, section 5.4), by the crate `friedrich`.

use friedrich::gaussian_process::GaussianProcess as Process;
use friedrich::kernel::SquaredExp;
use friedrich::prior::ConstantPrior;
use robot::estimators::GaussianProcessTable;

use super::{Bench, Calibration, Fit};
use crate::joint::Kind;
use crate::{Compliance, GaussianProcess, TorqueEstimator};

/// Cells each way: at most their square are training points.
const CELLS: usize = 20;
/// Lines of the grid each way.
const LINES: usize = 25;
/// Fewer rows than this make no mean.
const CELL_ROWS_MIN: usize = 3;

/// One training point: its place, the mean error there, and the error's spread.
struct Cell {
    sum: [f64; 3],
    squares: f64,
    rows: usize,
}

impl Bench<'_> {
    /// Needs the compliance model's calibration.
    pub(super) fn gaussian_process(&self, found: &mut Calibration) {
        let Some(compliance) = found.parameters.compliance.clone() else {
            return;
        };
        let points = self.points(Compliance::new(&compliance, self.joint.gear_ratio));
        let [compliance_nm, motor_nm] = [0, 1].map(|axis| {
            let values = points.iter().map(|point: &[f64; 3]| point[axis]);
            let low = values.clone().fold(f64::INFINITY, f64::min);
            [low, values.fold(low + f64::MIN_POSITIVE, f64::max)]
        });
        let axes = [compliance_nm, motor_nm];
        let cells = cells(&points, axes);
        if cells.is_empty() {
            return;
        }
        let table = train(&cells, axes);
        let estimator = GaussianProcess::new(&compliance, table.clone(), self.joint.gear_ratio);
        let misses = self.static_misses(estimator);
        let squares: f64 = misses.iter().map(|miss| miss * miss).sum();
        found.fits.push(Fit {
            kind: Kind::GaussianProcess,
            fitted: Vec::new(),
            rms_nm: (squares / misses.len().max(1) as f64).sqrt(),
            starts: 1,
            agreeing_starts: 1,
        });
        found.parameters.gaussian_process = Some(table);
    }

    /// Compliance torque, motor torque at the joint side, and what the compliance model misses.
    fn points(&self, mut compliance: Compliance) -> Vec<[f64; 3]> {
        let point = |row: &usize| {
            let sample = &self.log.samples[*row];
            let estimate = compliance.estimate(sample).ok()?;
            Some([
                estimate.torque_nm,
                self.joint.gear_ratio * sample.motor_torque_nm,
                self.reference_nm[*row] - estimate.torque_nm,
            ])
        };
        self.rows.iter().filter_map(point).collect()
    }
}

/// Where a value lies between the ends of its axis.
fn share(value: f64, [low, high]: [f64; 2]) -> f64 {
    (value - low) / (high - low)
}

fn cells(points: &[[f64; 3]], axes: [[f64; 2]; 2]) -> Vec<Cell> {
    let mut cells: Vec<Cell> = (0..CELLS * CELLS)
        .map(|_| Cell {
            sum: [0.0; 3],
            squares: 0.0,
            rows: 0,
        })
        .collect();
    for point in points {
        let place = [0, 1]
            .map(|axis| ((share(point[axis], axes[axis]) * CELLS as f64) as usize).min(CELLS - 1));
        let cell = &mut cells[place[1] * CELLS + place[0]];
        for (sum, value) in cell.sum.iter_mut().zip(point) {
            *sum += value;
        }
        cell.squares += point[2] * point[2];
        cell.rows += 1;
    }
    cells.retain(|cell| cell.rows >= CELL_ROWS_MIN);
    cells
}

impl Cell {
    fn mean(&self, axis: usize) -> f64 {
        self.sum[axis] / self.rows as f64
    }

    fn variance(&self) -> f64 {
        (self.squares / self.rows as f64 - self.mean(2).powi(2)).max(0.0)
    }
}

fn train(cells: &[Cell], axes: [[f64; 2]; 2]) -> GaussianProcessTable {
    let inputs: Vec<Vec<f64>> = cells
        .iter()
        .map(|cell| vec![share(cell.mean(0), axes[0]), share(cell.mean(1), axes[1])])
        .collect();
    let outputs: Vec<f64> = cells.iter().map(|cell| cell.mean(2)).collect();
    let rows: usize = cells.iter().map(|cell| cell.rows).sum();
    let within: f64 = cells
        .iter()
        .map(|cell| cell.variance() * cell.rows as f64)
        .sum::<f64>()
        / rows as f64;
    let spread = (outputs.iter().map(|value| value * value).sum::<f64>() / outputs.len() as f64)
        .sqrt()
        .max(f64::MIN_POSITIVE);
    let process = Process::builder(inputs, outputs)
        .set_prior(ConstantPrior::new(0.0))
        .set_kernel(SquaredExp::new(0.2, spread))
        // friedrich's noise is a share of the outputs' spread
        .set_noise(0.1)
        .set_fit_parameters(50, 0.01)
        .fit_kernel()
        .train();
    let lines = |axis: usize| {
        (0..LINES).map(move |line| {
            let along = line as f64 / (LINES - 1) as f64;
            let [low, high] = axes[axis];
            (along, low + along * (high - low))
        })
    };
    let grid: Vec<Vec<(f64, f64)>> = lines(1)
        .map(|(row, _)| {
            lines(0)
                .map(|(column, _)| {
                    let (mean, variance): (f64, f64) =
                        process.predict_mean_variance(&vec![column, row]);
                    (mean, (variance.max(0.0) + within).sqrt())
                })
                .collect()
        })
        .collect();
    let part = |of: fn(&(f64, f64)) -> f64| -> Vec<Vec<f64>> {
        grid.iter()
            .map(|row| row.iter().map(of).collect())
            .collect()
    };
    GaussianProcessTable {
        compliance_nm: axes[0],
        motor_nm: axes[1],
        residual_nm: part(|(mean, _)| *mean),
        std_nm: part(|(_, std)| *std),
    }
}
