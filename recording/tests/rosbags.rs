//! Bags of ROS: joint states of any order and number, in every kind of file that they come in.
#![allow(clippy::unwrap_used, reason = "a test may")]

use proptest::prelude::*;
use recording::{ReadProblem, Recording, Signal, read, read_mapped};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

const START_NS: i64 = 1_700_000_000_000_000_000;

/// Values as CDR writes them: little end first, aligned to their size after a head of four bytes.
struct Cdr(Vec<u8>);

impl Cdr {
    fn stamped(stamp_ns: i64) -> Self {
        let mut cdr = Self(vec![0, 1, 0, 0]);
        cdr.u32((stamp_ns / 1_000_000_000) as u32);
        cdr.u32((stamp_ns % 1_000_000_000) as u32);
        cdr.text("base");
        cdr
    }

    fn align(&mut self, size: usize) {
        while !(self.0.len() - 4).is_multiple_of(size) {
            self.0.push(0);
        }
    }

    fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    fn texts(&mut self, texts: &[&str]) {
        self.u32(texts.len() as u32);
        texts.iter().for_each(|text| self.text(text));
    }

    fn numbers(&mut self, numbers: &[f64]) {
        self.u32(numbers.len() as u32);
        for number in numbers {
            self.align(8);
            self.0.extend(number.to_le_bytes());
        }
    }
}

struct Message {
    topic: &'static str,
    kind: &'static str,
    received_ns: i64,
    bytes: Vec<u8>,
}

fn angle_rad(stamp_ns: i64) -> f64 {
    (stamp_ns - START_NS) as f64 * 1e-9
}

fn joint_state(stamp_ns: i64, names: &[&str], value: impl Fn(&str) -> f64) -> Message {
    let mut cdr = Cdr::stamped(stamp_ns);
    let values: Vec<f64> = names.iter().map(|name| value(name)).collect();
    cdr.texts(names);
    cdr.numbers(&values);
    cdr.numbers(&[]);
    cdr.numbers(&values.iter().map(|value| 10.0 * value).collect::<Vec<_>>());
    Message {
        topic: "/joint_states",
        kind: "sensor_msgs/msg/JointState",
        // The network is slow, and not always as slow.
        received_ns: stamp_ns + 3_000_000 + stamp_ns % 7_919,
        bytes: cdr.0,
    }
}

fn controller_state(stamp_ns: i64) -> Message {
    let mut cdr = Cdr::stamped(stamp_ns);
    cdr.texts(&["elbow"]);
    for value in [angle_rad(stamp_ns) + 0.5, angle_rad(stamp_ns)] {
        [&[value][..], &[1.0], &[], &[]]
            .iter()
            .for_each(|numbers| cdr.numbers(numbers));
        cdr.u32(0);
        cdr.u32(0);
    }
    Message {
        topic: "/arm_controller/state",
        kind: "control_msgs/msg/JointTrajectoryControllerState",
        received_ns: stamp_ns,
        bytes: cdr.0,
    }
}

/// Joint states at 500 Hz, the controller's at 100 Hz, and pictures that nobody reads.
fn messages() -> Vec<Message> {
    let mut messages = Vec::new();
    for row in 0..50_i64 {
        let stamp_ns = START_NS + row * 2_000_000;
        let value = |name: &str| match name {
            "elbow" => angle_rad(stamp_ns),
            _ => -1.0,
        };
        messages.push(joint_state(stamp_ns, &["gripper", "elbow"], value));
        if row % 5 == 0 {
            messages.push(controller_state(stamp_ns));
            messages.push(Message {
                topic: "/camera",
                kind: "sensor_msgs/msg/Image",
                received_ns: stamp_ns,
                bytes: vec![0; 1000],
            });
        }
    }
    messages
}

fn write_mcap(path: &Path, messages: &[Message]) {
    let mut writer = mcap::WriteOptions::new()
        .chunk_size(Some(2048))
        .create(std::io::BufWriter::new(
            std::fs::File::create(path).unwrap(),
        ))
        .unwrap();
    let mut channels = BTreeMap::new();
    for message in messages {
        let channel = *channels.entry(message.topic).or_insert_with(|| {
            let schema = writer.add_schema(message.kind, "ros2msg", b"").unwrap();
            writer
                .add_channel(schema, message.topic, "cdr", &BTreeMap::new())
                .unwrap()
        });
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: message.received_ns as u64,
            publish_time: message.received_ns as u64,
        };
        writer
            .write_to_known_channel(&header, &message.bytes)
            .unwrap();
    }
    writer.finish().unwrap();
}

fn write_sqlite(path: &Path, messages: &[Message], pack: fn(&[u8]) -> Cow<'_, [u8]>) {
    let database = rusqlite::Connection::open(path).unwrap();
    let tables = "PRAGMA synchronous = OFF;
        CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, \
            serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, \
            data BLOB NOT NULL);
        BEGIN;";
    database.execute_batch(tables).unwrap();
    let mut topics: Vec<&str> = Vec::new();
    for message in messages {
        if !topics.contains(&message.topic) {
            topics.push(message.topic);
            let sql = "INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')";
            database
                .execute(sql, (topics.len() as i64, message.topic, message.kind))
                .unwrap();
        }
        let topic = topics
            .iter()
            .position(|topic| *topic == message.topic)
            .unwrap()
            + 1;
        let sql = "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)";
        database
            .execute(
                sql,
                (topic as i64, message.received_ns, pack(&message.bytes)),
            )
            .unwrap();
    }
    database.execute_batch("COMMIT;").unwrap();
}

fn plain(bytes: &[u8]) -> Cow<'_, [u8]> {
    Cow::Borrowed(bytes)
}

fn packed(bytes: &[u8]) -> Cow<'_, [u8]> {
    Cow::Owned(zstd::encode_all(bytes, 1).unwrap())
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn mcap(&self, messages: &[Message]) -> PathBuf {
        let path = self.file("bag.mcap");
        write_mcap(&path, messages);
        path
    }

    fn refusal(&self, messages: &[Message]) -> String {
        read(&self.mcap(messages)).unwrap_err().problem.to_string()
    }
}

#[test]
fn joints_are_known_by_name_times_are_the_headers_and_topics_meet_at_the_fastest() {
    let folder = Folder::new();
    let recording = read(&folder.mcap(&messages())).unwrap();
    assert_eq!(recording.rows(), 50);
    assert_eq!(recording.time_s[0], 0.0);
    assert!((recording.time_s[49] - 0.098).abs() < 1e-12);
    assert_eq!(recording.metadata["start_unix_ns"], START_NS.to_string());
    assert!((recording.sample_rate_hz - 500.0).abs() < 1e-6);
    let of_elbow = |signal| recording.signal("elbow", signal).unwrap();
    assert_eq!(
        of_elbow(Signal::LinkPositionRad)[3],
        angle_rad(START_NS + 6_000_000)
    );
    assert_eq!(
        of_elbow(Signal::JointTorqueNm)[3],
        10.0 * angle_rad(START_NS + 6_000_000)
    );
    // Between two messages of the controller.
    assert!((of_elbow(Signal::ReferencePositionRad)[3] - 0.506).abs() < 1e-12);
    // It was not heard of again.
    assert!(of_elbow(Signal::ReferencePositionRad)[49].is_nan());
    assert_eq!(
        recording
            .signal("gripper", Signal::LinkPositionRad)
            .unwrap()[7],
        -1.0
    );
    assert!(
        recording
            .signal("gripper", Signal::LinkVelocityRadS)
            .is_err()
    );
    let notes = &recording.metadata;
    assert!(
        notes["rows_of"].starts_with("/joint_states, 50 messages at 500"),
        "{notes:?}"
    );
    assert!(
        notes["brought_to_these_rows"].starts_with("/arm_controller/state, 10 messages"),
        "{notes:?}"
    );
    assert!(notes["effort"].contains("joint_torque_nm"), "{notes:?}");
}

#[test]
fn every_kind_of_bag_is_the_same_recording() {
    let folder = Folder::new();
    let messages = messages();
    let whole = folder.mcap(&messages);
    let expected = read(&whole).unwrap();
    let same = |path: &Path| {
        let recording = read(path).unwrap();
        assert!(recording.same_table(&expected), "{}", path.display());
    };
    let sqlite = folder.file("bag.db3");
    write_sqlite(&sqlite, &messages, plain);
    same(&sqlite);
    let by_message = folder.file("by_message.db3");
    write_sqlite(&by_message, &messages, packed);
    same(&by_message);
    for (part, name) in [(&whole, "bag.mcap.zstd"), (&sqlite, "bag.db3.zstd")] {
        std::fs::write(folder.file(name), packed(&std::fs::read(part).unwrap())).unwrap();
        same(&folder.file(name));
    }
    // Split in the middle, the second part after the first in number, not in letters.
    let split = folder.file("split");
    std::fs::create_dir(&split).unwrap();
    std::fs::write(
        split.join("metadata.yaml"),
        "rosbag2_bagfile_information:\n",
    )
    .unwrap();
    write_mcap(&split.join("split_9.mcap"), &messages[..30]);
    write_mcap(&split.join("split_10.mcap"), &messages[30..]);
    same(&split);
    let database = split.join("split_10.db3");
    write_sqlite(&database, &messages[30..], plain);
    std::fs::write(
        split.join("split_10.db3.zstd"),
        packed(&std::fs::read(&database).unwrap()),
    )
    .unwrap();
    std::fs::remove_file(database).unwrap();
    std::fs::remove_file(split.join("split_10.mcap")).unwrap();
    same(&split);
}

#[test]
fn a_mapping_says_that_an_effort_is_the_motors() {
    let folder = Folder::new();
    let bag = folder.mcap(&messages());
    let mapping = folder.file("map.toml");
    let text =
        "[joint.elbow]\nmotor_torque_nm = { column = '/joint_states/elbow/effort', scale = 0.01 }";
    std::fs::write(&mapping, text).unwrap();
    let recording = read_mapped(&bag, &mapping).unwrap();
    assert!((recording.signal("elbow", Signal::MotorTorqueNm).unwrap()[1] - 0.000_2).abs() < 1e-15);
    assert!(recording.signal("elbow", Signal::JointTorqueNm).is_err());
    assert!(recording.signal("elbow", Signal::LinkPositionRad).is_ok());
    std::fs::write(
        &mapping,
        "[joint.elbow]\nmotor_torque_nm = '/joint_states/elbow/efort'",
    )
    .unwrap();
    let refusal = read_mapped(&bag, &mapping).unwrap_err().to_string();
    assert!(
        refusal.contains("did you mean `/joint_states/elbow/effort`?"),
        "{refusal}"
    );
}

#[test]
fn messages_out_of_order_and_without_a_stamp_are_put_where_they_belong_and_said() {
    let folder = Folder::new();
    let mut shuffled = messages();
    shuffled.swap(0, 20);
    let recording = read(&folder.mcap(&shuffled)).unwrap();
    assert!(recording.same_table(&read(&folder.mcap(&messages())).unwrap()));
    assert_eq!(recording.metadata["sorted_by_stamp"], "/joint_states");
    let unstamped: Vec<Message> = (0..5)
        .map(|row| Message {
            received_ns: START_NS + row * 4_000_000,
            ..joint_state(0, &["elbow"], |_| row as f64)
        })
        .collect();
    let recording = read(&folder.mcap(&unstamped)).unwrap();
    assert_eq!(
        recording.metadata["messages_without_a_stamp_timed_by_receipt"],
        "5"
    );
    assert!((recording.sample_rate_hz - 250.0).abs() < 1e-6);
}

#[test]
fn what_is_no_bag_of_joints_is_refused_in_words() {
    let folder = Folder::new();
    let pictures: Vec<Message> = messages()
        .into_iter()
        .filter(|message| message.topic == "/camera")
        .collect();
    assert!(
        folder
            .refusal(&pictures)
            .contains("`/camera (sensor_msgs/msg/Image)`")
    );
    let mut broken = messages();
    broken.truncate(1);
    broken[0].bytes.truncate(30);
    let refusal = folder.refusal(&broken);
    assert!(
        refusal.contains("; 1 messages of these types could not be decoded"),
        "{refusal}"
    );
    let path = folder.file("pictures.db3");
    write_sqlite(&path, &pictures, plain);
    let refusal = read(&path).unwrap_err().problem.to_string();
    assert!(
        refusal.contains("without the state of any joint"),
        "{refusal}"
    );
    let other = folder.file("other.db3");
    rusqlite::Connection::open(&other)
        .unwrap()
        .execute_batch("CREATE TABLE notes(text TEXT)")
        .unwrap();
    assert!(matches!(
        read(&other).unwrap_err().problem,
        ReadProblem::NotABag
    ));
    std::fs::create_dir(folder.file("empty")).unwrap();
    assert!(matches!(
        read(&folder.file("empty")).unwrap_err().problem,
        ReadProblem::UnknownFolder
    ));
}

#[test]
fn small_files_that_stand_for_large_ones_are_refused() {
    let folder = Folder::new();
    let bomb = zstd::encode_all(std::io::repeat(0).take(1 << 28), 1).unwrap();
    std::fs::write(folder.file("bomb.db3.zstd"), &bomb).unwrap();
    let refusal = read(&folder.file("bomb.db3.zstd")).unwrap_err().to_string();
    assert!(refusal.contains("unpacks to more than"), "{refusal}");
    std::fs::write(folder.file("twice.csv.zst"), packed(&packed(b"time_s"))).unwrap();
    let refusal = read(&folder.file("twice.csv.zst")).unwrap_err().to_string();
    assert!(refusal.contains("compressed twice"), "{refusal}");
    let message = Message {
        bytes: zstd::encode_all(std::io::repeat(0).take(1 << 25), 1).unwrap(),
        ..joint_state(START_NS, &["elbow"], |_| 0.0)
    };
    write_sqlite(&folder.file("message.db3"), &[message], plain);
    let refusal = read(&folder.file("message.db3")).unwrap_err().to_string();
    assert!(refusal.contains("unpacks to more than"), "{refusal}");
}

#[test]
fn a_bag_that_was_cut_short_is_read_as_far_as_it_goes() {
    let folder = Folder::new();
    let whole = std::fs::read(folder.mcap(&messages())).unwrap();
    let cut = folder.file("cut.mcap");
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let recording = read(&cut).unwrap();
    assert!(
        recording.truncated && (5..45).contains(&recording.rows()),
        "{}",
        recording.rows()
    );
    let path = folder.file("bag.db3");
    write_sqlite(&path, &messages(), plain);
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(folder.file("cut.db3"), &whole[..whole.len() * 3 / 4]).unwrap();
    let recording = read(&folder.file("cut.db3")).unwrap();
    assert!(
        recording.truncated && (5..50).contains(&recording.rows()),
        "{}",
        recording.rows()
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

fn read_bytes(name: &str, bytes: &[u8]) -> Result<Recording, ReadProblem> {
    static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());
    let path = FOLDER.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path).map_err(|error| error.problem)
}

proptest! {
    #[test]
    fn damage_is_read_or_refused(
        damage in prop::collection::vec((0.0..1.0, any::<u8>()), 0..6),
        length in prop_oneof![Just(1.0), 0.0..1.0],
    ) {
        static WHOLE: LazyLock<[(&str, Vec<u8>); 3]> = LazyLock::new(|| {
            let folder = Folder::new();
            let mcap = std::fs::read(folder.mcap(&messages())).unwrap();
            write_sqlite(&folder.file("bag.db3"), &messages(), plain);
            let sqlite = std::fs::read(folder.file("bag.db3")).unwrap();
            let packed = packed(&mcap).into_owned();
            [("damaged.mcap", mcap), ("damaged.db3", sqlite), ("damaged.mcap.zstd", packed)]
        });
        for (name, bytes) in &*WHOLE {
            match read_bytes(name, &damaged(bytes.clone(), &damage, length)) {
                Ok(recording) => prop_assert!(recording.rows() <= 2 * 50),
                Err(problem) => prop_assert!(!problem.to_string().contains('\n'), "{problem}"),
            }
        }
    }
}
