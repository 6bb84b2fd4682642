//! HDF5: MATLAB's `.mat` of version 7.3, and files of arrays that Python writes.
//!
//! A vector or a table is read by its path, with points between: `observations.qpos`.

use super::arrays::{Shape, frame_of, values_max};
use super::{Log, Source};
use crate::ReadProblem;
use crate::frame::{Array, Frame, Values};
use crate::guard::without_panic;
use crate::mapping::Mapping;
use hdf5_reader::dataset::Dataset;
use hdf5_reader::group::Group;
use hdf5_reader::{Datatype, H5Type, Hdf5File, OpenOptions};
use std::path::Path;

const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";
/// MATLAB writes a head of its own before that.
const MATLAB: &[u8] = b"MATLAB 7.3 MAT-file";
/// Groups in groups.
const DEPTH_MAX: usize = 8;
/// What MATLAB says that a dataset is: its axes are then in reverse, and text is numbers too.
const CLASS: &str = "MATLAB_class";
const EMPTY: &str = "MATLAB_empty";

pub(crate) struct Hdf5;

impl Source for Hdf5 {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.start.starts_with(MAGIC) || log.start.starts_with(MATLAB)
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        without_panic(|| read_arrays(path)).unwrap_or_else(|what| Err(ReadProblem::Hdf5(what)))
    }
}

fn read_arrays(path: &Path) -> Result<Frame, ReadProblem> {
    let values_left = values_max(path)?;
    let options = OpenOptions::default()
        .with_chunk_cache_bytes(1 << 22)
        .with_max_read_bytes(8 * values_left);
    let file = Hdf5File::open_with_options(path, options)?;
    let mut reader = Reader {
        arrays: Vec::new(),
        values_left,
    };
    reader.group(&file.root_group()?, "", 0)?;
    frame_of(reader.arrays)
}

struct Reader {
    arrays: Vec<Array>,
    /// That are read at most.
    values_left: usize,
}

impl Reader {
    fn group(&mut self, group: &Group, path: &str, depth: usize) -> Result<(), ReadProblem> {
        let (groups, datasets) = group.members()?;
        for dataset in datasets {
            self.dataset(&dataset, format!("{path}{}", dataset.name()))?;
        }
        for group in groups {
            // MATLAB keeps what cells point to there.
            if depth < DEPTH_MAX && !group.name().starts_with('#') {
                self.group(&group, &format!("{path}{}.", group.name()), depth + 1)?;
            }
        }
        Ok(())
    }

    fn dataset(&mut self, dataset: &Dataset, name: String) -> Result<(), ReadProblem> {
        let class = dataset
            .attribute(CLASS)
            .and_then(|class| class.read_string());
        let of_matlab = class.is_ok();
        let is_text = class.is_ok_and(|class| matches!(&*class, "char" | "cell" | "logical"));
        if is_text || dataset.attribute(EMPTY).is_ok() {
            return Ok(());
        }
        let mut axes = dataset.shape().to_vec();
        if of_matlab {
            axes.reverse();
        }
        let Some(shape) = Shape::of(&axes, of_matlab, self.values_left)? else {
            return Ok(());
        };
        if let Some(values) = values(dataset)? {
            self.values_left -= shape.values();
            self.arrays.push(shape.table(name, &values));
        }
        Ok(())
    }
}

/// A dataset's numbers one after the other; `None` of other kinds.
fn values(dataset: &Dataset) -> Result<Option<Values>, ReadProblem> {
    let integers = |values| Ok(Some(Values::Integers(values)));
    match dataset.dtype() {
        Datatype::FloatingPoint { size: 8, .. } => {
            Ok(Some(Values::Numbers(read(dataset, |number: f64| number)?)))
        }
        Datatype::FloatingPoint { size: 4, .. } => {
            Ok(Some(Values::Numbers(read(dataset, |number: f32| {
                f64::from(number)
            })?)))
        }
        Datatype::FixedPoint { size, signed, .. } => match (size, signed) {
            (8, true) => integers(read(dataset, |number: i64| Some(number))?),
            (8, false) => integers(read(dataset, |number: u64| i64::try_from(number).ok())?),
            (4, true) => integers(read(dataset, |number: i32| Some(number.into()))?),
            (4, false) => integers(read(dataset, |number: u32| Some(number.into()))?),
            (2, true) => integers(read(dataset, |number: i16| Some(number.into()))?),
            (2, false) => integers(read(dataset, |number: u16| Some(number.into()))?),
            (1, true) => integers(read(dataset, |number: i8| Some(number.into()))?),
            (1, false) => integers(read(dataset, |number: u8| Some(number.into()))?),
            _ => Ok(None),
        },
        _ => Ok(None),
    }
}

fn read<T: H5Type + Copy, U>(
    dataset: &Dataset,
    convert: fn(T) -> U,
) -> Result<Vec<U>, ReadProblem> {
    let values = dataset.read_array::<T>()?;
    Ok(values.iter().map(|number| convert(*number)).collect())
}

impl From<hdf5_reader::error::Error> for ReadProblem {
    fn from(error: hdf5_reader::error::Error) -> Self {
        Self::Hdf5(error.to_string())
    }
}
