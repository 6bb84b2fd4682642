//! Files and messages that were compressed with Zstandard as a whole.

use super::{Log, Source, source};
use crate::ReadProblem;
use crate::frame::Frame;
use crate::mapping::Mapping;
use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use tempfile::NamedTempFile;

const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// Bags and text shrink to a hundredth at most; a file that grows by more was made to fill the disk.
pub(super) const GROWTH_MAX: u64 = 1000;
const FILE_BYTES_MAX: u64 = 1 << 34;
/// A message about joints takes some kilobytes.
pub(super) const MESSAGE_BYTES_MAX: u64 = 1 << 24;

/// `NAME.db3.zstd`, `NAME.mcap.zst`, `NAME.csv.zst`: unpacked beside the system's other temporary files.
pub(crate) struct Zstd;

impl Source for Zstd {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.start.starts_with(&MAGIC)
    }

    fn frame(&self, path: &Path, mapping: &Mapping) -> Result<Frame, ReadProblem> {
        let unpacked = unpack_file(path)?;
        // Not twice, or a small file could unpack for ever.
        let mut start = [0; MAGIC.len()];
        let packed_again = File::open(unpacked.path())?.read_exact(&mut start).is_ok();
        if packed_again && start == MAGIC {
            return Err(ReadProblem::UnknownFormat {
                seems: "; it is compressed twice",
            });
        }
        source(unpacked.path())?.frame(unpacked.path(), mapping)
    }
}

/// The file's contents in a file of their own, with the rest of its name, which may tell the format.
pub(super) fn unpack_file(path: &Path) -> Result<NamedTempFile, ReadProblem> {
    let name = Path::new(path.file_stem().unwrap_or_default());
    let extension = name.extension().unwrap_or_default().to_string_lossy();
    let mut unpacked = tempfile::Builder::new()
        .suffix(&format!(".{extension}"))
        .tempfile()?;
    let file = File::open(path)?;
    let limit = file
        .metadata()?
        .len()
        .saturating_mul(GROWTH_MAX)
        .min(FILE_BYTES_MAX);
    let mut decoder = zstd::Decoder::new(file)?.take(limit + 1);
    let bytes = std::io::copy(&mut decoder, &mut unpacked)?;
    if bytes > limit {
        return Err(ReadProblem::UnpacksTooLarge { bytes: limit });
    }
    unpacked.flush()?;
    Ok(unpacked)
}

/// A message, unpacked if it was packed by itself.
pub(super) fn unpack_message(bytes: &[u8]) -> Result<Cow<'_, [u8]>, ReadProblem> {
    if !bytes.starts_with(&MAGIC) {
        return Ok(Cow::Borrowed(bytes));
    }
    let mut unpacked = Vec::new();
    let decoder = zstd::Decoder::with_buffer(bytes)?;
    decoder
        .take(MESSAGE_BYTES_MAX + 1)
        .read_to_end(&mut unpacked)?;
    if unpacked.len() as u64 > MESSAGE_BYTES_MAX {
        return Err(ReadProblem::UnpacksTooLarge {
            bytes: MESSAGE_BYTES_MAX,
        });
    }
    Ok(Cow::Owned(unpacked))
}
