//! How large a gap is, before and after: mean squares over rows away from reversals, with the part that noise and the
//! twin itself make up.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use robot::Effect;

use crate::fit::{BLOCKS, block_of};

use crate::observe::Channel;
use crate::refine::Refined;
use crate::report::{BeforeAfter, Gap, Parameter};
use crate::search::{Model, Search, Term, uniform};

/// A law is no truer than this part of its values, however well it is fitted.
const LAW: f64 = 0.03;
/// Samples of a bootstrap.
const DRAWS: usize = 400;
/// Within this part of a limit a shape counts as on it.
const AT_BOUND: f64 = 0.02;

/// Weighted squares of a channel's residual, block by block.
#[derive(Clone, Debug, PartialEq)]
pub struct Squares {
    square: Vec<f64>,
    weight: Vec<f64>,
}

impl Squares {
    /// Of one channel.
    pub fn of(search: &Search<'_>, residual_nm: &[f64], channel: Channel) -> Self {
        let blocks = block_of(&search.twin.rows);
        let mut squares = Self {
            square: vec![0.0; BLOCKS],
            weight: vec![0.0; BLOCKS],
        };
        for (k, row) in search.twin.rows.iter().enumerate() {
            if row.channel == channel {
                let weight = search.whitener.weight(k).powi(2);
                squares.square[blocks[k]] += weight * residual_nm[k].powi(2);
                squares.weight[blocks[k]] += weight;
            }
        }
        squares
    }

    /// Over all blocks.
    pub fn mean(&self) -> f64 {
        self.over(0..BLOCKS)
    }

    fn over(&self, blocks: impl IntoIterator<Item = usize>) -> f64 {
        let (mut square, mut weight) = (0.0, 0.0);
        for block in blocks {
            square += self.square[block];
            weight += self.weight[block];
        }
        square / f64::max(weight, 1e-300)
    }
}

/// `1 - (after - noise)/(before - noise)`, none where there was no gap above the noise.
pub fn shrink(before: f64, after: f64, noise: f64) -> Option<f64> {
    let gap = before - noise;
    (gap > 1e-3 * noise).then(|| 1.0 - (after - noise).max(0.0) / gap)
}

/// Sizes before and after, with the interval of the shrink from blocks drawn anew.
pub fn gap(search: &Search<'_>, before_nm: &[f64], after_nm: &[f64]) -> Gap {
    let before = Squares::of(search, before_nm, Channel::Motor);
    let after = Squares::of(search, after_nm, Channel::Motor);
    let noise = search.twin_floor_nm(Channel::Motor).powi(2);
    let whole = shrink(before.mean(), after.mean(), noise).unwrap_or(0.0);
    let mut random = uniform(1);
    let mut drawn: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let blocks: Vec<usize> = (0..BLOCKS)
                .map(|_| ((random() * BLOCKS as f64) as usize).min(BLOCKS - 1))
                .collect();
            let [before, after] = [&before, &after].map(|s| s.over(blocks.iter().copied()));
            shrink(before, after, noise).unwrap_or(0.0)
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    let at = |part: f64| drawn[(part * (DRAWS - 1) as f64) as usize];
    Gap {
        torque_rms_nm: BeforeAfter {
            before: before.mean().sqrt(),
            after: after.mean().sqrt(),
            noise_floor: noise.sqrt(),
            held_out: true,
        },
        position_rms_rad: BeforeAfter::default(),
        shrink: whole,
        shrink_low: at(0.025).min(whole),
        shrink_high: at(0.975).max(whole),
    }
}

/// Difference between recorded and re-simulated motor position, root mean square, joint side.
pub fn position_rms_rad(search: &Search<'_>, without: &Model, with: &Model) -> BeforeAfter {
    let rms = |model: &Model| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (piece, stretch) in search.twin.stretches().into_iter().enumerate() {
            let trace = search.twin.controlled(piece, &model.changes(&search.scale));
            for (a, b) in stretch.drive.motor_rad.iter().zip(&trace.motor_rad) {
                sum += (a - b).powi(2);
                count += 1.0;
            }
        }
        (sum / f64::max(count, 1.0)).sqrt()
    };
    let nominal = &search.twin.nominal;
    let step_rad = nominal.motor_resolution_rad / nominal.gear_ratio;
    let noise_rad = nominal.position_noise_rad / nominal.gear_ratio;
    BeforeAfter {
        before: rms(without),
        after: rms(with),
        // a rounded value is off by a twelfth of its step, squared
        noise_floor: (step_rad.powi(2) / 12.0 + noise_rad.powi(2)).sqrt(),
        held_out: false,
    }
}

/// Parameters of one term of a refined model with their standard errors: values are drawn from the fit's covariance and
/// written as the effect writes them.
pub fn parameters(
    search: &Search<'_>,
    refined: &Refined,
    covariance: &DMatrix<f64>,
    term: usize,
) -> (BTreeMap<String, Parameter>, Option<String>) {
    let value = &refined.model.terms[term];
    let first = search.twin.known.len()
        + refined.model.terms[..term]
            .iter()
            .map(|term| Search::values(&term.hypothesis))
            .sum::<usize>();
    let count = Search::values(&value.hypothesis);
    let own = if covariance.nrows() >= first + count {
        covariance.view((first, first), (count, count)).into_owned()
    } else {
        DMatrix::zeros(count, count)
    };
    term_parameters(search, value, &own)
}

/// The same of a term whose steps have this covariance.
pub fn term_parameters(
    search: &Search<'_>,
    value: &Term,
    covariance: &DMatrix<f64>,
) -> (BTreeMap<String, Parameter>, Option<String>) {
    let scale = &search.scale;
    let effect = value.effect(scale);
    let count = covariance.nrows();
    let root = covariance.clone().cholesky().map_or_else(
        || DMatrix::from_diagonal(&covariance.diagonal().map(|v| v.max(0.0).sqrt())),
        |cholesky| cholesky.l(),
    );
    let mut random = uniform(7);
    let mut spread: BTreeMap<String, (f64, f64)> = BTreeMap::new();
    let told = numbers(&effect);
    for _ in 0..DRAWS {
        let normal = DVector::from_fn(count, |_, _| {
            // sum of twelve uniform numbers: as good as normal for a standard error
            (0..12).map(|_| random()).sum::<f64>() - 6.0
        });
        let drawn = search.stepped(value, (&root * normal).as_slice());
        for (name, x) in numbers(&drawn.effect(scale)) {
            let off = match told.get(&name) {
                Some(centre) if name.contains("phase") => wrapped(x - centre),
                Some(centre) => x - centre,
                None => continue,
            };
            let entry = spread.entry(name).or_default();
            entry.0 += off * off;
            entry.1 += 1.0;
        }
    }
    let at_bound = at_bound(search, value);
    let parameters = told
        .into_iter()
        .map(|(name, value)| {
            let (sum, count) = spread.get(&name).copied().unwrap_or_default();
            let scatter = (sum / f64::max(count, 1.0)).sqrt();
            let of_law = if is_size(&name) {
                LAW * (value - if name == "gain" { 1.0 } else { 0.0 }).abs()
            } else {
                0.0
            };
            let parameter = Parameter {
                value,
                std: scatter.hypot(of_law),
                at_bound,
            };
            (name, parameter)
        })
        .collect();
    (parameters, side(&effect))
}

/// Whether a parameter says how much, not where.
fn is_size(name: &str) -> bool {
    !(name.contains("phase") || name.contains("cycles") || name.contains("centre"))
}

fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

fn at_bound(search: &Search<'_>, term: &Term) -> bool {
    if !term.hypothesis.shape_is_free() {
        return false;
    }
    let [low, high] = term.hypothesis.shape_range(&search.scale);
    let shape = term.hypothesis.shape[0];
    shape < low * (1.0 + AT_BOUND) || shape > high * (1.0 - AT_BOUND)
}

/// An effect's parameters by name; a point is three of them.
pub fn numbers(effect: &Effect) -> BTreeMap<String, f64> {
    let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(effect) else {
        return BTreeMap::new();
    };
    let mut numbers = BTreeMap::new();
    for (name, value) in fields {
        match value {
            serde_json::Value::Number(number) => {
                numbers.insert(name, number.as_f64().unwrap_or(0.0));
            }
            serde_json::Value::Array(items) => {
                // one number is the distance along z
                numbers.insert(
                    name.clone(),
                    items.last().and_then(|z| z.as_f64()).unwrap_or(0.0),
                );
                for (axis, item) in ["x", "y", "z"].iter().zip(items) {
                    numbers.insert(format!("{name}_{axis}"), item.as_f64().unwrap_or(0.0));
                }
            }
            _ => {}
        }
    }
    numbers
}

pub(crate) fn side(effect: &Effect) -> Option<String> {
    let fields = serde_json::to_value(effect).ok()?;
    fields.get("side")?.as_str().map(str::to_owned)
}

/// The effect's own share: how far the gap shrinks with one term alone, beside what is settled.
pub fn shrink_alone(
    search: &Search<'_>,
    refined: &Refined,
    settled: &[Term],
    term: usize,
    before_nm: &[f64],
) -> f64 {
    let alone = Model {
        known: refined.model.known.clone(),
        settled: settled.to_vec(),
        terms: vec![refined.model.terms[term].clone()],
    };
    let Ok(after_nm) = search.residual_nm(&alone) else {
        return 0.0;
    };
    shrink_of(search, before_nm, &after_nm)
}

/// How far the motor's gap shrinks from one residual to another; 0 where there was none above the noise.
pub(crate) fn shrink_of(search: &Search<'_>, before_nm: &[f64], after_nm: &[f64]) -> f64 {
    let noise = search.twin_floor_nm(Channel::Motor).powi(2);
    let [before, after] =
        [before_nm, after_nm].map(|r| Squares::of(search, r, Channel::Motor).mean());
    shrink(before, after, noise).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrink_counts_above_the_noise_and_needs_a_gap() {
        assert_eq!(shrink(5.0, 1.0, 1.0), Some(1.0));
        assert_eq!(shrink(5.0, 3.0, 1.0), Some(0.5));
        assert_eq!(shrink(5.0, 0.5, 1.0), Some(1.0));
        assert_eq!(shrink(1.0, 1.0, 1.0), None);
    }

    #[test]
    fn a_point_is_three_numbers_and_a_side_is_none() {
        let payload = Effect::Payload {
            mass_kg: 2.0,
            centre_m: [0.1, 0.2, 0.3],
        };
        let found = numbers(&payload);
        assert_eq!(found["mass_kg"], 2.0);
        assert_eq!(found["centre_m_y"], 0.2);
        assert_eq!(side(&payload), None);
    }
}
