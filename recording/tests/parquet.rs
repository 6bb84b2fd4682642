//! Parquet files, ours and those of others.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::write_recording;
use parquet::basic::{Compression, LogicalType, Repetition, TimeUnit, Type as Physical, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use proptest::prelude::*;
use recording::{ReadProblem, Recording, Signal, read, read_mapped, write_csv, write_parquet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

/// A column of some other program's file; the values that are `None` are nulls.
enum Column {
    Double(Vec<Option<f64>>),
    Float(Vec<Option<f32>>),
    Int32(Vec<Option<i32>>),
    Int64(Vec<Option<i64>>),
    Stamp(TimeUnit, Vec<Option<i64>>),
    Text(Vec<Option<&'static str>>),
}

impl Column {
    fn describe(&self, name: &str) -> Type {
        let (physical, logical) = match self {
            Self::Double(_) => (Physical::DOUBLE, None),
            Self::Float(_) => (Physical::FLOAT, None),
            Self::Int32(_) => (Physical::INT32, None),
            Self::Int64(_) => (Physical::INT64, None),
            Self::Stamp(unit, _) => (Physical::INT64, Some(LogicalType::timestamp(true, *unit))),
            Self::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build()
            .unwrap()
    }
}

fn write_foreign(path: &Path, columns: &[(&str, Column)], compression: Compression) {
    let fields = columns
        .iter()
        .map(|(name, column)| Arc::new(column.describe(name)));
    let schema = Type::group_type_builder("schema")
        .with_fields(fields.collect())
        .build()
        .unwrap();
    let properties = WriterProperties::builder()
        .set_compression(compression)
        .build();
    let file = std::fs::File::create(path).unwrap();
    let mut writer =
        SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for (_, column) in columns {
        let mut out = group.next_column().unwrap().unwrap();
        macro_rules! write {
            ($kind:ty, $values:expr) => {{
                let levels: Vec<i16> = $values
                    .iter()
                    .map(|value| i16::from(value.is_some()))
                    .collect();
                let there: Vec<_> = $values.iter().flatten().cloned().collect();
                out.typed::<$kind>()
                    .write_batch(&there, Some(&levels), None)
                    .unwrap();
            }};
        }
        match column {
            Column::Double(values) => write!(DoubleType, values),
            Column::Float(values) => write!(FloatType, values),
            Column::Int32(values) => write!(Int32Type, values),
            Column::Int64(values) | Column::Stamp(_, values) => write!(Int64Type, values),
            Column::Text(values) => {
                let values: Vec<Option<ByteArray>> = values
                    .iter()
                    .map(|text| text.map(ByteArray::from))
                    .collect();
                write!(ByteArrayType, values);
            }
        }
        out.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn foreign(&self, columns: &[(&str, Column)]) -> PathBuf {
        let path = self.file("log.parquet");
        write_foreign(&path, columns, Compression::SNAPPY);
        path
    }

    fn refusal(&self, columns: &[(&str, Column)]) -> String {
        read(&self.foreign(columns))
            .unwrap_err()
            .problem
            .to_string()
    }
}

fn seconds() -> (&'static str, Column) {
    (
        "time_s",
        Column::Double(vec![Some(0.0), Some(0.5), Some(1.0)]),
    )
}

#[test]
fn numbers_of_every_kind_are_read_and_nulls_are_missing() {
    let folder = Folder::new();
    let path = folder.foreign(&[
        seconds(),
        ("segment", Column::Int32(vec![Some(1), Some(1), Some(2)])),
        (
            "j.motor_torque_nm",
            Column::Float(vec![Some(0.5), None, Some(-0.25)]),
        ),
        (
            "j.motor_current_a",
            Column::Int64(vec![Some(3), None, Some(-4)]),
        ),
        (
            "j.link_position_rad",
            Column::Double(vec![None, Some(f64::NAN), Some(2.0)]),
        ),
        ("note", Column::Text(vec![Some("not read"), None, None])),
    ]);
    let recording = read(&path).unwrap();
    assert_eq!(recording.time_s, [0.0, 0.5, 1.0]);
    assert_eq!(recording.segment.as_deref(), Some(&[1, 1, 2][..]));
    let signal = |signal| recording.signal("j", signal).unwrap();
    assert_eq!(signal(Signal::MotorTorqueNm)[0], 0.5);
    assert_eq!(signal(Signal::MotorCurrentA)[2], -4.0);
    assert_eq!(signal(Signal::LinkPositionRad)[2], 2.0);
    assert!(signal(Signal::MotorTorqueNm)[1].is_nan());
    assert!(signal(Signal::MotorCurrentA)[1].is_nan());
    assert!(
        signal(Signal::LinkPositionRad)[..2]
            .iter()
            .all(|value| value.is_nan())
    );
}

#[test]
fn time_stamps_are_seconds_in_every_unit() {
    for (unit, per_s) in [
        (TimeUnit::MILLIS, 1_000),
        (TimeUnit::MICROS, 1_000_000),
        (TimeUnit::NANOS, 1_000_000_000),
    ] {
        let folder = Folder::new();
        let stamps = (0..3)
            .map(|row| Some(1_700_000_000 * per_s + row * per_s / 4))
            .collect();
        let torque = Column::Double(vec![Some(1.0); 3]);
        let recording = read(&folder.foreign(&[
            ("time_s", Column::Stamp(unit, stamps)),
            ("j.motor_torque_nm", torque),
        ]))
        .unwrap();
        assert_eq!(recording.time_s, [0.0, 0.25, 0.5]);
        assert_eq!(recording.metadata["start_unix_ns"], "1700000000000000000");
        assert_eq!(recording.sample_rate_hz, 4.0);
    }
}

#[test]
fn a_mapping_lies_beside_or_anywhere() {
    let folder = Folder::new();
    let path = folder.foreign(&[
        (
            "t_ns",
            Column::Int64(vec![Some(0), Some(4_000_000), Some(8_000_000)]),
        ),
        (
            "q_deg",
            Column::Double(vec![Some(180.0), Some(90.0), Some(0.0)]),
        ),
    ]);
    let mapping = "[columns]\ntime_s = { column = 't_ns', scale = 1e-9 }\n\
                   [joint.j]\nlink_position_rad = { column = 'q_deg', scale = 0.017453292519943295 }";
    std::fs::write(folder.file("elsewhere.toml"), mapping).unwrap();
    let unmapped = read(&path).unwrap_err().to_string();
    assert!(
        unmapped.contains("no column is named JOINT.SIGNAL"),
        "{unmapped}"
    );
    let mapped = read_mapped(&path, &folder.file("elsewhere.toml")).unwrap();
    assert_eq!(mapped.sample_rate_hz, 250.0);
    assert_eq!(
        mapped.signal("j", Signal::LinkPositionRad).unwrap()[0],
        std::f64::consts::PI
    );
    std::fs::write(folder.file("log.toml"), mapping).unwrap();
    assert!(read(&path).unwrap().same_table(&mapped));
    let missing = read_mapped(&path, &folder.file("none.toml"))
        .unwrap_err()
        .to_string();
    assert!(missing.contains("none.toml: cannot be read"), "{missing}");
}

#[test]
fn what_is_not_numbers_is_named() {
    let folder = Folder::new();
    let text = Column::Text(vec![Some("1,5"), None, None]);
    assert_eq!(
        folder.refusal(&[seconds(), ("j.motor_torque_nm", text)]),
        "column `j.motor_torque_nm` holds text, not numbers; write it as floating-point numbers or integers"
    );
    let hole = Column::Double(vec![Some(0.0), None, Some(1.0)]);
    let torque = || ("j.motor_torque_nm", Column::Double(vec![Some(1.0); 3]));
    assert_eq!(
        folder.refusal(&[("time_s", hole), torque()]),
        "row 2: no time in column `time_s`"
    );
    let half = Column::Double(vec![Some(1.0), Some(1.5), Some(2.0)]);
    assert_eq!(
        folder.refusal(&[seconds(), ("segment", half), torque()]),
        "row 2, column `segment`: `1.5` is not an integer, which a segment is"
    );
    let infinite = Column::Double(vec![Some(1.0), Some(f64::INFINITY), Some(1.0)]);
    assert!(
        folder
            .refusal(&[seconds(), ("j.motor_torque_nm", infinite)])
            .starts_with("row 2: j.motor_torque_nm is inf")
    );
    let back = Column::Double(vec![Some(1.0), Some(0.5), Some(2.0)]);
    assert!(
        folder
            .refusal(&[("time_s", back), torque()])
            .starts_with("row 2: time runs backwards")
    );
}

#[test]
fn a_recording_survives_parquet_with_what_is_told_about_it() {
    let folder = Folder::new();
    let mcap = folder.file("run.mcap");
    write_recording(&mcap, 4000);
    let recording = read(&mcap).unwrap();
    let path = folder.file("run.parquet");
    write_parquet(&recording, &path).unwrap();
    let again = read(&path).unwrap();
    assert!(recording.same_table(&again));
    assert_eq!(recording.metadata, again.metadata);
}

#[test]
fn many_row_groups_are_one_table() {
    let folder = Folder::new();
    let rows = 300_000;
    let torque = (0..rows).map(|row| f64::from(row).sqrt()).collect();
    let recording = Recording {
        time_s: (0..rows).map(|row| f64::from(row) / 1000.0).collect(),
        segment: Some((0..i64::from(rows)).map(|row| row / 100_000).collect()),
        joints: vec![recording::JointColumns {
            name: "j".to_owned(),
            signals: [(Signal::MotorTorqueNm, torque)].into(),
        }],
        sample_rate_hz: 1000.0,
        metadata: Default::default(),
        truncated: false,
    };
    let path = folder.file("long.parquet");
    write_parquet(&recording, &path).unwrap();
    assert!(recording.same_table(&read(&path).unwrap()));
}

#[test]
fn a_full_disk_is_an_error_that_names_the_file() {
    let folder = Folder::new();
    let mcap = folder.file("run.mcap");
    write_recording(&mcap, 10);
    let error = write_parquet(&read(&mcap).unwrap(), Path::new("/dev/full")).unwrap_err();
    assert!(
        error.to_string().starts_with("cannot write /dev/full: "),
        "{error}"
    );
}

/// Files to damage: compressed and not, ours and foreign.
static WHOLE: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let folder = Folder::new();
    let (mcap, ours) = (folder.file("run.mcap"), folder.file("run.parquet"));
    write_recording(&mcap, 60);
    write_parquet(&read(&mcap).unwrap(), &ours).unwrap();
    let mut files = vec![std::fs::read(&ours).unwrap()];
    for compression in [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::ZSTD(ZstdLevel::default()),
    ] {
        let path = folder.file("foreign.parquet");
        let columns = [
            (
                "time_s",
                Column::Stamp(TimeUnit::MILLIS, (0..60).map(|row| Some(row * 4)).collect()),
            ),
            (
                "segment",
                Column::Int64((0..60).map(|row| Some(row / 30)).collect()),
            ),
            (
                "j.motor_torque_nm",
                Column::Float(
                    (0..60_u8)
                        .map(|row| (row % 7 > 0).then_some(f32::from(row)))
                        .collect(),
                ),
            ),
            ("j.link_position_rad", Column::Double(vec![Some(1.5); 60])),
        ];
        write_foreign(&path, &columns, compression);
        files.push(std::fs::read(&path).unwrap());
    }
    files
});

fn read_bytes(bytes: &[u8]) -> Result<Recording, ReadProblem> {
    static FOLDERS: LazyLock<Folder> = LazyLock::new(Folder::new);
    // Tests run beside each other.
    let path = FOLDERS.file(&format!(
        "damaged-{:?}.parquet",
        std::thread::current().id()
    ));
    std::fs::write(&path, bytes).unwrap();
    read(&path).map_err(|error| error.problem)
}

#[test]
fn a_file_cut_anywhere_is_refused_in_one_line() {
    for whole in &*WHOLE {
        for length in (4..whole.len()).step_by(13) {
            let error = read_bytes(&whole[..length]).unwrap_err().to_string();
            assert!(
                error.contains("cannot be decoded") && !error.contains('\n'),
                "{error}"
            );
        }
    }
}

proptest! {
    #[test]
    fn damage_is_read_or_refused(
        file in 0..4_usize,
        damage in prop::collection::vec((0.0..1.0, prop_oneof![any::<u8>(), Just(0), Just(0xff)]), 1..6),
        near_the_footer in any::<bool>(),
    ) {
        let mut bytes = WHOLE[file].clone();
        for (place, byte) in damage {
            let length = bytes.len() as f64;
            let place: f64 = if near_the_footer { length - 1.0 - place * length.min(700.0) } else { place * (length - 1.0) };
            bytes[place.max(0.0) as usize] = byte;
        }
        if let Ok(recording) = read_bytes(&bytes) {
            prop_assert!(recording.rows() <= 60);
        }
    }
}

#[test]
fn csv_and_parquet_of_one_table_are_the_same() {
    let folder = Folder::new();
    let (csv, parquet) = (folder.file("r.csv"), folder.file("s.parquet"));
    let mcap = folder.file("run.mcap");
    write_recording(&mcap, 500);
    let recording = read(&mcap).unwrap();
    write_csv(&recording, &csv).unwrap();
    write_parquet(&recording, &parquet).unwrap();
    std::fs::write(
        folder.file("r.toml"),
        format!("sample_rate_hz = {:?}", recording.sample_rate_hz),
    )
    .unwrap();
    assert!(read(&csv).unwrap().same_table(&read(&parquet).unwrap()));
}

#[test]
fn a_compression_that_is_not_read_is_named() {
    // One byte of the footer tells the codec; pages are not looked at before.
    let folder = Folder::new();
    let path = folder.file("log.parquet");
    let columns = [
        seconds(),
        ("j.motor_torque_nm", Column::Double(vec![Some(1.0); 3])),
    ];
    write_foreign(&path, &columns, Compression::SNAPPY);
    let whole = std::fs::read(&path).unwrap();
    let named = (0..whole.len()).any(|at| {
        let mut changed = whole.clone();
        changed[at] = 8; // brotli, 4, as the footer's variable-length integers are written
        read_bytes(&changed).is_err_and(|error| {
            error
                .to_string()
                .starts_with("is compressed with `brotli`; only snappy, gzip, lz4, zstd")
        })
    });
    assert!(named);
}
