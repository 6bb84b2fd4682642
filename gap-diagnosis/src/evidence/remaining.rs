//! What the names leave, described afterwards by smooth laws over what it may depend on. They are no names: a table, not a cause.

use std::f64::consts::TAU;

use gap_report::{Remains, RemainsOver};
use nalgebra::{DMatrix, DVector};

use super::rows::Rows;
use super::{NAME_NATS, PARTS, independent_rows};

/// Corners of a smooth law.
const CORNERS: usize = 9;
/// Cycles per motor turn that gears and motors have.
const CYCLES: [f64; 3] = [1.0, 2.0, 4.0];
/// Keeps corners without rows at zero, relative to the rows' squares.
const RIDGE: f64 = 1e-3;

/// A variable, the columns over it, and where it is one number its corners and values.
type Family<'a> = (Remains, Vec<Vec<f64>>, Option<(Vec<f64>, &'a [f64])>);

/// Over which variables the rest lies, the largest share first. `left`: mean square that the names leave out; `gap`: of the whole gap,
/// both above the noise.
pub fn over(
    rows: &Rows,
    others: &[Vec<f64>],
    gear_ratio: f64,
    rest_nm: &[f64],
    [left, gap]: [f64; 2],
) -> Vec<RemainsOver> {
    let independent = independent_rows(rest_nm);
    let families: [Family<'_>; 7] = [
        table(Remains::Position, &rows.position_rad),
        table(Remains::Velocity, &rows.velocity_rad_s),
        table(Remains::Load, &rows.load_nm),
        (Remains::Time, bent(&rows.time_s), None),
        (Remains::SinceReversal, since_reversal(rows), None),
        (Remains::MotorPhase, motor_phase(rows, gear_ratio), None),
        (Remains::OtherJoints, others.to_vec(), None),
    ];
    let square = rest_nm.iter().map(|x| x * x).sum::<f64>();
    if square <= 0.0 || gap <= 0.0 {
        return Vec::new();
    }
    let mut found: Vec<RemainsOver> = families
        .into_iter()
        .filter(|(_, columns, _)| !columns.is_empty())
        .filter_map(|(over, columns, table)| {
            let after = left_out(&columns, rest_nm)?;
            let nats = 0.5 * independent * (square / after).ln();
            let share = (1.0 - after / square) * left / gap;
            let (at, torque_nm) = match table {
                Some((corners, values)) => {
                    let hats = hats_at(&corners, values);
                    (corners, solved(&hats, rest_nm)?)
                }
                None => (Vec::new(), Vec::new()),
            };
            (nats > NAME_NATS).then_some(RemainsOver {
                over,
                share,
                at,
                torque_nm,
            })
        })
        .collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found
}

fn table(over: Remains, values: &[f64]) -> Family<'_> {
    let corners = corners(values);
    let columns = hats_at(&corners, values);
    (over, columns, Some((corners, values)))
}

/// Columns of a smooth law over values.
pub(super) fn hats(values: &[f64]) -> Vec<Vec<f64>> {
    hats_at(&corners(values), values)
}

/// Columns times the direction of motion: what brakes.
pub(super) fn braking(columns: Vec<Vec<f64>>, velocity_rad_s: &[f64]) -> Vec<Vec<f64>> {
    let columns = columns.into_iter();
    columns
        .map(|column| {
            let both = column.iter().zip(velocity_rad_s);
            both.map(|(x, v)| x * v.signum()).collect()
        })
        .collect()
}

/// As many rows lie between any two.
fn corners(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let mut corners: Vec<f64> = (0..CORNERS)
        .filter_map(|k| sorted.get(k * last / (CORNERS - 1)).copied())
        .collect();
    corners.dedup();
    corners
}

fn hats_at(corners: &[f64], values: &[f64]) -> Vec<Vec<f64>> {
    (0..corners.len())
        .map(|corner| {
            let values = values.iter();
            values.map(|value| hat(corners, corner, *value)).collect()
        })
        .collect()
}

fn hat(corners: &[f64], corner: usize, value: f64) -> f64 {
    let at = corners[corner];
    let beside = if value < at {
        corner.checked_sub(1).map(|k| corners[k])
    } else {
        corners.get(corner + 1).copied()
    };
    match beside {
        Some(beside) => (1.0 - (value - at) / (beside - at)).clamp(0.0, 1.0),
        None => 1.0,
    }
}

pub(super) fn bent(time_s: &[f64]) -> Vec<Vec<f64>> {
    let ends = time_s.first().zip(time_s.last());
    let Some((first, last)) = ends.filter(|(first, last)| last > first) else {
        return Vec::new();
    };
    let part = |t: &f64| 2.0 * (t - first) / (last - first) - 1.0;
    let power = |n: i32| time_s.iter().map(move |t| part(t).powi(n)).collect();
    vec![power(0), power(1), power(2)]
}

/// Friction that grows or fades after each reversal.
pub(super) fn since_reversal(rows: &Rows) -> Vec<Vec<f64>> {
    braking(hats(&rows.since_reversal_s), &rows.velocity_rad_s)
}

fn motor_phase(rows: &Rows, gear_ratio: f64) -> Vec<Vec<f64>> {
    let range = |values: &[f64]| {
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        most - values.iter().copied().fold(f64::INFINITY, f64::min)
    };
    if range(&rows.position_rad) * gear_ratio.abs() < TAU {
        return Vec::new();
    }
    let of = |wave: fn(f64) -> f64, cycles: f64| {
        let angles = rows.position_rad.iter();
        angles.map(move |q| wave(cycles * gear_ratio * q)).collect()
    };
    CYCLES
        .iter()
        .flat_map(|cycles| [of(f64::sin, *cycles), of(f64::cos, *cycles)])
        .collect()
}

fn solved(columns: &[Vec<f64>], target: &[f64]) -> Option<Vec<f64>> {
    let all = 0..target.len();
    let (gram, vector) = sums(columns, target, &[all]);
    let values = lifted(gram).cholesky()?.solve(&vector);
    Some(values.iter().copied().collect())
}

fn lifted(mut gram: DMatrix<f64>) -> DMatrix<f64> {
    let mean = gram.trace() / gram.nrows().max(1) as f64;
    for k in 0..gram.nrows() {
        gram[(k, k)] += RIDGE * mean + f64::MIN_POSITIVE;
    }
    gram
}

fn sums(
    columns: &[Vec<f64>],
    target: &[f64],
    within: &[std::ops::Range<usize>],
) -> (DMatrix<f64>, DVector<f64>) {
    let count = columns.len();
    let product = |a: &[f64], b: &[f64]| -> f64 {
        let ranges = within.iter();
        ranges
            .map(|range| {
                let both = a[range.clone()].iter().zip(&b[range.clone()]);
                both.map(|(a, b)| a * b).sum::<f64>()
            })
            .sum()
    };
    (
        DMatrix::from_fn(count, count, |i, j| product(&columns[i], &columns[j])),
        DVector::from_fn(count, |i, _| product(&columns[i], target)),
    )
}

/// Sum of squares that columns leave of the parts that they are not fitted to.
fn left_out(columns: &[Vec<f64>], target: &[f64]) -> Option<f64> {
    let rows = target.len();
    let mut left = 0.0;
    for part in 0..PARTS {
        let within = part * rows / PARTS..(part + 1) * rows / PARTS;
        let (gram, vector) = sums(columns, target, &[0..within.start, within.end..rows]);
        let values = lifted(gram).cholesky()?.solve(&vector);
        for row in within {
            let predicted: f64 = columns
                .iter()
                .zip(values.iter())
                .map(|(column, value)| column[row] * value)
                .sum();
            left += (target[row] - predicted).powi(2);
        }
    }
    Some(left)
}
