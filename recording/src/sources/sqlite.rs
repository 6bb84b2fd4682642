//! SQLite files of rosbag2: a table of topics and one of messages.
//!
//! Format: the schema of `rosbag2_storage_sqlite3`, the same in all its versions for what is read here.

use super::unpacked::unpack_message;
use super::{Log, Source};
use crate::ReadProblem;
use crate::frame::Frame;
use crate::mapping::Mapping;
use crate::ros::{Bag, Encoding};
use rusqlite::types::ValueRef;
use rusqlite::{Connection, OpenFlags};
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use tempfile::NamedTempFile;

const MAGIC: &[u8] = b"SQLite format 3\0";

pub(crate) struct Sqlite;

impl Source for Sqlite {
    fn matches(&self, log: &Log<'_>) -> bool {
        log.start.starts_with(MAGIC)
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        let mut bag = Bag::default();
        read_bag(path, &mut bag)?;
        bag.into_frame()
    }
}

/// Adds what a SQLite file's messages tell. A file that ends too early is read as far as it goes.
pub(super) fn read_bag(path: &Path, bag: &mut Bag) -> Result<(), ReadProblem> {
    let mended = mended(path)?;
    bag.truncated |= mended.is_some();
    let path = mended.as_ref().map_or(path, |mended| mended.path());
    let database = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
    // Of a damaged file nothing is believed that can be checked, and nothing in it is run.
    database.execute_batch("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON;")?;
    check_tables(&database)?;
    let mut topics: HashMap<i64, usize> = HashMap::new();
    let mut told = database.prepare("SELECT id, name, type, serialization_format FROM topics")?;
    let mut rows = told.query([])?;
    while let Some(row) = rows.next()? {
        let (id, name, kind): (i64, String, String) = (row.get(0)?, row.get(1)?, row.get(2)?);
        let format: String = row.get(3)?;
        let encoding = (format == "cdr").then_some(Encoding::Cdr);
        if let Some(topic) = bag.topic(&name, &kind, encoding) {
            topics.insert(id, topic);
        }
    }
    let mut told = database.prepare("SELECT topic_id, timestamp, data FROM messages")?;
    let mut rows = told.query([])?;
    let mut read = 0_u64;
    loop {
        let row = match rows.next() {
            Ok(Some(row)) => row,
            Ok(None) => return Ok(()),
            Err(_) if read > 0 => {
                bag.truncated = true;
                return Ok(());
            }
            Err(error) => return Err(error.into()),
        };
        read += 1;
        let Some(topic) = topics.get(&row.get(0)?) else {
            continue;
        };
        let received_ns = row.get(1)?;
        if let ValueRef::Blob(data) = row.get_ref(2)? {
            bag.add(*topic, received_ns, &unpack_message(data)?)?;
        }
    }
}

/// A copy of a file that is shorter than it says, which SQLite would not open: one that leaves its length open.
///
/// Format: <https://www.sqlite.org/fileformat2.html>, 1.3.
fn mended(path: &Path) -> Result<Option<NamedTempFile>, ReadProblem> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut head = [0; 100];
    if file.read_exact(&mut head).is_err() {
        return Ok(None);
    }
    let word = |at: usize| {
        u64::from(u32::from_be_bytes([
            head[at],
            head[at + 1],
            head[at + 2],
            head[at + 3],
        ]))
    };
    let page_bytes = match u64::from(u16::from_be_bytes([head[16], head[17]])) {
        1 => 1 << 16,
        bytes => bytes,
    };
    let (pages, counter) = (word(28), word(24));
    if length >= pages * page_bytes || length < page_bytes || page_bytes == 0 {
        return Ok(None);
    }
    let mut mended = NamedTempFile::new()?;
    file.rewind()?;
    std::io::copy(&mut file.take(length - length % page_bytes), &mut mended)?;
    // The length is believed only where these two counters are equal.
    mended.seek(SeekFrom::Start(92))?;
    mended.write_all(&(counter as u32 ^ 1).to_be_bytes())?;
    mended.flush()?;
    Ok(Some(mended))
}

/// That both tables are tables: a view could compute anything for any time.
fn check_tables(database: &Connection) -> Result<(), ReadProblem> {
    let sql = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')";
    match database.query_row(sql, [], |row| row.get::<_, i64>(0))? {
        2 => Ok(()),
        _ => Err(ReadProblem::NotABag),
    }
}

impl From<rusqlite::Error> for ReadProblem {
    fn from(error: rusqlite::Error) -> Self {
        Self::Sqlite(error.to_string())
    }
}
