//! Where a gap is: stage of the joint, signals, ranges of the motion and frequencies.

use std::collections::BTreeMap;

use gap_report::{BandShare, NamedEffect, Regime, RemainsOver, Where};
use robot::Stage;

use super::rows::Rows;
use super::told::Found;

impl Found<'_> {
    pub(super) fn place(
        &self,
        effects: &[NamedEffect],
        gap_nm: &[f64],
        remaining: &[RemainsOver],
    ) -> Where {
        let mut stages: BTreeMap<Stage, f64> = BTreeMap::new();
        for effect in effects {
            if let Some(stage) = Stage::of(&effect.effect) {
                *stages.entry(stage).or_default() += effect.share.max(0.0);
            }
        }
        let largest = stages.iter().max_by(|a, b| a.1.total_cmp(b.1));
        let stage = largest.map(|(stage, _)| *stage);
        let sum: f64 = stages.values().sum();
        let stages = stages
            .into_iter()
            .map(|(stage, share)| (stage, share / sum.max(f64::MIN_POSITIVE)))
            .collect();
        let mut all = regimes("position_rad", &self.rows.position_rad, gap_nm);
        all.extend(regimes_of_motor(self, gap_nm));
        all.extend(regimes("load_nm", &self.rows.load_nm, gap_nm));
        all.extend(regimes("time_s", &self.rows.time_s, gap_nm));
        Where {
            stage: stage.or_else(|| self.stage_of_single(remaining)),
            stages,
            signals: self.signals.clone(),
            regimes: all,
            bands: bands(self.rows, gap_nm),
        }
    }

    /// Where no name is told: of the one that comes nearest, if anything is left at all.
    fn stage_of_single(&self, remaining: &[RemainsOver]) -> Option<Stage> {
        if remaining.is_empty() {
            return None;
        }
        let items = 0..self.called.items();
        let best = items
            .map(|index| self.evidence.scored(1 << index))
            .max_by(|a, b| a.score.total_cmp(&b.score))?;
        let index = best.names.trailing_zeros() as usize;
        Stage::of(self.name_in(best.names, index))
    }
}

fn regimes_of_motor(found: &Found<'_>, gap_nm: &[f64]) -> Vec<Regime> {
    let ratio = found.gear_ratio;
    let velocity = found.rows.velocity_rad_s.iter();
    let motor: Vec<f64> = velocity.map(|v| ratio * v).collect();
    regimes("motor_velocity_rad_s", &motor, gap_nm)
}

/// Shares of the gap's square in five ranges of a variable, each with as many rows.
pub fn regimes(variable: &str, values: &[f64], gap_nm: &[f64]) -> Vec<Regime> {
    const RANGES: usize = 5;
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let square: f64 = gap_nm.iter().map(|x| x * x).sum();
    if order.is_empty() || square <= 0.0 {
        return Vec::new();
    }
    (0..RANGES)
        .map(|range| {
            let within = &order[range * order.len() / RANGES..(range + 1) * order.len() / RANGES];
            let ends = within.first().zip(within.last());
            Regime {
                variable: variable.to_owned(),
                from: ends.map_or(0.0, |(first, _)| values[*first]),
                to: ends.map_or(0.0, |(_, last)| values[*last]),
                share: within.iter().map(|row| gap_nm[*row].powi(2)).sum::<f64>() / square,
            }
        })
        .collect()
}

/// Shares of the gap's square by frequency, octave by octave up to the compared band's end.
fn bands(rows: &Rows, gap_nm: &[f64]) -> Vec<BandShare> {
    use joint_twin::signal::band::{Band, COMPARED_HZ};
    let square: f64 = gap_nm.iter().map(|x| x * x).sum();
    let ends = rows.time_s.first().zip(rows.time_s.last());
    let Some((first, last)) = ends.filter(|(first, last)| last > first && square > 0.0) else {
        return Vec::new();
    };
    let rate_hz = (rows.count() - 1) as f64 / (last - first);
    let below = |hz: f64| {
        let smooth = Band::of(rate_hz, hz).limit(gap_nm).unwrap_or_default();
        smooth.iter().map(|x| x * x).sum::<f64>() / square
    };
    let mut bands = Vec::new();
    let (mut from_hz, mut known) = (0.0, 0.0);
    for octaves in [3, 2, 1, 0] {
        let to_hz = COMPARED_HZ / f64::from(1 << octaves);
        if to_hz > 0.45 * rate_hz && from_hz > 0.0 {
            break;
        }
        let all = if octaves == 0 { 1.0 } else { below(to_hz) };
        bands.push(BandShare {
            from_hz,
            to_hz,
            share: (all - known).max(0.0),
        });
        (from_hz, known) = (to_hz, all);
    }
    bands
}
