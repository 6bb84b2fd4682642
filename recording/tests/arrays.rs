//! Logs whose columns belong to joints without names: NumPy's `.npz`, lists in Parquet, datasets of LeRobot.
#![allow(clippy::unwrap_used, reason = "a test may")]

use parquet::data_type::{FloatType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use proptest::prelude::*;
use recording::{GuessJoint, ReadProblem, Signal, guess, read, read_mapped};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use zip::write::SimpleFileOptions;

/// A file as `numpy.save` writes it.
fn npy(kind: &str, fortran: bool, shape: &str, bytes: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut head = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': ({shape}), }}");
    while !(10 + head.len() + 1).is_multiple_of(64) {
        head.push(' ');
    }
    head.push('\n');
    let length = (head.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\0", &length[..], head.as_bytes(), bytes].concat()
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

fn npz(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (index, (name, bytes)) in members.iter().enumerate() {
        // As `savez` and as `savez_compressed`.
        let method = match index % 2 {
            0 => zip::CompressionMethod::Stored,
            _ => zip::CompressionMethod::Deflated,
        };
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file(format!("{name}.npy"), options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn arrays() -> Vec<u8> {
    npz(&[
        (
            "time",
            npy("<f8", false, "3,", &doubles(&[0.0, 0.002, 0.004])),
        ),
        (
            "q",
            npy(
                "<f8",
                false,
                "3, 2",
                &doubles(&[0.0, 10.0, 1.0, 11.0, 2.0, 12.0]),
            ),
        ),
        (
            "qd",
            npy(
                "<f8",
                true,
                "3, 2",
                &doubles(&[0.0, 1.0, 2.0, 10.0, 11.0, 12.0]),
            ),
        ),
        (
            "tau",
            npy("<f4", false, "3, 2", &[0, 0, 0, 0, 0, 0, 128, 63].repeat(3)),
        ),
        ("images", npy("|u1", false, "1, 2, 2", &[0; 4])),
        (
            "q_des",
            npy("<i8", false, "3, 2", &[7, 0, 0, 0, 0, 0, 0, 0].repeat(6)),
        ),
    ])
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.file(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn refusal(&self, log: &Path) -> String {
        let refusal = read(log).unwrap_err().problem.to_string();
        refusal.replace(&format!("{}/", self.0.path().display()), "")
    }
}

/// Simulink may log a source of its own a few steps longer.
#[test]
fn an_array_of_another_length_is_said_to_be_there_with_its_length() {
    let vector = |values: usize| {
        let numbers: Vec<f64> = (0..values).map(|row| row as f64).collect();
        npy("<f8", false, &format!("{values},"), &doubles(&numbers))
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.npz");
    let mapping = folder.path().join("log.mapping.toml");
    let text = "[joint.elbow]\nlink_position_rad = 'angle'\ncommand_torque_nm = 'input'";
    std::fs::write(&mapping, text).unwrap();
    for (length, what_to_do) in [(51, "the last 11 of it"), (30, "the last 10 of the others")] {
        let members = [
            ("t", vector(40)),
            ("angle", vector(40)),
            ("inputDig", vector(40)),
            ("input", vector(length)),
        ];
        std::fs::write(&path, npz(&members)).unwrap();
        let refusal = read_mapped(&path, &mapping)
            .unwrap_err()
            .problem
            .to_string();
        let told = format!("has `input`, but with {length} values where the times");
        assert!(refusal.starts_with(&told), "{refusal}");
        assert!(
            refusal.contains("have 40, so `joint.elbow.command_torque_nm`"),
            "{refusal}"
        );
        assert!(refusal.contains(what_to_do), "{refusal}");
        let elbow = GuessJoint {
            name: "elbow".to_owned(),
            gear_ratio: 1.0,
            is_limited: false,
            has_rotor: false,
            slides: false,
        };
        let guess = guess(&path, &[elbow]).unwrap();
        let why = format!("it has {length} values where the times have 40");
        assert!(
            guess.left_out.contains(&("input".to_owned(), why)),
            "{:?}",
            guess.left_out
        );
    }
}

#[test]
fn arrays_of_numpy_need_one_line() {
    let folder = Folder::new();
    let log = folder.write("log.npz", arrays());
    assert_eq!(
        folder.refusal(&log),
        "`q` has 2 columns, one for each joint, and 0 names of joints are told; write the names into log.mapping.toml, \
         in this order: joints = [\"joint1\", \"joint2\"]"
    );
    folder.write("log.mapping.toml", "joints = ['shoulder', 'elbow']");
    let recording = read(&log).unwrap();
    assert_eq!(recording.time_s, [0.0, 0.002, 0.004]);
    assert_eq!(
        recording.joint_names().collect::<Vec<_>>(),
        ["shoulder", "elbow"]
    );
    let of_elbow = |signal| recording.signal("elbow", signal).unwrap();
    assert_eq!(of_elbow(Signal::LinkPositionRad), [10.0, 11.0, 12.0]);
    assert_eq!(of_elbow(Signal::LinkVelocityRadS), [10.0, 11.0, 12.0]);
    assert_eq!(of_elbow(Signal::JointTorqueNm), [1.0; 3]);
    assert_eq!(of_elbow(Signal::ReferencePositionRad), [7.0; 3]);
    folder.write("log.mapping.toml", "joints = ['shoulder']");
    assert!(
        folder
            .refusal(&log)
            .contains("and 1 names of joints are told")
    );
    let single = "[joint.elbow]\nmotor_torque_nm = { column = 'tau[1]', scale = 0.01 }\n";
    let mapped = read_mapped(&log, &folder.write("single.toml", single)).unwrap();
    assert_eq!(
        mapped.signal("elbow", Signal::MotorTorqueNm).unwrap(),
        [0.01; 3]
    );
}

#[test]
fn arrays_that_do_not_fit_are_refused_in_words() {
    let folder = Folder::new();
    let short = npz(&[
        ("time", npy("<f8", false, "20,", &doubles(&[0.0; 20]))),
        ("q", npy("<f8", false, "21,", &doubles(&[0.0; 21]))),
    ]);
    let refusal = folder.refusal(&folder.write("short.npz", short));
    assert_eq!(refusal, "`q` has 21 rows, but `time` 20; make them as long");
    let cut = npz(&[("q", npy("<f8", false, "3,", &doubles(&[0.0; 2])))]);
    assert!(
        folder
            .refusal(&folder.write("cut.npz", cut))
            .contains("cannot be read")
    );
    let bomb = npz(&[("q", npy("<f8", false, "9000000000, 2", &[]))]);
    assert!(
        folder
            .refusal(&folder.write("bomb.npz", bomb))
            .contains("at most")
    );
    let head = [
        b"\x93NUMPY\x02\0",
        &(1_u32 << 31).to_le_bytes()[..],
        &[b' '; 1 << 20],
    ]
    .concat();
    let refusal = folder.refusal(&folder.write("head.npz", npz(&[("q", head)])));
    assert!(refusal.contains("description"), "{refusal}");
}

/// A dataset's episodes: `timestamp`, `episode_index` and lists of `state` and `action`; the parser of schemas takes no names with a point.
fn write_episodes(path: &Path, episodes: &[i64], rows: i64) {
    let schema = "message schema { required float timestamp; required int64 episode_index;
        optional group state (LIST) { repeated group list { optional float element; } }
        optional group action (LIST) { repeated group list { optional float element; } } }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer =
        SerializedFileWriter::new(File::create(path).unwrap(), schema, properties).unwrap();
    for episode in episodes {
        let mut group = writer.next_row_group().unwrap();
        let stamps: Vec<f32> = (0..rows).map(|row| row as f32 * 0.02).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column
            .typed::<FloatType>()
            .write_batch(&stamps, None, None)
            .unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let index = vec![*episode; rows as usize];
        column
            .typed::<Int64Type>()
            .write_batch(&index, None, None)
            .unwrap();
        column.close().unwrap();
        for offset in [0.0, 0.5] {
            let values: Vec<f32> = (0..2 * rows).map(|entry| entry as f32 + offset).collect();
            let defined = vec![3; values.len()];
            let repeated: Vec<i16> = (0..2 * rows).map(|entry| (entry % 2) as i16).collect();
            let mut column = group.next_column().unwrap().unwrap();
            let batch = column.typed::<FloatType>();
            batch
                .write_batch(&values, Some(&defined), Some(&repeated))
                .unwrap();
            column.close().unwrap();
        }
        group.close().unwrap();
    }
    writer.close().unwrap();
}

#[test]
fn an_episode_asks_for_its_joints_once_and_a_dataset_knows_them() {
    let folder = Folder::new();
    let episode = folder.file("set/data/chunk-000/episode_000000.parquet");
    write_episodes(&episode, &[0], 4);
    assert!(
        folder
            .refusal(&episode)
            .contains("joints = [\"joint1\", \"joint2\"]")
    );
    write_episodes(
        &folder.file("set/data/chunk-000/episode_000001.parquet"),
        &[1],
        3,
    );
    let info =
        r#"{"fps": 50, "features": {"observation.state": {"names": ["pan.pos", "lift.pos"]}}}"#;
    folder.write("set/meta/info.json", info);
    let alone = read(&episode).unwrap();
    assert_eq!(alone.time_s, [0.0, 0.02, 0.04, 0.06]);
    assert_eq!(
        alone.signal("lift", Signal::ReferencePositionRad).unwrap(),
        [1.5, 3.5, 5.5, 7.5]
    );
    let all = read(&folder.file("set")).unwrap();
    assert_eq!((all.rows(), all.segments()), (7, vec![0..4, 4..7]));
    assert_eq!(
        all.signal("pan", Signal::LinkPositionRad).unwrap()[..4],
        [0.0, 2.0, 4.0, 6.0]
    );
    // Version 3 puts several episodes into one file, and names into lists of their own.
    let third = folder.file("third/data/chunk-000/file-000.parquet");
    write_episodes(&third, &[0, 1], 4);
    folder.write(
        "third/meta/info.json",
        r#"{"features": {"observation.state": {"names": {"motors": ["pan", "lift"]}}}}"#,
    );
    assert_eq!(
        read(&folder.file("third")).unwrap().segments(),
        [0..4, 4..8]
    );
    folder.write("third/meta/info.json", "{");
    assert!(
        folder
            .refusal(&folder.file("third"))
            .contains("is not JSON")
    );
}

fn damaged(mut bytes: Vec<u8>, damage: &[(f64, u8)], length: f64) -> Vec<u8> {
    for (place, byte) in damage {
        let place = (place * bytes.len() as f64) as usize;
        bytes[place] = *byte;
    }
    bytes.truncate((length * bytes.len() as f64) as usize);
    bytes
}

proptest! {
    #[test]
    fn damage_is_read_or_refused(
        damage in prop::collection::vec((0.0..1.0, any::<u8>()), 0..6),
        length in prop_oneof![Just(1.0), 0.0..1.0],
    ) {
        static FOLDER: LazyLock<Folder> = LazyLock::new(|| {
            let folder = Folder::new();
            folder.write("damaged.mapping.toml", "joints = ['a', 'b']");
            write_episodes(&folder.file("whole.parquet"), &[0, 1], 20);
            folder
        });
        let episode = std::fs::read(FOLDER.file("whole.parquet")).unwrap();
        for (name, bytes) in [("damaged.npz", arrays()), ("damaged.parquet", episode)] {
            let log = FOLDER.write(name, damaged(bytes, &damage, length));
            match read(&log).map_err(|error| error.problem) {
                Ok(recording) => prop_assert!(recording.rows() <= 100),
                Err(ReadProblem::Io(_)) => {}
                Err(problem) => prop_assert!(!problem.to_string().contains('\n'), "{problem}"),
            }
        }
    }
}
