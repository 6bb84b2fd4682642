//! MATLAB's `.mat` files of versions 5 to 7.2, which scipy and Octave write too; version 7.3 is [`super::hdf5`].
//!
//! Format: "MAT-File Format", MathWorks 2023, level 5. Matrices of numbers are read, structs of them as `STRUCT.FIELD`, and cells
//! that hold a row of numbers each. Of MATLAB's objects, tables among them, only the name and the class are told: their values lie
//! in a part of the file, the subsystem data, whose format is not published.

use super::arrays::{Shape, frame_of, values_max};
use super::{Log, Source};
use crate::ReadProblem;
use crate::error::one_line;
use crate::frame::{Array, Frame, NOT_READ, Values};
use crate::mapping::Mapping;
use flate2::read::ZlibDecoder;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Text, then two bytes of version and two that show which end comes first.
const HEAD_BYTES: usize = 128;
/// Where the head says at which byte the subsystem data begin: zero or spaces if there are none.
const SUBSYSTEM_AT: std::ops::Range<usize> = 116..124;
/// Structs in structs.
const DEPTH_MAX: usize = 8;

/// Kinds of elements.
const INT32: u32 = 5;
const UINT32: u32 = 6;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

pub(crate) struct Mat;

impl Source for Mat {
    fn matches(&self, log: &Log<'_>) -> bool {
        big_end_first(&log.start).is_some()
    }

    fn frame(&self, path: &Path, _: &Mapping) -> Result<Frame, ReadProblem> {
        let mut file = BufReader::new(File::open(path)?);
        let mut head = [0; HEAD_BYTES];
        file.read_exact(&mut head)?;
        let mut reader = Reader {
            arrays: Vec::new(),
            not_read: Vec::new(),
            big_end_first: big_end_first(&head).unwrap_or(false),
            values_left: values_max(path)?,
        };
        let whole = reader.read(
            &mut file,
            path.metadata()?.len(),
            reader.subsystem_at(&head),
        )?;
        let not_read = reader.not_read.join(", ");
        if reader.arrays.is_empty() && !not_read.is_empty() {
            return Err(ReadProblem::NothingRead(not_read));
        }
        let mut frame = frame_of(reader.arrays)?;
        if !not_read.is_empty() {
            frame.notes.insert(NOT_READ.to_owned(), not_read);
        }
        frame.truncated = !whole;
        Ok(frame)
    }
}

/// What a head of version 5 says about the order of bytes.
fn big_end_first(head: &[u8]) -> Option<bool> {
    match head.get(HEAD_BYTES - 4..HEAD_BYTES)? {
        [0, 1, b'I', b'M'] => Some(false),
        [1, 0, b'M', b'I'] => Some(true),
        _ => None,
    }
}

struct Reader {
    arrays: Vec<Array>,
    /// What was not, and what to do.
    not_read: Vec<String>,
    big_end_first: bool,
    /// That are read at most.
    values_left: usize,
}

impl Reader {
    fn subsystem_at(&self, head: &[u8; HEAD_BYTES]) -> Option<u64> {
        let bytes = head[SUBSYSTEM_AT].first_chunk()?;
        Some(match self.big_end_first {
            true => u64::from_be_bytes(*bytes),
            false => u64::from_le_bytes(*bytes),
        })
    }

    /// Reads the variables of a file of that length but for what is at that byte; whether the file ends after the last of them.
    fn read(
        &mut self,
        file: &mut impl Read,
        length: u64,
        but_at: Option<u64>,
    ) -> Result<bool, ReadProblem> {
        let mut left = length.saturating_sub(HEAD_BYTES as u64);
        while left > 0 {
            let is_left_out = Some(length - left) == but_at;
            let Some((kind, bytes)) = self.tag(file)? else {
                return Ok(false);
            };
            left = left.saturating_sub(8);
            if u64::from(bytes) > left {
                return Ok(false);
            }
            left -= u64::from(bytes);
            let mut element = Read::take(&mut *file, u64::from(bytes));
            match kind {
                _ if is_left_out => {}
                COMPRESSED => {
                    let mut unpacked = ZlibDecoder::new(&mut element);
                    match self.tag(&mut unpacked).map_err(wrong)? {
                        Some((MATRIX, bytes)) => self.variable(&mut unpacked, bytes)?,
                        _ => return Err(wrong("a variable does not begin as one")),
                    }
                }
                MATRIX => self.variable(&mut element, bytes)?,
                _ => {}
            }
            std::io::copy(&mut element, &mut std::io::sink())?;
        }
        Ok(true)
    }

    /// What comes next, and how long it is; `None` at the end.
    fn tag(&self, from: &mut impl Read) -> std::io::Result<Option<(u32, u32)>> {
        let mut tag = Vec::new();
        from.take(8).read_to_end(&mut tag)?;
        let mut tag = self.elements(&tag);
        Ok(tag.u32().zip(tag.u32()))
    }

    /// Reads a variable of so many bytes.
    fn variable(&mut self, from: &mut impl Read, bytes: u32) -> Result<(), ReadProblem> {
        // Names and numbers of columns beside the values take little.
        const BESIDE: u64 = 1 << 20;
        let bytes_max = 8 * self.values_left as u64 + BESIDE;
        if u64::from(bytes) > bytes_max {
            return Err(ReadProblem::UnpacksTooLarge { bytes: bytes_max });
        }
        let mut body = Vec::new();
        from.take(u64::from(bytes))
            .read_to_end(&mut body)
            .map_err(wrong)?;
        if body.len() != bytes as usize {
            return Err(wrong("a variable ends before its last value"));
        }
        self.matrix(&body, None, 0)
    }

    fn elements<'a>(&self, rest: &'a [u8]) -> Elements<'a> {
        Elements {
            rest,
            big_end_first: self.big_end_first,
        }
    }

    /// Reads a matrix, or those in a struct. What lies in a struct has no name of its own.
    fn matrix(
        &mut self,
        body: &[u8],
        field: Option<String>,
        depth: usize,
    ) -> Result<(), ReadProblem> {
        let mut elements = self.elements(body);
        let Some((head, shape, name)) = elements.head() else {
            // An empty field, or one of MATLAB's objects, which are something else.
            return Ok(());
        };
        let name = field.unwrap_or(name);
        match head {
            Class::Struct if depth < DEPTH_MAX => {
                let ends = || wrong(format!("struct `{name}` ends before its last field"));
                let fields = elements.field_names().ok_or_else(ends)?;
                let count = shape
                    .iter()
                    .fold(1, |count: u64, axis| count.saturating_mul(*axis));
                // A damaged file may say any number; those without fields would take no bytes at all.
                let count = if fields.is_empty() { 0 } else { count };
                for index in 1..=count {
                    if elements.rest.is_empty() {
                        break;
                    }
                    let of = match count {
                        1 => name.clone(),
                        _ => format!("{name}({index})"),
                    };
                    for field in &fields {
                        let (kind, body) = elements.next().ok_or_else(ends)?;
                        if kind == MATRIX {
                            self.matrix(body, Some(format!("{of}.{field}")), depth + 1)?;
                        }
                    }
                }
            }
            Class::Numbers | Class::Integers => {
                let Some(shape) = Shape::of(&shape, true, self.values_left)? else {
                    return Ok(());
                };
                let values = elements.values(head);
                let values = values.filter(|values| values.len() == shape.values());
                let values =
                    values.ok_or_else(|| wrong(format!("`{name}` does not have its values")))?;
                self.values_left -= shape.values();
                self.arrays.push(shape.table(name, &values));
            }
            Class::Cells => match self.cells(elements, &shape, &name)? {
                Some(array) => self.arrays.push(array),
                None => self.not_read.push(of_cells(&name)),
            },
            Class::Object => {
                // Before its class stands the system that has the class.
                let class = elements.next().and_then(|_| elements.next());
                let class = class.map_or(&[][..], |(_, class)| class);
                let class = String::from_utf8_lossy(class);
                self.not_read.push(of_object(&name, &class));
            }
            _ => {}
        }
        Ok(())
    }

    /// The table of cells that have as many numbers each: a row, or a joint where there are fewer cells than numbers in one.
    fn cells(
        &mut self,
        mut cells: Elements<'_>,
        axes: &[u64],
        name: &str,
    ) -> Result<Option<Array>, ReadProblem> {
        let Some(count) = length_of(axes) else {
            return Ok(None);
        };
        let mut first: Option<(u64, Shape)> = None;
        let mut numbers: Vec<f64> = Vec::new();
        for _ in 0..count {
            let ends = || wrong(format!("`{name}` ends before its last cell"));
            let (_, body) = cells.next().ok_or_else(ends)?;
            let mut cell = self.elements(body);
            let Some((class @ (Class::Numbers | Class::Integers), axes, _)) = cell.head() else {
                return Ok(None);
            };
            let Some(length) = length_of(&axes) else {
                return Ok(None);
            };
            if first.is_none() {
                // Before any value is kept, as a damaged file may say any number of cells.
                let shape = Shape::of(&[count, length], false, self.values_left)?;
                first = shape.map(|shape| (length, shape));
            }
            let values = cell.values(class).map(|values| values.numbers());
            match (values, first) {
                (Some(values), Some((of_all, _)))
                    if length == of_all && values.len() as u64 == length =>
                {
                    numbers.extend(values);
                }
                _ => return Ok(None),
            }
        }
        let Some((_, shape)) = first else {
            return Ok(None);
        };
        self.values_left -= shape.values();
        let name = name.to_owned();
        Ok(Some(shape.table(name, &Values::Numbers(numbers))))
    }
}

/// How many are in a row or a column; `None` of a matrix.
fn length_of(axes: &[u64]) -> Option<u64> {
    match *axes {
        [1, length] | [length, 1] => Some(length),
        _ => None,
    }
}

/// What is told of cells that are not read.
fn of_cells(name: &str) -> String {
    let name = one_line(name);
    format!(
        "`{name}` (a cell array, whose cells are no rows of as many numbers each; `cell2mat` may make a matrix of it)"
    )
}

/// What is told of one of MATLAB's objects, and what writes it as something that is read.
fn of_object(name: &str, class: &str) -> String {
    let (name, class) = (one_line(name), one_line(class));
    let file = name.rsplit('.').next().unwrap_or_default();
    let remedy = match &*class {
        "table" => format!("write it in MATLAB as `writetable({name}, '{file}.csv')`"),
        "timetable" => format!("write it in MATLAB as `writetimetable({name}, '{file}.csv')`"),
        "timeseries" => {
            format!("write it in MATLAB as `writematrix([{name}.Time, {name}.Data], '{file}.csv')`")
        }
        _ => "save its numbers as a matrix".to_owned(),
    };
    format!("`{name}` (a MATLAB {class}; {remedy})")
}

fn wrong(what: impl ToString) -> ReadProblem {
    ReadProblem::Mat(what.to_string())
}

/// What a matrix holds.
#[derive(Clone, Copy)]
enum Class {
    Numbers,
    Integers,
    Struct,
    Cells,
    /// A table, a time, a text in double quotes.
    Object,
    /// Text, functions, sparse ones.
    Other,
}

/// Elements one after the other, each with its kind and length before it.
struct Elements<'a> {
    rest: &'a [u8],
    big_end_first: bool,
}

impl<'a> Elements<'a> {
    fn u32(&mut self) -> Option<u32> {
        let (word, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        Some(match self.big_end_first {
            true => u32::from_be_bytes(*word),
            false => u32::from_le_bytes(*word),
        })
    }

    fn next(&mut self) -> Option<(u32, &'a [u8])> {
        let word = self.u32()?;
        // Up to four bytes stand beside their kind and length.
        if word >> 16 != 0 {
            let (data, rest) = self.rest.split_at_checked(4)?;
            self.rest = rest;
            return Some((word & 0xffff, data.get(..(word >> 16) as usize)?));
        }
        let length = self.u32()? as usize;
        let (data, rest) = self.rest.split_at_checked(length)?;
        // The last padding may be left out.
        let padding = (length.next_multiple_of(8) - length).min(rest.len());
        self.rest = &rest[padding..];
        Some((word, data))
    }

    /// What a matrix holds, its axes and its name.
    fn head(&mut self) -> Option<(Class, Vec<u64>, String)> {
        const IS_COMPLEX: u32 = 0x800;
        let (UINT32, flags) = self.next()? else {
            return None;
        };
        let flags = self.words(flags).next()?;
        let class = match flags & 0xff {
            1 => Class::Cells,
            2 => Class::Struct,
            17 => Class::Object,
            _ if flags & IS_COMPLEX != 0 => Class::Other,
            6 | 7 => Class::Numbers,
            8..=15 => Class::Integers,
            _ => Class::Other,
        };
        if matches!(class, Class::Object) {
            let (_, name) = self.next()?;
            return Some((
                class,
                Vec::new(),
                String::from_utf8_lossy(name).into_owned(),
            ));
        }
        let (INT32, axes) = self.next()? else {
            return None;
        };
        // More axes than two are two where the others have length one.
        let mut axes: Vec<u64> = self.words(axes).map(u64::from).collect();
        while axes.len() > 2 && axes.last() == Some(&1) {
            axes.pop();
        }
        let (_, name) = self.next()?;
        Some((class, axes, String::from_utf8_lossy(name).into_owned()))
    }

    fn words(&self, bytes: &'a [u8]) -> impl Iterator<Item = u32> + 'a {
        let big_end_first = self.big_end_first;
        bytes
            .as_chunks()
            .0
            .iter()
            .map(move |word| match big_end_first {
                true => u32::from_be_bytes(*word),
                false => u32::from_le_bytes(*word),
            })
    }

    /// Each in as many bytes as the longest has, with zeros behind.
    fn field_names(&mut self) -> Option<Vec<String>> {
        let (INT32, length) = self.next()? else {
            return None;
        };
        let length = self.words(length).next().filter(|length| *length > 0)?;
        let (_, names) = self.next()?;
        let names = names.chunks_exact(length as usize).map(|name| {
            let end = name.iter().position(|byte| *byte == 0);
            String::from_utf8_lossy(&name[..end.unwrap_or(name.len())]).into_owned()
        });
        Some(names.collect())
    }

    /// A matrix' values, which may lie in a smaller type than theirs.
    fn values(&mut self, class: Class) -> Option<Values> {
        /// The numbers of that type, as the class has them.
        macro_rules! of_type {
            ($number:ty, $bytes:ident) => {{
                let numbers = $bytes
                    .as_chunks()
                    .0
                    .iter()
                    .map(|bytes| match self.big_end_first {
                        true => <$number>::from_be_bytes(*bytes),
                        false => <$number>::from_le_bytes(*bytes),
                    });
                match class {
                    Class::Integers => Values::Integers(
                        numbers
                            .map(|number| i64::try_from(number as i128).ok())
                            .collect(),
                    ),
                    _ => Values::Numbers(numbers.map(|number| number as f64).collect()),
                }
            }};
        }
        let (kind, bytes) = self.next()?;
        Some(match kind {
            1 => of_type!(i8, bytes),
            2 => of_type!(u8, bytes),
            3 => of_type!(i16, bytes),
            4 => of_type!(u16, bytes),
            INT32 => of_type!(i32, bytes),
            UINT32 => of_type!(u32, bytes),
            7 => of_type!(f32, bytes),
            9 => of_type!(f64, bytes),
            12 => of_type!(i64, bytes),
            13 => of_type!(u64, bytes),
            _ => return None,
        })
    }
}
