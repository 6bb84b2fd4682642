//! Which velocity filter makes a controller's commands of what its encoder shows: the robot file tells its law, so that nothing else of
//! them is unknown but what is fed forward.

use joint_model::filter::Butterworth;
use joint_twin::known::LAW;
use joint_twin::scale::ROWS_MIN;
use nalgebra::{DMatrix, DVector};
use recording::{JointColumns, Signal};
use robot::{Control, Effect, Feedback, Feedforward};

use super::found::{Found, SURE};

/// The lowest cut-off that is tried, and from one to the next a factor; then each of those in as many parts.
const LOWEST_HZ: f64 = 2.0;
const FACTOR: f64 = 1.2;
const PARTS: i32 = 8;
/// Means over this time are compared, in which an encoder's rounding is little.
const BLOCK_S: f64 = 0.01;

/// A joint's law.
pub(crate) struct Law<'a> {
    /// The robot file's.
    pub control: &'a Control,
    /// The joint's place in its gains.
    pub joint: usize,
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// Of the recording, which is that of the loop.
    pub rate_hz: f64,
}

/// One run of rows: what a filter is told from.
struct Run {
    /// The velocity that is filtered, joint side.
    velocity_rad_s: Vec<f64>,
    /// The command without its proportional part and the reference's rate, joint side: `-kd` times the filtered velocity, and what is fed
    /// forward.
    rest_nm: Vec<f64>,
    /// What may be fed forward, and an instant of the command that is not the row's.
    beside: Vec<Vec<f64>>,
}

impl Law<'_> {
    /// The filter that the commands show, where it is slower than `usual_s` makes it for certain.
    pub fn slow_filter(&self, columns: &[JointColumns], usual_s: f64) -> Option<Found> {
        let runs: Vec<Run> = columns.iter().filter_map(|of| self.run(of)).collect();
        let highest_hz = 1.0 / (std::f64::consts::TAU * usual_s);
        let mut best: Option<(f64, Fit)> = None;
        let mut looked_at = |cutoff_hz: f64| {
            if let Some(fit) = self.fit(&runs, cutoff_hz)
                && best.as_ref().is_none_or(|(_, best)| fit.left < best.left)
            {
                best = Some((cutoff_hz, fit));
            }
            best.as_ref().map(|(cutoff_hz, _)| *cutoff_hz)
        };
        let mut cutoff_hz = LOWEST_HZ;
        let mut coarse = None;
        while cutoff_hz < 0.25 * self.rate_hz {
            coarse = looked_at(cutoff_hz);
            cutoff_hz *= FACTOR;
        }
        let coarse_hz = coarse?;
        for part in 1 - PARTS..PARTS {
            looked_at(coarse_hz * FACTOR.powf(f64::from(part) / f64::from(PARTS)));
        }
        let (cutoff_hz, fit) = best?;
        // a law that is told is all there is: what else left so much would be unknown
        let as_told = self.fit(&runs, self.control.velocity_filter_hz)?;
        if fit.left > LAW * as_told.left {
            return None;
        }
        let is_sure = (highest_hz / cutoff_hz).ln() > SURE * fit.std;
        let told_hz = self.control.velocity_filter_hz;
        (cutoff_hz < highest_hz && is_sure && fit.rows >= ROWS_MIN).then(|| Found {
            effect: Effect::VelocityFilterLag { cutoff_hz },
            std: cutoff_hz * fit.std,
            because: format!(
                "the commands are what the robot file's gains make of a velocity filtered at {cutoff_hz:.1} Hz, where it tells {}",
                if told_hz > 0.0 {
                    format!("{told_hz} Hz")
                } else {
                    "no filter".to_owned()
                }
            ),
        })
    }

    /// None where something is missing.
    fn run(&self, columns: &JointColumns) -> Option<Run> {
        let control = self.control;
        let [kp, kd] = [
            *control.proportional_nm_rad.get(self.joint)?,
            *control.derivative_nm_s_rad.get(self.joint)?,
        ];
        let (encoder, side) = match control.feedback {
            Feedback::Motor => (Signal::MotorPositionRad, self.gear_ratio),
            Feedback::Link => (Signal::LinkPositionRad, 1.0),
        };
        let whole = |signal| {
            let values = columns.measured(signal)?;
            values
                .iter()
                .all(|value| value.is_finite())
                .then_some(values)
        };
        let position_rad: Vec<f64> = whole(encoder)?.iter().map(|rad| rad / side).collect();
        let reference_rad = whole(Signal::ReferencePositionRad)?;
        let command_nm: Vec<f64> = whole(Signal::CommandTorqueNm)?
            .iter()
            .map(|nm| nm * self.gear_ratio)
            .collect();
        if kd == 0.0 || position_rad.len() < ROWS_MIN {
            return None;
        }
        let backward = |values: &[f64]| -> Vec<f64> {
            let steps = values
                .windows(2)
                .map(|two| (two[1] - two[0]) * self.rate_hz);
            std::iter::once(0.0).chain(steps).collect()
        };
        let rate_rad_s = match whole(Signal::ReferenceVelocityRadS) {
            Some(rate_rad_s) => rate_rad_s.to_vec(),
            None => backward(reference_rad),
        };
        let rest_nm = (0..command_nm.len())
            .map(|k| {
                let held_nm = kp * (reference_rad[k] - position_rad[k]) + kd * rate_rad_s[k];
                command_nm[k] - held_nm
            })
            .collect();
        let mut beside = vec![vec![1.0; command_nm.len()], backward(&command_nm)];
        if control.feedforward != Feedforward::None {
            beside.extend([
                backward(&rate_rad_s),
                rate_rad_s,
                reference_rad.iter().map(|rad| rad.sin()).collect(),
                reference_rad.iter().map(|rad| rad.cos()).collect(),
            ]);
        }
        Some(Run {
            velocity_rad_s: backward(&position_rad)
                .into_iter()
                .map(|v| kd * v)
                .collect(),
            rest_nm,
            beside,
        })
    }

    fn fit(&self, runs: &[Run], cutoff_hz: f64) -> Option<Fit> {
        let order = self.control.velocity_filter_order as usize;
        let block = ((BLOCK_S * self.rate_hz).ceil() as usize).max(1);
        // until a filter of the lowest cut-off has forgotten where it began
        let begin = (self.rate_hz / LOWEST_HZ) as usize / block;
        let means = |values: &[f64]| -> Vec<f64> {
            let blocks = values.chunks_exact(block).skip(begin);
            blocks
                .map(|of| of.iter().sum::<f64>() / block as f64)
                .collect()
        };
        let filtered = |run: &Run, cutoff_hz: f64| -> Vec<f64> {
            // none, or one that is faster than the loop
            let Ok(mut filter) = Butterworth::design(order, cutoff_hz, self.rate_hz) else {
                return means(&run.velocity_rad_s);
            };
            let values: Vec<f64> = run.velocity_rad_s.iter().map(|v| filter.step(*v)).collect();
            means(&values)
        };
        let (mut target, mut slope) = (Vec::new(), Vec::new());
        let mut beside: Vec<Vec<f64>> = Vec::new();
        for run in runs {
            let made_nm = filtered(run, cutoff_hz);
            // by the logarithm of the cut-off
            let faster_nm = filtered(run, cutoff_hz * FACTOR);
            let both = faster_nm.iter().zip(&made_nm);
            slope.extend(both.map(|(faster, made)| (made - faster) / FACTOR.ln()));
            let rest_nm = means(&run.rest_nm);
            target.extend(rest_nm.iter().zip(&made_nm).map(|(rest, made)| rest + made));
            beside.resize(run.beside.len(), Vec::new());
            for (all, own) in beside.iter_mut().zip(&run.beside) {
                all.extend(means(own));
            }
        }
        let rows = target.len();
        let columns = beside.len() + 1;
        if rows <= columns {
            return None;
        }
        let target = DVector::from_vec(target);
        let all = DMatrix::from_fn(rows, columns, |row, column| match column {
            0 => slope[row],
            _ => beside[column - 1][row],
        });
        let without = all.columns(1, columns - 1).into_owned();
        let fitted = without
            .tr_mul(&without)
            .cholesky()?
            .solve(&without.tr_mul(&target));
        let left = (&target - &without * fitted).norm_squared();
        let variance = left / (rows - columns) as f64;
        // without a filter its cut-off has no slope
        let solved = all.tr_mul(&all).cholesky();
        let std = solved.map_or(f64::INFINITY, |of| (variance * of.inverse()[(0, 0)]).sqrt());
        Some(Fit { left, std, rows })
    }
}

/// How well a filter makes the commands.
struct Fit {
    /// Sum of squares that is left.
    left: f64,
    /// Standard error of the cut-off's logarithm.
    std: f64,
    /// Means that were compared.
    rows: usize,
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::follow::tests::columns;
    use robot::ControlKind;

    const RATE_HZ: f64 = 500.0;
    const RATIO: f64 = 100.0;

    fn control(velocity_filter_hz: f64) -> Control {
        Control {
            rate_hz: RATE_HZ,
            kind: ControlKind::PdFeedforward,
            proportional_nm_rad: vec![200.0],
            derivative_nm_s_rad: vec![10.0],
            feedback: Feedback::Motor,
            feedforward: Feedforward::RigidBody,
            velocity_filter_hz,
            velocity_filter_order: 1,
            delay_cycles: 1,
        }
    }

    /// What a controller of this filter commands, with feedforward and something that the file does not know.
    fn commands(cutoff_hz: f64, unknown_nm: f64) -> JointColumns {
        let at = |k: i32, late_s: f64| {
            let t = f64::from(k) / RATE_HZ - late_s;
            0.6 * (2.3 * t).sin() + 0.2 * (7.1 * t).sin()
        };
        let mut filter = Butterworth::design(1, cutoff_hz, RATE_HZ).unwrap();
        let step_rad = 1e-4;
        let shown = |k: i32| (RATIO * at(k, 0.01) / step_rad).round() * step_rad / RATIO;
        let (mut reference, mut rate, mut motor, mut command) = (vec![], vec![], vec![], vec![]);
        for k in 0..10_000 {
            let rates = [k - 1, k, k + 1].map(|k| (at(k, 0.0) - at(k - 1, 0.0)) * RATE_HZ);
            let velocity = filter.step(if k == 0 {
                0.0
            } else {
                (shown(k) - shown(k - 1)) * RATE_HZ
            });
            let fed_nm = 1.2 * (rates[1] - rates[0]) * RATE_HZ + 5.0 * at(k, 0.0).sin();
            let other_nm = unknown_nm * (3.7 * f64::from(k) / RATE_HZ).sin();
            reference.push(at(k, 0.0));
            rate.push(rates[1]);
            motor.push(RATIO * shown(k));
            command.push(
                (200.0 * (at(k, 0.0) - shown(k))
                    + 10.0 * (rates[1] - velocity)
                    + fed_nm
                    + other_nm)
                    / RATIO,
            );
        }
        columns(vec![
            (Signal::ReferencePositionRad, reference),
            (Signal::ReferenceVelocityRadS, rate),
            (Signal::MotorPositionRad, motor),
            (Signal::CommandTorqueNm, command),
        ])
    }

    fn found(columns: JointColumns, told_hz: f64) -> Option<f64> {
        let control = control(told_hz);
        let law = Law {
            control: &control,
            joint: 0,
            gear_ratio: RATIO,
            rate_hz: RATE_HZ,
        };
        let found = law.slow_filter(&[columns], 4e-3)?;
        match found.effect {
            Effect::VelocityFilterLag { cutoff_hz } => Some(cutoff_hz),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn commands_tell_a_filter_that_is_slower_than_told() {
        let cutoff_hz = found(commands(12.0, 0.0), 80.0).unwrap();
        assert!((cutoff_hz / 12.0 - 1.0).abs() < 0.05, "{cutoff_hz}");
        // of none that is told
        assert!(found(commands(12.0, 0.0), 0.0).is_some());
    }

    #[test]
    fn a_filter_as_told_and_a_law_that_is_not_all_there_is_tell_none() {
        assert_eq!(found(commands(80.0, 0.0), 80.0), None);
        assert_eq!(found(commands(12.0, 3.0), 80.0), None);
    }
}
