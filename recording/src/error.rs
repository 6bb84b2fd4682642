//! What can go wrong with a file, in words that say where and what to change.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// A file could not be read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct ReadError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: ReadProblem,
}

/// What is wrong with a file that could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadProblem {
    /// The operating system refused.
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    /// None of the formats.
    #[error(
        "is neither an MCAP recording nor a ROS 1 bag, a Parquet, SQLite, .npz, PyTorch, pickle, MATLAB or HDF5 file, nor named as a CSV log is \
         (.csv, .tsv, .txt, .dat){seems}"
    )]
    UnknownFormat {
        /// What it looks like, and what to do.
        seems: &'static str,
    },
    /// A file that Git did not fetch.
    #[error("is a pointer of Git LFS, not the file itself; fetch that with `git lfs pull`")]
    LfsPointer,
    /// A folder of something else.
    #[error(
        "is a folder, but holds neither the .mcap or .db3 files of a rosbag2 nor the meta/info.json of a LeRobot dataset"
    )]
    UnknownFolder,
    /// One of a bag's files.
    #[error("its part {}: {problem}", part.display())]
    Part {
        /// The file.
        part: PathBuf,
        /// What is wrong with it.
        problem: Box<ReadProblem>,
    },
    /// A SQLite file of something else.
    #[error("is a SQLite file, but no rosbag2: it has no tables `topics` and `messages`")]
    NotABag,
    /// A SQLite file that cannot be read.
    #[error("is a SQLite file that cannot be read: {}; it was cut short or damaged", one_line(.0))]
    Sqlite(String),
    /// A NumPy file that cannot be read.
    #[error("is an .npz file that cannot be read: {}", one_line(.0))]
    Npz(String),
    /// What `torch.save` wrote and cannot be read.
    #[error("is a file of PyTorch that cannot be read: {}", one_line(.0))]
    Torch(String),
    /// A Python pickle that cannot be read.
    #[error("is a Python pickle that cannot be read: {}", one_line(.0))]
    Pickle(String),
    /// A MATLAB file that cannot be read.
    #[error(
        "is a MATLAB file that cannot be read: {}; it was damaged, so save it again",
        one_line(.0)
    )]
    Mat(String),
    /// A MATLAB file with nothing that is read.
    #[error("holds no numbers that are read: {0}")]
    NothingRead(String),
    /// A log that is not understood, and something in it that was not read.
    #[error("{problem}; what was not read: {not_read}")]
    NotAllRead {
        /// What is not understood.
        problem: Box<ReadProblem>,
        /// What that is, and what to do.
        not_read: String,
    },
    /// An HDF5 file that cannot be read.
    #[error(
        "is an HDF5 file (a .mat of version 7.3 is one too) that cannot be read: {}; if it is whole, \
         `h5repack -f GZIP=1 OLD NEW`, or MATLAB's `save` with '-v7', writes one that can",
        one_line(.0)
    )]
    Hdf5(String),
    /// Arrays whose columns belong to joints without names.
    #[error(
        "`{}` has {columns} columns, one for each joint, and {names} names of joints are told; write the names into {}, in this \
         order: joints = [{}]", one_line(array), mapping.display(), names_to_write(*columns)
    )]
    UnnamedJoints {
        /// The array's name.
        array: String,
        /// How many it has.
        columns: usize,
        /// How many there are.
        names: usize,
        /// The mapping file that could say.
        mapping: PathBuf,
    },
    /// Columns of different lengths.
    #[error(
        "`{}` has {rows} rows, but `{}` {other_rows}; make them as long",
        one_line(column),
        one_line(other)
    )]
    ColumnLengths {
        /// One column.
        column: String,
        /// Its length.
        rows: usize,
        /// The first one.
        other: String,
        /// Its length.
        other_rows: usize,
    },
    /// Files of one log that have other columns.
    #[error("has no column `{}`, which the files before it have", one_line(column))]
    MissingInPart {
        /// Its name.
        column: String,
    },
    /// A LeRobot dataset whose description cannot be read.
    #[error("its {}: {}", file.display(), one_line(what))]
    Dataset {
        /// The file of the dataset.
        file: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// A bag of something else.
    #[error(
        "is a bag of ROS without the state of any joint: sensor_msgs/JointState, control_msgs/DynamicJointState or \
         JointTrajectoryControllerState is read, its topics are {}{}", list(.channels), and_unreadable(*.not_decoded)
    )]
    NoJointStates {
        /// Topic and type of each.
        channels: Vec<String>,
        /// Messages of these types that are none.
        not_decoded: u64,
    },
    /// A small file that stands for a very large one.
    #[error("unpacks to more than {bytes} bytes, as no log of its size does")]
    UnpacksTooLarge {
        /// That were allowed.
        bytes: u64,
    },
    /// Named `.mcap`, but something else.
    #[error("is not an MCAP file, in spite of its name: it does not begin as one")]
    NotMcap,
    /// A mapping for a file that needs none.
    #[error("is an MCAP recording, whose channels say what they hold; leave the mapping file out")]
    MappedMcap,
    /// Named `.parquet`, but something else.
    #[error("is not a Parquet file, in spite of its name: it does not begin as one")]
    NotParquet,
    /// A Parquet file that cannot be decoded.
    #[error(
        "is a Parquet file that cannot be decoded: {}; it was cut short, damaged or encrypted",
        one_line(.0)
    )]
    Parquet(String),
    /// More values than a table in memory shall hold.
    #[error(
        "says that it holds {rows} rows of {columns} columns; at most {} values are read, so split it",
        crate::VALUES_MAX
    )]
    TooLarge {
        /// As the file says.
        rows: i64,
        /// That would be read.
        columns: usize,
    },
    /// A Parquet column of something else than numbers.
    #[error(
        "column `{}` holds {found}, not numbers; write it as floating-point numbers or integers",
        one_line(column)
    )]
    ColumnType {
        /// Its name.
        column: String,
        /// The Parquet type.
        found: String,
    },
    /// The recorder died before anything was written.
    #[error(
        "is an MCAP file that ends before its description of the recording; nothing was recorded"
    )]
    NothingRecorded,
    /// Bytes that no MCAP writer writes.
    #[error("is damaged at byte {offset}: {}", one_line(what))]
    Damaged {
        /// Of the record in the file.
        offset: u64,
        /// What is wrong there.
        what: String,
    },
    /// A compression this reader does not know.
    #[error(
        "is compressed with `{}`; only {known} and uncompressed files of its kind are read, so convert it first",
        one_line(compression)
    )]
    UnknownCompression {
        /// As the file names it.
        compression: String,
        /// What is read.
        known: &'static str,
    },
    /// An MCAP file of something else.
    #[error(
        "is an MCAP file of something else: no channel holds flexspline.JointCycle messages or joint states of ROS, its \
         channels (with schemas) are {}; export what you want to compare as CSV or Parquet, one row per control cycle, and say in a mapping file \
         which column is which signal", list(.channels)
    )]
    NoJoints {
        /// Topic and schema of each.
        channels: Vec<String>,
    },
    /// More joints than [`crate::JOINTS_MAX`].
    #[error(
        "holds {joints} joints or more; at most {} are read",
        crate::JOINTS_MAX
    )]
    TooManyJoints {
        /// How many were seen.
        joints: usize,
    },
    /// A clock that jumped, or rows of several trajectories without a segment column.
    #[error(
        "{place}: time runs backwards, from {previous_s} s to {time_s} s; where a new trajectory begins, say so with a `segment` column, \
         and where rows were written out of order, sort them by time"
    )]
    TimeBackwards {
        /// Line, row or cycle.
        place: Place,
        /// Of the row before.
        previous_s: f64,
        /// Of this row.
        time_s: f64,
    },
    /// A time in another unit than seconds, which it was said or taken to be in.
    #[error(
        "has rows that are {step_s:.3e} s apart, which no log has: as {unit} since 1970 its times would be right; in {}, [columns], multiply \
         the scale of time_s by {factor:e}",
        mapping.display()
    )]
    TimeUnit {
        /// From row to row, as it was read.
        step_s: f64,
        /// What it is in.
        unit: &'static str,
        /// Seconds of one.
        factor: f64,
        /// The file that says the scale.
        mapping: PathBuf,
    },
    /// An infinite value.
    #[error(
        "{place}: {} is {value}; a value that is not there is left empty",
        one_line(column)
    )]
    NotFinite {
        /// Line, row or cycle.
        place: Place,
        /// The column's name.
        column: String,
        /// As read.
        value: f64,
    },
    /// Nothing says how fast it was recorded.
    #[error(
        "has {rows} rows, from which no sample rate can be told{}; give `sample_rate_hz` in {}",
        if *rows > 1 { ": all times are the same, as where the clock tells whole minutes" } else { "" },
        source_of_rate.display()
    )]
    SampleRateUnknown {
        /// How many there are.
        rows: usize,
        /// The file that could say.
        source_of_rate: PathBuf,
    },
    /// An empty file.
    #[error("is empty; its first line must name the columns")]
    NoHeader,
    /// A log without column names.
    #[error(
        "begins with numbers, so its columns are called `1` to `{columns}`; say in {} which is which (`sample_rate_hz = 1000.0`, or \
         `[columns]` and `time_s = \"1\"`; `[joint.NAME]` and `motor_position_rad = \"2\"`), or name them in the first line",
        mapping.display()
    )]
    HeaderOfNumbers {
        /// How many.
        columns: usize,
        /// The mapping file that could say.
        mapping: PathBuf,
    },
    /// A table with a line for each signal.
    #[error(
        "has more columns ({columns}) than rows ({rows}) by far, so its lines seem to be signals and its columns moments; turn the table \
         round, so that each signal is a column (Python: `pandas.read_csv(OLD, header=None, sep=None, engine='python').T.to_csv(NEW, \
         index=False, header=NAMES)`)"
    )]
    RowsAreSignals {
        /// How many.
        columns: usize,
        /// How many.
        rows: usize,
    },
    /// No column is a signal.
    #[error(
        "no column is named JOINT.SIGNAL, and {} does not say which column is which signal; its columns are {}",
        mapping.display(), list(.columns)
    )]
    NoSignals {
        /// The mapping file that could say.
        mapping: PathBuf,
        /// What the header line holds.
        columns: Vec<String>,
    },
    /// A guess that somebody must look at.
    #[error("what is in {} is doubtful (`{}`: {})", list(.columns), one_line(.columns.first().map_or("", String::as_str)), one_line(why))]
    Doubtful {
        /// The doubtful ones.
        columns: Vec<String>,
        /// Of the first.
        why: String,
    },
    /// A mapped column is not there.
    #[error("has no column `{}`, which `{}` in the mapping file asks for{}", one_line(column), one_line(key), did_you_mean(.nearest))]
    NoColumn {
        /// The key in the mapping file.
        key: String,
        /// The column it names.
        column: String,
        /// The column that looks most like it.
        nearest: Option<String>,
    },
    /// A mapped array has more or fewer values than the times.
    #[error(
        "has `{}`, but with {length} values where the times and the other columns have {rows}, so `{}` in the mapping file cannot take it; \
         if it begins when they do, leave the last {} of {} out before you save, or else bring it to their times",
        one_line(column), one_line(key), length.abs_diff(*rows), if length > rows { "it" } else { "the others" }
    )]
    OtherLength {
        /// The key in the mapping file.
        key: String,
        /// The array, or a column of it.
        column: String,
        /// How many values it has in a column.
        length: usize,
        /// How many rows are read.
        rows: usize,
    },
    /// Two columns of one name.
    #[error("has two columns named `{}`; rename one", one_line(column))]
    AmbiguousColumn {
        /// The name.
        column: String,
    },
    /// A row of another length than the header.
    #[error("line {line}: {fields} fields where the header names {columns}{}", too_many(*fields, *columns))]
    RowLength {
        /// Counted from 1.
        line: u64,
        /// In this row.
        fields: u64,
        /// In the header.
        columns: u64,
    },
    /// A cell that is no number.
    #[error(
        "{place}, column `{}`: `{}` is not a number (no unit and nothing between thousands is expected, and one decimal mark, point or comma, in the whole file)",
        one_line(column),
        one_line(cell)
    )]
    NotANumber {
        /// Line or row.
        place: Place,
        /// The header's name.
        column: String,
        /// What is there.
        cell: String,
    },
    /// A time that is written as a date is, in an order that is not known.
    #[error(
        "{place}, column `{}`: `{}` is not a date that can be read; write it as `2024-05-13 00:53:12.345` (`13/05/2024 0:53` is read too, \
         where only one of the two can be the month)",
        one_line(column),
        one_line(cell)
    )]
    NotADate {
        /// Line or row.
        place: Place,
        /// The header's name.
        column: String,
        /// What is there.
        cell: String,
    },
    /// A segment that is no integer.
    #[error(
        "{place}, column `{}`: `{}` is not an integer, which a segment is",
        one_line(column),
        one_line(cell)
    )]
    NotAnInteger {
        /// Line or row.
        place: Place,
        /// The header's name.
        column: String,
        /// What is there.
        cell: String,
    },
    /// A row without a time.
    #[error("{place}: no time in column `{}`", one_line(column))]
    NoTime {
        /// Line or row.
        place: Place,
        /// The time column's name.
        column: String,
    },
    /// Neither a time column nor a sample rate.
    #[error("has no column `time_s`; name the time column in {} (`[columns]`, `time_s = \"…\"`) or give `sample_rate_hz` there; its columns are {}", mapping.display(), list(.columns))]
    NoTimeColumn {
        /// The mapping file that could say.
        mapping: PathBuf,
        /// What the log has.
        columns: Vec<String>,
    },
    /// The mapping file is wrong.
    #[error("its mapping file {}: {problem}", mapping.display())]
    Mapping {
        /// The mapping file.
        mapping: PathBuf,
        /// What is wrong with it.
        problem: MappingProblem,
    },
}

/// What is wrong with a mapping file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MappingProblem {
    /// The operating system refused.
    #[error("cannot be read: {0}")]
    Io(io::Error),
    /// Not TOML.
    #[error("is not TOML, line {line}: {}", one_line(what))]
    Toml {
        /// From one on.
        line: usize,
        /// In the parser's words.
        what: String,
    },
    /// A key that means nothing here.
    #[error("unknown key `{}`{}", one_line(key), did_you_mean(.nearest))]
    UnknownKey {
        /// With the tables around it.
        key: String,
        /// The known key that looks most like it.
        nearest: Option<String>,
    },
    /// A value of the wrong kind.
    #[error("`{}` must be {expected}", one_line(key))]
    WrongValue {
        /// With the tables around it.
        key: String,
        /// What belongs there.
        expected: &'static str,
    },
}

/// A recording could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The operating system refused: no space, no permission.
    #[error("cannot write {}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        cause: io::Error,
    },
    /// The MCAP writer refused.
    #[error("cannot write {}: {cause}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What it said.
        cause: mcap::McapError,
    },
    /// The Parquet writer refused.
    #[error("cannot write {}: {cause}", path.display())]
    Parquet {
        /// The file.
        path: PathBuf,
        /// What it said.
        cause: parquet::errors::ParquetError,
    },
    /// A joint name that a topic or a list of names cannot hold.
    #[error("joint name `{}` {problem}", one_line(name))]
    JointName {
        /// The name.
        name: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// More joints than [`crate::JOINTS_MAX`].
    #[error("{joints} joints; a recording holds at most {}", crate::JOINTS_MAX)]
    TooManyJoints {
        /// How many were given.
        joints: usize,
    },
    /// A sample rate that is none.
    #[error("a sample rate of {sample_rate_hz} Hz; it must be positive")]
    SampleRate {
        /// As given.
        sample_rate_hz: f64,
    },
    /// A row for another robot.
    #[error("cycle {cycle} holds {given} joints where the recording has {expected}")]
    JointCount {
        /// Of the row.
        cycle: u64,
        /// In the row.
        given: usize,
        /// In the recording.
        expected: usize,
    },
    /// A row from before the one written last.
    #[error(
        "cycle {cycle} is of {time_ns} ns, before the last one written, of {previous_ns} ns, in the same segment"
    )]
    TimeBackwards {
        /// Of the row.
        cycle: u64,
        /// Of the row.
        time_ns: u64,
        /// Of the last row.
        previous_ns: u64,
    },
    /// A time that MCAP cannot hold.
    #[error("row {row} is of {time_s} s; MCAP times are from 0 to 1.8e10 s, so shift them")]
    TimeOutOfRange {
        /// Counted from 0.
        row: usize,
        /// Of the row.
        time_s: f64,
    },
    /// A table whose columns do not fit together.
    #[error("column {column} holds {length} values where the table has {rows} rows")]
    ColumnLength {
        /// Its name.
        column: String,
        /// Its length.
        length: usize,
        /// The length of `time_s`.
        rows: usize,
    },
}

/// Where in a file a row is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Of a CSV log, counted from 1.
    Line(u64),
    /// Of a Parquet file, counted from 1.
    Row(u64),
    /// Of an MCAP recording.
    Cycle(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}"),
            Self::Cycle(cycle) => write!(f, "cycle {cycle}"),
        }
    }
}

/// What a file holds, as a message quotes it: control characters escaped and the end of a long text left out, so that the
/// message stays one line.
pub(crate) fn one_line(text: &str) -> String {
    const LENGTH_MAX: usize = 200;
    let mut line = String::new();
    for c in text.trim().chars().take(LENGTH_MAX) {
        if c.is_control() {
            line.extend(c.escape_default());
        } else {
            line.push(c);
        }
    }
    if text.chars().nth(LENGTH_MAX).is_some() {
        line.push('…');
    }
    line
}

/// The candidate most like `name`, unless none is.
pub(crate) fn nearest<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    // Below this similarity a suggestion misleads more often than it helps.
    const ALIKE: f64 = 0.5;
    candidates
        .into_iter()
        .map(|candidate| {
            (
                strsim::normalized_damerau_levenshtein(name, candidate),
                candidate,
            )
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(similarity, _)| *similarity >= ALIKE)
        .map(|(_, candidate)| candidate.to_owned())
}

/// As many names in quotes as there are joints, the first few of many.
fn names_to_write(joints: usize) -> String {
    const SHOWN: usize = 3;
    let names: Vec<String> = (1..=joints.min(SHOWN))
        .map(|joint| format!("\"joint{joint}\""))
        .collect();
    let more = if joints > SHOWN { ", …" } else { "" };
    format!("{}{more}", names.join(", "))
}

fn and_unreadable(messages: u64) -> String {
    match messages {
        0 => String::new(),
        messages => format!("; {messages} messages of these types could not be decoded"),
    }
}

fn did_you_mean(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |nearest| {
        format!("; did you mean `{}`?", one_line(nearest))
    })
}

/// Names in backticks, the first few of many.
pub(crate) fn list(names: &[String]) -> String {
    const SHOWN: usize = 12;
    if names.is_empty() {
        return "none".to_owned();
    }
    let mut shown: Vec<_> = names
        .iter()
        .take(SHOWN)
        .map(|name| format!("`{}`", one_line(name)))
        .collect();
    if names.len() > SHOWN {
        shown.push(format!("{} more", names.len() - SHOWN));
    }
    shown.join(", ")
}

/// What to do about fields without a name.
fn too_many(fields: u64, columns: u64) -> &'static str {
    if fields > columns {
        "; name every field there, or take the header away and map columns by their numbers"
    } else {
        ""
    }
}
