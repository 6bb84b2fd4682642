//! A torque that the drive holds while more is commanded, read off the samples: command and torque tell it whatever the joint does.

use std::f64::consts::TAU;

use joint_twin::known::LAW;
use joint_twin::scale::largest_of;
use recording::JointColumns;
use robot::Effect;

use crate::follow::{Response, TAPS, pairs, reached_nm};
use crate::found::{Found, sure_nats};
use crate::lost::ODD;

/// Rounds in which the limit and the rows beyond it settle: it is the mean torque of those, which changes few of them.
const ROUNDS: usize = 10;

/// What the drive should have made of its commands, beside the torque that it reports of a row, both as if it were positive.
struct Row {
    expected_nm: f64,
    torque_nm: f64,
}

/// The torque at which a drive ends, where that is less than `told_nm`, the robot file's limit; none where it follows its commands
/// as far as they go, or does so as well in any other way.
pub(crate) fn drive_limit(
    columns: &[JointColumns],
    responses: &[Response],
    told_nm: Option<f64>,
) -> Option<Found> {
    let followed = responses.iter();
    let followed = followed.filter_map(|response| Followed::by(columns, &response.weights()));
    let Followed { rows, variance } = followed.min_by(|a, b| a.variance.total_cmp(&b.variance))?;
    let mut limit_nm = largest_of(rows.iter().map(|row| row.torque_nm));
    for _ in 0..ROUNDS {
        limit_nm = mean(beyond(&rows, limit_nm).map(|row| row.torque_nm))?;
    }
    // one torque may be anything, many are not
    let odd = ODD / (2.0 * limit_nm);
    let likely = |left_nm: f64| -> f64 {
        let normal = (-0.5 * left_nm.powi(2) / variance).exp() / (TAU * variance).sqrt();
        ((1.0 - ODD) * normal + odd).ln()
    };
    let log_likelihood = |left_nm: &dyn Fn(&Row) -> f64| -> f64 {
        let each = beyond(&rows, limit_nm).map(|row| likely(left_nm(row)));
        each.sum()
    };
    let held = log_likelihood(&|row| row.torque_nm - limit_nm);
    // a drive that follows, one that is weaker there, and one that lacks as much whatever it is told
    let short_nm = mean(beyond(&rows, limit_nm).map(|row| row.expected_nm - row.torque_nm))?;
    let expected_nm = mean(beyond(&rows, limit_nm).map(|row| row.expected_nm))?;
    let gain = 1.0 - short_nm / expected_nm;
    let otherwise = log_likelihood(&|row| row.torque_nm - row.expected_nm)
        .max(log_likelihood(&|row| {
            row.torque_nm - gain * row.expected_nm
        }))
        .max(log_likelihood(&|row| {
            row.torque_nm - row.expected_nm + short_nm
        }));
    let nats = held - otherwise;
    let is_told = told_nm.is_some_and(|told_nm| limit_nm > (1.0 - LAW) * told_nm);
    // of a torque that turns round nothing can be said, and numbers that are none say nothing
    let is_held = limit_nm > 0.0 && nats >= sure_nats();
    if !is_held || is_told {
        return None;
    }
    let count = beyond(&rows, limit_nm).count();
    Some(Found {
        effect: Effect::TorqueSaturation { limit_nm },
        std: (variance / count as f64).sqrt().hypot(LAW * limit_nm),
        because: format!(
            "the drive holds {limit_nm:.4} Nm in {count} rows that command up to {:.4} Nm, by {nats:.0} nats",
            beyond(&rows, limit_nm)
                .map(|row| row.expected_nm)
                .fold(0.0, f64::max)
        ),
    })
}

/// Rows of which more is expected than a limit.
fn beyond(rows: &[Row], limit_nm: f64) -> impl Iterator<Item = &Row> {
    rows.iter().filter(move |row| row.expected_nm > limit_nm)
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then_some(sum / count)
}

/// What a drive makes of its commands within what it reaches.
struct Followed {
    rows: Vec<Row>,
    /// Of the torque about what is expected.
    variance: f64,
}

impl Followed {
    /// Of all recordings, by the weights of the last commands; none where nothing tells.
    fn by(columns: &[JointColumns], weights: &[f64]) -> Option<Self> {
        let mut rows = Vec::new();
        for (torque_nm, command_nm) in pairs(columns) {
            for k in TAPS..torque_nm.len() {
                let past = command_nm[..=k].iter().rev();
                let expected_nm: f64 = weights.iter().zip(past).map(|(w, u)| w * u).sum();
                let row = Row {
                    expected_nm: expected_nm.abs(),
                    torque_nm: expected_nm.signum() * torque_nm[k],
                };
                if row.expected_nm.is_finite() && row.torque_nm.is_finite() {
                    rows.push(row);
                }
            }
        }
        let torques_nm: Vec<f64> = rows.iter().map(|row| row.torque_nm).collect();
        let reached_nm = reached_nm(&torques_nm);
        let within = || rows.iter().filter(|row| row.expected_nm < reached_nm);
        // in other units it is not held
        let square = mean(within().map(|row| row.expected_nm.powi(2)))?;
        let scale = mean(within().map(|row| row.expected_nm * row.torque_nm))? / square;
        let variance = mean(within().map(|row| (row.torque_nm - scale * row.expected_nm).powi(2)))?;
        let is_there = scale > 0.0 && scale.is_finite() && variance > 0.0;
        rows.iter_mut().for_each(|row| row.expected_nm *= scale);
        is_there.then_some(Self { rows, variance })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::follow::tests::{columns, command};
    use recording::Signal;

    /// Any numbers that are small and are not the commands.
    fn noise_nm(k: usize) -> f64 {
        0.01 * f64::from((7919 * k as u32) % 101) / 101.0
    }

    /// What a drive that makes `made` of its commands, one row late, shows with noise.
    fn found(made: impl Fn(f64) -> f64, told_nm: Option<f64>) -> Option<f64> {
        let command_nm = command();
        let torque_nm = (0..command_nm.len())
            .map(|k| made(command_nm[k.saturating_sub(1)]) + noise_nm(k))
            .collect();
        let joint = [columns(vec![
            (Signal::CommandTorqueNm, command_nm.clone()),
            (Signal::MotorTorqueNm, torque_nm),
        ])];
        let found = drive_limit(&joint, &Response::all(&joint, 1e-3), told_nm)?;
        match found.effect {
            Effect::TorqueSaturation { limit_nm } => Some(limit_nm),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_a_drive_holds_is_told() {
        let limit_nm = found(|u| u.clamp(-0.9, 0.9), None).unwrap();
        assert!((limit_nm - 0.9).abs() < 0.01, "{limit_nm}");
    }

    #[test]
    fn a_drive_that_follows_or_ends_where_the_file_has_it_end_is_told_of_no_limit() {
        assert_eq!(found(|u| u, None), None);
        assert_eq!(found(|u| u.clamp(-0.9, 0.9), Some(0.9)), None);
        // one that gives nothing, or turns round
        assert_eq!(found(|_| 0.0, None), None);
        assert_eq!(found(|u| if u.abs() > 0.8 { -u } else { u }, None), None);
        // other units, and a motor that is weaker at large currents
        assert_eq!(found(|u| 0.8 * u, None), None);
        let weaker = |u: f64| u.signum() * (u.abs() - 0.3 * (u.abs() - 0.7).max(0.0));
        assert_eq!(found(weaker, None), None);
    }

    #[test]
    fn one_command_that_leaps_is_no_limit() {
        let mut command_nm: Vec<f64> = command().iter().map(|u| u.clamp(-0.9, 0.9)).collect();
        let mean_nm = |k: usize| 0.5 * (command_nm[k] + command_nm[k.saturating_sub(1)]);
        let torque_nm = (0..command_nm.len())
            .map(|k| mean_nm(k) + noise_nm(k))
            .collect();
        *command_nm.last_mut().unwrap() = 50.0;
        let joint = [columns(vec![
            (Signal::CommandTorqueNm, command_nm),
            (Signal::MotorTorqueNm, torque_nm),
        ])];
        assert_eq!(
            drive_limit(&joint, &Response::all(&joint, 1e-3), None),
            None
        );
    }
}
