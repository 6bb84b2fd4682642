//! Bags of ROS 1, whole, cut anywhere, without an index, and damaged.
#![allow(clippy::unwrap_used, reason = "a test may")]

use proptest::prelude::*;
use recording::{ReadProblem, Recording, Signal, read};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
const START_S: u32 = 1_700_000_000;
const MESSAGES: u32 = 60;

fn head(fields: &[(&str, &[u8])]) -> Vec<u8> {
    let mut head = Vec::new();
    for (name, value) in fields {
        head.extend(((name.len() + 1 + value.len()) as u32).to_le_bytes());
        head.extend(name.as_bytes());
        head.push(b'=');
        head.extend(*value);
    }
    head
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let head = head(fields);
    let lengths = [head.len() as u32, data.len() as u32].map(u32::to_le_bytes);
    [&lengths[0], &head[..], &lengths[1], data].concat()
}

fn connection(number: u32, topic: &str, kind: &str) -> Vec<u8> {
    let fields = [
        ("op", &[7][..]),
        ("conn", &number.to_le_bytes()),
        ("topic", topic.as_bytes()),
    ];
    let definition = "x".repeat(300);
    let said = [
        ("topic", topic.as_bytes()),
        ("type", kind.as_bytes()),
        ("message_definition", definition.as_bytes()),
    ];
    record(&fields, &head(&said))
}

fn message(number: u32, time: [u32; 2], data: &[u8]) -> Vec<u8> {
    let time = [time[0].to_le_bytes(), time[1].to_le_bytes()].concat();
    let fields = [
        ("op", &[2][..]),
        ("conn", &number.to_le_bytes()),
        ("time", &time),
    ];
    record(&fields, data)
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

fn numbers(numbers: &[f64]) -> Vec<u8> {
    let mut bytes = (numbers.len() as u32).to_le_bytes().to_vec();
    numbers
        .iter()
        .for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes
}

fn stamped(sequence: u32, nanoseconds: u32) -> Vec<u8> {
    let words = [sequence, START_S, nanoseconds]
        .map(u32::to_le_bytes)
        .concat();
    [words, text("base")].concat()
}

fn position_rad(index: u32) -> f64 {
    0.1 * f64::from(index)
}

fn joint_state(index: u32) -> Vec<u8> {
    let position = position_rad(index);
    [
        stamped(index, index * 4_000_000),
        2_u32.to_le_bytes().to_vec(),
        text("gripper"),
        text("elbow"),
        numbers(&[-1.0, position]),
        numbers(&[]),
        numbers(&[0.0, 10.0 * position]),
    ]
    .concat()
}

/// A `control_msgs/JointTrajectoryControllerState`.
fn controller_state(index: u32) -> Vec<u8> {
    let mut bytes = [
        stamped(index, index * 4_000_000),
        1_u32.to_le_bytes().to_vec(),
        text("elbow"),
    ]
    .concat();
    for position in [position_rad(index) + 0.5, position_rad(index), 0.5] {
        for values in [&[position][..], &[0.0], &[], &[]] {
            bytes.extend(numbers(values));
        }
        bytes.extend([0; 8]);
    }
    bytes
}

fn lz4(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
    encoder.write_all(bytes).unwrap();
    encoder.finish().0
}

fn bz2(bytes: &[u8]) -> Vec<u8> {
    let mut packed = Vec::new();
    bzip2::read::BzEncoder::new(bytes, bzip2::Compression::fast())
        .read_to_end(&mut packed)
        .unwrap();
    packed
}

type Pack = fn(&[u8]) -> Vec<u8>;
const PACKS: [(&str, Pack); 3] = [("none", <[u8]>::to_vec), ("bz2", bz2), ("lz4", lz4)];

fn chunk(compression: &str, size: usize, packed: &[u8]) -> Vec<u8> {
    let size = (size as u32).to_le_bytes();
    let fields = [
        ("op", &[5][..]),
        ("compression", compression.as_bytes()),
        ("size", &size),
    ];
    record(&fields, packed)
}

/// Without its head, in chunks of that many messages.
fn chunks(compression: &str, pack: Pack, in_each: u32) -> Vec<Vec<u8>> {
    let mut chunks = Vec::new();
    for start in (0..MESSAGES).step_by(in_each as usize) {
        let mut records = Vec::new();
        if start == 0 {
            records.extend(connection(0, "/joint_states", "sensor_msgs/JointState"));
            records.extend(connection(1, "/camera", "sensor_msgs/Image"));
            let kind = "control_msgs/JointTrajectoryControllerState";
            records.extend(connection(7, "/arm_controller/state", kind));
        }
        for index in start..(start + in_each).min(MESSAGES) {
            let received = [START_S, index * 4_000_000 + 1_000_000];
            records.extend(message(0, received, &joint_state(index)));
            records.extend(message(1, received, &[7; 3000]));
            records.extend(message(7, received, &controller_state(index)));
        }
        chunks.push(chunk(compression, records.len(), &pack(&records)));
        // Of the index, which stands behind each chunk.
        chunks.push(record(
            &[("op", &[4]), ("conn", &[0; 4]), ("ver", &[1, 0, 0, 0])],
            &[0; 36],
        ));
    }
    chunks
}

fn bag_head(index_pos: u64) -> Vec<u8> {
    let fields = [
        ("op", &[3][..]),
        ("index_pos", &index_pos.to_le_bytes()),
        ("conn_count", &[3, 0, 0, 0]),
    ];
    [MAGIC, &record(&fields, &[b' '; 4000])].concat()
}

fn whole(compression: &str, pack: Pack, in_each: u32) -> Vec<u8> {
    let chunks = chunks(compression, pack, in_each).concat();
    let index = connection(0, "/joint_states", "sensor_msgs/JointState");
    let place = bag_head(1).len() + chunks.len();
    [bag_head(place as u64), chunks, index].concat()
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join("log.bag");
        std::fs::write(&path, bytes).unwrap();
        path
    }

    fn read(&self, bytes: &[u8]) -> Recording {
        read(&self.write(bytes)).unwrap()
    }

    fn refusal(&self, bytes: &[u8]) -> ReadProblem {
        read(&self.write(bytes)).unwrap_err().problem
    }
}

#[test]
fn chunks_of_every_compression_are_read_by_the_headers_stamps() {
    let folder = Folder::new();
    for (compression, pack) in PACKS {
        let recording = folder.read(&whole(compression, pack, 7));
        assert!(!recording.truncated, "{compression}");
        assert_eq!(recording.rows(), MESSAGES as usize);
        assert_eq!(
            recording.metadata["start_unix_ns"],
            format!("{START_S}000000000")
        );
        let elbow = |signal| recording.signal("elbow", signal).unwrap();
        for index in 0..MESSAGES {
            let row = index as usize;
            assert_eq!(recording.time_s[row], f64::from(index * 4) / 1000.0);
            assert_eq!(elbow(Signal::LinkPositionRad)[row], position_rad(index));
            assert_eq!(
                elbow(Signal::JointTorqueNm)[row],
                10.0 * position_rad(index)
            );
            assert_eq!(
                elbow(Signal::ReferencePositionRad)[row],
                position_rad(index) + 0.5
            );
        }
        assert_eq!(
            recording
                .signal("gripper", Signal::LinkPositionRad)
                .unwrap()[3],
            -1.0
        );
    }
}

#[test]
fn a_bag_cut_anywhere_is_read_as_far_as_it_goes_and_says_so() {
    let folder = Folder::new();
    for (compression, pack) in PACKS {
        let bytes = whole(compression, pack, 7);
        let all = folder.read(&bytes);
        let index = connection(0, "/joint_states", "sensor_msgs/JointState").len();
        let mut rows_seen = 0;
        for length in (MAGIC.len()..bytes.len() - index).step_by(137) {
            match read(&folder.write(&bytes[..length])) {
                Ok(cut) => {
                    assert!(
                        cut.truncated || length >= bytes.len() - index,
                        "{compression} {length}"
                    );
                    assert_eq!(cut.time_s, all.time_s[..cut.rows()]);
                    assert!(cut.rows() >= rows_seen, "{compression} {length}");
                    rows_seen = cut.rows();
                }
                Err(error) => assert!(
                    matches!(
                        error.problem,
                        ReadProblem::NoJointStates { .. } | ReadProblem::SampleRateUnknown { .. }
                    ),
                    "{compression} {length}: {error}"
                ),
            }
        }
        // Of what is not packed, all messages but the last that was cut.
        assert!(
            rows_seen >= MESSAGES as usize - 8,
            "{compression} {rows_seen}"
        );
    }
}

#[test]
fn a_bag_whose_recorder_was_killed_has_no_index_and_a_chunk_in_pieces() {
    let folder = Folder::new();
    let chunks = chunks("none", <[u8]>::to_vec, 20);
    let mut bytes = bag_head(0);
    bytes.extend(chunks[..4].concat());
    // Its length is written when it is full: the messages stand behind it as if they were in none.
    bytes.extend(chunk("none", 0, &[]));
    bytes.extend(&chunks[4][chunk("none", 0, &[]).len()..]);
    bytes.extend(b"\x55\x00\x00\x00");
    let recording = folder.read(&bytes);
    assert!(recording.truncated);
    assert_eq!(recording.rows(), MESSAGES as usize);
    let mut wiped = bag_head(0);
    wiped.extend(chunks[..2].concat());
    wiped.extend([0; 5000]);
    let recording = folder.read(&wiped);
    assert_eq!((recording.rows(), recording.truncated), (20, true));
}

#[test]
fn damage_is_named_by_its_place() {
    let folder = Folder::new();
    let mut bytes = whole("bz2", bz2, 20);
    let at = bag_head(0).len();
    bytes[at + 200..at + 220].fill(0);
    let problem = folder.refusal(&bytes);
    assert!(
        matches!(problem, ReadProblem::Damaged { offset, .. } if offset == at as u64),
        "{problem}"
    );
    let bytes = [bag_head(1), chunk("zip", 10, &[0; 10])].concat();
    assert!(
        folder
            .refusal(&bytes)
            .to_string()
            .contains("compressed with `zip`; only bz2, lz4")
    );
    let bytes = [bag_head(1), chunk("lz4", 0, &lz4(&message(4, [0, 0], b"")))].concat();
    let unknown = [bag_head(1), message(4, [0, 0], b"")].concat();
    assert!(
        folder
            .refusal(&bytes)
            .to_string()
            .contains("without the state")
    );
    assert!(
        folder
            .refusal(&unknown)
            .to_string()
            .contains("unknown connection")
    );
    assert!(
        folder
            .refusal(b"#ROSBAG V1.2\n")
            .to_string()
            .contains("rosbag migrate")
    );
}

#[test]
fn chunks_that_stand_for_more_than_bags_hold_are_refused() {
    let folder = Folder::new();
    let zeros = bz2(&vec![0; 1 << 24]);
    for size in [1 << 29, 1 << 27] {
        let bytes = [bag_head(1), chunk("bz2", size, &zeros)].concat();
        let problem = folder.refusal(&bytes);
        assert!(
            matches!(problem, ReadProblem::UnpacksTooLarge { .. }),
            "{problem}"
        );
    }
    let told_small = [bag_head(1), chunk("bz2", 1 << 20, &zeros)].concat();
    assert!(
        folder
            .refusal(&told_small)
            .to_string()
            .contains("damaged at byte")
    );
}

fn damaged(
    path: &Path,
    mut bytes: Vec<u8>,
    damage: &[(f64, u8)],
) -> Result<Recording, ReadProblem> {
    for (place, byte) in damage {
        let place = (place * bytes.len() as f64) as usize;
        bytes[place] = *byte;
    }
    std::fs::write(path, bytes).unwrap();
    read(path).map_err(|error| error.problem)
}

proptest! {
    #[test]
    fn damage_is_read_or_refused(
        damage in prop::collection::vec((0.0..1.0, prop_oneof![any::<u8>(), Just(0), Just(0xff)]), 1..6),
    ) {
        static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());
        static WHOLE: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
            // No room for what no longer belongs to the file, so that damage reaches what matters.
            let small = |(compression, pack): (&str, Pack)| {
                let head = [MAGIC, &record(&[("op", &[3]), ("index_pos", &1_u64.to_le_bytes())], &[])].concat();
                [head, chunks(compression, pack, 30).concat()].concat()
            };
            PACKS.map(small).into()
        });
        for bytes in &*WHOLE {
            match damaged(&FOLDER.path().join("damaged.bag"), bytes.clone(), &damage) {
                Ok(recording) => prop_assert!(recording.rows() <= 2 * MESSAGES as usize),
                Err(problem) => prop_assert!(!problem.to_string().contains('\n'), "{problem}"),
            }
        }
    }
}
