//! The records of an MCAP file in order, those inside chunks included.
//!
//! The file is taken for what it may be: cut short or damaged. No length in it is believed before it is held
//! against the bytes that are there. Format: <https://mcap.dev/spec>.

use super::op;
use crate::ReadProblem;
use mcap::parse_record;
use mcap::records::{ChunkHeader, Record};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// A record's first bytes: what it is and how long.
const RECORD_HEAD: usize = 1 + 8;
/// LZ4 shrinks no more than this (one length byte stands for 255), plus a frame's fixed part.
const LZ4_GROWTH: u64 = 256;
/// Zstandard shrinks a run of equal bytes to nothing, so a small damaged file may promise any amount.
const ZSTD_CHUNK_BYTES: u64 = 1 << 28;
/// What a file ends with: the magic it began with.
const MAGIC: &[u8] = mcap::MAGIC;

/// Reads records from the file, a chunk at a time.
pub(super) struct Records {
    file: BufReader<File>,
    /// Of the next record.
    offset: u64,
    /// When the file was opened: a recorder may still be writing.
    length: u64,
    /// The record read last.
    body: Vec<u8>,
    /// The records of the chunk read last.
    chunk: Vec<u8>,
    /// How far the chunk was read.
    chunk_read: usize,
    chunk_offset: u64,
}

/// What comes next.
pub(super) enum Next<'a> {
    Record {
        offset: u64,
        record: Record<'a>,
    },
    /// The file ends, as a finished one does or in the middle.
    End {
        whole: bool,
    },
}

impl Records {
    /// Opens a file that begins with the magic bytes.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let mut file = BufReader::new(file);
        file.read_exact(&mut [0; MAGIC.len()])?;
        let offset = MAGIC.len() as u64;
        Ok(Self {
            file,
            offset,
            length,
            body: Vec::new(),
            chunk: Vec::new(),
            chunk_read: 0,
            chunk_offset: offset,
        })
    }

    /// The next record that tells something about rows.
    pub(super) fn next(&mut self) -> Result<Next<'_>, ReadProblem> {
        let (opcode, place) = loop {
            if self.chunk_read < self.chunk.len() {
                let (opcode, body) = record_in_chunk(&self.chunk, &mut self.chunk_read)
                    .ok_or_else(|| {
                        damaged(self.chunk_offset, "a record runs past its chunk's end")
                    })?;
                if is_wanted(opcode) {
                    break (opcode, Source::Chunk(body));
                }
                continue;
            }
            let offset = self.offset;
            let Some(opcode) = self.read_record()? else {
                return Ok(Next::End { whole: false });
            };
            match opcode {
                op::CHUNK => self.open_chunk(offset)?,
                op::DATA_END => {
                    return Ok(Next::End {
                        whole: self.ends_whole()?,
                    });
                }
                opcode if is_wanted(opcode) => break (opcode, Source::File(offset)),
                0 => return Err(damaged(offset, "no record begins with a zero byte")),
                _ => {}
            }
        };
        let (offset, body) = match place {
            Source::Chunk(body) => (self.chunk_offset, &self.chunk[body]),
            Source::File(offset) => (offset, &self.body[..]),
        };
        let record = parsed(opcode, body).map_err(|what| damaged(offset, what))?;
        Ok(Next::Record { offset, record })
    }

    /// Reads one record into `body` and tells what it is, unless the file ends within it.
    fn read_record(&mut self) -> Result<Option<u8>, ReadProblem> {
        let left = self.length - self.offset;
        let mut head = [0; RECORD_HEAD];
        if left < head.len() as u64 {
            return Ok(None);
        }
        self.file.read_exact(&mut head)?;
        let (opcode, length) = split_head(head);
        if length > left - head.len() as u64 {
            return Ok(None);
        }
        self.body.clear();
        (&mut self.file).take(length).read_to_end(&mut self.body)?;
        self.offset += head.len() as u64 + length;
        // Shorter only if somebody cut the file while we were reading it.
        Ok((self.body.len() as u64 == length).then_some(opcode))
    }

    /// Unpacks the chunk in `body`.
    fn open_chunk(&mut self, offset: u64) -> Result<(), ReadProblem> {
        let Record::Chunk { header, data } =
            parsed(op::CHUNK, &self.body).map_err(|what| damaged(offset, what))?
        else {
            return Err(damaged(offset, "a chunk that is none"));
        };
        self.chunk.clear();
        self.chunk_read = 0;
        self.chunk_offset = offset;
        match header.compression.as_str() {
            "" => self.chunk.extend_from_slice(&data),
            "lz4" => {
                unpack_lz4(&header, &data, &mut self.chunk).map_err(|what| damaged(offset, what))?
            }
            "zstd" => unpack_zstd(&header, &data, &mut self.chunk)
                .map_err(|what| damaged(offset, what))?,
            _ => {
                return Err(ReadProblem::UnknownCompression {
                    compression: header.compression,
                    known: "lz4, zstd",
                });
            }
        }
        if self.chunk.len() as u64 != header.uncompressed_size {
            return Err(damaged(offset, "a chunk's size is not what it says"));
        }
        // A sum of zero means that the writer made none.
        if header.uncompressed_crc != 0 && crc32fast::hash(&self.chunk) != header.uncompressed_crc {
            return Err(damaged(offset, "a chunk's checksum is wrong"));
        }
        Ok(())
    }

    /// Whether the file goes on to its last bytes as a finished one does.
    fn ends_whole(&mut self) -> Result<bool, ReadProblem> {
        let mut last = None;
        while last != Some(op::FOOTER) {
            last = self.read_record()?;
            if last.is_none() {
                return Ok(false);
            }
        }
        let mut end = Vec::with_capacity(MAGIC.len());
        (&mut self.file)
            .take(MAGIC.len() as u64)
            .read_to_end(&mut end)?;
        Ok(end == MAGIC)
    }
}

enum Source {
    Chunk(std::ops::Range<usize>),
    File(u64),
}

/// A file that is damaged at the record of that offset.
pub(super) fn damaged(offset: u64, what: impl ToString) -> ReadProblem {
    ReadProblem::Damaged {
        offset,
        what: what.to_string(),
    }
}

/// What a record's body says. The parser reserves as much as a text's length promises, so lengths are looked at first.
fn parsed(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    lengths_hold(opcode, body).ok_or("a text runs past its record's end")?;
    parse_record(opcode, body).map_err(|error| error.to_string())
}

/// Whether every length in a record leads to a place within it.
fn lengths_hold(opcode: u8, body: &[u8]) -> Option<()> {
    match opcode {
        op::SCHEMA => {
            let name = body.get(2..)?;
            past_text(past_text(past_text(name)?)?)?;
        }
        op::CHANNEL => {
            let topic = body.get(4..)?;
            map_holds(past_text(past_text(topic)?)?)?;
        }
        op::METADATA => map_holds(past_text(body)?)?,
        op::CHUNK => {
            let compression = body.get(28..)?;
            past_text(compression)?;
        }
        _ => {}
    }
    Some(())
}

/// What follows a text, or bytes, that begin with their length.
fn past_text(bytes: &[u8]) -> Option<&[u8]> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.get(u32::from_le_bytes(*length) as usize..)
}

/// Names and values, one after the other, in as many bytes as their length says.
fn map_holds(bytes: &[u8]) -> Option<()> {
    let (length, rest) = bytes.split_first_chunk()?;
    let mut entries = rest.get(..u32::from_le_bytes(*length) as usize)?;
    while !entries.is_empty() {
        entries = past_text(past_text(entries)?)?;
    }
    Some(())
}

/// Others are indexes and attachments, which hold no rows.
fn is_wanted(opcode: u8) -> bool {
    matches!(
        opcode,
        op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA
    )
}

fn split_head(head: [u8; RECORD_HEAD]) -> (u8, u64) {
    let [opcode, length @ ..] = head;
    (opcode, u64::from_le_bytes(length))
}

/// What the next record of a chunk is and where its body is, unless it runs past the end.
fn record_in_chunk(chunk: &[u8], read: &mut usize) -> Option<(u8, std::ops::Range<usize>)> {
    let (opcode, length) = split_head(*chunk[*read..].first_chunk()?);
    let start = *read + RECORD_HEAD;
    let end = start.checked_add(usize::try_from(length).ok()?)?;
    *read = end;
    (end <= chunk.len()).then_some((opcode, start..end))
}

fn unpack_lz4(header: &ChunkHeader, data: &[u8], chunk: &mut Vec<u8>) -> Result<(), String> {
    if header.uncompressed_size > LZ4_GROWTH * data.len() as u64 {
        return Err("a chunk says that it unpacks to more than it can".to_owned());
    }
    let decoder = lz4::Decoder::new(data).map_err(|error| error.to_string())?;
    unpack(header, decoder, chunk)
}

fn unpack_zstd(header: &ChunkHeader, data: &[u8], chunk: &mut Vec<u8>) -> Result<(), String> {
    if header.uncompressed_size > ZSTD_CHUNK_BYTES {
        return Err(format!(
            "a chunk says that it unpacks to {} bytes; at most {ZSTD_CHUNK_BYTES} are read",
            header.uncompressed_size
        ));
    }
    let decoder = zstd::Decoder::with_buffer(data).map_err(|error| error.to_string())?;
    unpack(header, decoder, chunk)
}

fn unpack(header: &ChunkHeader, decoder: impl Read, chunk: &mut Vec<u8>) -> Result<(), String> {
    // One byte more than promised shows a chunk that holds more.
    decoder
        .take(header.uncompressed_size + 1)
        .read_to_end(chunk)
        .map_err(|error| error.to_string())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_that_leads_out_of_its_record_is_refused_before_anything_is_reserved() {
        let text = |said: u32, bytes: &[u8]| [&said.to_le_bytes(), bytes].concat();
        let entry = [text(1, b"a"), text(2, b"bc")].concat();
        let map = |said: u32| text(said, &entry);
        let whole = u32::try_from(entry.len()).unwrap_or(0);
        let metadata = |name: u32, map: Vec<u8>| [text(name, b"run"), map].concat();
        assert!(parsed(op::METADATA, &metadata(3, map(whole))).is_ok());
        for said in [4_u32, 200, u32::MAX] {
            assert!(parsed(op::METADATA, &metadata(said, map(whole))).is_err());
            assert!(parsed(op::METADATA, &metadata(3, map(whole.saturating_add(said)))).is_err());
        }
        let inner = text(whole, &[text(u32::MAX, b"a"), text(2, b"bc")].concat());
        assert!(parsed(op::METADATA, &metadata(3, inner)).is_err());
        let chunk = |said: u32| [vec![0; 28], text(said, b"lz4"), vec![0; 8]].concat();
        assert!(lengths_hold(op::CHUNK, &chunk(3)).is_some());
        assert!(lengths_hold(op::CHUNK, &chunk(u32::MAX)).is_none());
        assert!(lengths_hold(op::CHANNEL, &[0; 6]).is_none());
        assert!(lengths_hold(op::SCHEMA, &[0; 14]).is_some());
    }
}
