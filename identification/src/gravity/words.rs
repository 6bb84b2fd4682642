//! What is identifiable, in words: subspaces as sums of named parameters.
//!
//! A basis of a subspace can be turned at will. Reduced to row echelon form it has as few terms as possible, with a
//! parameter of its own in each row: the base parameters of Khalil and Kleinfinger, IEEE Trans. Robotics and Automation 3
//! (1987) 517-526, found from the data's subspace instead of from the kinematics.

use nalgebra::{DMatrix, DVector};
use robot::Robot;

use super::parameters::{PER_LINK, Parameters, QUANTITIES};
use super::{Combination, Quantity, Term, UnseenDirection};
use crate::Estimate;

/// A parameter that makes up less than this share of a row does not lead a sum, for all others would then stand there
/// with large factors; unless no other is left, down to what is rounding of the subspace.
const LEAST_PIVOTS: [f64; 2] = [0.1, 1e-4];

/// Terms below this share of the largest, in standard deviations of the file, are left out of the words.
const LEAST_TERM: f64 = 1e-2;

/// The determined sums with their values in the file and from the data. All rows are in units of the file's tolerance.
pub(super) fn combinations(
    robot: &Robot,
    parameters: &Parameters,
    seen: &DMatrix<f64>,
    change: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> Vec<Combination> {
    let order: Vec<usize> = (0..parameters.count()).collect();
    reduced(seen.clone(), &order)
        .into_iter()
        .map(|(pivot, row)| {
            // p = t·u, so a sum of u with factors r is one of p with factors r/t.
            let factors = row.zip_map(
                &parameters.tolerance,
                |r, t| if t > 0.0 { r / t } else { 0.0 },
            );
            let to_pivot = factors[pivot].recip();
            let file_value = factors.dot(&parameters.file) * to_pivot;
            let fitted = Estimate {
                value: file_value + row.dot(change) * to_pivot,
                standard_error: (covariance * &row).dot(&row).max(0.0).sqrt() * to_pivot.abs(),
            };
            let terms = terms(robot, pivot, &row, &(factors * to_pivot));
            Combination {
                words: sum_in_words(&terms),
                unit: match QUANTITIES[pivot % PER_LINK] {
                    Quantity::Mass => "kg",
                    _ => "kg m",
                },
                terms,
                file_value,
                fitted,
            }
        })
        .collect()
}

/// The directions that change no torque. A link without mass has none: its parameters stay.
pub(super) fn unseen_directions(
    robot: &Robot,
    parameters: &Parameters,
    unseen: &DMatrix<f64>,
) -> Vec<UnseenDirection> {
    let held = |parameter: usize| parameters.tolerance[parameter] == 0.0;
    // From the tip: a link's mass moves against the first moment of the link before.
    let order: Vec<usize> = (0..parameters.count())
        .rev()
        .filter(|p| !held(*p))
        .collect();
    reduced(unseen.clone(), &order)
        .into_iter()
        .map(|(pivot, row)| {
            let changes = row.component_mul(&parameters.tolerance);
            let to_pivot = changes[pivot].recip();
            let terms = terms(robot, pivot, &row, &(changes * to_pivot));
            UnseenDirection {
                words: direction_in_words(&terms),
                terms,
            }
        })
        .collect()
}

/// Reduced row echelon form with the columns taken in this order: pivots with their rows.
fn reduced(mut rows: DMatrix<f64>, order: &[usize]) -> Vec<(usize, DVector<f64>)> {
    let mut pivots = Vec::new();
    let tried = LEAST_PIVOTS
        .into_iter()
        .flat_map(|least| order.iter().map(move |column| (least, column)));
    for (least_pivot, column) in tried {
        let done = pivots.len();
        if done == rows.nrows() {
            break;
        }
        if pivots.contains(column) {
            continue;
        }
        let best = (done..rows.nrows()).max_by(|a, b| {
            rows[(*a, *column)]
                .abs()
                .total_cmp(&rows[(*b, *column)].abs())
        });
        let Some(best) = best.filter(|row| rows[(*row, *column)].abs() > least_pivot) else {
            continue;
        };
        rows.swap_rows(done, best);
        let pivot = rows.row(done) / rows[(done, *column)];
        for row in 0..rows.nrows() {
            let factor = rows[(row, *column)];
            if row == done {
                rows.set_row(row, &pivot);
            } else {
                let cleared = rows.row(row) - &pivot * factor;
                rows.set_row(row, &cleared);
            }
        }
        pivots.push(*column);
    }
    let row = |index: usize| rows.row(index).transpose();
    let reduced = pivots.into_iter().enumerate();
    reduced.map(|(index, pivot)| (pivot, row(index))).collect()
}

/// The pivot first, the rest in the order of the chain.
fn terms(robot: &Robot, pivot: usize, row: &DVector<f64>, factors: &DVector<f64>) -> Vec<Term> {
    let least = LEAST_TERM * row.amax();
    let term = |parameter: usize| Term {
        joint: robot.joints[parameter / PER_LINK].name.clone(),
        quantity: QUANTITIES[parameter % PER_LINK],
        coefficient: factors[parameter],
    };
    let rest = (0..row.len()).filter(|index| *index != pivot && row[*index].abs() > least);
    std::iter::once(pivot).chain(rest).map(term).collect()
}

fn quantity_in_words(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Mass => "m",
        Quantity::MomentX => "m·c_x",
        Quantity::MomentY => "m·c_y",
        Quantity::MomentZ => "m·c_z",
    }
}

/// Three digits, and none that are zero.
fn number_in_words(value: f64) -> String {
    let rounded = format!("{value:.3}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short.is_empty() || short == "-0" {
        return format!("{value:.1e}");
    }
    short.to_owned()
}

fn sum_in_words(terms: &[Term]) -> String {
    let mut words = String::new();
    for term in terms {
        let sign = if term.coefficient < 0.0 { "-" } else { "+" };
        if !words.is_empty() {
            words += &format!(" {sign} ");
        }
        let size = number_in_words(term.coefficient.abs());
        if size != "1" {
            words += &format!("{size}·");
        }
        words += &format!("{} of {}", quantity_in_words(term.quantity), term.joint);
    }
    words
}

fn direction_in_words(terms: &[Term]) -> String {
    let changes: Vec<String> = terms
        .iter()
        .map(|term| {
            let unit = match term.quantity {
                Quantity::Mass => "kg",
                _ => "kg m",
            };
            let sign = if term.coefficient < 0.0 { "-" } else { "+" };
            let size = number_in_words(term.coefficient.abs());
            let quantity = quantity_in_words(term.quantity);
            format!("{quantity} of {} {sign}{size} {unit}", term.joint)
        })
        .collect();
    changes.join(" with ")
}
