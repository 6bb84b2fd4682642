//! What files of arrays have in common: NumPy's, MATLAB's, HDF5.

use crate::clock::time_column;
use crate::frame::{Array, Frame, Values};
use crate::names::meaning;
use crate::{JOINTS_MAX, ReadProblem, VALUES_MAX};
use std::collections::BTreeMap;
use std::path::Path;

/// Arrays of measurements shrink to a tenth; of a file that grows by more only so much is read. In memory an integer takes twice
/// its eight bytes, and the array is there twice while it becomes columns.
const GROWTH_MAX: u64 = 100;
const BYTES_MAX: u64 = 1 << 26;

/// Where the metadata tell which arrays were left out.
const LEFT_OUT: &str = "arrays_of_other_lengths_left_out";

/// How many values of a file of that length are read.
pub(super) fn values_max(path: &Path) -> std::io::Result<usize> {
    let bytes_max = BYTES_MAX.max(path.metadata()?.len().saturating_mul(GROWTH_MAX));
    Ok(VALUES_MAX.min(usize::try_from(bytes_max / 8).unwrap_or(VALUES_MAX)))
}

/// How the values of a table lie one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    rows: usize,
    width: usize,
    by_columns: bool,
}

impl Shape {
    /// Of these axes, unless there are more than two, or more columns than joints can be. Time runs along the longer one.
    ///
    /// # Errors
    /// If it has more values than are left.
    pub(super) fn of(
        axes: &[u64],
        by_columns: bool,
        values_left: usize,
    ) -> Result<Option<Self>, ReadProblem> {
        let (rows, width) = match *axes {
            [rows] => (rows, 1),
            [rows, width] => (rows, width),
            _ => return Ok(None),
        };
        let (long, short) = (rows.max(width), rows.min(width));
        if short == 0 || short > JOINTS_MAX as u64 {
            return Ok(None);
        }
        let values = long.checked_mul(short);
        if values.is_none_or(|values| values > values_left as u64) {
            let rows = i64::try_from(long).unwrap_or(i64::MAX);
            let columns = usize::try_from(short).unwrap_or(0);
            return Err(ReadProblem::TooLarge { rows, columns });
        }
        Ok(Some(Self {
            rows: long as usize,
            width: short as usize,
            by_columns: by_columns == (rows >= width),
        }))
    }

    pub(super) fn values(self) -> usize {
        self.rows * self.width
    }

    /// The table of as many values.
    pub(super) fn table(self, name: String, values: &Values) -> Array {
        let Self { rows, width, .. } = self;
        let order = |column: usize| -> Vec<usize> {
            match self.by_columns {
                true => (column * rows..(column + 1) * rows).collect(),
                false => (column..rows * width).step_by(width).collect(),
            }
        };
        let columns = (0..width).map(|column| values.picked(&order(column)));
        Array {
            name,
            columns: columns.collect(),
        }
    }
}

/// A measured array that is nearly as long as the others was to be as long; one that is not is of something else.
const NEARLY: f64 = 0.1;

/// The log that these arrays are. Those of another length are left out, unless they are measured and nearly as long.
pub(super) fn frame_of(mut arrays: Vec<Array>) -> Result<Frame, ReadProblem> {
    name_as_simulink_means(&mut arrays);
    take_off_the_common_struct(&mut arrays);
    let rows = rows_of(&arrays);
    let mut frame = Frame::default();
    let mut left_out = Vec::new();
    for array in arrays {
        let length = array.rows();
        let nearly = length.abs_diff(rows) as f64 <= NEARLY * rows as f64;
        if length != rows && !(nearly && is_told(&array)) {
            left_out.push(format!("{} ({length})", array.name));
            frame.other_lengths.push((array.name, length));
        } else {
            frame.add_array(array);
        }
    }
    frame.check_lengths()?;
    if !left_out.is_empty() {
        frame.notes.insert(LEFT_OUT.to_owned(), left_out.join(", "));
    }
    Ok(frame)
}

/// Simulink's structures with time: `angle.signals.values` is `angle`, and the `angle.time` of all that have the same one is `time`.
fn name_as_simulink_means(arrays: &mut Vec<Array>) {
    const VALUES: &str = ".signals.values";
    let structs = arrays
        .iter()
        .filter_map(|array| array.name.strip_suffix(VALUES));
    let structs: Vec<String> = structs.map(str::to_owned).collect();
    let is_time = |array: &Array| {
        let of = array.name.strip_suffix(".time");
        of.is_some_and(|of| structs.iter().any(|known| known == of))
    };
    let numbers = |array: &Array| array.columns.iter().flat_map(Values::numbers).collect();
    let times = arrays.iter().filter(|array| is_time(array)).map(numbers);
    let times: Vec<Vec<f64>> = times.collect();
    // each sums up its own steps
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
    let is_one_clock = times
        .windows(2)
        .all(|two| two[0].len() == two[1].len() && two[0].iter().zip(&two[1]).all(is_near));
    let mut has_time = false;
    arrays.retain_mut(|array| {
        if is_time(array) && is_one_clock {
            array.name = "time".to_owned();
            return !std::mem::replace(&mut has_time, true);
        }
        if let Some(of) = array.name.strip_suffix(VALUES) {
            array.name = of.to_owned();
        }
        true
    });
}

/// `log.t`, `log.q` are `t` and `q` where there is nothing beside `log`.
fn take_off_the_common_struct(arrays: &mut [Array]) {
    let Some(first) = arrays.first() else { return };
    let Some((prefix, _)) = first.name.split_once('.') else {
        return;
    };
    let prefix = format!("{prefix}.");
    if arrays.iter().all(|array| array.name.starts_with(&prefix)) {
        for array in &mut *arrays {
            array.name.drain(..prefix.len());
        }
        take_off_the_common_struct(arrays);
    }
}

/// As long as the time, or as most arrays whose name says something, or as most.
fn rows_of(arrays: &[Array]) -> usize {
    let most = |fits: &dyn Fn(&&Array) -> bool| {
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        for array in arrays.iter().filter(fits) {
            *counts.entry(array.rows()).or_default() += array.columns.len();
        }
        let most = counts
            .into_iter()
            .max_by_key(|(rows, columns)| (*columns, *rows));
        most.map(|(rows, _)| rows)
    };
    most(&|array| time_column(&array.name).is_some() && array.rows() > 1)
        .or_else(|| most(&|array| is_told(array) && array.rows() > 1))
        .or_else(|| most(&|_| true))
        .unwrap_or(0)
}

fn is_told(array: &Array) -> bool {
    time_column(&array.name).is_some() || meaning(&array.name).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(name: &str, width: usize, rows: usize) -> Array {
        Array {
            name: name.to_owned(),
            columns: (0..width)
                .map(|_| Values::Numbers(vec![0.5; rows]))
                .collect(),
        }
    }

    #[test]
    fn time_runs_along_the_longer_axis_however_the_values_lie() {
        let values = Values::Numbers(vec![1.0, 2.0, 3.0, 10.0, 20.0, 30.0]);
        for (axes, by_columns) in [([3, 2], true), ([2, 3], false)] {
            let shape = Shape::of(&axes, by_columns, 6).unwrap().unwrap();
            let table = shape.table("q".to_owned(), &values);
            let Values::Numbers(second) = &table.columns[1] else {
                panic!()
            };
            assert_eq!(second[..], [10.0, 20.0, 30.0], "{axes:?}");
        }
        assert_eq!(Shape::of(&[300, 300], false, 1 << 20).unwrap(), None);
        assert_eq!(Shape::of(&[3, 2, 2], false, 100).unwrap(), None);
        assert_eq!(Shape::of(&[0, 2], false, 100).unwrap(), None);
        for axes in [[3, 3], [u64::MAX, 2]] {
            assert!(Shape::of(&axes, false, 8).is_err());
        }
    }

    #[test]
    fn simulinks_structures_are_their_values_with_one_time() {
        let mut arrays = vec![
            array("angle.time", 1, 50),
            array("angle.signals.values", 1, 50),
            array("angle.signals.dimensions", 1, 1),
            array("volts.time", 1, 50),
            array("volts.signals.values", 1, 50),
        ];
        name_as_simulink_means(&mut arrays);
        let names: Vec<&str> = arrays.iter().map(|array| array.name.as_str()).collect();
        assert_eq!(
            names,
            ["time", "angle", "angle.signals.dimensions", "volts"]
        );
    }

    #[test]
    fn settings_are_left_out_and_said_and_what_is_measured_must_be_as_long() {
        let arrays = |torque_rows| {
            vec![
                array("log.t", 1, 50),
                array("log.q", 2, 50),
                array("log.tau", 2, torque_rows),
                array("log.masses", 1, 51),
                array("log.speed", 1, 6),
            ]
        };
        let frame = frame_of(arrays(50)).unwrap();
        let names: Vec<&str> = frame.columns.iter().map(|column| &*column.name).collect();
        assert_eq!(names, ["t", "q[0]", "q[1]", "tau[0]", "tau[1]"]);
        assert_eq!(frame.notes[LEFT_OUT], "masses (51), speed (6)");
        let refusal = frame_of(arrays(49)).err().unwrap().to_string();
        assert!(
            refusal.starts_with("`tau[0]` has 49 rows, but `t` 50"),
            "{refusal}"
        );
    }
}
