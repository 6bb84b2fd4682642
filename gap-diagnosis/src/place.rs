//! Where a gap lies: by signal, by regime, by frequency. Shares are of the squared residual above the noise floor, over
//! rows away from reversals.

use std::f64::consts::TAU;

use crate::judge::Squares;
use crate::observe::Channel;
use crate::report::{BandShare, Regime, SignalGap};
use crate::search::Search;
use crate::smooth::low_pass;
use crate::twin::Row;
use crate::whiten::series;

/// Ranges of each variable.
const RANGES: usize = 5;
/// Edges of the bands, as parts of the highest frequency compared.
const BAND_EDGES: [f64; 3] = [0.07, 0.27, 1.0];

/// What is read off a row.
type Variable<'a> = &'a dyn Fn(&Row) -> f64;

/// Gap over noise of every signal, largest first.
pub fn signals(search: &Search<'_>, residual_nm: &[f64]) -> Vec<SignalGap> {
    let channels = search.twin.channels.iter();
    let mut all: Vec<SignalGap> = channels
        .map(|&channel| SignalGap {
            signal: channel.signal().to_owned(),
            gap_to_noise: gap_to_noise(search, residual_nm, channel),
        })
        .collect();
    all.sort_by(|a, b| b.gap_to_noise.total_cmp(&a.gap_to_noise));
    all
}

fn gap_to_noise(search: &Search<'_>, residual_nm: &[f64], channel: Channel) -> f64 {
    let square = Squares::of(search, residual_nm, channel).mean();
    let noise = search.twin_floor_nm(channel).powi(2);
    ((square - noise).max(0.0) / noise.max(1e-300)).sqrt()
}

/// The channel with the largest gap over noise.
fn loudest(search: &Search<'_>, residual_nm: &[f64]) -> Channel {
    let gap = |channel: &Channel| gap_to_noise(search, residual_nm, *channel);
    let channels = search.twin.channels.iter().copied();
    let loudest = channels.max_by(|a, b| gap(a).total_cmp(&gap(b)));
    loudest.unwrap_or(Channel::Motor)
}

/// Shares by ranges of position, velocity, load, motor phase and time, of the channel with the largest gap.
pub fn regimes(search: &Search<'_>, residual_nm: &[f64]) -> Vec<Regime> {
    let ratio = search.scale.gear_ratio;
    let variables: [(&str, Variable<'_>); 5] = [
        ("position_rad", &|row| row.position_rad),
        ("motor_velocity_rad_s", &|row| ratio * row.velocity_rad_s),
        ("load_nm", &|row| row.load_nm),
        ("motor_phase_rad", &|row| {
            row.motor_angle_rad.rem_euclid(TAU)
        }),
        ("time_s", &|row| row.time_s),
    ];
    let channel = loudest(search, residual_nm);
    let noise = search.twin_floor_nm(channel).powi(2);
    let rows: Vec<(usize, &Row)> = search
        .twin
        .rows
        .iter()
        .enumerate()
        .filter(|(_, row)| row.channel == channel)
        .collect();
    let mut all = Vec::new();
    for (name, of) in variables {
        let (low, high) = rows
            .iter()
            .map(|(_, row)| of(row))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
        let width = (high - low) / RANGES as f64;
        if width.is_nan() || width <= 0.0 {
            continue;
        }
        let mut energy = [0.0; RANGES];
        for (k, row) in &rows {
            let range = (((of(row) - low) / width) as usize).min(RANGES - 1);
            let weight = search.whitener.weight(*k).powi(2);
            energy[range] += weight * (residual_nm[*k].powi(2) - noise);
        }
        let total: f64 = energy.iter().map(|e| e.max(0.0)).sum();
        all.extend(energy.iter().enumerate().map(|(range, energy)| Regime {
            variable: name.to_owned(),
            from: low + range as f64 * width,
            to: low + (range + 1) as f64 * width,
            share: energy.max(0.0) / total.max(1e-300),
        }));
    }
    all
}

/// Shares by frequency, of the channel with the largest gap; its floor is taken for white.
pub fn bands(search: &Search<'_>, residual_nm: &[f64]) -> Vec<BandShare> {
    let rate_hz = search.twin.rows_hz();
    let top_hz = search.twin.cutoff_hz();
    let channel = loudest(search, residual_nm);
    let mut below = [0.0; BAND_EDGES.len()];
    let mut rows = 0;
    for of in series(&search.twin.rows) {
        if search.twin.rows[of.start].channel != channel {
            continue;
        }
        rows += of.len();
        let values = &residual_nm[of];
        for (sum, edge) in below.iter_mut().zip(BAND_EDGES) {
            let cutoff_hz = edge * top_hz;
            let energy = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
            *sum += if edge < 1.0 {
                low_pass(values, cutoff_hz, rate_hz).map_or(0.0, |slow| energy(&slow))
            } else {
                energy(values)
            };
        }
    }
    let noise = rows as f64 * search.twin_floor_nm(channel).powi(2);
    let mut from = (0.0, 0.0);
    let mut bands: Vec<BandShare> = BAND_EDGES
        .iter()
        .zip(below)
        .map(|(edge, sum)| {
            let above = sum - from.1 - (edge - from.0) * noise;
            let band = BandShare {
                from_hz: from.0 * top_hz,
                to_hz: edge * top_hz,
                share: above.max(0.0),
            };
            from = (*edge, sum);
            band
        })
        .collect();
    let total: f64 = bands.iter().map(|band| band.share).sum();
    for band in &mut bands {
        band.share /= total.max(1e-300);
    }
    bands
}
