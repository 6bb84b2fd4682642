//! Parquet logs: the same columns and mapping file as CSV, nulls for values that are not there.
//!
//! Lengths and counts in the file are not believed before a table of that size was found fit to be held in memory.

use super::{Log, Source, lerobot};
use crate::builder::TableBuilder;
use crate::clock::{UnitsPerSecond, time_column};
use crate::columns::Plan;
use crate::error::Place;
use crate::frame::{Array, Column, Frame, Row, Values};
use crate::guard::without_panic;
use crate::mapping::{Mapping, MappingFile};
use crate::writer::{METADATA_JOINTS, told_rate_hz};
use crate::{JOINTS_MAX, ReadProblem, Recording, VALUES_MAX};
use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::reader::{FileReader, RowGroupReader};
use parquet::file::serialized_reader::SerializedFileReader;
use parquet::schema::types::ColumnDescriptor;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

/// What a Parquet file begins and ends with.
const MAGIC: &[u8] = b"PAR1";
/// Rows decoded at once.
const BATCH: usize = 1 << 14;

pub(crate) struct Parquet;

impl Source for Parquet {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.start.starts_with(MAGIC)
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        let mut frame = read_frame(path)?;
        frame.joint_names = lerobot::names_for_episode(path)?;
        Ok(frame)
    }

    fn read(&self, path: &Path, mapping: &MappingFile<'_>) -> Result<Recording, ReadProblem> {
        let (mapping, mapping_path) = mapping.load()?;
        if fenced(|| has_lists(path))? {
            let frame = self.frame(path, &mapping)?;
            return frame.into_table(&mapping, &mapping_path);
        }
        fenced(|| decode_table(path, &mapping, &mapping_path))
    }
}

/// The decoders check what a writer could do wrong, and panic at what only damage does.
fn fenced<T>(decode: impl FnOnce() -> Result<T, ReadProblem>) -> Result<T, ReadProblem> {
    without_panic(decode).unwrap_or_else(|what| Err(ReadProblem::Parquet(what)))
}

/// Whether a column has several numbers in each row, as datasets that robots learn from have.
fn has_lists(path: &Path) -> Result<bool, ReadProblem> {
    let file = SerializedFileReader::new(File::open(path)?)?;
    let columns = file.metadata().file_metadata().schema_descr().columns();
    Ok(columns.iter().any(|column| is_list(column)))
}

fn is_list(column: &ColumnDescriptor) -> bool {
    column.max_rep_level() == 1 && matches!(column.physical_type(), Type::FLOAT | Type::DOUBLE)
}

/// All columns of numbers, and those of lists of numbers as arrays.
pub(super) fn read_frame(path: &Path) -> Result<Frame, ReadProblem> {
    fenced(|| decode_frame(path))
}

fn decode_frame(path: &Path) -> Result<Frame, ReadProblem> {
    let file = SerializedFileReader::new(File::open(path)?)?;
    let metadata = file.metadata();
    let schema = metadata.file_metadata().schema_descr();
    check_size(metadata, schema.num_columns())?;
    check_values(metadata)?;
    let mut frame = Frame::default();
    for (field, descriptor) in schema.columns().iter().enumerate() {
        if is_list(descriptor) {
            let mut array = Vec::new();
            for group in 0..file.num_row_groups() {
                add_lists(&mut array, &*file.get_row_group(group)?, field)?;
            }
            frame.add_array(Array {
                name: descriptor
                    .path()
                    .parts()
                    .first()
                    .cloned()
                    .unwrap_or_default(),
                columns: array.into_iter().map(Values::Numbers).collect(),
            });
            continue;
        }
        let mut whole: Option<Column> = None;
        for group in 0..file.num_row_groups() {
            let group = file.get_row_group(group)?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            match read_column(&*group, field, rows) {
                Ok(part) => match &mut whole {
                    Some(column) => column.values.append(part.values),
                    None => whole = Some(part),
                },
                // Text and the like.
                Err(ReadProblem::ColumnType { .. }) => break,
                Err(other) => return Err(other),
            }
        }
        frame.columns.extend(whole);
    }
    frame.check_lengths()?;
    frame.notes = about_the_run(metadata);
    Ok(frame)
}

/// Lists of a few rows may hold any number of values.
fn check_values(metadata: &ParquetMetaData) -> Result<(), ReadProblem> {
    let groups = metadata.row_groups().iter();
    let counts = groups.flat_map(|group| group.columns().iter().map(|column| column.num_values()));
    let values = counts.fold(0_i64, |values, count| values.saturating_add(count.max(0)));
    if usize::try_from(values).is_ok_and(|values| values <= VALUES_MAX) {
        return Ok(());
    }
    Err(ReadProblem::TooLarge {
        rows: values,
        columns: 1,
    })
}

/// Adds a row group's lists to the columns of their entries; a list that is too short misses its last.
fn add_lists(
    array: &mut Vec<Vec<f64>>,
    group: &dyn RowGroupReader,
    field: usize,
) -> Result<(), ReadProblem> {
    let chunk = group.metadata().column(field);
    check_compression(chunk.compression())?;
    let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let full_level = chunk.column_descr().max_def_level();
    let lists = match group.get_column_reader(field)? {
        ColumnReader::DoubleColumnReader(reader) => {
            decode_lists(reader, full_level, rows, |value| *value)?
        }
        ColumnReader::FloatColumnReader(reader) => {
            decode_lists(reader, full_level, rows, |value| f64::from(*value))?
        }
        _ => return Ok(()),
    };
    let before = array.first().map_or(0, Vec::len);
    let width = lists
        .iter()
        .map(|(entry, _, _)| entry + 1)
        .max()
        .unwrap_or(0);
    if width > JOINTS_MAX {
        return Err(ReadProblem::TooManyJoints { joints: width });
    }
    array.resize(array.len().max(width), vec![f64::NAN; before]);
    for column in array.iter_mut() {
        column.resize(before + rows, f64::NAN);
    }
    for (entry, row, value) in lists {
        array[entry][before + row] = value;
    }
    Ok(())
}

/// Entry, row and value of all lists of a row group.
fn decode_lists<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    full_level: i16,
    rows: usize,
    convert: impl Fn(&T::T) -> f64,
) -> Result<Vec<(usize, usize, f64)>, ReadProblem> {
    let mut lists = Vec::new();
    let (mut row, mut entry) = (0_usize, 0_usize);
    let (mut values, mut defined, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
    let mut done = 0;
    while done < rows {
        values.clear();
        defined.clear();
        repeated.clear();
        let wanted = BATCH.min(rows - done);
        let (read, _, _) =
            reader.read_records(wanted, Some(&mut defined), Some(&mut repeated), &mut values)?;
        if read == 0 {
            let what = format!("a column ends after {done} of {rows} rows");
            return Err(ReadProblem::Parquet(what));
        }
        done += read;
        let mut there = values.iter();
        for (defined, repeated) in defined.iter().zip(&repeated) {
            match repeated {
                0 => (row, entry) = (row + 1, 0),
                _ => entry += 1,
            }
            if *defined == full_level
                && let (Some(value), Some(row)) = (there.next(), row.checked_sub(1))
                && row < rows
            {
                lists.push((entry, row, convert(value)));
            }
        }
    }
    Ok(lists)
}

fn decode_table(
    path: &Path,
    mapping: &Mapping,
    mapping_path: &Path,
) -> Result<Recording, ReadProblem> {
    let file = SerializedFileReader::new(File::open(path)?)?;
    let metadata = file.metadata();
    let descriptors = metadata.file_metadata().schema_descr().columns();
    let names = descriptors.iter().map(|column| column.path().string());
    let plan = Plan::new(names.collect(), &[], mapping, mapping_path)?;
    check_size(metadata, plan.fields().count())?;
    let about_the_run = about_the_run(metadata);
    let mut table = TableBuilder::default();
    expect_joints(&mut table, &about_the_run)?;
    plan.prepare(&mut table);
    for group in 0..file.num_row_groups() {
        add_row_group(&plan, &mut table, &*file.get_row_group(group)?)?;
    }
    let rate_hz = mapping
        .sample_rate_hz
        .or_else(|| told_rate_hz(&about_the_run));
    let mut recording = table.finish(rate_hz, || mapping_path.to_owned())?;
    recording.metadata.extend(about_the_run);
    Ok(recording)
}

/// The file's own metadata, without what other programs keep there for themselves.
fn about_the_run(metadata: &ParquetMetaData) -> BTreeMap<String, String> {
    let pairs = metadata.file_metadata().key_value_metadata();
    let told = pairs.into_iter().flatten().filter_map(|pair| {
        let key = pair.key.strip_prefix(KEY_PREFIX)?;
        Some((key.to_owned(), pair.value.clone()?))
    });
    told.collect()
}

/// Before the keys of what is told about the run.
pub(crate) const KEY_PREFIX: &str = "flexspline.";

/// A joint without a single value has no column, and is told here only.
fn expect_joints(
    table: &mut TableBuilder,
    about_the_run: &BTreeMap<String, String>,
) -> Result<(), ReadProblem> {
    let names = about_the_run.get(METADATA_JOINTS).map(String::as_str);
    let names = names.unwrap_or_default().split(',');
    for (index, name) in names.filter(|name| !name.is_empty()).enumerate() {
        if index == JOINTS_MAX {
            return Err(ReadProblem::TooManyJoints { joints: index + 1 });
        }
        table.joint(name);
    }
    Ok(())
}

fn check_size(metadata: &ParquetMetaData, columns: usize) -> Result<(), ReadProblem> {
    let told_columns = metadata.file_metadata().schema_descr().num_columns();
    if let Some(group) = metadata
        .row_groups()
        .iter()
        .find(|group| group.num_columns() != told_columns)
    {
        let what = format!(
            "a row group holds {} columns, the whole file {told_columns}",
            group.num_columns()
        );
        return Err(ReadProblem::Parquet(what));
    }
    let told = metadata.file_metadata().num_rows();
    let groups = metadata.row_groups().iter().map(|group| group.num_rows());
    let rows = groups.fold(0_i64, |rows, group| rows.saturating_add(group.max(0)));
    if rows != told {
        let what = format!("its row groups hold {rows} rows, the whole file {told}");
        return Err(ReadProblem::Parquet(what));
    }
    let fits = usize::try_from(rows)
        .ok()
        .and_then(|rows| rows.checked_mul(columns))
        .is_some_and(|values| values <= VALUES_MAX);
    if fits {
        Ok(())
    } else {
        Err(ReadProblem::TooLarge { rows, columns })
    }
}

fn add_row_group(
    plan: &Plan,
    table: &mut TableBuilder,
    group: &dyn RowGroupReader,
) -> Result<(), ReadProblem> {
    let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let mut columns: Vec<Option<Column>> = Vec::new();
    columns.resize_with(group.num_columns(), || None);
    for field in plan.fields() {
        if columns[field].is_none() {
            columns[field] = Some(read_column(group, field, rows)?);
        }
    }
    let first_row = table.rows();
    for row in 0..rows {
        let cells = Row {
            columns: &columns,
            row,
            place: Place::Row((first_row + row + 1) as u64),
        };
        plan.add_row(table, &cells)?;
    }
    Ok(())
}

fn read_column(
    group: &dyn RowGroupReader,
    field: usize,
    rows: usize,
) -> Result<Column, ReadProblem> {
    let chunk = group.metadata().column(field);
    let descriptor = chunk.column_descr();
    check_compression(chunk.compression())?;
    let wrong_type = || ReadProblem::ColumnType {
        column: descriptor.path().string(),
        found: found(descriptor),
    };
    if descriptor.max_rep_level() > 0 {
        return Err(wrong_type());
    }
    let reader = group.get_column_reader(field)?;
    let values = match (reader, Meaning::of(descriptor)) {
        (ColumnReader::DoubleColumnReader(reader), Meaning::Number) => {
            let number = |value: &f64| *value;
            Values::Numbers(decode(reader, descriptor, rows, &f64::NAN, number)?)
        }
        (ColumnReader::FloatColumnReader(reader), Meaning::Number) => {
            // A time was a short decimal before it was rounded to 24 bits.
            let is_time = time_column(&descriptor.path().string()).is_some();
            let number = |value: &f32| match is_time {
                true => value.to_string().parse().unwrap_or(f64::NAN),
                false => f64::from(*value),
            };
            Values::Numbers(decode(reader, descriptor, rows, &f64::NAN, number)?)
        }
        (ColumnReader::Int64ColumnReader(reader), Meaning::Instant(unit)) => {
            let ticks = |value: &i64| Some(*value);
            Values::Instants(decode(reader, descriptor, rows, &None, ticks)?, unit)
        }
        (ColumnReader::Int64ColumnReader(reader), Meaning::Number) => {
            let integer = |value: &i64| Some(*value);
            Values::Integers(decode(reader, descriptor, rows, &None, integer)?)
        }
        (ColumnReader::Int32ColumnReader(reader), Meaning::Number) => {
            let unsigned = descriptor.converted_type() == ConvertedType::UINT_32;
            let integer = |value: &i32| {
                Some(match unsigned {
                    true => i64::from(value.cast_unsigned()),
                    false => i64::from(*value),
                })
            };
            Values::Integers(decode(reader, descriptor, rows, &None, integer)?)
        }
        _ => return Err(wrong_type()),
    };
    let name = descriptor.path().string();
    Ok(Column { name, values })
}

/// What the numbers of a column stand for.
enum Meaning {
    Number,
    Instant(UnitsPerSecond),
    Other,
}

impl Meaning {
    fn of(descriptor: &ColumnDescriptor) -> Self {
        match descriptor.logical_type_ref() {
            Some(LogicalType::Timestamp(stamp)) => Self::Instant(match stamp.unit {
                TimeUnit::MILLIS => UnitsPerSecond::MILLISECONDS,
                TimeUnit::MICROS => UnitsPerSecond::MICROSECONDS,
                TimeUnit::NANOS => UnitsPerSecond::NANOSECONDS,
            }),
            Some(LogicalType::Integer(_)) => Self::Number,
            Some(_) => Self::Other,
            None => Self::of_old(descriptor.converted_type()),
        }
    }

    /// What files from before the logical types say.
    fn of_old(converted: ConvertedType) -> Self {
        match converted {
            ConvertedType::TIMESTAMP_MILLIS => Self::Instant(UnitsPerSecond::MILLISECONDS),
            ConvertedType::TIMESTAMP_MICROS => Self::Instant(UnitsPerSecond::MICROSECONDS),
            ConvertedType::DECIMAL
            | ConvertedType::DATE
            | ConvertedType::TIME_MILLIS
            | ConvertedType::TIME_MICROS => Self::Other,
            _ => Self::Number,
        }
    }
}

fn found(descriptor: &ColumnDescriptor) -> String {
    let physical = descriptor.physical_type();
    let list = if descriptor.max_rep_level() > 0 {
        "lists of "
    } else {
        ""
    };
    match (physical, descriptor.logical_type_ref()) {
        (Type::BYTE_ARRAY, Some(LogicalType::String)) => format!("{list}text"),
        (Type::INT96, _) => format!("{list}INT96 time stamps"),
        (physical, Some(logical)) => format!("{list}{physical} ({logical:?})"),
        (physical, None) => format!("{list}{physical}"),
    }
}

fn check_compression(compression: Compression) -> Result<(), ReadProblem> {
    match compression {
        Compression::UNCOMPRESSED
        | Compression::SNAPPY
        | Compression::GZIP(_)
        | Compression::LZ4
        | Compression::LZ4_RAW
        | Compression::ZSTD(_) => Ok(()),
        other => Err(ReadProblem::UnknownCompression {
            compression: name(other),
            known: "snappy, gzip, lz4, zstd",
        }),
    }
}

/// Without the level that it was compressed with.
fn name(compression: Compression) -> String {
    let text = compression.to_string().to_lowercase();
    text.split('(').next().unwrap_or_default().to_owned()
}

/// The values of one column of a row group; `missing` where there is a null.
fn decode<T: DataType, V: Clone>(
    mut reader: ColumnReaderImpl<T>,
    descriptor: &ColumnDescriptor,
    rows: usize,
    missing: &V,
    convert: impl Fn(&T::T) -> V,
) -> Result<Vec<V>, ReadProblem> {
    let full_level = descriptor.max_def_level();
    let (mut decoded, mut values, mut levels) = (Vec::new(), Vec::new(), Vec::new());
    while decoded.len() < rows {
        values.clear();
        levels.clear();
        let wanted = BATCH.min(rows - decoded.len());
        let (read, _, _) = reader.read_records(wanted, Some(&mut levels), None, &mut values)?;
        if read == 0 {
            let what = format!("a column ends after {} of {rows} rows", decoded.len());
            return Err(ReadProblem::Parquet(what));
        }
        if full_level == 0 {
            decoded.extend(values.iter().map(&convert));
            continue;
        }
        let mut there = values.iter();
        decoded.extend(levels.iter().map(|level| {
            let value = (*level == full_level).then(|| there.next()).flatten();
            value.map_or_else(|| missing.clone(), &convert)
        }));
    }
    Ok(decoded)
}

impl From<ParquetError> for ReadProblem {
    fn from(error: ParquetError) -> Self {
        let text = error.to_string();
        let text = text.strip_prefix("Parquet error: ").unwrap_or(&text);
        // One line, whatever the library says.
        Self::Parquet(text.split_whitespace().collect::<Vec<_>>().join(" "))
    }
}
