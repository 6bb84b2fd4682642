//! A recorder that was killed loses its last chunk and nothing else; a damaged file is an error, never a panic.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{header, write_cycles, write_recording};
use proptest::prelude::*;
use recording::{ReadProblem, Recording, Writer, read};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

fn read_bytes(folder: &Path, name: &str, bytes: &[u8]) -> Result<Recording, ReadProblem> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path).map_err(|error| error.problem)
}

#[test]
fn a_file_cut_anywhere_gives_its_whole_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.mcap");
    let mut writer = Writer::create(&path, &header()).unwrap();
    for start in [0, 100, 200] {
        write_cycles(&mut writer, start..start + 100);
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    let whole = std::fs::read(&path).unwrap();
    let table = read(&path).unwrap();
    let mut rows_seen = Vec::new();
    let near_the_ends = (0..400).chain(whole.len() - 400..whole.len());
    for length in near_the_ends.chain((0..whole.len()).step_by(whole.len() / 300)) {
        match read_bytes(folder.path(), "cut.mcap", &whole[..length]) {
            Ok(cut) => {
                assert!(cut.truncated, "{length} bytes");
                assert_eq!(cut.time_s, table.time_s[..cut.rows()]);
                assert_eq!(cut.joint_names().collect::<Vec<_>>(), common::JOINT_NAMES);
                rows_seen.push(cut.rows());
            }
            Err(ReadProblem::NotMcap) => assert!(length < mcap::MAGIC.len()),
            Err(ReadProblem::NothingRecorded) => assert!(length < 400),
            Err(other) => panic!("{length} bytes: {other}"),
        }
    }
    rows_seen.sort_unstable();
    rows_seen.dedup();
    assert_eq!(rows_seen, [0, 100, 200, 300]);
}

#[test]
fn a_chunk_ends_once_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = Writer::create(&path, &header()).unwrap();
    write_cycles(&mut writer, 0..5000);
    assert_eq!(read(&path).unwrap().rows(), 4500);
    writer.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.chunk_indexes.len(), 4);
}

#[test]
fn what_was_flushed_is_there_while_the_recorder_still_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("running.mcap");
    let mut writer = Writer::create(&path, &header()).unwrap();
    assert_eq!(read(&path).unwrap().rows(), 0);
    write_cycles(&mut writer, 0..10);
    writer.flush().unwrap();
    writer.flush().unwrap();
    write_cycles(&mut writer, 10..20);
    let running = read(&path).unwrap();
    assert_eq!((running.rows(), running.truncated), (10, true));
    writer.finish().unwrap();
    let finished = read(&path).unwrap();
    assert_eq!((finished.rows(), finished.truncated), (20, false));
}

#[test]
fn a_recording_without_a_row_is_readable() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.mcap");
    write_recording(&path, 0);
    let recording = read(&path).unwrap();
    assert_eq!(
        (
            recording.rows(),
            recording.truncated,
            recording.joints.len()
        ),
        (0, false, 2)
    );
}

#[test]
fn other_files_are_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let refusal = |name: &str, bytes: &[u8]| {
        read_bytes(folder.path(), name, bytes)
            .unwrap_err()
            .to_string()
    };
    assert!(refusal("a.mcap", b"time_s\n").contains("not an MCAP file"));
    assert!(refusal("a.parquet", b"PAR1").contains("neither an MCAP recording"));
    assert!(
        read(&folder.path().join("none.csv"))
            .unwrap_err()
            .to_string()
            .contains("none.csv: cannot be read")
    );
    assert!(refusal("b.mcap", mcap::MAGIC).contains("nothing was recorded"));
    assert!(
        refusal("zeros.mcap", &[mcap::MAGIC, &[0; 100]].concat()).contains("damaged at byte 8")
    );
}

#[test]
fn a_foreign_mcap_file_is_told_by_its_channels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.mcap");
    let mut writer = mcap::Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
    let schema = writer
        .add_schema("sensor_msgs/JointState", "ros2msg", b"")
        .unwrap();
    writer
        .add_channel(schema, "/joint_states", "cdr", &BTreeMap::new())
        .unwrap();
    writer.finish().unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(
        error.contains("its channels are `/joint_states (sensor_msgs/JointState)`"),
        "{error}"
    );
}

/// The recording with neither compression nor checksums, so that damage reaches every layer of the reader.
fn unprotected(folder: &Path) -> Vec<u8> {
    let (from, to) = (folder.join("from.mcap"), folder.join("to.mcap"));
    write_recording(&from, 30);
    let bytes = std::fs::read(&from).unwrap();
    let options = mcap::WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false);
    let mut writer = options.create(std::fs::File::create(&to).unwrap()).unwrap();
    let metadata = [("joints", "shoulder,elbow.1"), ("sample_rate_hz", "1500")];
    let metadata = metadata
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .into();
    writer
        .write_metadata(&mcap::records::Metadata {
            name: "flexspline".to_owned(),
            metadata,
        })
        .unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    assert!(read(&from).unwrap().same_table(&read(&to).unwrap()));
    std::fs::read(&to).unwrap()
}

fn native(folder: &Path) -> Vec<u8> {
    let path = folder.join("native.mcap");
    write_recording(&path, 30);
    std::fs::read(path).unwrap()
}

/// Where in the file, as a share of its length, and what is put there.
fn damage() -> impl Strategy<Value = Vec<(f64, u8)>> {
    prop::collection::vec(
        (0.0..1.0, prop_oneof![any::<u8>(), Just(0), Just(0xff)]),
        1..6,
    )
}

fn damaged(mut bytes: Vec<u8>, damage: &[(f64, u8)]) -> Vec<u8> {
    for (place, byte) in damage {
        let place = (place * bytes.len() as f64) as usize;
        bytes[place] = *byte;
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn damage_is_read_or_refused(damage in damage()) {
        static WHOLE: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| {
            let folder = tempfile::tempdir().unwrap();
            [native(folder.path()), unprotected(folder.path())]
        });
        let folder = tempfile::tempdir().unwrap();
        for bytes in &*WHOLE {
            if let Ok(recording) = read_bytes(folder.path(), "damaged.mcap", &damaged(bytes.clone(), &damage)) {
                prop_assert!(recording.rows() <= 2 * 30 * 5);
                prop_assert!(recording.joints.len() <= recording::JOINTS_MAX);
            }
        }
    }

    #[test]
    fn any_csv_and_any_mapping_are_read_or_refused(
        csv in "(time_s|segment|a\\.motor_torque_nm|[,;\t\n\"0-9.e-]|nan|inf|\\PC){0,60}",
        mapping in "(sample_rate_hz|columns|joint|time_s|motor_torque_nm|scale|[\\[\\]={}\"\n0-9.a]){0,20}",
    ) {
        let folder = tempfile::tempdir().unwrap();
        let _ = read_bytes(folder.path(), "alone.csv", csv.as_bytes());
        std::fs::write(folder.path().join("mapped.toml"), mapping).unwrap();
        let _ = read_bytes(folder.path(), "mapped.csv", csv.as_bytes());
    }
}
