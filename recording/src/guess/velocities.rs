//! A velocity is what its position's difference says, in whatever unit and on whatever side of the gear.

use super::names::{Guesser, said};
use super::{GuessedColumn, GuessedTime, Sure};
use crate::Signal;
use crate::builder::shown_rate_hz;
use crate::clock::{Clock, UnitsPerSecond, only_time_column};
use crate::columns::TIME;
use crate::frame::clock_of;
use std::f64::consts::PI;
use std::fmt::Write;
use std::ops::RangeInclusive;

/// Ways of a joint, one after the other, that say how a velocity goes with them.
const WAYS_MIN: usize = 10;

impl Guesser<'_> {
    /// Unit, sign and side of the gear of velocities, from their positions. One that no unit, sign or side explains is taken out and
    /// told with the reason: it lags, or was filtered, and the position tells the motion without it. Where all are off by one factor the
    /// time is, and they stay, for they show it; its unit is told too, if nothing else tells that.
    pub(super) fn weigh_velocities(
        &self,
        columns: &mut Vec<(usize, GuessedColumn)>,
    ) -> (Vec<(String, String)>, Option<GuessedTime>) {
        let nothing = (Vec::new(), None);
        let clock = self
            .time_column()
            .and_then(|(time, unit)| clock_of(&self.frame.columns[time].values, unit));
        let Some(clock) = clock else {
            return nothing;
        };
        let positions: Vec<(usize, String, Vec<f64>)> = columns
            .iter()
            .filter(|(_, found)| found.signal == Signal::LinkPositionRad)
            .map(|(index, found)| {
                let numbers = self.numbers(*index);
                let scaled = numbers.iter().map(|value| value * found.scale);
                (*index, found.joint.clone(), scaled.collect())
            })
            .collect();
        let velocities = columns
            .iter_mut()
            .filter(|(_, found)| found.signal == Signal::LinkVelocityRadS);
        let mut left_out = Vec::new();
        let mut slopes = Vec::new();
        let mut are_explained = false;
        let mut in_either = Vec::new();
        for (index, found) in velocities {
            // A finger's velocity is not that of the arm's position with the same number.
            let of_joint = || {
                positions
                    .iter()
                    .filter(|(_, joint, _)| *joint == found.joint)
            };
            let position = of_joint()
                .find(|(position, _, _)| self.families.are_alike(*position, *index))
                .or_else(|| of_joint().next());
            let ratio = self
                .joint_named(&found.joint)
                .map_or(1.0, |joint| joint.gear_ratio);
            let slope = position
                .and_then(|(_, _, position)| slope(&clock.time_s, position, &self.numbers(*index)));
            let Some(slope) = slope.map(|slope| slope * found.scale) else {
                continue;
            };
            let explained = [
                (
                    1.0,
                    Signal::LinkVelocityRadS,
                    "agrees with the position's difference",
                ),
                (
                    180.0 / PI,
                    Signal::LinkVelocityRadS,
                    "is 57.3 times the position's difference: degrees",
                ),
                (
                    30.0 / PI,
                    Signal::LinkVelocityRadS,
                    "is 9.55 times the position's difference: turns per minute",
                ),
                (
                    ratio,
                    Signal::MotorVelocityRadS,
                    "is the gear ratio times the position's difference",
                ),
                (
                    ratio * 30.0 / PI,
                    Signal::MotorVelocityRadS,
                    "is the motor's, in turns per minute, by the position's difference",
                ),
                (
                    ratio * 180.0 / PI,
                    Signal::MotorVelocityRadS,
                    "is the motor's, in degrees, by the position's difference",
                ),
            ];
            let slides = self
                .joint_named(&found.joint)
                .is_some_and(|joint| joint.slides);
            let near = |factor: f64| {
                let is_possible = !slides || factor == 1.0 || factor == ratio;
                is_possible && (slope.abs() / factor.abs() - 1.0).abs() < 0.1
            };
            let Some((factor, signal, why)) =
                explained.into_iter().find(|(factor, _, _)| near(*factor))
            else {
                let why = format!(
                    "is {slope:.3} times the position's difference, which no unit explains"
                );
                left_out.push((found.column.clone(), why));
                slopes.push(slope);
                continue;
            };
            are_explained = true;
            found.signal = signal;
            let _ = write!(found.why, "; {why}");
            // only how far it goes says that the position is in degrees, which a joint that turns round and round may do in radians
            let position = position.map(|(position, _, _)| *position);
            if factor == 180.0 / PI
                && let Some(position) = position.filter(|of| self.may_be_radians(*of, *index))
            {
                in_either.extend([position, *index]);
            }
            // On the motor's side the velocity is the position's difference times the ratio, with its sign.
            let side = if signal == Signal::MotorVelocityRadS {
                ratio
            } else {
                1.0
            };
            found.scale *= side * slope.signum() / factor.abs();
            if slope * side < 0.0 {
                found.why.push_str(", reversed");
            }
        }
        for (_, found) in columns.iter_mut().filter(|(of, _)| in_either.contains(of)) {
            found.sure = Sure::Doubtful;
            found
                .why
                .push_str(", or position and velocity are both in radians");
        }
        let mean = slopes.iter().sum::<f64>() / slopes.len() as f64;
        let is_alike = |slope: &f64| (slope / mean - 1.0).abs() < 0.1;
        let are_one = !are_explained && slopes.iter().all(is_alike);
        let is_one = |found: &GuessedColumn| left_out.iter().any(|(of, _)| *of == found.column);
        if let Some(time) = self.other_unit_of_time(mean, &clock).filter(|_| are_one) {
            for (_, found) in columns.iter_mut().filter(|(_, found)| is_one(found)) {
                let unit = time.unit.name();
                let _ = write!(
                    found.why,
                    "; agrees with the position's difference if times are {unit}"
                );
            }
            return (Vec::new(), Some(time));
        }
        if are_one && slopes.len() > 1 {
            for (_, found) in columns.iter_mut().filter(|(_, found)| is_one(found)) {
                let _ = write!(
                    found.why,
                    "; is {mean:.3} times the position's difference, as all velocities are"
                );
            }
            return nothing;
        }
        columns.retain(|(_, found)| left_out.iter().all(|(column, _)| *column != found.column));
        (left_out, None)
    }

    /// The unit of times that nothing told, where velocities say that it is another than their steps let one think, of rows that a controller
    /// may have written. `slope`: of velocities over their positions' differences.
    fn other_unit_of_time(&self, slope: f64, clock: &Clock) -> Option<GuessedTime> {
        /// From one row to the next, in seconds.
        const ROWS_S: RangeInclusive<f64> = 1e-5..=10.0;
        let (column, _) = self.time_column()?;
        let told = clock
            .guessed_unit
            .filter(|_| clock.start_unix_ns.is_none())?;
        let unit = told.shorter_by(slope)?;
        let row_s = slope.recip() / shown_rate_hz(&clock.time_s, None)?;
        ROWS_S.contains(&row_s).then(|| GuessedTime {
            column: self.frame.columns[column].name.clone(),
            unit,
        })
    }

    /// Whether a position and its velocity, which agree, are of a joint without limits and neither's name tells a unit.
    fn may_be_radians(&self, position: usize, velocity: usize) -> bool {
        let tells_no_unit = |column: usize| {
            let said = said(&self.frame.columns[column].name, self.joints);
            said.is_some_and(|said| said.meaning.scale.is_none())
        };
        let is_free = self.joints.iter().any(|joint| !joint.is_limited);
        is_free && tells_no_unit(position) && tells_no_unit(velocity)
    }

    fn time_column(&self) -> Option<(usize, Option<UnitsPerSecond>)> {
        let columns = &self.frame.columns;
        match columns.iter().position(|column| column.name == TIME) {
            Some(time) => Some((time, Some(UnitsPerSecond::SECONDS))),
            None => only_time_column(columns.iter().map(|column| &*column.name)),
        }
    }

    fn numbers(&self, column: usize) -> Vec<f64> {
        self.frame.columns[column].values.numbers()
    }
}

/// Least squares of the difference of a position over its velocity's integral, as a factor of the velocity, over so many rows as make
/// both agree best: from one row to the next an encoder's rounding may be more than the way. `None` if it stands still or scatters.
fn slope(time_s: &[f64], position: &[f64], velocity: &[f64]) -> Option<f64> {
    let rows = time_s.len().min(position.len()).min(velocity.len());
    // the integral up to each row, and how many rows of it are missing
    let mut until = vec![(0.0, 0_usize); rows];
    for row in 1..rows {
        let step_s = time_s[row] - time_s[row - 1];
        let way = 0.5 * (velocity[row] + velocity[row - 1]) * step_s;
        let (gone, missing) = until[row - 1];
        until[row] = if step_s > 0.0 && way.is_finite() {
            (gone + way, missing)
        } else {
            (gone, missing + 1)
        };
    }
    let mut best = (0.0, 0.0);
    let mut apart = 1;
    while apart == 1 || WAYS_MIN * apart <= rows {
        let (mut with, mut of, mut own) = (0.0, 0.0, 0.0);
        for row in apart..rows {
            let (before, after) = (until[row - apart], until[row]);
            let way = position[row] - position[row - apart];
            if before.1 == after.1 && way.is_finite() {
                let integral = after.0 - before.0;
                with += integral * way;
                of += way * way;
                own += integral * integral;
            }
        }
        let agreement = with * with / (of * own);
        if agreement > best.0 {
            best = (agreement, with / of);
        }
        apart *= 2;
    }
    let (agreement, slope) = best;
    // Half of the squares are of something else: nothing can be told.
    (agreement > 0.5).then_some(slope)
}
