//! Logs that Python programs save: `pickle.dump` of dictionaries, lists of them and NumPy's arrays, and `torch.save` of the same with
//! tensors, which is a ZIP file of a pickle and the tensors' numbers.
//!
//! Format of the latter: PyTorch's `torch/serialization.py`, version 1.6 and later.

use super::arrays::{Shape, frame_of, values_max};
use super::pickle::{Id, Node, Object, Pickle};
use super::{Log, Source};
use crate::ReadProblem;
use crate::frame::{Array, Frame, Values};
use crate::guard::without_panic;
use crate::mapping::Mapping;
use std::borrow::Cow;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use zip::ZipArchive;

/// The description of what is saved; beside large tensors, which lie in other members, it is short.
const DESCRIPTION: &str = "data.pkl";
const DESCRIPTION_BYTES_MAX: u64 = 1 << 26;
/// A log of a day, of 50 signals at 100 Hz as doubles in one dictionary for each row, is 3 GB; pickles are read as a whole.
const PICKLE_BYTES_MAX: u64 = 1 << 32;
/// A row of 256 joints has some ten signals of each.
const KEYS_MAX: usize = 4096;
/// Dictionaries in dictionaries: loggers have two or three.
const DEPTH_MAX: usize = 16;

/// What `torch.save` writes.
pub(crate) struct Torch;

impl Source for Torch {
    fn matches(&self, log: &Log<'_>) -> bool {
        // The name of the first member, behind its length and 30 bytes.
        let length = log
            .start
            .get(26..28)
            .and_then(|length| length.first_chunk());
        let end = length.map_or(0, |length| 30 + usize::from(u16::from_le_bytes(*length)));
        let name = log.start.get(30..end).unwrap_or_default();
        let is_named = matches!(log.extension.as_str(), "pt" | "pth");
        log.start.starts_with(b"PK\x03\x04") && (is_named || name.ends_with(b"/data.pkl"))
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        // The library was not made for damaged files.
        without_panic(|| read_torch(path)).unwrap_or_else(|what| Err(ReadProblem::Torch(what)))
    }
}

/// What `pickle.dump` writes.
pub(crate) struct Pickled;

impl Source for Pickled {
    fn matches(&self, log: &Log<'_>) -> bool {
        matches!(log.start[..], [0x80, 2..=5, ..])
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        if length > PICKLE_BYTES_MAX {
            let what = format!("it has more than {PICKLE_BYTES_MAX} bytes");
            return Err(ReadProblem::Pickle(what));
        }
        let mut bytes = Vec::new();
        file.take(length).read_to_end(&mut bytes)?;
        let none = |_: &str| Err("its numbers lie in another file".to_owned());
        read_pickle(&bytes, values_max(path)?, none, ReadProblem::Pickle)
    }
}

fn read_torch(path: &Path) -> Result<Frame, ReadProblem> {
    let wrong = |what: &dyn ToString| ReadProblem::Torch(what.to_string());
    let mut archive =
        ZipArchive::new(BufReader::new(File::open(path)?)).map_err(|error| wrong(&error))?;
    let names = archive.file_names().filter_map(Result::ok);
    let description = names
        .map(|name| name.into_owned())
        .find(|name| name.ends_with(DESCRIPTION));
    let description = description.ok_or_else(|| wrong(&"it has no `data.pkl`"))?;
    let folder = description.trim_end_matches(DESCRIPTION).to_owned();
    let bytes =
        member(&mut archive, &description, DESCRIPTION_BYTES_MAX).map_err(|what| wrong(&what))?;
    let order = member(&mut archive, &format!("{folder}byteorder"), 16);
    if order.is_ok_and(|order| order != b"little") {
        return Err(wrong(
            &"its numbers have the highest byte first; load it and save it on a usual machine",
        ));
    }
    let values_max = values_max(path)?;
    let storage = |key: &str| {
        member(
            &mut archive,
            &format!("{folder}data/{key}"),
            8 * values_max as u64,
        )
    };
    read_pickle(&bytes, values_max, storage, ReadProblem::Torch)
}

fn member(
    archive: &mut ZipArchive<BufReader<File>>,
    name: &str,
    bytes_max: u64,
) -> Result<Vec<u8>, String> {
    let member = archive
        .by_name(name)
        .map_err(|error| format!("`{name}`: {error}"))?;
    let mut bytes = Vec::new();
    let read = member.take(bytes_max + 1).read_to_end(&mut bytes);
    read.map_err(|error| format!("`{name}`: {error}"))?;
    match bytes.len() as u64 <= bytes_max {
        true => Ok(bytes),
        false => Err(format!("`{name}` is larger than a log's")),
    }
}

fn read_pickle(
    bytes: &[u8],
    values_max: usize,
    storage: impl FnMut(&str) -> Result<Vec<u8>, String>,
    wrong: fn(String) -> ReadProblem,
) -> Result<Frame, ReadProblem> {
    let pickle = Pickle::parse(bytes, values_max).map_err(wrong)?;
    let mut reader = Reader {
        pickle: &pickle,
        storage,
        wrong,
        values_left: values_max,
        arrays: Vec::new(),
    };
    reader.value(String::new(), pickle.root(), 0)?;
    match reader.arrays {
        arrays if arrays.is_empty() => Err(wrong(nothing_in(&pickle))),
        arrays => frame_of(arrays),
    }
}

/// Why a pickle without arrays has none.
fn nothing_in(pickle: &Pickle<'_>) -> String {
    let module = match pickle.node(pickle.root()) {
        Node::Object(object) => pickle
            .global(object.callee)
            .map_or("", |(module, _)| module),
        // PyTorch's number before its own format.
        Node::Other => "torch",
        _ => "",
    };
    match module.split('.').next() {
        Some("pandas") => "it is a table of pandas; write it with `to_parquet`".to_owned(),
        Some("torch") => "it is of PyTorch before 1.6; load it and save it again".to_owned(),
        _ => "it holds no arrays, and no lists of numbers or dictionaries".to_owned(),
    }
}

/// Finds arrays among the values of a pickle.
struct Reader<'a, S> {
    pickle: &'a Pickle<'a>,
    storage: S,
    wrong: fn(String) -> ReadProblem,
    /// What is held many times counts many times.
    values_left: usize,
    arrays: Vec<Array>,
}

impl<S: FnMut(&str) -> Result<Vec<u8>, String>> Reader<'_, S> {
    fn value(&mut self, name: String, id: Id, depth: usize) -> Result<(), ReadProblem> {
        self.count(1)?;
        if let Some(numbers) = self.numbers(id)? {
            return self.add(name, &numbers);
        }
        if depth == DEPTH_MAX {
            return Ok(());
        }
        let pickle = self.pickle;
        if let Some(entries) = pickle.entries(id) {
            for (key, value) in entries {
                if let Some(name) = self.below(&name, *key) {
                    self.value(name, *value, depth + 1)?;
                }
            }
        } else if let Some(rows) = pickle.items(id) {
            self.rows(name, rows, depth + 1)?;
        }
        Ok(())
    }

    /// A list: of numbers, of as many numbers each, or of dictionaries with the same keys, of which each is a column.
    fn rows(&mut self, name: String, rows: &[Id], depth: usize) -> Result<(), ReadProblem> {
        self.count(rows.len())?;
        let pickle = self.pickle;
        let Some(first) = rows.first() else {
            return Ok(());
        };
        let Some(entries) = pickle.entries(*first) else {
            return self.table(name, rows);
        };
        if entries.len() > KEYS_MAX {
            return Ok(());
        }
        for (place, (key, _)) in entries.iter().enumerate() {
            let of_row = |row: &Id| -> Option<Id> {
                let entries = pickle.entries(*row)?;
                let is_it = |(other, _): &&(Id, Id)| {
                    *other == *key
                        || pickle.text(*other).is_some() && pickle.text(*other) == pickle.text(*key)
                };
                // mostly at the same place
                let here = entries.get(place).filter(is_it);
                here.or_else(|| entries.iter().find(is_it))
                    .map(|(_, value)| *value)
            };
            let column: Option<Vec<Id>> = rows.iter().map(of_row).collect();
            if let (Some(column), Some(name)) = (column, self.below(&name, *key))
                && depth < DEPTH_MAX
            {
                self.rows(name, &column, depth + 1)?;
            }
        }
        Ok(())
    }

    fn table(&mut self, name: String, rows: &[Id]) -> Result<(), ReadProblem> {
        let mut width = None;
        let mut values = Values::Integers(Vec::new());
        for row in rows {
            let Some(cells) = self.cells(*row)? else {
                return Ok(());
            };
            if *width.get_or_insert(cells.len()) != cells.len() {
                return Ok(());
            }
            self.count(cells.len())?;
            add_cells(&mut values, cells);
        }
        let axes = vec![rows.len() as u64, width.unwrap_or(0) as u64];
        let by_columns = false;
        self.add(
            name,
            &Numbers {
                axes,
                by_columns,
                values,
            },
        )
    }

    /// The numbers of a row.
    fn cells(&mut self, id: Id) -> Result<Option<Values>, ReadProblem> {
        let pickle = self.pickle;
        if let Some(numbers) = self.numbers(id)? {
            return Ok(Some(numbers.values));
        }
        let Some(items) = pickle.items(id) else {
            return Ok(None);
        };
        let mut values = Values::Integers(Vec::new());
        for item in items {
            match self.numbers(*item)? {
                Some(number) if number.values.len() == 1 => add_cells(&mut values, number.values),
                _ => return Ok(None),
            }
        }
        Ok(Some(values))
    }

    fn add(&mut self, name: String, numbers: &Numbers) -> Result<(), ReadProblem> {
        // A log of one robot of many has an axis for them.
        let is_long = |axis: &&u64| **axis != 1;
        let mut axes: Vec<u64> = numbers.axes.clone();
        if axes.len() > 2 {
            axes = axes.iter().filter(is_long).copied().collect();
        }
        let shape = Shape::of(&axes, numbers.by_columns, self.values_left)?;
        if let Some(shape) = shape.filter(|shape| shape.values() == numbers.values.len()) {
            self.count(shape.values())?;
            self.arrays.push(shape.table(name, &numbers.values));
        }
        Ok(())
    }

    fn count(&mut self, values: usize) -> Result<(), ReadProblem> {
        let left = self.values_left.checked_sub(values);
        let wrong = || (self.wrong)("it holds more values than a log has".to_owned());
        self.values_left = left.ok_or_else(wrong)?;
        Ok(())
    }

    fn below(&self, name: &str, key: Id) -> Option<String> {
        let key = match self.pickle.node(key) {
            Node::Integer(key) => Cow::Owned(key.to_string()),
            _ => Cow::Borrowed(self.pickle.text(key)?),
        };
        Some(match name {
            "" => key.into_owned(),
            _ => format!("{name}.{key}"),
        })
    }

    /// A number, an array of NumPy or a tensor.
    fn numbers(&mut self, id: Id) -> Result<Option<Numbers>, ReadProblem> {
        let one = |values| Numbers {
            axes: Vec::new(),
            by_columns: false,
            values,
        };
        Ok(match self.pickle.node(id) {
            Node::Integer(value) => Some(one(Values::Integers(vec![Some(*value)]))),
            Node::Number(value) => Some(one(Values::Numbers(vec![*value]))),
            Node::Object(object) => self.object(object).map_err(self.wrong)?,
            _ => None,
        })
    }

    fn object(&mut self, object: &Object) -> Result<Option<Numbers>, String> {
        let pickle = self.pickle;
        let arguments = pickle.items(object.arguments).unwrap_or_default();
        let Some((module, name)) = pickle.global(object.callee) else {
            return Ok(None);
        };
        match (module, name) {
            ("torch._utils", "_rebuild_tensor_v2" | "_rebuild_tensor") => self.tensor(arguments),
            ("torch._utils", "_rebuild_parameter") => {
                match arguments.first().map(|tensor| pickle.node(*tensor)) {
                    Some(Node::Object(tensor))
                        if pickle.global(tensor.callee) != Some((module, name)) =>
                    {
                        self.object(tensor)
                    }
                    _ => Ok(None),
                }
            }
            (_, "_reconstruct") if module.starts_with("numpy") => {
                let state = object.state.and_then(|state| pickle.items(state));
                match state {
                    Some(&[_, axes, kind, order, bytes]) => {
                        let by_columns = matches!(pickle.node(order), Node::Bool(true));
                        self.array(axes, kind, by_columns, bytes)
                    }
                    _ => Ok(None),
                }
            }
            (_, "_frombuffer") if module.starts_with("numpy") => match arguments {
                &[bytes, kind, axes, order] => {
                    self.array(axes, kind, pickle.text(order) == Some("F"), bytes)
                }
                _ => Ok(None),
            },
            (_, "scalar") if module.starts_with("numpy") => match arguments {
                &[kind, bytes] => {
                    let bytes = pickle.bytes(bytes);
                    let kind = self.kind(kind);
                    Ok(bytes.zip(kind).and_then(|(bytes, kind)| {
                        let values = kind.read(&bytes)?;
                        let axes = Vec::new();
                        let by_columns = false;
                        Some(Numbers {
                            axes,
                            by_columns,
                            values,
                        })
                    }))
                }
                _ => Ok(None),
            },
            _ => Ok(None),
        }
    }

    fn array(
        &self,
        axes: Id,
        kind: Id,
        by_columns: bool,
        bytes: Id,
    ) -> Result<Option<Numbers>, String> {
        let (Some(axes), Some(kind), Some(bytes)) =
            (self.axes(axes), self.kind(kind), self.pickle.bytes(bytes))
        else {
            return Ok(None);
        };
        let Some(values) = kind.read(&bytes) else {
            return Ok(None);
        };
        match product(&axes) == Some(values.len()) {
            true => Ok(Some(Numbers {
                axes,
                by_columns,
                values,
            })),
            false => Err("an array has not as many numbers as its axes say".to_owned()),
        }
    }

    /// NumPy's type of numbers.
    fn kind(&self, id: Id) -> Option<Kind> {
        let pickle = self.pickle;
        let Node::Object(object) = pickle.node(id) else {
            return None;
        };
        let name = pickle.text(*pickle.items(object.arguments)?.first()?)?;
        let state = object.state.and_then(|state| pickle.items(state));
        let order = state.and_then(|state| pickle.text(*state.get(1)?));
        Kind::of(name, order == Some(">"))
    }

    fn axes(&self, id: Id) -> Option<Vec<u64>> {
        let axes = self.pickle.items(id)?;
        let axis = |id: &Id| u64::try_from(self.pickle.integer(*id)?).ok();
        axes.iter().map(axis).collect()
    }

    /// Storage, offset, axes and strides, counted in numbers.
    fn tensor(&mut self, arguments: &[Id]) -> Result<Option<Numbers>, String> {
        let pickle = self.pickle;
        let &[storage, offset, axes, strides, ..] = arguments else {
            return Ok(None);
        };
        let Node::Elsewhere(storage) = pickle.node(storage) else {
            return Ok(None);
        };
        let Some(&[_, kind, key, ..]) = pickle.items(*storage) else {
            return Ok(None);
        };
        let kind = pickle
            .global(kind)
            .and_then(|(_, name)| Kind::of(name, false));
        let (Some(kind), Some(key), Some(offset), Some(axes), Some(strides)) = (
            kind,
            pickle.text(key),
            pickle.integer(offset),
            self.axes(axes),
            self.axes(strides),
        ) else {
            return Ok(None);
        };
        let count = product(&axes)
            .filter(|count| *count <= self.values_left && axes.len() == strides.len());
        let (Some(count), Ok(offset)) = (count, usize::try_from(offset)) else {
            return Err("a tensor is larger than a log's".to_owned());
        };
        let Some(all) = kind.read(&(self.storage)(key)?) else {
            return Ok(None);
        };
        let places: Option<Vec<usize>> = (0..count)
            .map(|number| place(number, offset, &axes, &strides))
            .collect();
        let places = places.filter(|places| places.iter().all(|place| *place < all.len()));
        let places = places.ok_or("a tensor reaches beyond its numbers")?;
        Ok(Some(Numbers {
            axes,
            by_columns: false,
            values: all.picked(&places),
        }))
    }
}

/// Where the tensor's number of that order lies.
fn place(mut number: usize, offset: usize, axes: &[u64], strides: &[u64]) -> Option<usize> {
    let mut place = offset;
    for (axis, stride) in axes.iter().zip(strides).rev() {
        let axis = usize::try_from(*axis).ok()?;
        let along = (number % axis).checked_mul(usize::try_from(*stride).ok()?)?;
        place = place.checked_add(along)?;
        number /= axis;
    }
    Some(place)
}

fn product(axes: &[u64]) -> Option<usize> {
    let product = axes
        .iter()
        .try_fold(1_u64, |product, axis| product.checked_mul(*axis));
    usize::try_from(product?).ok()
}

/// Whole numbers stay whole as long as all are.
fn add_cells(values: &mut Values, cells: Values) {
    let as_numbers = |integers: &[Option<i64>]| -> Vec<f64> {
        integers
            .iter()
            .map(|value| value.map_or(f64::NAN, |value| value as f64))
            .collect()
    };
    match (&mut *values, cells) {
        (Values::Integers(all), Values::Integers(cells)) => all.extend(cells),
        (Values::Integers(all), cells) => {
            *values = Values::Numbers(as_numbers(all));
            values.append(cells);
        }
        (Values::Numbers(all), Values::Integers(cells)) => all.extend(as_numbers(&cells)),
        (_, cells) => values.append(cells),
    }
}

/// What an array or a tensor holds.
struct Numbers {
    axes: Vec<u64>,
    by_columns: bool,
    values: Values,
}

/// How numbers lie in bytes.
#[derive(Clone, Copy)]
struct Kind {
    width: usize,
    is_float: bool,
    is_signed: bool,
    highest_first: bool,
}

impl Kind {
    /// By NumPy's name of the type, or the name of PyTorch's storage.
    fn of(name: &str, highest_first: bool) -> Option<Self> {
        let (width, is_float, is_signed) = match name {
            "f8" | "DoubleStorage" => (8, true, true),
            "f4" | "FloatStorage" => (4, true, true),
            "i8" | "LongStorage" => (8, false, true),
            "i4" | "IntStorage" => (4, false, true),
            "i2" | "ShortStorage" => (2, false, true),
            "u4" => (4, false, false),
            "u2" => (2, false, false),
            _ => return None,
        };
        Some(Self {
            width,
            is_float,
            is_signed,
            highest_first,
        })
    }

    /// `None` if it is no whole number of them.
    fn read(self, bytes: &[u8]) -> Option<Values> {
        if !bytes.len().is_multiple_of(self.width) {
            return None;
        }
        let words = bytes.chunks_exact(self.width).map(|word| {
            let add = |value: u64, byte: &u8| (value << 8) | u64::from(*byte);
            match self.highest_first {
                true => word.iter().fold(0, add),
                false => word.iter().rev().fold(0, add),
            }
        });
        Some(match (self.is_float, self.width) {
            (true, 8) => Values::Numbers(words.map(f64::from_bits).collect()),
            (true, _) => Values::Numbers(
                words
                    .map(|word| f32::from_bits(word as u32).into())
                    .collect(),
            ),
            (false, width) => {
                // the sign is that of the highest bit
                let spare = 64 - 8 * width as u32;
                let whole = |word: u64| match self.is_signed {
                    true => (word << spare) as i64 >> spare,
                    false => word as i64,
                };
                Values::Integers(words.map(|word| Some(whole(word))).collect())
            }
        })
    }
}
