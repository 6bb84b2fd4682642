//! Commands that the drive left out, found by likelihood: at every row the drive either takes the command or holds the one
//! before, so that its torque answers a command that is 0, 1, 2 … rows older than it should be. That age is a hidden Markov
//! chain (Rabiner, Proceedings of the IEEE 77 (1989) 257-286): many small steps tell of it together, even below the noise.

use std::f64::consts::TAU;
use std::ops::{Range, RangeInclusive};

use joint_twin::known::LAW;
use joint_twin::scale::ROWS_MIN;
use recording::{JointColumns, Signal};

use crate::follow::{FAST_LAG_S, Response, TAPS, pairs, reached_nm};
use crate::found::{LOST_MIN, SURE, sure_nats};

/// Ages that are told apart: older ones are rare, or alike.
const AGES: usize = 16;
/// Part left out at which the search begins.
const BEGIN: f64 = 0.2;
/// Rounds of expectation and maximisation: for each delay, and for the best one until its values change by less.
const FIRST_ROUNDS: usize = 4;
const ROUNDS: usize = 20;
const SETTLED: f64 = 1e-3;
/// Part of the torques that may be anything: a drive that starts or stops answers no command.
pub(crate) const ODD: f64 = 0.01;
/// No torque is surer than this part of the largest.
const LEAST: f64 = 1e-6;
/// The least part of a variance that is left of it in one round.
const LEAST_OF_BEFORE: f64 = 0.1;
/// By which factors slower current loops are sought about the best: up to half a second first.
const SLOWER: [(f64, RangeInclusive<i32>); 3] = [(1.25, 0..=33), (1.05, -5..=5), (1.01, -5..=5)];
/// Step of the part left out by which its standard error is found.
const CURVATURE: f64 = 0.1;
/// Rows that are looked at as one: what is kept of them is bounded.
const PIECE: usize = 20_000;

/// Commands left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LeftOut {
    /// Of all commands.
    pub fraction: f64,
    /// Its standard error.
    pub std: f64,
    /// Rows from a command that is taken to the torque that is measured of it.
    pub delay_rows: usize,
    /// Nats by which this explains the torque better than any delay and lag.
    pub nats: f64,
}

/// The commands that were left out; none where a delay and a lag tell as much of the torque. `told_rows`: from a command to the
/// torque that is measured of it.
pub(crate) fn left_out(
    columns: &[JointColumns],
    responses: &[Response],
    told_rows: usize,
) -> Option<LeftOut> {
    fitted(columns, responses, told_rows).map(|(left_out, _)| left_out)
}

/// For every run the command that the drive acted on instead of the recorded one, as far as the torque tells: the mean over what
/// it may have been. None where it left out none.
pub(crate) fn acted_on(
    columns: &[JointColumns],
    period_s: f64,
    told_rows: usize,
) -> Option<Vec<Vec<f64>>> {
    let responses = Response::all(columns, period_s);
    let (left_out, chain) = fitted(columns, &responses, told_rows)?;
    let weights = responses.first()?.weights_after(left_out.delay_rows);
    let of_run = |run: &JointColumns| {
        let command_nm = run.signals.get(&Signal::CommandTorqueNm);
        let command_nm = command_nm.cloned().unwrap_or_default();
        let mut acted_nm = command_nm.clone();
        let Some(answers) = Answers::of(std::slice::from_ref(run), period_s, &weights) else {
            return acted_nm;
        };
        // answers begin where all commands that they are made of are there
        let before = command_nm.len() - answers.torque_nm.len();
        let sent = |k: usize| (before + k).checked_sub(left_out.delay_rows);
        for piece in &answers.pieces {
            let (forward, _) = chain.forward(&answers, piece);
            let smoothed = chain.smoothed(&forward, Chain::odd(&answers));
            for (k, ages) in piece.clone().zip(smoothed) {
                let Some(row) = sent(k).filter(|row| *row >= AGES) else {
                    continue;
                };
                let may_be = ages.iter().enumerate();
                let mean_nm = may_be
                    .map(|(age, part)| part * command_nm[row - age])
                    .sum::<f64>();
                if mean_nm.is_finite() {
                    acted_nm[row] = mean_nm;
                }
            }
        }
        acted_nm
    };
    Some(columns.iter().map(of_run).collect())
}

fn fitted(
    columns: &[JointColumns],
    responses: &[Response],
    told_rows: usize,
) -> Option<(LeftOut, Chain)> {
    let response = responses.first()?;
    let period_s = response.period_s();
    // what is left out makes the answer come later, on the whole
    let fast_rows = response.fast_delay();
    let first = told_rows.min(fast_rows.floor() as usize);
    let last = told_rows.max(fast_rows.ceil() as usize);
    // steps tell little of a smooth command: the best of what any span says, and of whole delays
    let after = (first..=last).map(|delay_rows| response.weights_after(delay_rows));
    let smooth = responses.iter().map(Response::weights).chain(after);
    let smooth = smooth.filter_map(|weights| Answers::of(columns, period_s, &weights));
    let smooth = smooth.map(|answers| (Chain::of(&answers, 0.0), answers));
    let (chain, smooth) = smooth.min_by(|a, b| a.0.variance.total_cmp(&b.0.variance))?;
    if !smooth.leaves_more_at_steps() {
        return None;
    }
    let nothing_lost_nats = chain.fitted(&smooth, ROUNDS).1.log_likelihood;
    let mut best: Option<(f64, usize, Answers, Chain)> = None;
    for delay_rows in first..=last {
        let answers = Answers::of(columns, period_s, &response.weights_after(delay_rows))?;
        let (chain, said) = Chain::of(&smooth, BEGIN).fitted(&answers, FIRST_ROUNDS);
        let nats = said.log_likelihood;
        if best.as_ref().is_none_or(|(most, ..)| nats > *most) {
            best = Some((nats, delay_rows, answers, chain));
        }
    }
    let (_, delay_rows, answers, chain) = best?;
    let (chain, said) = chain.fitted(&answers, ROUNDS);
    let nats = said.log_likelihood - nothing_lost_nats;
    if nats < sure_nats() || chain.fraction < LOST_MIN {
        return None;
    }
    let rows = [first, last];
    if is_slow_loop(columns, rows, period_s, said.log_likelihood) {
        return None;
    }
    let std = chain.std(&answers, said.log_likelihood);
    let left_out = LeftOut {
        fraction: chain.fraction,
        // a drive that loses commands does so in no chain's way exactly
        std: std.hypot(LAW * chain.fraction),
        delay_rows,
        nats,
    };
    (chain.fraction > SURE * std).then_some((left_out, chain))
}

/// Whether a current loop of any time constant explains the torques as well: a drive that takes few of its commands follows
/// them as a slow one does, on the whole.
fn is_slow_loop(
    columns: &[JointColumns],
    [first_row, last_row]: [usize; 2],
    period_s: f64,
    log_likelihood: f64,
) -> bool {
    let lagged = |lag_s: f64, row: usize| {
        let answers = Answers::lagged(columns, period_s, row, lag_s)?;
        Some((Chain::of(&answers, 0.0).variance, lag_s, row))
    };
    // a variance, a time constant and a delay
    let less = |a: (f64, f64, usize), b: (f64, f64, usize)| if b.0 < a.0 { b } else { a };
    let mut best = (f64::INFINITY, FAST_LAG_S, first_row);
    for (factor, steps) in SLOWER {
        let (_, about_s, row) = best;
        let lags_s = steps.map(|k| about_s * f64::powi(factor, k));
        best = lags_s
            .filter_map(|lag_s| lagged(lag_s, row))
            .fold(best, less);
        let (_, lag_s, _) = best;
        let rows = first_row..=last_row;
        best = rows.filter_map(|row| lagged(lag_s, row)).fold(best, less);
    }
    let (_, lag_s, row) = best;
    let answers = Answers::lagged(columns, period_s, row, lag_s);
    answers.is_some_and(|answers| {
        let (_, said) = Chain::of(&answers, 0.0).fitted(&answers, ROUNDS);
        log_likelihood - said.log_likelihood < sure_nats()
    })
}

/// Torques beside what a response makes of their commands.
struct Answers {
    torque_nm: Vec<f64>,
    expected_nm: Vec<f64>,
    /// Rows that follow each other, with as many before them as there are ages.
    pieces: Vec<Range<usize>>,
    largest_nm: f64,
    /// Part of a step that a current loop as it should be may still have to go when its torque is read.
    to_go: f64,
}

impl Answers {
    /// Of all recordings, by the weights of the last commands; none where too few rows tell.
    fn of(columns: &[JointColumns], period_s: f64, weights: &[f64]) -> Option<Self> {
        let used = weights.iter().copied().enumerate();
        let used: Vec<(usize, f64)> = used.filter(|(_, weight)| *weight != 0.0).collect();
        Self::with(columns, period_s, |command_nm| {
            let expected_nm = |k: usize| -> f64 {
                let terms = used.iter().map(|(back, w)| w * command_nm[k - back]);
                terms.sum()
            };
            (TAPS..command_nm.len()).map(expected_nm).collect()
        })
    }

    /// The same for a current loop of a time constant that takes commands so many rows late.
    fn lagged(
        columns: &[JointColumns],
        period_s: f64,
        delay_rows: usize,
        lag_s: f64,
    ) -> Option<Self> {
        let keep = (-period_s / lag_s).exp();
        Self::with(columns, period_s, |command_nm| {
            let mut torque_nm = f64::NAN;
            let mut expected_nm = Vec::with_capacity(command_nm.len());
            for k in 0..command_nm.len() {
                let taken_nm = command_nm[k.saturating_sub(delay_rows)];
                torque_nm = if torque_nm.is_finite() {
                    keep * torque_nm + (1.0 - keep) * taken_nm
                } else {
                    taken_nm
                };
                expected_nm.push(torque_nm);
            }
            expected_nm.drain(..TAPS.min(command_nm.len()));
            expected_nm
        })
    }

    /// With what should come of the commands of a run, but for its first rows.
    fn with(
        columns: &[JointColumns],
        period_s: f64,
        expected_nm: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Option<Self> {
        let mut answers = Self {
            torque_nm: Vec::new(),
            expected_nm: Vec::new(),
            pieces: Vec::new(),
            largest_nm: 0.0,
            to_go: (-period_s / FAST_LAG_S).exp(),
        };
        for (torque_nm, command_nm) in pairs(columns) {
            let reached_nm = reached_nm(torque_nm);
            answers.largest_nm = answers.largest_nm.max(reached_nm);
            let start = answers.torque_nm.len();
            answers.expected_nm.extend(expected_nm(command_nm));
            // the same rows whatever is expected, so that likelihoods can be compared
            for (k, torque_nm) in torque_nm.iter().enumerate().skip(TAPS) {
                // a drive at its limit follows no command
                let mut past = command_nm[k - AGES..=k].iter();
                let is_beyond = past.any(|command_nm| command_nm.abs() > reached_nm);
                answers
                    .torque_nm
                    .push(if is_beyond { f64::NAN } else { *torque_nm });
            }
            let end = answers.torque_nm.len();
            let starts = (start + AGES..end).step_by(PIECE);
            answers
                .pieces
                .extend(starts.map(|start| start..(start + PIECE).min(end)));
        }
        (answers.rows().count() >= ROWS_MIN && answers.largest_nm > 0.0).then_some(answers)
    }

    /// Rows with a torque that a command was there for.
    fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        let rows = self.pieces.iter().flat_map(Range::clone);
        rows.filter(|k| (self.torque_nm[*k] - self.expected_nm[*k]).is_finite())
    }

    fn left_nm(&self, k: usize) -> f64 {
        self.torque_nm[k] - self.expected_nm[k]
    }

    /// Whether a closer look, which takes long, is worth it: what a smooth response leaves grows with the steps of what it expects,
    /// squares over the half of the rows with the larger steps against those over the other half.
    fn leaves_more_at_steps(&self) -> bool {
        let step_nm = |k: usize| (self.expected_nm[k] - self.expected_nm[k - 1]).abs();
        let mut rows: Vec<(f64, f64)> = self
            .rows()
            .map(|k| (step_nm(k), self.left_nm(k).powi(2)))
            .filter(|(step_nm, _)| step_nm.is_finite())
            .collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (small, large) = rows.split_at(rows.len() / 2);
        let mean_and_error = |rows: &[(f64, f64)]| {
            let count = rows.len() as f64;
            let mean = rows.iter().map(|row| row.1).sum::<f64>() / count;
            let spread = rows.iter().map(|row| (row.1 - mean).powi(2)).sum::<f64>();
            (mean, (spread / count / (count - 1.0)).sqrt())
        };
        let [small, large] = [small, large].map(mean_and_error);
        large.0 - small.0 > 0.5 * SURE * small.1.hypot(large.1)
    }
}

/// What a chain has to say of one value for every age.
type Ages = [f64; AGES];

/// The hidden chain with its values.
#[derive(Clone, Copy, Debug)]
struct Chain {
    /// Part of the commands that is left out.
    fraction: f64,
    /// Of the torque about what is expected.
    variance: f64,
    /// The torque is this much of what is expected and this beside it: in other units it is not late.
    scale: f64,
    offset_nm: f64,
}

/// What the torques say of a chain.
struct Said {
    log_likelihood: f64,
    /// The values that explain the torques best if ages are as this chain has them.
    next: Chain,
}

impl Chain {
    /// One to begin with.
    fn of(answers: &Answers, fraction: f64) -> Self {
        let (mut square, mut rows) = (0.0, 0.0);
        for k in answers.rows() {
            square += answers.left_nm(k).powi(2);
            rows += 1.0;
        }
        Self {
            fraction,
            variance: f64::max(square / rows, (LEAST * answers.largest_nm).powi(2)),
            scale: 1.0,
            offset_nm: 0.0,
        }
    }

    /// Ages one row on, before its torque is seen.
    fn moved(&self, ages: &Ages) -> Ages {
        let mut moved = [0.0; AGES];
        moved[0] = 1.0 - self.fraction;
        for age in 1..AGES {
            moved[age] = self.fraction * ages[age - 1];
        }
        moved[AGES - 1] += self.fraction * ages[AGES - 1];
        moved
    }

    /// What a torque at an age should be, and its variance.
    fn expected(&self, answers: &Answers, k: usize, age: usize) -> (f64, f64) {
        let expected_nm = self.offset_nm + self.scale * answers.expected_nm[k - age];
        let to_go_nm = answers.to_go * (expected_nm - answers.torque_nm[k - 1]);
        let to_go_nm = if to_go_nm.is_finite() { to_go_nm } else { 0.0 };
        (expected_nm, self.variance + to_go_nm.powi(2))
    }

    /// Likelihood of a row's torque at every age as an answer to its command; that of one that answers none is [`Self::odd`].
    fn answered(&self, answers: &Answers, k: usize) -> Ages {
        let torque_nm = answers.torque_nm[k];
        std::array::from_fn(|age| {
            // where nothing is left out nothing is older
            if age > 0 && self.fraction == 0.0 {
                return 0.0;
            }
            let (expected_nm, variance) = self.expected(answers, k, age);
            let exponent = -0.5 * (torque_nm - expected_nm).powi(2) / variance;
            let likelihood = (1.0 - ODD) * exponent.exp() / (TAU * variance).sqrt();
            if likelihood.is_finite() {
                likelihood
            } else {
                0.0
            }
        })
    }

    fn odd(answers: &Answers) -> f64 {
        ODD / (2.0 * answers.largest_nm)
    }

    /// For every row of a piece its torque's likelihoods and, from the torques up to it, its ages; and the log likelihood of all.
    fn forward(&self, answers: &Answers, piece: &Range<usize>) -> (Vec<[Ages; 2]>, f64) {
        let odd = Self::odd(answers);
        let mut ages = [1.0 / AGES as f64; AGES];
        let mut log_likelihood = 0.0;
        let all = piece.clone().map(|k| {
            let answered = self.answered(answers, k);
            let moved = self.moved(&ages);
            let joint: Ages = std::array::from_fn(|age| moved[age] * (answered[age] + odd));
            let sum: f64 = joint.iter().sum();
            log_likelihood += sum.ln();
            ages = joint.map(|value| value / sum);
            [answered, ages]
        });
        let all: Vec<[Ages; 2]> = all.collect();
        (all, log_likelihood)
    }

    /// For every row of a piece its ages, from the torques before and after it.
    fn smoothed(&self, forward: &[[Ages; 2]], odd: f64) -> Vec<Ages> {
        let mut later = [1.0; AGES];
        let backward = forward.iter().rev().map(|[answered, ages]| {
            let joint: Ages = std::array::from_fn(|age| ages[age] * later[age]);
            let sum: f64 = joint.iter().sum();
            let from_taken = (1.0 - self.fraction) * (answered[0] + odd) * later[0];
            let before: Ages = std::array::from_fn(|age| {
                let older = (age + 1).min(AGES - 1);
                from_taken + self.fraction * (answered[older] + odd) * later[older]
            });
            let most = before.iter().copied().fold(0.0, f64::max);
            later = before.map(|value| value / most);
            joint.map(|value| value / sum)
        });
        let mut smoothed: Vec<Ages> = backward.collect();
        smoothed.reverse();
        smoothed
    }

    /// One round of expectation and maximisation.
    fn round(&self, answers: &Answers) -> Said {
        let odd = Self::odd(answers);
        let (mut taken, mut rows) = (0.0, 0.0);
        let (mut excess, mut information) = (0.0, 0.0);
        let mut straight = Straight::default();
        let mut log_likelihood = 0.0;
        for piece in &answers.pieces {
            let (forward, log) = self.forward(answers, piece);
            log_likelihood += log;
            let smoothed = self.smoothed(&forward, odd);
            for ((k, [answered, _]), ages) in piece.clone().zip(&forward).zip(smoothed) {
                taken += ages[0];
                rows += 1.0;
                for age in (0..AGES).filter(|age| answered[*age] > 0.0) {
                    let weight = ages[age] * answered[age] / (answered[age] + odd);
                    let (expected_nm, variance) = self.expected(answers, k, age);
                    let square = (answers.torque_nm[k] - expected_nm).powi(2);
                    excess += weight * (square - variance) / variance.powi(2);
                    information += weight / variance.powi(2);
                    let [x, y] = [answers.expected_nm[k - age], answers.torque_nm[k]];
                    straight.add(weight / variance, x, y);
                }
            }
        }
        // by scoring: a variance that grows with the steps has no other closed form
        let variance = self.variance + excess / f64::max(information, 1e-300);
        let least = (LEAST_OF_BEFORE * self.variance).max((LEAST * answers.largest_nm).powi(2));
        let (scale, offset_nm) = straight.fitted().unwrap_or((self.scale, self.offset_nm));
        Said {
            log_likelihood,
            next: Self {
                fraction: 1.0 - taken / f64::max(rows, 1.0),
                variance: variance.max(least),
                scale,
                offset_nm,
            },
        }
    }

    /// The chain that explains the torques best, after so many rounds at most.
    fn fitted(self, answers: &Answers, rounds: usize) -> (Self, Said) {
        let mut chain = self;
        let mut said = chain.round(answers);
        for _ in 0..rounds {
            let before = chain;
            chain = said.next;
            if before.fraction == 0.0 {
                chain.fraction = 0.0;
            }
            said = chain.round(answers);
            let moved = (chain.fraction - before.fraction).abs() / before.fraction.max(1e-9);
            let spread = (chain.variance / before.variance - 1.0).abs();
            if moved < SETTLED && spread < SETTLED {
                break;
            }
        }
        (chain, said)
    }

    /// Standard error of the part left out, from the curvature of the likelihood.
    fn std(&self, answers: &Answers, log_likelihood: f64) -> f64 {
        let step = CURVATURE * self.fraction.min(1.0 - self.fraction);
        let at = |fraction: f64| -> f64 {
            let chain = Self { fraction, ..*self };
            let pieces = answers.pieces.iter();
            pieces.map(|piece| chain.forward(answers, piece).1).sum()
        };
        let curvature = 2.0 * log_likelihood - at(self.fraction - step) - at(self.fraction + step);
        if curvature > 0.0 {
            step / curvature.sqrt()
        } else {
            f64::INFINITY
        }
    }
}

/// Weighted sums of a straight line.
#[derive(Default)]
struct Straight {
    weight: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl Straight {
    fn add(&mut self, weight: f64, x: f64, y: f64) {
        self.weight += weight;
        self.x += weight * x;
        self.y += weight * y;
        self.xx += weight * x * x;
        self.xy += weight * x * y;
    }

    /// Slope, and value at zero; none where nothing changes.
    fn fitted(&self) -> Option<(f64, f64)> {
        let spread = self.weight * self.xx - self.x * self.x;
        let scale = (self.weight * self.xy - self.x * self.y) / spread;
        let at_zero = (self.y - scale * self.x) / self.weight;
        (scale.is_finite() && at_zero.is_finite()).then_some((scale, at_zero))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use joint_twin::signal::random::uniform;

    use super::*;
    use crate::follow::tests::{columns, command};

    const PERIOD_S: f64 = 1e-3;

    /// A drive that follows a command so many rows later and with a lag, but for those it loses, beside noise.
    fn driven(delay_rows: usize, lag_s: f64, lost: f64, noise_nm: f64) -> Vec<JointColumns> {
        let command_nm = command();
        let mut random = uniform(5);
        let mut torque_nm = vec![0.0; command_nm.len()];
        let (mut taken_nm, mut drive_nm) = (0.0, 0.0);
        for k in delay_rows..command_nm.len() {
            if random() >= lost {
                taken_nm = command_nm[k - delay_rows];
            }
            drive_nm += (1.0 - f64::exp(-PERIOD_S / lag_s)) * (taken_nm - drive_nm);
            let normal = (0..12).map(|_| random()).sum::<f64>() - 6.0;
            torque_nm[k] = drive_nm + noise_nm * normal;
        }
        vec![columns(vec![
            (Signal::CommandTorqueNm, command_nm),
            (Signal::MotorTorqueNm, torque_nm),
        ])]
    }

    /// A torque that follows a smooth command so many rows later, in noise that its steps drown in.
    fn smooth(delay_rows: f64, noise_nm: f64) -> Vec<JointColumns> {
        let command = |k: f64| (0.004 * k).sin() + 0.4 * (0.023 * k).sin();
        let mut random = uniform(6);
        let torque_nm = (0..20_000_u32).map(|k| {
            let normal = (0..12).map(|_| random()).sum::<f64>() - 6.0;
            command(f64::from(k) - delay_rows) + noise_nm * normal
        });
        vec![columns(vec![
            (Signal::MotorTorqueNm, torque_nm.collect()),
            (
                Signal::CommandTorqueNm,
                (0..20_000_u32).map(|k| command(f64::from(k))).collect(),
            ),
        ])]
    }

    fn found(delay_rows: usize, lag_s: f64, lost: f64, noise_nm: f64) -> Option<LeftOut> {
        of(&driven(delay_rows, lag_s, lost, noise_nm))
    }

    fn of(runs: &[JointColumns]) -> Option<LeftOut> {
        left_out(runs, &Response::all(runs, PERIOD_S), 1)
    }

    #[test]
    fn commands_that_the_drive_left_out_are_counted() {
        for (lost, noise_nm) in [
            (0.01, 1e-4),
            (0.1, 0.02),
            (0.25, 0.1),
            (0.5, 0.02),
            (0.8, 0.02),
        ] {
            let found = found(1, 1e-5, lost, noise_nm).unwrap();
            let off = (found.fraction - lost).abs();
            assert!(
                off < 4.0 * found.std && found.std < 0.2 * lost,
                "{lost}: {found:?}"
            );
            assert_eq!(found.delay_rows, 1, "{lost}: {found:?}");
        }
    }

    #[test]
    fn the_command_that_the_drive_acted_on_is_found() {
        let runs = driven(2, 1e-5, 0.5, 0.01);
        let acted_nm = acted_on(&runs, PERIOD_S, 2).unwrap();
        let of = |signal| &runs[0].signals[&signal];
        let (torque_nm, command_nm) = (of(Signal::MotorTorqueNm), of(Signal::CommandTorqueNm));
        let off = |nm: &[f64]| {
            let square = (100..19_990).map(|k| (torque_nm[k + 2] - nm[k]).powi(2));
            (square.sum::<f64>() / 19_890.0).sqrt()
        };
        assert!(off(command_nm) > 0.05, "{}", off(command_nm));
        assert!(off(&acted_nm[0]) < 0.025, "{}", off(&acted_nm[0]));
        assert_eq!(acted_on(&driven(2, 1e-5, 0.0, 0.01), PERIOD_S, 2), None);
    }

    #[test]
    fn a_later_answer_is_told_from_commands_left_out() {
        let found = found(4, 1e-5, 0.4, 0.02).unwrap();
        assert_eq!(found.delay_rows, 4);
        assert!((found.fraction - 0.4).abs() < 4.0 * found.std, "{found:?}");
    }

    #[test]
    fn a_delay_a_lag_or_noise_is_no_command_left_out() {
        for delay_rows in [1.0, 1.4, 2.0, 3.7] {
            for noise_nm in [1e-3, 0.03] {
                let found = of(&smooth(delay_rows, noise_nm));
                assert_eq!(found, None, "smooth, {delay_rows} rows, {noise_nm} Nm");
            }
        }
        for (delay_rows, lag_s) in [
            (1, 1e-5),
            (4, 1e-5),
            (1, 3e-4),
            (1, 1.5e-3),
            (2, 6e-3),
            (1, 0.03),
            (2, 0.1),
        ] {
            for noise_nm in [1e-4, 0.02, 0.2] {
                let found = found(delay_rows, lag_s, 0.0, noise_nm);
                assert_eq!(found, None, "{delay_rows} rows, {lag_s} s, {noise_nm} Nm");
            }
        }
    }
}
