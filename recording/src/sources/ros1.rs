//! Bags of ROS 1: records one after the other, most of them in chunks.
//!
//! Format: version 2.0, <https://wiki.ros.org/Bags/Format/2.0>. A bag is read from its beginning to its end and its index is not used,
//! so one whose recorder was killed before it wrote the index is read as far as it goes. What is not about joints is passed
//! over without being kept.

use super::unpacked::{GROWTH_MAX, MESSAGE_BYTES_MAX};
use super::{Log, Source};
use crate::ReadProblem;
use crate::frame::Frame;
use crate::mapping::Mapping;
use crate::ros::{Bag, Encoding};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// What a record is, by its field `op`.
mod op {
    pub(super) const MESSAGE: u8 = 2;
    pub(super) const BAG: u8 = 3;
    pub(super) const CHUNK: u8 = 5;
    pub(super) const CONNECTION: u8 = 7;
}
/// A record's fields take some hundred bytes; a longer head is damage.
const HEAD_BYTES_MAX: u64 = 1 << 16;
/// Recorders begin a new chunk after 768 KiB and one message; a picture has some tens of MiB.
const CHUNK_BYTES_MAX: u64 = 1 << 28;

pub(crate) struct Ros1;

impl Source for Ros1 {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.start.starts_with(MAGIC)
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(MAGIC.len() as u64))?;
        let mut reader = Reader {
            bag: Bag::default(),
            topics: HashMap::new(),
            unpacked_left: length.saturating_mul(GROWTH_MAX),
        };
        reader.read(&mut BufReader::new(file), length)?;
        reader.bag.into_frame()
    }
}

struct Reader {
    bag: Bag,
    /// By the connection's number; `None` if its messages are not read.
    topics: HashMap<u32, Option<usize>>,
    /// Bytes that the file's chunks may still unpack to.
    unpacked_left: u64,
}

/// Why reading ended before the last record.
enum Stop {
    /// The bytes ended within a record.
    Cut,
    Wrong(String),
    Problem(ReadProblem),
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            ErrorKind::UnexpectedEof => Self::Cut,
            // What decoders say of bytes that they cannot have made.
            ErrorKind::InvalidData | ErrorKind::InvalidInput | ErrorKind::Other => {
                Self::Wrong(error.to_string())
            }
            _ => Self::Problem(error.into()),
        }
    }
}

impl Reader {
    /// Reads all records of the file.
    fn read(&mut self, file: &mut BufReader<File>, length: u64) -> Result<(), ReadProblem> {
        let mut is_finished = true;
        let mut at = MAGIC.len() as u64;
        while at < length {
            match self.top_record(file, at, length, &mut is_finished) {
                Ok(bytes) => at += bytes,
                Err(Stop::Cut) => {
                    self.bag.truncated = true;
                    return Ok(());
                }
                // Of a recorder that was killed the last chunk is in pieces.
                Err(Stop::Wrong(_)) if !is_finished => break,
                Err(Stop::Wrong(what)) => return Err(ReadProblem::Damaged { offset: at, what }),
                Err(Stop::Problem(problem)) => return Err(problem),
            }
            file.seek(SeekFrom::Start(at))?;
        }
        self.bag.truncated |= !is_finished;
        Ok(())
    }

    /// Reads a record that begins here, and those in it if it is a chunk; returns its length.
    fn top_record(
        &mut self,
        file: &mut BufReader<File>,
        at: u64,
        length: u64,
        is_finished: &mut bool,
    ) -> Result<u64, Stop> {
        let left = length - at;
        let mut bytes = Bytes { from: file, left };
        let head = Head::read(&mut bytes)?;
        let data_bytes = u64::from(bytes.u32()?);
        let whole = left - bytes.left + data_bytes;
        match head.op()? {
            // Written when the recorder ends.
            op::BAG => {
                let index = head.u64("index_pos").unwrap_or(0);
                *is_finished = index != 0 && index < length;
            }
            op::CHUNK => {
                let there = data_bytes.min(bytes.left);
                let read = self.chunk(&head, bytes.from.take(there), there);
                match read {
                    // Whatever is wrong with the last bytes of a file that was cut is no more than that.
                    Err(Stop::Wrong(_)) if there < data_bytes => return Err(Stop::Cut),
                    Err(Stop::Cut) if there == data_bytes => {
                        let what = "a record runs past its chunk's end".to_owned();
                        return Err(Stop::Wrong(what));
                    }
                    read => read?,
                }
            }
            op => self.record(op, &head, data_bytes, &mut bytes)?,
        }
        if whole > left {
            return Err(Stop::Cut);
        }
        Ok(whole)
    }

    /// Reads the records of a chunk, of which so many bytes are there.
    fn chunk(&mut self, head: &Head, data: impl Read, packed: u64) -> Result<(), Stop> {
        let compression = head.text("compression").unwrap_or_default();
        if compression == "none" {
            return self.records(&mut Bytes {
                from: data,
                left: packed,
            });
        }
        let size = head
            .u32("size")
            .ok_or_else(|| wrong("a chunk without its size"))?;
        let size = u64::from(size);
        if size > CHUNK_BYTES_MAX || size > self.unpacked_left {
            let bytes = CHUNK_BYTES_MAX.min(self.unpacked_left);
            return Err(Stop::Problem(ReadProblem::UnpacksTooLarge { bytes }));
        }
        self.unpacked_left -= size;
        match compression.as_str() {
            "bz2" => self.records(&mut Bytes {
                from: bzip2::read::BzDecoder::new(data),
                left: size,
            }),
            "lz4" => self.records(&mut Bytes {
                from: lz4::Decoder::new(data)?,
                left: size,
            }),
            _ => Err(Stop::Problem(ReadProblem::UnknownCompression {
                compression,
                known: "bz2, lz4",
            })),
        }
    }

    fn records(&mut self, bytes: &mut Bytes<impl Read>) -> Result<(), Stop> {
        while bytes.left > 0 {
            let head = Head::read(bytes)?;
            let data_bytes = u64::from(bytes.u32()?);
            self.record(head.op()?, &head, data_bytes, bytes)?;
        }
        Ok(())
    }

    /// Reads what a record holds, or passes over it.
    fn record(
        &mut self,
        op: u8,
        head: &Head,
        data_bytes: u64,
        bytes: &mut Bytes<impl Read>,
    ) -> Result<(), Stop> {
        let connection = || {
            head.u32("conn")
                .ok_or_else(|| wrong("a record without its connection"))
        };
        match op {
            op::CONNECTION => {
                let fields = Head(bytes.take(data_bytes, MESSAGE_BYTES_MAX)?);
                let topic = head.text("topic").unwrap_or_default();
                let kind = fields.text("type").unwrap_or_default();
                // Written once among the messages and once more in the index.
                self.topics
                    .entry(connection()?)
                    .or_insert_with(|| self.bag.topic(&topic, &kind, Some(Encoding::Ros1)));
            }
            op::MESSAGE => match self.topics.get(&connection()?) {
                None => return Err(wrong("a message of an unknown connection")),
                Some(None) => bytes.pass_over(data_bytes)?,
                Some(Some(topic)) => {
                    let message = bytes.take(data_bytes, MESSAGE_BYTES_MAX)?;
                    let received_ns = head.time_ns("time").unwrap_or(0);
                    self.bag
                        .add(*topic, received_ns, &message)
                        .map_err(Stop::Problem)?;
                }
            },
            // The index.
            _ => bytes.pass_over(data_bytes)?,
        }
        Ok(())
    }
}

fn wrong(what: &str) -> Stop {
    Stop::Wrong(what.to_owned())
}

/// Bytes to be read one after the other, as many as are said to be left.
struct Bytes<R> {
    from: R,
    left: u64,
}

impl<R: Read> Bytes<R> {
    fn take(&mut self, bytes: u64, bytes_max: u64) -> Result<Vec<u8>, Stop> {
        if bytes > self.left {
            return Err(Stop::Cut);
        }
        if bytes > bytes_max {
            return Err(Stop::Wrong(format!(
                "a record says that it has {bytes} bytes; at most {bytes_max} are read"
            )));
        }
        let mut taken = Vec::new();
        (&mut self.from).take(bytes).read_to_end(&mut taken)?;
        self.left -= bytes;
        match taken.len() as u64 == bytes {
            true => Ok(taken),
            false => Err(Stop::Cut),
        }
    }

    fn u32(&mut self) -> Result<u32, Stop> {
        let bytes = self.take(4, 4)?;
        Ok(le_u32(&bytes).unwrap_or(0))
    }

    fn pass_over(&mut self, bytes: u64) -> Result<(), Stop> {
        if bytes > self.left {
            return Err(Stop::Cut);
        }
        let passed = io::copy(&mut (&mut self.from).take(bytes), &mut io::sink())?;
        self.left -= bytes;
        match passed == bytes {
            true => Ok(()),
            false => Err(Stop::Cut),
        }
    }
}

/// Fields, each after its length: `NAME=VALUE`.
struct Head(Vec<u8>);

impl Head {
    fn read(bytes: &mut Bytes<impl Read>) -> Result<Self, Stop> {
        let length = bytes.u32()?;
        Ok(Self(bytes.take(u64::from(length), HEAD_BYTES_MAX)?))
    }

    fn field(&self, name: &str) -> Option<&[u8]> {
        let mut rest = &self.0[..];
        loop {
            let (length, after) = rest.split_first_chunk()?;
            let (field, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
            let value = field.strip_prefix(name.as_bytes());
            if let Some(value) = value.and_then(|value| value.strip_prefix(b"=")) {
                return Some(value);
            }
            rest = after;
        }
    }

    fn op(&self) -> Result<u8, Stop> {
        match self.field("op") {
            Some([op]) => Ok(*op),
            _ => Err(wrong("a record does not say what it is")),
        }
    }

    fn text(&self, name: &str) -> Option<String> {
        let text = self.field(name)?;
        Some(String::from_utf8_lossy(text).into_owned())
    }

    fn u32(&self, name: &str) -> Option<u32> {
        le_u32(self.field(name)?)
    }

    fn u64(&self, name: &str) -> Option<u64> {
        Some(u64::from_le_bytes(self.field(name)?.try_into().ok()?))
    }

    /// Seconds, then nanoseconds.
    fn time_ns(&self, name: &str) -> Option<i64> {
        let time = self.u64(name)?;
        Some((time & u64::from(u32::MAX)) as i64 * 1_000_000_000 + (time >> 32) as i64)
    }
}

fn le_u32(bytes: &[u8]) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}
