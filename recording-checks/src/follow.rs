//! How a drive's torque follows its command, read off the samples: a delay and a lag of the current loop.

use joint_twin::known::LAW;
use joint_twin::scale::{ROWS_MIN, SATURATED, largest_of};
use nalgebra::{DMatrix, DVector};
use recording::{JointColumns, Signal};
use robot::Effect;

use crate::found::{Found, SURE};

/// Samples over which the drive's response is sought.
pub(crate) const TAPS: usize = 64;
/// Time constant of a current loop as it should be.
pub(crate) const FAST_LAG_S: f64 = 3e-4;
/// Time constants that are tried, each over the one before.
const LAG_RATIO: f64 = 1.12;
/// Delays that are tried are so many samples apart.
const DELAY_STEP: f64 = 0.1;
/// Those of current loops that nobody would call slow.
const FAST_LAGS_S: [f64; 3] = [0.0, 0.5 * FAST_LAG_S, FAST_LAG_S];
/// From this on a lag is told.
pub(crate) const SLOW_LAG_S: f64 = 2.0 * FAST_LAG_S;
/// Tenths of a sample by which the torque may be later than the controller's delay.
const LATE_STEPS: i32 = 4;
/// Delay at which the search ends: what is best there may be anything.
const LATEST: f64 = TAPS as f64 - 4.0;
/// Time constants, as a part of the samples, of which next to nothing is left after the last one.
const SEEN_LAGS: f64 = 0.25;
/// A response that leaves more of the torque's changes than this part does not tell when it came.
const UNCLEAR: f64 = 0.5;
/// Samples over which the torque's change is compared with the commands': over one sample a step tells best what came when, over
/// more a smooth command stands out of the torque's noise.
const SPANS: [usize; 2] = [1, 16];
/// Of these, how many differences are taken.
const PER_SPAN: usize = 4;

/// How the drive's torque follows its command: a delay and a first-order lag.
pub(crate) struct Response {
    /// Sums of products of the command's changes, and of those with the torque's.
    matrix: DMatrix<f64>,
    vector: DVector<f64>,
    square: f64,
    /// Independent differences.
    rows: f64,
    period_s: f64,
}

/// A delay in samples and a time constant.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Follow {
    delay: f64,
    lag_s: f64,
}

/// Sums over one lag's responses `t`, by their whole delay.
struct Lagged {
    square: f64,
    /// Of products with the torque's changes.
    like: [f64; TAPS + 1],
    /// `t` with itself, and with the response after one sample more.
    own: [f64; TAPS + 1],
    next: [f64; TAPS],
}

impl Lagged {
    /// Sum of squares that a response leaves, whatever the torque's scale: a wrong one is no lag.
    fn left(&self, delay: f64) -> f64 {
        let whole = delay.floor() as usize;
        if whole >= TAPS {
            return self.square;
        }
        let late = delay - whole as f64;
        let share = 1.0 - late;
        let like = share * self.like[whole] + late * self.like[whole + 1];
        let own = share * share * self.own[whole]
            + 2.0 * share * late * self.next[whole]
            + late * late * self.own[whole + 1];
        (self.square - like.max(0.0).powi(2) / own.max(1e-300)).max(0.0)
    }
}

impl Response {
    /// From the changes over so many samples, wherever command and torque are there.
    fn over(span: usize, columns: &[JointColumns], period_s: f64) -> Option<Self> {
        let mut response = Self {
            matrix: DMatrix::zeros(TAPS, TAPS),
            vector: DVector::zeros(TAPS),
            square: 0.0,
            rows: 0.0,
            period_s,
        };
        let stride = span.div_ceil(PER_SPAN);
        for (torque_nm, command_nm) in pairs(columns) {
            let reached_nm = reached_nm(torque_nm);
            for k in (TAPS + span..torque_nm.len()).step_by(stride) {
                // a drive at its limit does not follow, and a lag is not to be made of that
                if command_nm[k + 1 - TAPS - span..=k]
                    .iter()
                    .any(|u| u.abs() > reached_nm)
                {
                    continue;
                }
                // changes tell when a command came; the values themselves are all alike
                let past: [f64; TAPS] =
                    std::array::from_fn(|i| command_nm[k - i] - command_nm[k - i - span]);
                let change_nm = torque_nm[k] - torque_nm[k - span];
                if !change_nm.is_finite() || past.iter().any(|u| !u.is_finite()) {
                    continue;
                }
                response.add(&past, change_nm);
            }
        }
        for i in 0..TAPS {
            for j in 0..i {
                response.matrix[(j, i)] = response.matrix[(i, j)];
            }
        }
        if response.rows < ROWS_MIN as f64 {
            return None;
        }
        // differences that overlap are not independent
        let independent = stride as f64 / span as f64;
        response.matrix *= independent;
        response.vector *= independent;
        response.square *= independent;
        response.rows *= independent;
        Some(response)
    }

    /// Over every span that is looked at, the shortest first.
    pub(crate) fn all(columns: &[JointColumns], period_s: f64) -> Vec<Self> {
        let spans = SPANS.iter();
        spans
            .filter_map(|span| Self::over(*span, columns, period_s))
            .collect()
    }

    /// Time between samples.
    pub(crate) fn period_s(&self) -> f64 {
        self.period_s
    }

    /// From one sample to the next.
    pub(crate) fn of_steps(columns: &[JointColumns], period_s: f64) -> Option<Self> {
        Self::over(1, columns, period_s)
    }

    fn add(&mut self, past: &[f64; TAPS], change_nm: f64) {
        self.rows += 1.0;
        self.square += change_nm * change_nm;
        for (j, change) in past.iter().enumerate() {
            self.vector[j] += change * change_nm;
            // a matrix lies column by column
            let below = &mut self.matrix.as_mut_slice()[j * (TAPS + 1)..(j + 1) * TAPS];
            for (sum, other) in below.iter_mut().zip(&past[j..]) {
                *sum += other * change;
            }
        }
    }

    /// What of a command is still to go a sample later.
    fn keep(&self, lag_s: f64) -> f64 {
        if lag_s > 0.0 {
            (-self.period_s / lag_s).exp()
        } else {
            0.0
        }
    }

    fn taps(&self, follow: Follow) -> DVector<f64> {
        let keep = self.keep(follow.lag_s);
        let whole = follow.delay.floor();
        let share = follow.delay - whole;
        let at = |i: f64| {
            if i < 0.0 {
                0.0
            } else {
                (1.0 - keep) * keep.powf(i)
            }
        };
        DVector::from_fn(TAPS, |i, _| {
            let since = i as f64 - whole;
            (1.0 - share) * at(since) + share * at(since - 1.0)
        })
    }

    /// What a lag makes of the sums, for every whole delay.
    fn lagged(&self, lag_s: f64) -> Lagged {
        let keep = self.keep(lag_s);
        let mut lagged = Lagged {
            square: self.square,
            like: [0.0; TAPS + 1],
            own: [0.0; TAPS + 1],
            next: [0.0; TAPS],
        };
        // a response after one sample more is this one a sample on: t = (1 - keep) e + keep t_next
        let mut product = DVector::zeros(TAPS);
        for whole in (0..TAPS).rev() {
            let (like, own) = (lagged.like[whole + 1], lagged.own[whole + 1]);
            lagged.like[whole] = (1.0 - keep) * self.vector[whole] + keep * like;
            lagged.next[whole] = (1.0 - keep) * product[whole] + keep * own;
            product.axpy(1.0 - keep, &self.matrix.column(whole), keep);
            lagged.own[whole] = (1.0 - keep) * product[whole] + keep * lagged.next[whole];
        }
        lagged
    }

    /// The best response with these delays and lags.
    fn best(&self, delays: &[f64], lags_s: &[f64]) -> (Follow, f64) {
        let mut best = (
            Follow {
                delay: delays[0],
                lag_s: lags_s[0],
            },
            f64::INFINITY,
        );
        for &lag_s in lags_s {
            let lagged = self.lagged(lag_s);
            for &delay in delays {
                let left = lagged.left(delay);
                if left < best.1 {
                    best = (Follow { delay, lag_s }, left);
                }
            }
        }
        best
    }

    /// By how much each of the last commands counts in the torque, newest first, with the delay and lag that fit best.
    pub(crate) fn weights(&self) -> Vec<f64> {
        let (follow, _) = self.best(
            &delays(),
            &[&FAST_LAGS_S[..], &slow_lags_s(self.period_s)].concat(),
        );
        self.taps(follow).iter().copied().collect()
    }

    /// The same after so many samples, with a current loop that is not slow.
    pub(crate) fn weights_after(&self, samples: usize) -> Vec<f64> {
        let (follow, _) = self.best(&[samples as f64], &FAST_LAGS_S);
        self.taps(follow).iter().copied().collect()
    }

    /// Samples after which the torque answers, if the current loop is not slow.
    pub(crate) fn fast_delay(&self) -> f64 {
        self.best(&delays(), &FAST_LAGS_S).0.delay
    }
}

/// Samples from a command to the torque that is measured of it: what acts from a sample on is measured at the next.
pub(crate) fn told_delay(delay_cycles: usize) -> f64 {
    delay_cycles as f64 + 1.0
}

/// The largest torque but for a few samples and a margin: commands up to it were not cut off.
pub(crate) fn reached_nm(torque_nm: &[f64]) -> f64 {
    SATURATED * largest_of(torque_nm.iter().copied())
}

/// Torque and command of every recording that has both.
pub(crate) fn pairs(columns: &[JointColumns]) -> impl Iterator<Item = (&Vec<f64>, &Vec<f64>)> {
    columns.iter().filter_map(|columns| {
        let torque_nm = columns.signals.get(&Signal::MotorTorqueNm)?;
        let command_nm = columns.signals.get(&Signal::CommandTorqueNm)?;
        Some((torque_nm, command_nm))
    })
}

/// By how much each of the last commands counts in the drive's torque, newest first; none where too few rows tell.
pub(crate) fn weights_of_commands(columns: &[JointColumns], period_s: f64) -> Option<Vec<f64>> {
    Response::of_steps(columns, period_s).map(|response| response.weights())
}

/// Samples after which a joint's torque answers its command; none where it does not tell, or no better than an answer after as
/// many as told.
pub(crate) fn answered_after(
    columns: &[JointColumns],
    period_s: f64,
    told: Option<f64>,
) -> Option<f64> {
    let all = delays();
    let slow_s = slow_lags_s(period_s);
    SPANS.iter().find_map(|span| {
        let response = Response::over(*span, columns, period_s)?;
        // a torque that goes on after its command is no answer that comes later; what it does within a row may be other commands'
        let fast = response.best(&all, &FAST_LAGS_S);
        let slow = response.best(&all, &slow_s);
        let is_slow =
            slow.0.lag_s > period_s && fast.1 - slow.1 > SURE.powi(2) * slow.1 / response.rows;
        let ((follow, left), lags_s) = if is_slow {
            (slow, &slow_s[..])
        } else {
            (fast, &FAST_LAGS_S[..])
        };
        let is_clear = left < UNCLEAR * response.square && follow.delay < LATEST;
        let is_worth = told.is_none_or(|told| {
            let late = DELAY_STEP * f64::from(LATE_STEPS);
            let (_, as_told) = response.best(&[told, told + 0.5 * late, told + late], lags_s);
            as_told - left > SURE.powi(2) * left / response.rows
        });
        (is_clear && is_worth).then_some(follow.delay)
    })
}

/// All delays that are tried.
fn delays() -> Vec<f64> {
    (0..)
        .map(|k| DELAY_STEP * f64::from(k))
        .take_while(|delay| *delay <= LATEST)
        .collect()
}

/// Time constants of slower and slower current loops, up to the samples over which a response is sought.
fn slow_lags_s(period_s: f64) -> Vec<f64> {
    let all = std::iter::successors(Some(FAST_LAG_S), |lag_s| Some(LAG_RATIO * lag_s));
    all.take_while(|lag_s| *lag_s <= TAPS as f64 * period_s)
        .collect()
}

/// Lag of the current loop, and delay of the command beyond what the robot file's controller has, where that is told.
pub(crate) fn slow_drive(responses: &[Response], delay_cycles: Option<usize>) -> Vec<Found> {
    let found = responses
        .iter()
        .map(|response| response.slow(delay_cycles, responses));
    let mut found = found.filter(|found| !found.is_empty());
    found.next().unwrap_or_default()
}

/// The delay that all changes tell of a torque that follows at once: over one sample they may tell it best and not that it is there.
fn delay_without_lag(responses: &[Response]) -> f64 {
    let all = delays();
    let mut squares = vec![0.0; all.len()];
    for response in responses {
        let lagged = response.lagged(0.0);
        let left: Vec<f64> = all.iter().map(|delay| lagged.left(*delay)).collect();
        let least = left.iter().copied().fold(f64::INFINITY, f64::min);
        let variance = (least / response.rows).max(1e-300);
        for (sum, left) in squares.iter_mut().zip(left) {
            *sum += left / variance;
        }
    }
    let best = all.iter().zip(&squares).min_by(|a, b| a.1.total_cmp(b.1));
    best.map_or(0.0, |(delay, _)| *delay)
}

impl Response {
    fn slow(&self, delay_cycles: Option<usize>, every: &[Self]) -> Vec<Found> {
        let all = delays();
        let told = delay_cycles.map_or(LATEST, told_delay);
        // a recorder may write down what acts from a row on: sooner than told is no effect
        let latest = told + DELAY_STEP * f64::from(LATE_STEPS);
        let usual: Vec<f64> = all
            .iter()
            .copied()
            .filter(|delay| *delay <= latest + 1e-9)
            .collect();
        let lags = slow_lags_s(self.period_s);
        let (_, as_told) = self.best(&usual, &FAST_LAGS_S);
        let (late, with_delay) = self.best(&all, &FAST_LAGS_S);
        let (slow, with_lag) = self.best(&usual, &lags);
        let (both, least) = self.best(&all, &lags);
        let variance = (least / self.rows).max(1e-300);
        let worth = |before: f64, after: f64| (before - after) / variance > SURE.powi(2);
        if !worth(as_told, least) {
            return Vec::new();
        }
        let chosen = if with_delay <= with_lag && !worth(with_delay, least) {
            late
        } else if !worth(with_lag, least) {
            slow
        } else {
            both
        };
        let mut found = Vec::new();
        // what still goes on after the last sample is the twin's to find
        let slowest_s = SEEN_LAGS * TAPS as f64 * self.period_s;
        if chosen.lag_s >= slowest_s || chosen.delay >= LATEST - 0.5 {
            return found;
        }
        if chosen.lag_s > SLOW_LAG_S {
            found.push(Found {
                effect: Effect::CurrentLoopLag {
                    time_constant_s: chosen.lag_s,
                },
                std: 0.5 * (LAG_RATIO - 1.0) * chosen.lag_s,
                because: format!(
                    "the drive's torque follows its command with {:.2} ms",
                    1e3 * chosen.lag_s
                ),
            });
        }
        let late = chosen.delay - told;
        if late > DELAY_STEP * f64::from(LATE_STEPS) {
            // no lag that is told is one that only chance tells from a delay
            let late = if found.is_empty() {
                delay_without_lag(every) - told
            } else {
                late
            };
            let delay_s = late * self.period_s;
            found.push(Found {
                effect: Effect::CommandDelay { delay_s },
                std: (LAW * delay_s).max(DELAY_STEP * self.period_s),
                because: format!(
                    "the drive's torque comes {:.2} ms later than the controller's delay",
                    1e3 * delay_s
                ),
            });
        }
        found
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
pub(crate) mod tests {
    use super::*;

    /// As a controller's command is: a wave, and the encoder's steps in it.
    pub(crate) fn command() -> Vec<f64> {
        let mut state = 1_u64;
        (0..20_000)
            .map(|k| {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                let noise = (state >> 33) as f64 / (1_u64 << 31) as f64 - 0.5;
                (0.02 * f64::from(k)).sin() + 0.2 * noise
            })
            .collect()
    }

    pub(crate) fn columns(signals: Vec<(Signal, Vec<f64>)>) -> JointColumns {
        JointColumns {
            name: "j".to_owned(),
            signals: signals.into_iter().collect(),
        }
    }

    fn driven(lag_s: f64, delay: usize) -> Vec<Found> {
        let command = command();
        let share = 1.0 - (-1e-3 / lag_s).exp();
        let mut torque = vec![0.0; 20_000];
        for k in delay..20_000 {
            torque[k] = torque[k - 1] + share * (command[k - delay] - torque[k - 1]);
        }
        let joint = columns(vec![
            (Signal::CommandTorqueNm, command),
            (Signal::MotorTorqueNm, torque),
        ]);
        slow_drive(&Response::all(&[joint], 1e-3), Some(0))
    }

    #[test]
    fn a_lag_is_told_from_a_delay() {
        assert_eq!(driven(1e-4, 1), []);
        let lag = driven(3e-3, 1);
        let Effect::CurrentLoopLag { time_constant_s } = lag[0].effect else {
            panic!("{lag:?}");
        };
        assert!((time_constant_s - 3e-3).abs() < 3e-4, "{time_constant_s}");
        assert_eq!(lag.len(), 1, "{lag:?}");
        let delay = driven(1e-4, 4);
        let Effect::CommandDelay { delay_s } = delay[0].effect else {
            panic!("{delay:?}");
        };
        assert!((delay_s - 3e-3).abs() < 2e-4, "{delay_s}");
    }

    #[test]
    fn a_torque_that_goes_on_answers_when_it_begins() {
        let command_nm = command();
        let period_s = 2e-3;
        for lag_s in [1e-4, 2e-2, 6e-2] {
            let share = -f64::exp_m1(-period_s / lag_s);
            let mut torque_nm = vec![0.0; command_nm.len()];
            for k in 1..torque_nm.len() {
                torque_nm[k] = torque_nm[k - 1] + share * (command_nm[k - 1] - torque_nm[k - 1]);
            }
            let joint = columns(vec![
                (Signal::CommandTorqueNm, command_nm.clone()),
                (Signal::MotorTorqueNm, torque_nm),
            ]);
            let joint = [joint];
            let after = answered_after(&joint, period_s, None).unwrap();
            assert!((after - 1.0).abs() <= DELAY_STEP, "{lag_s}: {after}");
            // what is told is as it shows, however slow the drive
            assert_eq!(answered_after(&joint, period_s, Some(1.0)), None, "{lag_s}");
        }
    }

    #[test]
    fn a_drive_at_its_limit_is_not_slow() {
        let command = command();
        let most_nm = command.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        let limit_nm = 0.6 * most_nm;
        let mut torque = vec![0.0; 20_000];
        for k in 1..20_000 {
            torque[k] = command[k - 1].clamp(-limit_nm, limit_nm);
        }
        let joint = columns(vec![
            (Signal::CommandTorqueNm, command),
            (Signal::MotorTorqueNm, torque),
        ]);
        let found = slow_drive(&Response::all(&[joint], 1e-3), Some(0));
        assert_eq!(found, []);
    }

    #[test]
    fn a_smooth_command_is_told_from_a_noisy_torque() {
        let late = |delay: usize, gain: f64| {
            let noise = command();
            let smooth = |k: usize| (0.004 * k as f64).sin() + 0.4 * (0.023 * k as f64).sin();
            let torque = (0..20_000_usize).map(|k| {
                let whole = (0.02 * k as f64).sin();
                gain * smooth(k.saturating_sub(delay)) + noise[k] - whole
            });
            let joint = columns(vec![
                (Signal::CommandTorqueNm, (0..20_000).map(smooth).collect()),
                (Signal::MotorTorqueNm, torque.collect()),
            ]);
            let steps = Response::of_steps(std::slice::from_ref(&joint), 1e-3).unwrap();
            assert_eq!(steps.slow(Some(0), &[]), [], "steps drown in the noise");
            slow_drive(&Response::all(&[joint], 1e-3), Some(0))
        };
        assert_eq!(late(1, 1.0), []);
        assert_eq!(late(1, 0.9), [], "a wrong scale is no lag");
        for after in [10, 17, 30] {
            let found = late(after, 1.0);
            let Effect::CommandDelay { delay_s } = found[0].effect else {
                panic!("{found:?}");
            };
            let off_s = delay_s - 1e-3 * (after - 1) as f64;
            assert!(off_s.abs() < 1.5e-4, "{after}: {off_s}");
            assert_eq!(found.len(), 1, "{found:?}");
        }
    }
}
