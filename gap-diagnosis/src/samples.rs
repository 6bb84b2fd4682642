//! Effects that show in single samples and in no band: lost samples and commands, coarse encoders, a slow velocity
//! filter. They are counted, not fitted.

use nalgebra::{DMatrix, DVector};
use recording::{JointColumns, Recording, Signal};
use robot::{Control, Effect, EncoderSide, RobotJoint};

/// A position that stays although the joint should have moved by so many steps of its encoder was not measured.
const STEPS_MOVED: f64 = 3.0;
/// Fewer rows than this tell no fraction.
const ROWS_MIN: usize = 200;
/// Losses below this part are a recorder's hiccup.
const LOST_MIN: f64 = 0.002;
/// A step coarser than the file's by this factor is another encoder.
const COARSER: f64 = 1.4;
/// A velocity that lags its own position by less is filtered as it should be.
const LAG_MIN_S: f64 = 6e-4;
/// Samples over which the drive's response is sought.
const TAPS: usize = 64;
/// A step of the command stands out if it is so many times the noise.
const SURE_STEP: f64 = 8.0;
/// Time constant of a current loop as it should be.
const FAST_LAG_S: f64 = 3e-4;
/// Those of current loops that nobody would call slow.
const FAST_LAGS_S: [f64; 3] = [0.0, 0.5 * FAST_LAG_S, FAST_LAG_S];
/// Tenths of a sample by which the torque may be later than the controller's delay.
const LATE_STEPS: i32 = 4;
/// What a slower response must be worth, in squared standard deviations.
const WORTH: f64 = 50.0;
/// Standard errors that a finding is away from nothing.
const SURE: f64 = 5.0;
/// Quantile of torques that were reached: a few samples may be anything; and the part of it up to which a drive is taken to
/// follow its command.
const NEARLY_ALL: f64 = 0.999;
const REACHED: f64 = 0.97;

/// An effect found in samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// With the value found.
    pub effect: Effect,
    /// Standard error of that value.
    pub std: f64,
    /// The count or measurement that decided, in one sentence.
    pub because: String,
}

/// What the samples of one joint show, over all recordings. Where the robot file tells of no feedback there is no
/// velocity filter that could be slower than told.
pub fn find(
    recordings: &[&Recording],
    joint: &RobotJoint,
    control: Option<&Control>,
) -> Vec<Found> {
    let columns: Vec<&JointColumns> = recordings
        .iter()
        .filter_map(|recording| recording.joint(&joint.name).ok())
        .collect();
    let Some(rate_hz) = recordings.first().map(|recording| recording.sample_rate_hz) else {
        return Vec::new();
    };
    let response = Response::of(&columns, 1.0 / rate_hz);
    let lost = lost_samples(&columns, joint);
    // a torque that was not measured anew tells nothing of its command
    let response = response.filter(|_| lost.is_none());
    let delay_cycles = control.map_or(1, |control| control.delay_cycles as usize);
    let drive = slow_drive(response.as_ref(), delay_cycles);
    let found = [
        lost,
        lost_commands(&columns, response.as_ref()),
        coarse_encoder(
            &columns,
            Signal::MotorPositionRad,
            EncoderSide::Motor,
            joint.motor_encoder_resolution_rad,
            joint.position_noise_rad,
        ),
        coarse_encoder(
            &columns,
            Signal::LinkPositionRad,
            EncoderSide::Link,
            joint.link_encoder_resolution_rad,
            joint.position_noise_rad,
        ),
        control
            .filter(|control| control.is_closed())
            .and_then(|_| slow_velocity(&columns, rate_hz)),
    ];
    found.into_iter().flatten().chain(drive).collect()
}

/// A part of many, with its standard error; none where there are too few.
fn fraction(lost: usize, of: usize) -> Option<(f64, f64)> {
    if of < ROWS_MIN {
        return None;
    }
    let part = lost as f64 / of as f64;
    let std = (part.max(1.0 / of as f64) * (1.0 - part) / of as f64).sqrt();
    (part > LOST_MIN && part > SURE * std).then_some((part, std))
}

/// Rows in which nothing of the joint changed although it moved.
fn lost_samples(columns: &[&JointColumns], joint: &RobotJoint) -> Option<Found> {
    let resolution_rad = joint.motor_encoder_resolution_rad.unwrap_or(0.0);
    let noise_rad = joint.position_noise_rad;
    let (mut lost, mut of) = (0, 0);
    for columns in columns {
        let Some(position_rad) = columns.signals.get(&Signal::MotorPositionRad) else {
            continue;
        };
        let beside = [
            Signal::LinkPositionRad,
            Signal::MotorTorqueNm,
            Signal::JointTorqueNm,
        ];
        let beside: Vec<&Vec<f64>> = beside
            .iter()
            .filter_map(|signal| columns.signals.get(signal))
            .filter(|values| values.iter().any(|value| value.is_finite()))
            .collect();
        let step_rad = resolution_rad.max(smallest_step(position_rad).unwrap_or(0.0));
        for k in 2..position_rad.len().saturating_sub(2) {
            // what a row should have moved, from the rows around it
            let moves_rad = 0.25 * (position_rad[k + 2] - position_rad[k - 2]);
            let sure_rad = STEPS_MOVED * step_rad.max(noise_rad);
            if !moves_rad.is_finite() || moves_rad.abs() <= sure_rad {
                continue;
            }
            of += 1;
            let stays = |values: &Vec<f64>| values[k] == values[k - 1];
            let all_stay = stays(position_rad) && beside.iter().all(|values| stays(values));
            lost += usize::from(all_stay);
        }
    }
    let (part, std) = fraction(lost, of)?;
    Some(Found {
        effect: Effect::DroppedSamples { fraction: part },
        std,
        because: format!("{lost} of {of} rows repeat the row before although the joint moved"),
    })
}

/// How the drive's torque follows its command, sample by sample: a delay and a first-order lag.
struct Response {
    /// Sums of products of the command's steps, and of those with the torque's.
    matrix: DMatrix<f64>,
    vector: DVector<f64>,
    square: f64,
    rows: usize,
    period_s: f64,
}

/// A delay in samples and a time constant.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Follow {
    delay: f64,
    lag_s: f64,
}

impl Response {
    /// From all rows in which command and torque are there.
    fn of(columns: &[&JointColumns], period_s: f64) -> Option<Self> {
        let mut response = Self {
            matrix: DMatrix::zeros(TAPS, TAPS),
            vector: DVector::zeros(TAPS),
            square: 0.0,
            rows: 0,
            period_s,
        };
        for (torque_nm, command_nm) in pairs(columns) {
            let reached_nm = reached_nm(torque_nm);
            for k in TAPS + 1..torque_nm.len() {
                // a drive at its limit does not follow, and a lag is not to be made of that
                if command_nm[k - TAPS..=k]
                    .iter()
                    .any(|u| u.abs() > reached_nm)
                {
                    continue;
                }
                // steps tell one sample from the next; the values themselves are all alike
                let past: [f64; TAPS] =
                    std::array::from_fn(|i| command_nm[k - i] - command_nm[k - i - 1]);
                let step_nm = torque_nm[k] - torque_nm[k - 1];
                if !step_nm.is_finite() || past.iter().any(|u| !u.is_finite()) {
                    continue;
                }
                response.add(&past, step_nm);
            }
        }
        for i in 0..TAPS {
            for j in 0..i {
                response.matrix[(j, i)] = response.matrix[(i, j)];
            }
        }
        (response.rows >= ROWS_MIN).then_some(response)
    }

    fn add(&mut self, past: &[f64; TAPS], step_nm: f64) {
        self.rows += 1;
        self.square += step_nm * step_nm;
        for i in 0..TAPS {
            self.vector[i] += past[i] * step_nm;
            for j in 0..=i {
                self.matrix[(i, j)] += past[i] * past[j];
            }
        }
    }

    fn taps(&self, follow: Follow) -> DVector<f64> {
        let keep = if follow.lag_s > 0.0 {
            (-self.period_s / follow.lag_s).exp()
        } else {
            0.0
        };
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

    /// Sum of squares that a response leaves.
    fn left(&self, follow: Follow) -> f64 {
        let taps = self.taps(follow);
        (self.square - 2.0 * taps.dot(&self.vector) + taps.dot(&(&self.matrix * &taps))).max(0.0)
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
        for &delay in delays {
            for &lag_s in lags_s {
                let follow = Follow { delay, lag_s };
                let left = self.left(follow);
                if left < best.1 {
                    best = (follow, left);
                }
            }
        }
        best
    }
}

/// The largest torque but for a few samples and a margin: commands up to it were not cut off.
fn reached_nm(torque_nm: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = torque_nm.iter().map(|torque_nm| torque_nm.abs()).collect();
    sizes.retain(|size| size.is_finite());
    sizes.sort_by(f64::total_cmp);
    let nearly_all = (NEARLY_ALL * sizes.len().saturating_sub(1) as f64) as usize;
    REACHED * sizes.get(nearly_all).copied().unwrap_or(0.0)
}

fn pairs<'a>(columns: &'a [&JointColumns]) -> impl Iterator<Item = (&'a Vec<f64>, &'a Vec<f64>)> {
    columns.iter().filter_map(|columns| {
        let torque_nm = columns.signals.get(&Signal::MotorTorqueNm)?;
        let command_nm = columns.signals.get(&Signal::CommandTorqueNm)?;
        Some((torque_nm, command_nm))
    })
}

/// By how much each of the last commands counts in the drive's torque, newest first; none where too few rows tell.
pub(crate) fn weights_of_commands(columns: &[&JointColumns], period_s: f64) -> Option<Vec<f64>> {
    let response = Response::of(columns, period_s)?;
    let (follow, _) = response.best(&delays(0.0), &[&FAST_LAGS_S[..], &slow_lags_s()].concat());
    Some(response.taps(follow).iter().copied().collect())
}

/// Rows in which the drive's torque stayed with the command before.
fn lost_commands(columns: &[&JointColumns], response: Option<&Response>) -> Option<Found> {
    let response = response?;
    let (follow, left) = response.best(&delays(0.0), &FAST_LAGS_S);
    // of steps, so of two samples' noise
    let noise_nm = (left / response.rows as f64 / 2.0).sqrt();
    // a delay between two samples spreads each step over both
    let weights = response.taps(follow);
    let (mut lost, mut of) = (0, 0);
    for (torque_nm, command_nm) in pairs(columns) {
        let digit_nm = smallest_step(torque_nm).unwrap_or(0.0);
        let sure_nm = SURE_STEP * noise_nm.max(digit_nm);
        let answer_nm = |k: usize| -> f64 {
            let past = command_nm[..=k].iter().rev();
            weights.iter().zip(past).map(|(w, u)| w * u).sum()
        };
        for k in TAPS..torque_nm.len() {
            let expected_nm = answer_nm(k - 1);
            let step_nm = answer_nm(k) - expected_nm;
            let given_nm = torque_nm[k] - torque_nm[k - 1];
            let before_nm = torque_nm[k - 1] - expected_nm;
            let stands_out = step_nm.abs() > sure_nm;
            if !stands_out || !given_nm.is_finite() {
                continue;
            }
            of += 1;
            // the torque was where it should be, and stayed there
            let stays = (given_nm / step_nm).abs() < 0.25;
            lost += usize::from(stays && (before_nm / step_nm).abs() < 0.25);
        }
    }
    let (part, std) = fraction(lost, of)?;
    Some(Found {
        effect: Effect::DroppedCommands { fraction: part },
        std,
        because: format!("{lost} of {of} steps of the command were left out by the drive"),
    })
}

/// Delays from a smallest one on.
fn delays(from: f64) -> Vec<f64> {
    (0..)
        .map(|k| from + 0.1 * f64::from(k))
        .take_while(|delay| *delay < TAPS as f64 - 4.0)
        .collect()
}

/// Time constants of slower and slower current loops.
fn slow_lags_s() -> Vec<f64> {
    (0..40).map(|k| FAST_LAG_S * 1.12_f64.powi(k)).collect()
}

/// Lag of the current loop and delay of the command, beyond what the robot file's controller has.
fn slow_drive(response: Option<&Response>, delay_cycles: usize) -> Vec<Found> {
    let Some(response) = response else {
        return Vec::new();
    };
    // what acts from a sample on is measured at the next
    let told = delay_cycles as f64 + 1.0;
    let usual: Vec<f64> = (0..=LATE_STEPS)
        .map(|k| told + 0.1 * f64::from(k))
        .collect();
    let lags = slow_lags_s();
    let (_, as_told) = response.best(&usual, &FAST_LAGS_S);
    let (late, with_delay) = response.best(&delays(told), &FAST_LAGS_S);
    let (slow, with_lag) = response.best(&usual, &lags);
    let (both, least) = response.best(&delays(told), &lags);
    let variance = (least / response.rows as f64).max(1e-300);
    let worth = |before: f64, after: f64| (before - after) / variance > WORTH;
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
    if chosen.lag_s > 2.0 * FAST_LAG_S {
        found.push(Found {
            effect: Effect::CurrentLoopLag {
                time_constant_s: chosen.lag_s,
            },
            std: 0.06 * chosen.lag_s,
            because: format!(
                "the drive's torque follows its command with {:.2} ms",
                1e3 * chosen.lag_s
            ),
        });
    }
    let late = chosen.delay - told;
    if late > 0.1 * f64::from(LATE_STEPS) {
        let delay_s = late * response.period_s;
        found.push(Found {
            effect: Effect::CommandDelay { delay_s },
            std: (0.03 * delay_s).max(0.1 * response.period_s),
            because: format!(
                "the drive's torque comes {:.2} ms later than the controller's delay",
                1e3 * delay_s
            ),
        });
    }
    found
}

/// The smallest step between two rows that differ; none where the values are not in steps.
fn smallest_step(values: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = values
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .filter(|step| step.is_finite() && *step > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    // rounding makes steps of nothing: the smallest that many agree on
    let first = steps
        .iter()
        .position(|step| *step > 1e-12)
        .map(|k| k + steps.len() / 500)?;
    let step = *steps.get(first)?;
    let whole = steps[first..]
        .iter()
        .take(2000)
        .filter(|other| {
            let times = *other / step;
            (times - times.round()).abs() < 0.05
        })
        .count();
    let looked_at = steps.len().saturating_sub(first).min(2000);
    (whole * 10 > looked_at * 9).then_some(step)
}

fn coarse_encoder(
    columns: &[&JointColumns],
    signal: Signal,
    side: EncoderSide,
    file_rad: Option<f64>,
    noise_rad: f64,
) -> Option<Found> {
    let steps: Vec<f64> = columns
        .iter()
        .filter_map(|columns| smallest_step(columns.signals.get(&signal)?))
        .collect();
    let step_rad = steps.iter().copied().fold(f64::NAN, f64::max);
    let expected_rad = file_rad.unwrap_or(0.0);
    // a step below the noise is no coarser encoder than the noise makes it anyway
    let is_coarse = step_rad > COARSER * expected_rad && step_rad > COARSER * noise_rad;
    is_coarse.then(|| Found {
        effect: Effect::EncoderQuantisation {
            resolution_rad: step_rad,
            side,
        },
        std: 0.02 * step_rad,
        because: format!(
            "{signal} comes in steps of {step_rad:.3e} rad, the robot file has {expected_rad:.3e} rad"
        ),
    })
}

/// How far the reported velocity is behind the derivative of the reported position.
fn slow_velocity(columns: &[&JointColumns], rate_hz: f64) -> Option<Found> {
    let period_s = 1.0 / rate_hz;
    let (mut slope, mut square, mut left, mut rows) = (0.0, 0.0, 0.0, 0.0);
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for columns in columns {
        let position = columns.signals.get(&Signal::MotorPositionRad);
        let velocity = columns.signals.get(&Signal::MotorVelocityRadS);
        let (Some(position_rad), Some(velocity_rad_s)) = (position, velocity) else {
            continue;
        };
        // position smoothed and velocity smoothed alike, so that only what the drive did remains
        let width = ((0.01 * rate_hz) as usize).max(2);
        for k in (2 * width..velocity_rad_s.len().saturating_sub(2 * width)).step_by(width) {
            let mean = |from: usize, to: usize| {
                velocity_rad_s[from..to].iter().sum::<f64>() / (to - from) as f64
            };
            let true_rad_s = (position_rad[k + width] - position_rad[k - width])
                / (2.0 * width as f64 * period_s);
            let told_rad_s =
                0.5 * (mean(k - width, k + width) + mean(k - width + 1, k + width + 1));
            let change = (mean(k + width, k + 2 * width) - mean(k - 2 * width, k - width))
                / (3.0 * width as f64 * period_s);
            if true_rad_s.is_finite() && told_rad_s.is_finite() && change.is_finite() {
                pairs.push((change, true_rad_s - told_rad_s));
            }
        }
    }
    for (change, behind) in &pairs {
        slope += change * behind;
        square += change * change;
        rows += 1.0;
    }
    if rows < ROWS_MIN as f64 / 4.0 || square <= 0.0 {
        return None;
    }
    let lag_s = slope / square;
    for (change, behind) in &pairs {
        left += (behind - lag_s * change).powi(2);
    }
    let std_s = (left / (rows - 1.0) / square).sqrt();
    if lag_s < LAG_MIN_S || lag_s < SURE * std_s {
        return None;
    }
    let cutoff_hz = 1.0 / (std::f64::consts::TAU * lag_s);
    Some(Found {
        effect: Effect::VelocityFilterLag { cutoff_hz },
        std: cutoff_hz * std_s / lag_s,
        because: format!(
            "the reported velocity is {:.2} ms behind the position's derivative",
            1e3 * lag_s
        ),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    /// As a controller's command is: a wave, and the encoder's steps in it.
    fn command() -> Vec<f64> {
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

    fn wave(k: usize) -> f64 {
        let t = k as f64 / 1000.0;
        40.0 * (2.0 * t).sin() + 11.0 * (5.3 * t).sin()
    }

    fn columns(signals: Vec<(Signal, Vec<f64>)>) -> JointColumns {
        JointColumns {
            name: "j".to_owned(),
            signals: signals.into_iter().collect(),
        }
    }

    #[test]
    fn a_coarse_encoder_is_measured_and_a_fine_one_is_not_called_coarse() {
        let coarse: Vec<f64> = (0..20_000)
            .map(|k| (wave(k) / 0.01).round() * 0.01)
            .collect();
        let joint = columns(vec![(Signal::MotorPositionRad, coarse)]);
        let find = |file| {
            coarse_encoder(
                &[&joint],
                Signal::MotorPositionRad,
                EncoderSide::Motor,
                Some(file),
                0.0,
            )
        };
        let found = find(0.001).unwrap();
        let Effect::EncoderQuantisation { resolution_rad, .. } = found.effect else {
            panic!("{found:?}");
        };
        assert!((resolution_rad - 0.01).abs() < 1e-6);
        assert!(find(0.01).is_none());
        let smooth: Vec<f64> = (0..20_000).map(wave).collect();
        assert_eq!(smallest_step(&smooth), None);
    }

    #[test]
    fn a_slow_velocity_is_measured() {
        let cutoff_hz = 40.0;
        let share = 1.0 - (-std::f64::consts::TAU * cutoff_hz / 1000.0_f64).exp();
        let mut slow = 91.8;
        let mut told = Vec::new();
        for k in 0..20_000 {
            told.push(slow);
            slow += share * ((wave(k + 1) - wave(k)) * 1000.0 - slow);
        }
        let joint = columns(vec![
            (Signal::MotorPositionRad, (0..20_000).map(wave).collect()),
            (Signal::MotorVelocityRadS, told),
        ]);
        let found = slow_velocity(&[&joint], 1000.0).unwrap();
        let Effect::VelocityFilterLag {
            cutoff_hz: found_hz,
        } = found.effect
        else {
            panic!("{found:?}");
        };
        assert!((found_hz / cutoff_hz - 1.0).abs() < 0.2, "{found_hz}");
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
        slow_drive(Response::of(&[&joint], 1e-3).as_ref(), 0)
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
        let found = slow_drive(Response::of(&[&joint], 1e-3).as_ref(), 0);
        assert_eq!(found, []);
    }

    #[test]
    fn steps_that_the_drive_left_out_are_counted() {
        let command = command();
        let mut torque = vec![0.0; 20_000];
        let lost = |k: usize| k % 50 == 7;
        for k in 1..20_000 {
            torque[k] = if lost(k) {
                torque[k - 1]
            } else {
                command[k - 1]
            };
        }
        let joint = columns(vec![
            (Signal::CommandTorqueNm, command),
            (Signal::MotorTorqueNm, torque),
        ]);
        let columns = [&joint];
        let response = Response::of(&columns, 1e-3).unwrap();
        let found = lost_commands(&columns, Some(&response)).unwrap();
        let Effect::DroppedCommands { fraction } = found.effect else {
            panic!("{found:?}");
        };
        assert!((fraction - 0.02).abs() < 0.01, "{fraction}");
    }
}
