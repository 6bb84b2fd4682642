//! A recorder that was killed loses its last chunk and nothing else; a damaged file is an error, never a panic.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{header, write_cycles, write_recording};
use proptest::prelude::*;
use recording::{GuessJoint, ReadProblem, Recording, Writer, read, read_guessing};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

/// Reads it for a robot too, with a guess of what it holds.
fn read_guessed(path: &Path) -> Result<Recording, ReadProblem> {
    let joints = ["elbow", "joint1"].map(|name| GuessJoint {
        name: name.to_owned(),
        gear_ratio: 50.0,
        is_limited: true,
        has_rotor: false,
        slides: false,
    });
    let read = read_guessing(path, &joints);
    read.map(|(recording, _)| recording)
        .map_err(|error| error.problem)
}

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
    assert!(refusal("a.bag", b"#ROSBAG").contains("neither an MCAP recording"));
    assert!(refusal("a.parquet", b"time_s\n").contains("not a Parquet file"));
    assert!(refusal("b.parquet", b"PAR1").contains("cannot be decoded"));
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
        .add_schema("sensor_msgs/Image", "ros2msg", b"")
        .unwrap();
    writer
        .add_channel(schema, "/camera", "cdr", &BTreeMap::new())
        .unwrap();
    writer.finish().unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(
        error.contains("its channels (with schemas) are `/camera (sensor_msgs/Image)`; export"),
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

/// The same file with its chunks compressed as most MCAP writers do it.
fn zstd_compressed(uncompressed: &[u8]) -> Vec<u8> {
    const CHUNK: u8 = 6;
    const CHUNK_HEAD: usize = 8 + 8 + 8 + 4; // first and last time, size, checksum
    let mut file = mcap::MAGIC.to_vec();
    let mut rest = &uncompressed[mcap::MAGIC.len()..uncompressed.len() - mcap::MAGIC.len()];
    while let Some((&opcode, after)) = rest.split_first() {
        let (length, after) = after.split_first_chunk().unwrap();
        let (body, after) = after.split_at(u64::from_le_bytes(*length) as usize);
        rest = after;
        let mut written = body.to_vec();
        if opcode == CHUNK {
            // No name of a compression, and the records, each after its length.
            let records = zstd::encode_all(&body[CHUNK_HEAD + 4 + 8..], 0).unwrap();
            written.truncate(CHUNK_HEAD);
            written.extend(4_u32.to_le_bytes());
            written.extend(b"zstd");
            written.extend((records.len() as u64).to_le_bytes());
            written.extend(records);
        }
        file.push(opcode);
        file.extend((written.len() as u64).to_le_bytes());
        file.extend(written);
    }
    file.extend(mcap::MAGIC);
    file
}

#[test]
fn zstd_chunks_are_read_as_uncompressed_ones_and_others_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let uncompressed = unprotected(folder.path());
    let zstd = zstd_compressed(&uncompressed);
    let table = read_bytes(folder.path(), "zstd.mcap", &zstd).unwrap();
    assert!(!table.truncated);
    assert!(table.same_table(&read_bytes(folder.path(), "plain.mcap", &uncompressed).unwrap()));
    let at = zstd.windows(4).position(|name| name == b"zstd").unwrap();
    let mut other = zstd.clone();
    other[at..at + 4].copy_from_slice(b"rare");
    let refusal = read_bytes(folder.path(), "rare.mcap", &other)
        .unwrap_err()
        .to_string();
    assert!(
        refusal.contains("compressed with `rare`; only lz4, zstd"),
        "{refusal}"
    );
    // A chunk that promises more than any recording holds.
    let mut bomb = zstd;
    bomb[at - 16..at - 8].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    let refusal = read_bytes(folder.path(), "bomb.mcap", &bomb)
        .unwrap_err()
        .to_string();
    assert!(
        refusal.contains("unpacks to 1099511627776 bytes"),
        "{refusal}"
    );
}

fn native(folder: &Path) -> Vec<u8> {
    let path = folder.join("native.mcap");
    write_recording(&path, 30);
    std::fs::read(path).unwrap()
}

const PLAIN_LOG: &str = "time_s,segment,elbow.motor_torque_nm,elbow.motor_position_rad\n0,1,2.5,0.1\n0.004,1,,0.2\n\
                         0.008,1,nan,0.3\n0,2,-1e-3,0.1\n0.004,2,7,0.15\n";
const MAPPED_LOG: &str = "t;trial;q;i\n0;1;180;1\n4;1;181;1,5\n8;1;182;2\n0;2;90;1\n4;2;91;1\n";
const MAPPING: &str = "sample_rate_hz = 250.0\n[columns]\ntime_s = { column = 't', scale = 1e-3 }\nsegment = 'trial'\n\
                       [joint.elbow]\nmotor_current_a = 'i'\nmotor_position_rad = { column = 'q', scale = 4.48, offset = 1 }\n";

/// The text with some stretches removed, doubled or overwritten.
fn mangle(text: &str, wounds: &[(prop::sample::Index, usize, String)]) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for (at, length, insert) in wounds {
        let start = at.index(chars.len() + 1);
        let end = (start + length).min(chars.len());
        chars.splice(start..end, insert.chars());
    }
    chars.into_iter().collect()
}

fn wounds() -> impl Strategy<Value = Vec<(prop::sample::Index, usize, String)>> {
    let scrap = prop::sample::select(vec![
        "",
        "nan",
        "-inf",
        "1e400",
        "-1e-400",
        "\n",
        "\r\n",
        ",",
        ";",
        "\t",
        "\"",
        "'",
        "=",
        "[joint.",
        "]\n",
        "{",
        "}",
        "9999999999999999999999",
        "\u{feff}",
        "\0",
        "time_s",
        "column",
    ]);
    prop::collection::vec(
        (
            any::<prop::sample::Index>(),
            0_usize..12,
            scrap.prop_map(str::to_owned),
        ),
        0..6,
    )
}

/// Where in the file, as a share of its length, and what is put there.
fn damage() -> impl Strategy<Value = Vec<(f64, u8)>> {
    prop::collection::vec(
        (0.0..1.0, prop_oneof![any::<u8>(), Just(0), Just(0xff)]),
        1..6,
    )
}

/// A folder whose files are written again for each input. Each test has names of its own in it.
fn shared_folder() -> &'static Path {
    static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());
    FOLDER.path()
}

fn damaged(mut bytes: Vec<u8>, damage: &[(f64, u8)]) -> Vec<u8> {
    for (place, byte) in damage {
        let place = (place * bytes.len() as f64) as usize;
        bytes[place] = *byte;
    }
    bytes
}

proptest! {
    #[test]
    fn damage_is_read_or_refused(damage in damage()) {
        static WHOLE: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
            let folder = tempfile::tempdir().unwrap();
            let unprotected = unprotected(folder.path());
            [native(folder.path()), zstd_compressed(&unprotected), unprotected]
        });
        for bytes in &*WHOLE {
            if let Ok(recording) = read_bytes(shared_folder(), "damaged.mcap", &damaged(bytes.clone(), &damage)) {
                prop_assert!(recording.rows() <= 2 * 30 * 5);
                prop_assert!(recording.joints.len() <= recording::JOINTS_MAX);
            }
        }
    }

    #[test]
    fn a_mangled_log_and_a_mangled_mapping_are_read_or_refused(in_log in wounds(), in_mapping in wounds()) {
        let folder = shared_folder();
        std::fs::write(folder.join("mangled.toml"), mangle(MAPPING, &in_mapping)).unwrap();
        for (name, log) in [("mangled.csv", MAPPED_LOG), ("plain.csv", PLAIN_LOG)] {
            match read_bytes(folder, name, mangle(log, &in_log).as_bytes()) {
                Ok(recording) => prop_assert!(recording.rows() <= log.len() + 6 * 12),
                Err(problem) => prop_assert!(!problem.to_string().contains('\n'), "{problem}"),
            }
        }
    }

    #[test]
    fn any_csv_and_any_mapping_are_read_or_refused(
        csv in "(time_s|segment|a\\.motor_torque_nm|elbow_pos|q1|tau|deg|ms|[ ,;\t\n\"0-9.e-]|nan|inf|\\PC){0,60}",
        mapping in "(sample_rate_hz|columns|joint|time_s|motor_torque_nm|scale|[\\[\\]={}\"\n0-9.a]){0,20}",
    ) {
        let folder = shared_folder();
        std::fs::write(folder.join("mapped.toml"), mapping).unwrap();
        for name in ["alone.csv", "mapped.csv"] {
            if let Err(problem) = read_bytes(folder, name, csv.as_bytes()) {
                prop_assert!(!problem.to_string().contains('\n'), "{problem}");
            }
        }
        if let Err(problem) = read_guessed(&folder.join("alone.csv")) {
            prop_assert!(!problem.to_string().contains('\n'), "{problem}");
        }
    }
}
