//! The recorder's end: rows appended to an MCAP file while the robot runs.

use crate::message::{CycleRow, Described, JointCycle, JointTruth, LoopCycle};
use crate::{JOINTS_MAX, WriteError};
use mcap::records::MessageHeader;
use mcap::write::{Metadata, NoSeek};
use mcap::{Compression, McapError, WriteOptions};
use prost::Message;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// The MCAP metadata record that describes the run.
pub(crate) const METADATA: &str = "flexspline";
/// Its key of the joints' names, separated by commas.
pub(crate) const METADATA_JOINTS: &str = "joints";
/// Its key of the planned rate.
pub(crate) const METADATA_RATE: &str = "sample_rate_hz";
/// The topic of [`LoopCycle`].
pub(crate) const LOOP_TOPIC: &str = "/loop";
/// A joint's topic is its name after this.
pub(crate) const JOINT_PREFIX: &str = "/";
/// The topic of a joint's truth is its name after this.
pub(crate) const TRUTH_PREFIX: &str = "/truth/";

/// A recorder that is killed loses at most the rows since its last chunk ended.
const CHUNK_NS: u64 = 1_000_000_000;
/// Ends a chunk earlier where many joints are recorded: readers hold a whole chunk in memory.
const CHUNK_BYTES: usize = 8 * 1024 * 1024;

/// What a recording says before its first row.
#[derive(Clone, Debug)]
pub struct Header {
    /// The robot file's names, in its order.
    pub joint_names: Vec<String>,
    /// The planned rate of the rows.
    pub sample_rate_hz: f64,
    /// About the run: robot, mode, trajectory, seed, version. The keys `joints` and `sample_rate_hz` are set from
    /// the fields above.
    pub metadata: BTreeMap<String, String>,
}

/// Writes one MCAP file. Equal input makes equal bytes.
///
/// Channels: `/JOINT` of [`JointCycle`] per joint; `/loop` of [`LoopCycle`] and `/truth/JOINT` of [`JointTruth`]
/// from the first row that has them.
pub struct Writer {
    path: PathBuf,
    mcap: mcap::Writer<NoSeek<BufWriter<File>>>,
    joint_names: Vec<String>,
    joint_channels: Vec<u16>,
    truth_channels: Vec<u16>,
    loop_channel: Option<u16>,
    /// One message, encoded; reused.
    encoded: Vec<u8>,
    chunk: Option<Chunk>,
    last_row: Option<LastRow>,
}

/// The rows that the file does not hold yet.
struct Chunk {
    began_ns: u64,
    bytes: usize,
}

#[derive(Clone, Copy)]
struct LastRow {
    time_ns: u64,
    segment: Option<i64>,
}

impl Writer {
    /// Creates the file, or empties it, and writes the description of the run.
    ///
    /// # Errors
    /// If a joint's name cannot be a topic, the rate is not positive or the file cannot be written.
    pub fn create(path: &Path, header: &Header) -> Result<Self, WriteError> {
        check_joint_names(&header.joint_names)?;
        let sample_rate_hz = header.sample_rate_hz;
        if !(sample_rate_hz > 0.0 && sample_rate_hz.is_finite()) {
            return Err(WriteError::SampleRate { sample_rate_hz });
        }
        let file = File::create(path).map_err(|cause| WriteError::Io {
            path: path.to_owned(),
            cause,
        })?;
        let (mcap, joint_channels) = begin(file, header).map_err(|cause| failure(path, cause))?;
        Ok(Self {
            path: path.to_owned(),
            mcap,
            joint_names: header.joint_names.clone(),
            joint_channels,
            truth_channels: Vec::new(),
            loop_channel: None,
            encoded: Vec::new(),
            chunk: None,
            last_row: None,
        })
    }

    /// Appends one row. Once per second of recorded time this ends a chunk, which takes milliseconds.
    ///
    /// # Errors
    /// If the row is of another robot or from before the last one of its segment: then nothing of it is written
    /// and the next row may follow. If the file cannot be written: then the recording has ended.
    pub fn write_cycle(&mut self, row: &CycleRow<'_>) -> Result<(), WriteError> {
        self.check(row)?;
        if self
            .chunk
            .as_ref()
            .is_some_and(|chunk| chunk.is_due(row.time_ns))
        {
            self.flush()?;
        }
        self.append(row).map_err(|cause| failure(&self.path, cause))
    }

    /// Ends the chunk and hands all bytes to the operating system: a reader finds every row written so far, even
    /// if this process is killed now.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        if self.chunk.take().is_some() {
            self.mcap
                .flush()
                .map_err(|cause| failure(&self.path, cause))?;
        }
        Ok(())
    }

    /// Writes what is left, and the summary that lets viewers jump.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.mcap
            .finish()
            .map_err(|cause| failure(&self.path, cause))?;
        Ok(())
    }

    fn check(&mut self, row: &CycleRow<'_>) -> Result<(), WriteError> {
        let expected = self.joint_channels.len();
        for given in [row.joints.len(), row.truth.map_or(expected, <[_]>::len)] {
            if given != expected {
                return Err(WriteError::JointCount {
                    cycle: row.cycle,
                    given,
                    expected,
                });
            }
        }
        let segment = row.joints.iter().find_map(|joint| joint.segment);
        if let Some(last) = self.last_row
            && row.time_ns < last.time_ns
            && segment == last.segment
        {
            let previous_ns = last.time_ns;
            return Err(WriteError::TimeBackwards {
                cycle: row.cycle,
                time_ns: row.time_ns,
                previous_ns,
            });
        }
        self.last_row = Some(LastRow {
            time_ns: row.time_ns,
            segment,
        });
        Ok(())
    }

    fn append(&mut self, row: &CycleRow<'_>) -> Result<(), McapError> {
        self.chunk.get_or_insert(Chunk {
            began_ns: row.time_ns,
            bytes: 0,
        });
        if let Some(loop_cycle) = row.loop_cycle {
            let channel = self.loop_channel()?;
            self.append_message(row, channel, loop_cycle)?;
        }
        for (index, joint) in row.joints.iter().enumerate() {
            self.append_message(row, self.joint_channels[index], joint)?;
        }
        if let Some(truth) = row.truth {
            self.add_truth_channels()?;
            for (index, joint) in truth.iter().enumerate() {
                self.append_message(row, self.truth_channels[index], joint)?;
            }
        }
        Ok(())
    }

    fn append_message(
        &mut self,
        row: &CycleRow<'_>,
        channel_id: u16,
        message: &impl Message,
    ) -> Result<(), McapError> {
        self.encoded.clear();
        message
            .encode(&mut self.encoded)
            .expect("a Vec grows as it is written");
        let sequence = row.cycle as u32; // MCAP counts in 32 bits and says that it wraps
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: row.time_ns,
            publish_time: row.time_ns,
        };
        if let Some(chunk) = &mut self.chunk {
            chunk.bytes += self.encoded.len();
        }
        self.mcap.write_to_known_channel(&header, &self.encoded)
    }

    fn loop_channel(&mut self) -> Result<u16, McapError> {
        if let Some(channel) = self.loop_channel {
            return Ok(channel);
        }
        let channel = add_channel::<LoopCycle>(&mut self.mcap, LOOP_TOPIC)?;
        self.loop_channel = Some(channel);
        Ok(channel)
    }

    fn add_truth_channels(&mut self) -> Result<(), McapError> {
        if self.truth_channels.is_empty() {
            self.truth_channels =
                add_joint_channels::<JointTruth>(&mut self.mcap, TRUTH_PREFIX, &self.joint_names)?;
        }
        Ok(())
    }
}

impl Chunk {
    fn is_due(&self, time_ns: u64) -> bool {
        time_ns.saturating_sub(self.began_ns) >= CHUNK_NS || self.bytes >= CHUNK_BYTES
    }
}

type Mcap = mcap::Writer<NoSeek<BufWriter<File>>>;

fn begin(file: File, header: &Header) -> Result<(Mcap, Vec<u16>), McapError> {
    let options = WriteOptions::new()
        .compression(Some(Compression::Lz4))
        .library(concat!("flexspline ", env!("CARGO_PKG_VERSION")))
        // A chunk goes into the file when it is whole, so a killed recorder leaves whole ones.
        .disable_seeking(true)
        // Chunks end between rows.
        .chunk_size(None);
    let mut mcap = options.create(NoSeek::new(BufWriter::new(file)))?;
    mcap.write_metadata(&Metadata {
        name: METADATA.to_owned(),
        metadata: metadata(header),
    })?;
    mcap.flush()?;
    let joint_channels =
        add_joint_channels::<JointCycle>(&mut mcap, JOINT_PREFIX, &header.joint_names)?;
    Ok((mcap, joint_channels))
}

/// The rate that the metadata tells, if it tells one.
pub(crate) fn told_rate_hz(metadata: &BTreeMap<String, String>) -> Option<f64> {
    let rate_hz = metadata.get(METADATA_RATE)?.parse().ok()?;
    (rate_hz > 0.0 && f64::is_finite(rate_hz)).then_some(rate_hz)
}

/// About the run, joints and rate included.
pub(crate) fn metadata(header: &Header) -> BTreeMap<String, String> {
    let mut metadata = header.metadata.clone();
    metadata.insert(METADATA_JOINTS.to_owned(), header.joint_names.join(","));
    metadata.insert(METADATA_RATE.to_owned(), header.sample_rate_hz.to_string());
    metadata
}

fn add_joint_channels<M: Described>(
    mcap: &mut Mcap,
    prefix: &str,
    joint_names: &[String],
) -> Result<Vec<u16>, McapError> {
    joint_names
        .iter()
        .map(|name| add_channel::<M>(mcap, &format!("{prefix}{name}")))
        .collect()
}

fn add_channel<M: Described>(mcap: &mut Mcap, topic: &str) -> Result<u16, McapError> {
    let schema = mcap.add_schema(M::SCHEMA, "protobuf", &M::schema())?;
    mcap.add_channel(schema, topic, "protobuf", &BTreeMap::new())
}

/// That names can be topics, and listed.
pub(crate) fn check_joint_names(names: &[String]) -> Result<(), WriteError> {
    if names.len() > JOINTS_MAX {
        return Err(WriteError::TooManyJoints {
            joints: names.len(),
        });
    }
    let mut seen = BTreeSet::new();
    for name in names {
        let problem = if name.is_empty() {
            "is empty"
        } else if name.contains(['/', ',']) {
            "holds a `/` or a `,`, which separate names in a recording"
        } else if JOINT_PREFIX.to_owned() + name == LOOP_TOPIC {
            "is the name of the loop's own channel"
        } else if !seen.insert(name) {
            "is given twice"
        } else {
            continue;
        };
        return Err(WriteError::JointName {
            name: name.clone(),
            problem,
        });
    }
    Ok(())
}

fn failure(path: &Path, cause: McapError) -> WriteError {
    let path = path.to_owned();
    match cause {
        McapError::Io(cause) => WriteError::Io { path, cause },
        cause => WriteError::Mcap { path, cause },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(joint_names: &[&str]) -> Header {
        let joint_names = joint_names.iter().map(|name| (*name).to_owned()).collect();
        Header {
            joint_names,
            sample_rate_hz: 1500.0,
            metadata: BTreeMap::new(),
        }
    }

    fn row(joints: &[JointCycle], cycle: u64, time_ns: u64) -> CycleRow<'_> {
        CycleRow {
            cycle,
            time_ns,
            loop_cycle: None,
            joints,
            truth: None,
        }
    }

    #[test]
    fn a_full_disk_is_an_error_that_names_the_file() {
        let Err(error) = Writer::create(Path::new("/dev/full"), &header(&["elbow"])) else {
            panic!("a full disk took a file")
        };
        assert!(
            error
                .to_string()
                .starts_with("cannot write /dev/full: No space left"),
            "{error}"
        );
    }

    #[test]
    fn names_that_would_make_a_wrong_topic_are_refused() {
        for names in [
            &["loop"][..],
            &["truth/elbow"],
            &["a", "a"],
            &[""],
            &["a,b"],
        ] {
            let folder = tempfile::tempdir().unwrap();
            let made = Writer::create(&folder.path().join("r.mcap"), &header(names));
            assert!(
                matches!(made, Err(WriteError::JointName { .. })),
                "{names:?}"
            );
        }
    }

    #[test]
    fn a_row_that_does_not_fit_is_refused_and_the_next_one_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.mcap");
        let mut writer = Writer::create(&path, &header(&["elbow"])).unwrap();
        let joint = JointCycle::default();
        writer.write_cycle(&row(&[joint], 5, 10)).unwrap();
        assert!(matches!(
            writer.write_cycle(&row(&[joint, joint], 6, 11)),
            Err(WriteError::JointCount { .. })
        ));
        let backwards = writer.write_cycle(&row(&[joint], 7, 9)).unwrap_err();
        assert!(matches!(
            backwards,
            WriteError::TimeBackwards {
                cycle: 7,
                time_ns: 9,
                previous_ns: 10
            }
        ));
        writer.write_cycle(&row(&[joint], 8, 10)).unwrap();
        let next_segment = JointCycle {
            segment: Some(1),
            ..joint
        };
        writer.write_cycle(&row(&[next_segment], 9, 0)).unwrap();
        writer.finish().unwrap();
        assert_eq!(crate::read(&path).unwrap().time_s, [10e-9, 10e-9, 0.0]);
    }
}
