//! A table put together while its file is read, row by row.

use crate::Signal;
use crate::clock::{Clock, Instant, mistaken_for_seconds, spread};
use crate::error::{Place, ReadProblem};
use crate::table::{JointColumns, Recording, segments};
use crate::ticks;
use std::path::PathBuf;

/// The rows read so far.
#[derive(Default)]
pub(crate) struct TableBuilder {
    times: Vec<Instant>,
    /// The file says of times only that they are such, not in which unit.
    unit_is_unknown: bool,
    segment: Vec<Option<i64>>,
    joints: Vec<JointBuilder>,
}

/// Where the metadata tell when a recording began whose rows were timed since 1970, in nanoseconds.
const START: &str = "start_unix_ns";
/// Where the metadata tell the unit that times were taken for.
const TIME_UNIT: &str = "time_unit_guessed";
/// Where the metadata tell the step of a clock that is longer than a row, in seconds.
pub(crate) const SPREAD: &str = "clock_step_s";

struct JointBuilder {
    name: String,
    /// By [`Signal::ALL`]; empty until the first value comes.
    columns: [Vec<f64>; Signal::ALL.len()],
}

impl TableBuilder {
    /// How many rows were begun.
    pub(crate) fn rows(&self) -> usize {
        self.times.len()
    }

    /// That times are to be taken for the unit that they show. They are handed over as if they were seconds.
    pub(crate) fn guess_unit_of_time(&mut self) {
        self.unit_is_unknown = true;
    }

    /// The joint of that name, added if it is new.
    pub(crate) fn joint(&mut self, name: &str) -> usize {
        if let Some(known) = self.joints.iter().position(|joint| joint.name == name) {
            return known;
        }
        self.joints.push(JointBuilder {
            name: name.to_owned(),
            columns: Default::default(),
        });
        self.joints.len() - 1
    }

    /// Begins a row; its values follow. Without a segment it belongs to that of the row before.
    pub(crate) fn begin_row(
        &mut self,
        place: Place,
        time: Instant,
        segment: Option<i64>,
    ) -> Result<(), ReadProblem> {
        let previous_segment = self.segment.last().copied().flatten();
        let segment = segment.or(previous_segment);
        if let Some(&previous) = self.times.last()
            && time.is_before(previous)
            && segment == previous_segment
        {
            return Err(ReadProblem::TimeBackwards {
                place,
                previous_s: previous.seconds(),
                time_s: time.seconds(),
            });
        }
        self.times.push(time);
        self.segment.push(segment);
        Ok(())
    }

    /// Sets a value in the row begun last.
    pub(crate) fn set(
        &mut self,
        place: Place,
        joint: usize,
        signal: Signal,
        value: f64,
    ) -> Result<(), ReadProblem> {
        if value.is_nan() {
            return Ok(());
        }
        let joint = &mut self.joints[joint];
        if value.is_infinite() {
            return Err(ReadProblem::NotFinite {
                place,
                column: format!("{}.{signal}", joint.name),
                value,
            });
        }
        let column = &mut joint.columns[signal as usize];
        let row = self.times.len() - 1;
        column.resize(row, f64::NAN);
        column.push(value);
        Ok(())
    }

    /// The table, with the rate that was told or else the one the times show.
    pub(crate) fn finish(
        self,
        told_rate_hz: Option<f64>,
        source_of_rate: impl FnOnce() -> PathBuf,
    ) -> Result<Recording, ReadProblem> {
        let rows = self.rows();
        let segment = fill_segments(&self.segment);
        if !self.unit_is_unknown
            && let Some((step_s, unit)) = mistaken_for_seconds(&self.times)
        {
            return Err(ReadProblem::TimeUnit {
                step_s,
                unit: unit.name(),
                factor: unit.seconds(),
                mapping: source_of_rate(),
            });
        }
        let mut clock = Clock::new(self.times, !self.unit_is_unknown);
        let joints: Vec<JointColumns> = self
            .joints
            .into_iter()
            .map(|joint| joint.finish(rows))
            .collect();
        let clock_step_s = if are_samples(&clock.time_s, &joints) {
            spread(&mut clock.time_s, told_rate_hz)
        } else {
            let is_sample = |row| is_other(&joints, row);
            ticks::even_out(&mut clock.time_s, is_sample).map(Some)
        };
        let shown_hz = || match clock_step_s {
            Some(None) => None,
            _ => shown_rate_hz(&clock.time_s, segment.as_deref()),
        };
        let Some(sample_rate_hz) = told_rate_hz.or_else(shown_hz) else {
            return Err(ReadProblem::SampleRateUnknown {
                rows,
                source_of_rate: source_of_rate(),
            });
        };
        let start = clock.start_unix_ns.map(|start| (START, start.to_string()));
        let unit = clock
            .guessed_unit
            .map(|unit| (TIME_UNIT, unit.name().to_owned()));
        let spread = clock_step_s.flatten().map(|step_s| (SPREAD, shown(step_s)));
        let metadata = start.into_iter().chain(unit).chain(spread);
        Ok(Recording {
            time_s: clock.time_s,
            segment,
            joints,
            sample_rate_hz,
            metadata: metadata
                .map(|(key, value)| (key.to_owned(), value))
                .collect(),
            truncated: false,
        })
    }
}

impl JointBuilder {
    fn finish(self, rows: usize) -> JointColumns {
        let filled = Signal::ALL
            .into_iter()
            .zip(self.columns)
            .filter(|(_, column)| !column.is_empty());
        let signals = filled
            .map(|(signal, mut column)| {
                column.resize(rows, f64::NAN);
                (signal, column)
            })
            .collect();
        JointColumns {
            name: self.name,
            signals,
        }
    }
}

/// A clock's step to four digits: it is a mean of steps.
fn shown(step_s: f64) -> String {
    let digits = (3.0 - step_s.log10().floor()).max(0.0) as usize;
    let text = format!("{step_s:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Whether rows with the time of the row before are samples of their own: one of a clock's step at least has another value of some signal.
/// Rows written twice have not, and a row for each joint has other signals.
fn are_samples(time_s: &[f64], joints: &[JointColumns]) -> bool {
    let (same, new): (Vec<usize>, Vec<usize>) =
        (1..time_s.len()).partition(|row| time_s[*row] == time_s[*row - 1]);
    let others = same.into_iter().filter(|row| is_other(joints, *row));
    others.count() > new.len()
}

/// Whether a row has another value of some signal than the row before.
fn is_other(joints: &[JointColumns], row: usize) -> bool {
    let mut signals = joints.iter().flat_map(|joint| joint.signals.values());
    signals.any(|values| (values[row] - values[row - 1]).abs() > 0.0)
}

/// The segments of all rows if any row tells one; rows before the first that does belong to it.
fn fill_segments(told: &[Option<i64>]) -> Option<Vec<i64>> {
    let first = told.iter().copied().find_map(|segment| segment)?;
    Some(
        told.iter()
            .map(|segment| segment.unwrap_or(first))
            .collect(),
    )
}

/// The rate at which rows follow each other: regular steps only, so that gaps and late rows do not lower it,
/// and their mean, so that rounded times do not shift it.
pub(crate) fn shown_rate_hz(time_s: &[f64], segment: Option<&[i64]>) -> Option<f64> {
    let mut steps_s: Vec<f64> = segments(time_s.len(), segment)
        .into_iter()
        .flat_map(|rows| time_s[rows].windows(2).map(|pair| pair[1] - pair[0]))
        .filter(|step_s| *step_s > 0.0)
        .collect();
    if steps_s.is_empty() {
        return None;
    }
    let middle = steps_s.len() / 2;
    let median_s = *steps_s.select_nth_unstable_by(middle, f64::total_cmp).1;
    let regular = || {
        steps_s
            .iter()
            .filter(|step_s| (0.5..1.5).contains(&(*step_s / median_s)))
    };
    Some(regular().count() as f64 / regular().sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: Place = Place::Line(1);

    fn nowhere() -> PathBuf {
        "nowhere".into()
    }

    fn table(rows: &[(f64, Option<i64>)]) -> Recording {
        let mut table = TableBuilder::default();
        for (time_s, segment) in rows {
            table
                .begin_row(HERE, Instant::from_s(*time_s), *segment)
                .unwrap();
        }
        table.finish(Some(1.0), nowhere).unwrap()
    }

    #[test]
    fn a_value_missing_in_a_row_is_nan_and_a_signal_never_seen_is_absent() {
        let mut table = TableBuilder::default();
        let joint = table.joint("elbow");
        for row in 0..4 {
            table
                .begin_row(HERE, Instant::from_s(f64::from(row)), None)
                .unwrap();
            let value = if row == 1 { 5.0 } else { f64::NAN };
            table
                .set(HERE, joint, Signal::MotorTorqueNm, value)
                .unwrap();
            table
                .set(HERE, joint, Signal::JointTorqueNm, f64::NAN)
                .unwrap();
        }
        let recording = table.finish(None, nowhere).unwrap();
        let torque_nm = recording.signal("elbow", Signal::MotorTorqueNm).unwrap();
        assert_eq!(torque_nm[1], 5.0);
        assert!(
            [0, 2, 3]
                .map(|row| torque_nm[row].is_nan())
                .iter()
                .all(|missing| *missing)
        );
        let missing = recording
            .signal("elbow", Signal::JointTorqueNm)
            .unwrap_err()
            .to_string();
        assert_eq!(
            missing,
            "the recording has no joint_torque_nm of joint `elbow`; it has `motor_torque_nm`"
        );
        let missing = recording
            .signal("wrist", Signal::JointTorqueNm)
            .unwrap_err()
            .to_string();
        assert_eq!(
            missing,
            "the recording has no joint `wrist`; its joints are `elbow`"
        );
    }

    #[test]
    fn time_may_jump_back_only_where_a_segment_begins() {
        let recording = table(&[
            (0.0, Some(1)),
            (1.0, Some(1)),
            (0.0, Some(2)),
            (0.0, Some(2)),
        ]);
        assert_eq!(recording.segments(), [0..2, 2..4]);
        let mut table = TableBuilder::default();
        table
            .begin_row(HERE, Instant::from_s(1.0), Some(1))
            .unwrap();
        let backwards = table
            .begin_row(Place::Line(7), Instant::from_s(0.5), Some(1))
            .unwrap_err()
            .to_string();
        assert!(
            backwards.starts_with("line 7: time runs backwards, from 1 s to 0.5 s"),
            "{backwards}"
        );
    }

    #[test]
    fn a_row_without_a_segment_belongs_to_its_neighbours() {
        let recording = table(&[(0.0, None), (1.0, Some(3)), (2.0, None), (3.0, Some(4))]);
        assert_eq!(recording.segment.unwrap(), [3, 3, 3, 4]);
        assert_eq!(
            table(&[(0.0, None), (1.0, None)]).segments().first(),
            Some(&(0..2))
        );
        assert!(table(&[]).segments().is_empty());
    }

    #[test]
    fn the_shown_rate_ignores_gaps_rounding_and_jumps_between_segments() {
        // 1500 Hz rounded to whole nanoseconds, ten cycles lost in the middle, then a second trajectory.
        let cycles = (0..3000_u64).filter(|cycle| !(1000..1010).contains(cycle));
        let mut time_s: Vec<f64> = cycles
            .map(|cycle| (cycle * 1_000_000_000 / 1500) as f64 * 1e-9)
            .collect();
        let mut segment = vec![0; time_s.len()];
        time_s.extend([0.0, 1.0 / 1500.0]);
        segment.extend([1, 1]);
        let rate_hz = shown_rate_hz(&time_s, Some(&segment)).unwrap();
        assert!((rate_hz - 1500.0).abs() < 1e-3, "{rate_hz}");
        assert_eq!(shown_rate_hz(&[1.0, 1.0], None), None);
    }

    #[test]
    fn infinity_is_not_a_measurement() {
        let mut table = TableBuilder::default();
        let joint = table.joint("elbow");
        table.begin_row(HERE, Instant::from_s(0.0), None).unwrap();
        let error = table
            .set(Place::Cycle(3), joint, Signal::MotorTorqueNm, f64::INFINITY)
            .unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("cycle 3: elbow.motor_torque_nm is inf"),
            "{error}"
        );
    }
}
