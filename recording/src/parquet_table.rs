//! Tables written as Parquet.

use crate::columns::{SEGMENT, TIME};
use crate::mcap_file::header;
use crate::sources::PARQUET_KEY_PREFIX;
use crate::writer::{check_joint_names, metadata};
use crate::{Recording, WriteError};
use parquet::basic::{Compression, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::{DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Rows of one row group: readers hold one in memory.
const GROUP_ROWS: usize = 1 << 17;

/// Writes a table as Parquet: `time_s`, `segment` where there is one, and `JOINT.SIGNAL`; a missing value is a null.
/// What is told about the run goes into the file's metadata, its rate included.
///
/// # Errors
/// If the table's columns differ in length, a joint's name cannot be listed or the file cannot be written.
pub fn write_parquet(recording: &Recording, path: &Path) -> Result<(), WriteError> {
    recording.check_lengths()?;
    let names: Vec<String> = recording.joint_names().map(str::to_owned).collect();
    check_joint_names(&names)?;
    let file = File::create(path).map_err(|cause| WriteError::Io {
        path: path.to_owned(),
        cause,
    })?;
    write_table(recording, file).map_err(|cause| WriteError::Parquet {
        path: path.to_owned(),
        cause,
    })
}

fn write_table(recording: &Recording, file: File) -> Result<(), ParquetError> {
    let pairs = metadata(&header(recording));
    let pairs = pairs
        .into_iter()
        .map(|(key, value)| KeyValue::new(format!("{PARQUET_KEY_PREFIX}{key}"), value));
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by(concat!("flexspline ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(pairs.collect()))
        .build();
    let mut writer =
        SerializedFileWriter::new(file, Arc::new(schema(recording)?), Arc::new(properties))?;
    for start in (0..recording.rows()).step_by(GROUP_ROWS) {
        let end = recording.rows().min(start + GROUP_ROWS);
        let mut group = writer.next_row_group()?;
        write_group(recording, start..end, &mut group)?;
        group.close()?;
    }
    writer.close()?;
    Ok(())
}

fn schema(recording: &Recording) -> Result<Type, ParquetError> {
    let column = |name: &str, physical: Physical, repetition: Repetition| {
        let column = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        column.build().map(Arc::new)
    };
    let mut fields = vec![column(TIME, Physical::DOUBLE, Repetition::REQUIRED)?];
    if recording.segment.is_some() {
        fields.push(column(SEGMENT, Physical::INT64, Repetition::REQUIRED)?);
    }
    for joint in &recording.joints {
        for signal in joint.signals.keys() {
            let name = format!("{}.{signal}", joint.name);
            fields.push(column(&name, Physical::DOUBLE, Repetition::OPTIONAL)?);
        }
    }
    Type::group_type_builder("recording")
        .with_fields(fields)
        .build()
}

fn write_group(
    recording: &Recording,
    rows: std::ops::Range<usize>,
    group: &mut SerializedRowGroupWriter<'_, File>,
) -> Result<(), ParquetError> {
    write_column::<DoubleType>(group, &recording.time_s[rows.clone()], None)?;
    if let Some(segment) = &recording.segment {
        write_column::<Int64Type>(group, &segment[rows.clone()], None)?;
    }
    for column in recording
        .joints
        .iter()
        .flat_map(|joint| joint.signals.values())
    {
        let column = &column[rows.clone()];
        let levels: Vec<i16> = column
            .iter()
            .map(|value| i16::from(!value.is_nan()))
            .collect();
        let there: Vec<f64> = column
            .iter()
            .copied()
            .filter(|value| !value.is_nan())
            .collect();
        write_column::<DoubleType>(group, &there, Some(&levels))?;
    }
    Ok(())
}

fn write_column<T: parquet::data_type::DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: &[T::T],
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let mut column = group
        .next_column()?
        .ok_or_else(|| ParquetError::General("a column more than the schema has".to_owned()))?;
    column.typed::<T>().write_batch(values, levels, None)?;
    column.close()
}
