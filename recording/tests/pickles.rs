//! Logs that Python programs save as pickles, and with `torch.save`. `write_pickles.py` wrote those in `data`.
#![allow(clippy::unwrap_used, reason = "a test may")]

use proptest::prelude::*;
use recording::{ReadProblem, Recording, Signal, read, read_mapped};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use zip::write::SimpleFileOptions;

const ROWS: usize = 40;
const PICKLES: [&str; 4] = ["arrays_2.pkl", "arrays_4.pkl", "arrays_5.pkl", "rows.pkl"];

fn data(name: &str) -> PathBuf {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");
    Path::new(folder).join(name)
}

/// With the names of two joints.
fn read_with_joints(name: &str) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let mapping = folder.path().join("joints.toml");
    std::fs::write(&mapping, "joints = ['hip', 'knee']").unwrap();
    read_mapped(&data(name), &mapping).unwrap()
}

fn time_s(row: usize) -> f64 {
    row as f64 * 0.004
}

fn assert_angles(recording: &Recording, signal: Signal, rounded: impl Fn(f64) -> f64) {
    assert_eq!(recording.rows(), ROWS);
    for (joint, angle) in [("hip", f64::sin as fn(f64) -> f64), ("knee", f64::cos)] {
        let read = recording.signal(joint, signal).unwrap();
        for (row, value) in read.iter().enumerate() {
            let written = rounded(angle(time_s(row)));
            assert!(
                (value - written).abs() < 1e-15,
                "{joint}, row {row}: {value}"
            );
        }
    }
}

fn assert_counts(recording: &Recording, signal: Signal) {
    for (index, joint) in ["hip", "knee"].into_iter().enumerate() {
        let expected: Vec<f64> = (0..ROWS).map(|row| (2 * row + index) as f64).collect();
        assert_eq!(recording.signal(joint, signal).unwrap(), expected);
    }
}

fn single(value: f64) -> f64 {
    f64::from(value as f32)
}

#[test]
fn arrays_of_every_protocol_are_read_in_both_orders_of_bytes_and_of_columns() {
    for name in &PICKLES[..3] {
        let recording = read_with_joints(name);
        assert_angles(&recording, Signal::LinkPositionRad, |value| value);
        assert_angles(&recording, Signal::LinkVelocityRadS, single);
        assert_counts(&recording, Signal::ReferencePositionRad);
        assert_eq!(recording.time_s[ROWS - 1], time_s(ROWS - 1));
    }
}

#[test]
fn a_dictionary_for_each_row_is_a_table() {
    let recording = read_with_joints("rows.pkl");
    assert_angles(&recording, Signal::LinkPositionRad, |value| value);
    assert_counts(&recording, Signal::JointTorqueNm);
}

#[test]
fn tensors_are_read_with_their_strides() {
    let recording = read_with_joints("log.pt");
    assert_angles(&recording, Signal::LinkPositionRad, single);
    assert_counts(&recording, Signal::ReferencePositionRad);
    assert!((recording.time_s[ROWS - 1] - time_s(ROWS - 1)).abs() < 1e-7);
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path).unwrap_err().problem.to_string()
}

#[test]
fn what_is_no_log_is_refused_with_what_to_do() {
    for (bytes, expected) in [
        (&b"\x80\x02N."[..], "no arrays"),
        (
            b"\x80\x04\x8c\x11pandas.core.frame\x8c\x09DataFrame\x93)R.",
            "`to_parquet`",
        ),
        // the number that PyTorch's files began with before they were ZIP files
        (
            b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.",
            "save it again",
        ),
        (b"\x80\x04\x95", "byte 2: it ends before its last value"),
        (b"\x80\x04a.", "byte 2: a value is missing"),
        (b"\x80\x05\x97.", "code 0x97"),
    ] {
        let refusal = refusal("log.pkl", bytes);
        assert!(refusal.contains(expected), "{refusal}");
    }
}

#[test]
fn what_is_held_twice_sixty_times_over_is_not_followed() {
    // in pairs, and under two keys: 2^60 numbers
    for (start, twice) in [
        (&b"K\x01"[..], &b"2\x86"[..]),
        (b"K\x01", b"q\x00}(K\x00h\x00K\x01h\x00u"),
    ] {
        let bytes = [b"\x80\x04", start, &twice.repeat(60), b"."].concat();
        let refusal = refusal("log.pkl", &bytes);
        assert!(
            refusal.starts_with("is a Python pickle that cannot be read"),
            "{refusal}"
        );
    }
}

#[test]
fn a_tensor_beyond_its_numbers_is_refused() {
    let mut whole = zip::ZipArchive::new(std::fs::File::open(data("log.pt")).unwrap()).unwrap();
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for index in 0..whole.len() {
        let mut member = whole.by_index(index).unwrap();
        let name = member.name().unwrap().into_owned();
        let mut bytes = Vec::new();
        member.read_to_end(&mut bytes).unwrap();
        // the axes of forty rows, whose code is `K`
        if name.ends_with("data.pkl") {
            for at in 1..bytes.len() {
                if bytes[at - 1..=at] == *b"K(" {
                    bytes[at] = 200;
                }
            }
        }
        zip.start_file(name, SimpleFileOptions::default()).unwrap();
        zip.write_all(&bytes).unwrap();
    }
    let refusal = refusal("log.pt", &zip.finish().unwrap().into_inner());
    assert!(refusal.contains("reaches beyond its numbers"), "{refusal}");
}

/// A file with some bytes changed, and cut.
fn damaged(mut bytes: Vec<u8>, damage: &[(f64, u8)], length: f64) -> Vec<u8> {
    for (place, byte) in damage {
        let place = (place * bytes.len() as f64) as usize;
        bytes[place] = *byte;
    }
    bytes.truncate((length * bytes.len() as f64) as usize);
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_time: 10_000, ..ProptestConfig::default() })]
    #[test]
    fn damage_is_read_or_refused(
        damage in prop::collection::vec((0.0..1.0, any::<u8>()), 0..6),
        length in prop_oneof![Just(1.0), 0.0..1.0],
    ) {
        static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join("log.mapping.toml"), "joints = ['a', 'b']").unwrap();
            folder
        });
        for name in PICKLES.into_iter().chain(["log.pt"]) {
            let extension = name.rsplit('.').next().unwrap();
            let path = FOLDER.path().join(format!("log.{extension}"));
            let whole = std::fs::read(data(name)).unwrap();
            std::fs::write(&path, damaged(whole, &damage, length)).unwrap();
            match read(&path).map_err(|error| error.problem) {
                Ok(recording) => prop_assert!(recording.rows() <= 400),
                Err(ReadProblem::Io(_)) => {}
                Err(problem) => prop_assert!(!problem.to_string().contains('\n'), "{problem}"),
            }
        }
    }
}
