//! The text of a CSV log as people write it: what stands between the fields, and lines that are comments.

use crate::names::are_units;
use std::io::{BufRead, Read, Result};

/// What may stand between two fields; the line that names the columns shows which does. Spaces do where nothing else does.
const DELIMITERS: [u8; 3] = [b',', b';', b'\t'];
const SPACE: u8 = b' ';
/// What a line that is a comment begins with.
const COMMENT: [u8; 2] = [b'#', b'%'];
/// A line longer than this is handed over in pieces.
const LINE_BYTES_MAX: u64 = 1 << 20;
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();
/// So many lines are looked at for the one that names the columns: instruments and programs write up to some dozens before it.
const LINES_AHEAD: usize = 100;

/// What begins a CSV file.
pub(crate) struct Start {
    pub(crate) delimiter: u8,
    /// The columns' names, where they are in a comment.
    pub(crate) commented_header: Option<Vec<u8>>,
    /// Of the columns, where a line after their names tells them.
    pub(crate) units: Option<Vec<String>>,
    /// How many columns without names there are, where the first line is one of numbers.
    pub(crate) unnamed: Option<usize>,
}

/// A text without its comments, its byte order mark and its line of units, opened and looked at. These become empty lines,
/// which the reader of the fields passes over but counts.
pub(crate) struct Uncommented<R> {
    text: R,
    line: Vec<u8>,
    read: usize,
    /// Whether the next bytes begin a line.
    at_start: bool,
    /// Whether spaces stand between the fields, as many as it takes to put numbers below each other.
    by_spaces: bool,
}

impl<R: BufRead> Uncommented<R> {
    /// Passes over the comments before the first line and tells what that and the next look like.
    pub(crate) fn open(text: R) -> Result<(Self, Start)> {
        let mut lines = Self {
            text,
            line: Vec::new(),
            read: 0,
            at_start: true,
            by_spaces: false,
        };
        let (mut comments, mut passed_over) = lines.pass_over_comments()?;
        let mut ahead = vec![(0, std::mem::take(&mut lines.line))];
        while lines.at_start && ahead.len() < LINES_AHEAD && !ahead[ahead.len() - 1].1.is_empty() {
            let between = lines.pass_over_comments()?.1;
            ahead.push((between, std::mem::take(&mut lines.line)));
        }
        let preamble = preamble(&ahead);
        if preamble > 0 {
            comments.clear();
        }
        for (between, _) in ahead.drain(..preamble) {
            passed_over += between + 1;
        }
        let mut ahead = ahead.into_iter();
        let (before, first) = ahead.next().unwrap_or_default();
        passed_over += before;
        let (between, mut second) = ahead.next().unwrap_or_default();
        let delimiter = delimiter(&first, &second);
        lines.by_spaces = delimiter == SPACE;
        let fields = |line: &[u8]| fields(line, delimiter);
        // Some writers put the columns' names in a comment, and their units in another.
        let (mut commented_header, mut units) = (None, None);
        let names = fields(&first);
        let all_numbers = names.iter().all(|field| is_number(field));
        if all_numbers || is_mostly_numbers(&names) {
            let fits = |line: &Vec<u8>| {
                let told = fields(line);
                let numbers = told.iter().filter(|name| is_number(name)).count();
                told.len() == names.len()
                    && if all_numbers {
                        numbers < told.len()
                    } else {
                        numbers == 0
                    }
            };
            commented_header = comments.pop().filter(fits);
            let told = commented_header.as_ref().map(|line| fields(line));
            if let Some(names) = comments.pop().filter(fits)
                && told.as_ref().is_some_and(|told| are_units(told))
            {
                (commented_header, units) = (Some(names), told);
            }
        }
        if !all_numbers
            && commented_header.is_none()
            && fields(&second).len() == names.len()
            && are_units(&fields(&second))
        {
            units = Some(fields(&second));
            second = b"\n".to_vec();
        }
        if lines.by_spaces {
            commented_header
                .iter_mut()
                .for_each(|line| one_space(line, true));
        }
        // The lines passed over are still to be counted.
        let mut text = vec![b'\n'; passed_over];
        for (between, mut line) in [(0, first), (between, second)].into_iter().chain(ahead) {
            if lines.by_spaces {
                one_space(&mut line, true);
            }
            text.extend(std::iter::repeat_n(b'\n', between));
            text.append(&mut line);
        }
        lines.line = text;
        let start = Start {
            unnamed: (commented_header.is_none() && is_row(&names)).then_some(names.len()),
            delimiter,
            commented_header,
            units,
        };
        Ok((lines, start))
    }

    /// Reads on to the next line that is none, into `line`; the comments, and how many lines were passed over.
    fn pass_over_comments(&mut self) -> Result<(Vec<Vec<u8>>, usize)> {
        let (mut comments, mut passed_over) = (Vec::new(), 0);
        while self.next_line()? {
            if self.line.starts_with(BYTE_ORDER_MARK) {
                self.line.drain(..BYTE_ORDER_MARK.len());
            }
            match self.line.trim_ascii().split_first() {
                Some((first, rest)) if COMMENT.contains(first) => {
                    comments.push(rest.trim_ascii().to_vec());
                }
                Some(_) => break,
                None => {}
            }
            passed_over += 1;
        }
        Ok((comments, passed_over))
    }

    /// Reads the next line into `line`; false at the end.
    fn next_line(&mut self) -> Result<bool> {
        self.line.clear();
        self.read = 0;
        let mut piece = (&mut self.text).take(LINE_BYTES_MAX);
        piece.read_until(b'\n', &mut self.line)?;
        self.at_start = self.line.ends_with(b"\n");
        Ok(!self.line.is_empty())
    }
}

impl<R: BufRead> Read for Uncommented<R> {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        if self.read == self.line.len() {
            let begins = self.at_start;
            if !self.next_line()? {
                return Ok(0);
            }
            let first = self.line.trim_ascii_start().first();
            if begins && first.is_some_and(|first| COMMENT.contains(first)) {
                self.line.clear();
                self.line.push(b'\n');
            } else if self.by_spaces {
                one_space(&mut self.line, begins);
            }
        }
        let count = into.len().min(self.line.len() - self.read);
        into[..count].copy_from_slice(&self.line[self.read..self.read + count]);
        self.read += count;
        Ok(count)
    }
}

/// The delimiter that the first line has most of. Commas of numbers are not in a line that names the columns, and in one of
/// numbers they go after the others, but for commas that a space follows, which no number has. Spaces part the fields where the next
/// line has as many.
fn delimiter(first: &[u8], second: &[u8]) -> u8 {
    let count = |delimiter: &u8| first.iter().filter(|byte| *byte == delimiter).count();
    let of_numbers = first
        .iter()
        .all(|byte| !byte.is_ascii_alphabetic() || matches!(byte, b'e' | b'E'));
    if of_numbers && let Some(delimiter) = [b'\t', b';'].into_iter().find(|one| count(one) > 0) {
        return delimiter;
    }
    let parted = fields(first, SPACE);
    if let Some((_, before)) = parted.split_last()
        && !before.is_empty()
        && before.iter().all(|word| word.ends_with(','))
    {
        return b',';
    }
    let words = |line: &[u8]| fields(line, SPACE).len();
    let others = if of_numbers { &b";\t"[..] } else { &DELIMITERS };
    if others.iter().all(|other| count(other) == 0)
        && words(first) > 1
        && words(first) == words(second)
    {
        return SPACE;
    }
    // `max_by_key` takes the last of equals, so a line without any delimiter counts as comma-separated.
    let most = DELIMITERS.into_iter().rev().max_by_key(count);
    most.unwrap_or(b',')
}

/// How many lines stand before the one that names the columns: none, but where all lines from a later one on have as many fields as
/// that, it has no numbers and those after it have, which no file has that begins with its columns' names or values.
fn preamble(ahead: &[(usize, Vec<u8>)]) -> usize {
    let lines: Vec<&[u8]> = ahead.iter().map(|(_, line)| &line[..]).collect();
    let lines = lines.strip_suffix(&[&[][..]]).unwrap_or(&lines);
    let begins = |from: usize| {
        let delimiter = delimiter(lines[from], lines[from + 1]);
        let parted = lines[from..].iter().map(|line| fields(line, delimiter));
        let parted: Vec<Vec<String>> = parted.collect();
        let names = &parted[0];
        if names.len() < 2 || parted.iter().any(|line| line.len() != names.len()) {
            return false;
        }
        let values = &parted[1 + usize::from(are_units(&parted[1]))..];
        let are_names = !names.iter().any(|name| is_number(name) && !name.is_empty());
        let are_rows = !values.is_empty() && values.iter().all(|line| is_mostly_numbers(line));
        from == 0 || are_names && are_rows
    };
    let mut candidates = 0..lines.len().saturating_sub(1);
    candidates.find(|from| begins(*from)).unwrap_or(0)
}

/// A line's fields, without quotes and spaces around them.
fn fields(line: &[u8], delimiter: u8) -> Vec<String> {
    let text = |field: &[u8]| {
        let field = String::from_utf8_lossy(field);
        field.trim().trim_matches('"').trim().to_owned()
    };
    let line = line.trim_ascii();
    match delimiter {
        SPACE => {
            let words = line.split(u8::is_ascii_whitespace);
            words.filter(|word| !word.is_empty()).map(text).collect()
        }
        _ => line.split(|byte| *byte == delimiter).map(text).collect(),
    }
}

/// Whether a first line is one of values: all numbers, but not the columns counted, as pandas names those that have no names.
fn is_row(fields: &[String]) -> bool {
    let counted = |from: usize| {
        let mut numbers = fields.iter().zip(from..);
        numbers.all(|(field, number)| *field == number.to_string())
    };
    let some = fields.iter().any(|field| !field.is_empty());
    some && fields.iter().all(|field| is_number(field)) && !(counted(0) || counted(1))
}

/// Whether half of a line's fields and more are numbers: text is in rows too, but no numbers are in a line of names.
pub(super) fn is_mostly_numbers(fields: &[String]) -> bool {
    let numbers = fields
        .iter()
        .filter(|field| is_number(field) && !field.is_empty());
    2 * numbers.count() >= fields.len()
}

fn is_number(field: &str) -> bool {
    field.is_empty() || field.replacen(',', ".", 1).parse::<f64>().is_ok()
}

/// Leaves one space of several, and none at the beginning of a line.
fn one_space(line: &mut Vec<u8>, begins: bool) {
    let mut before = if begins { SPACE } else { b'0' };
    line.retain_mut(|byte| {
        if *byte == b'\t' {
            *byte = SPACE;
        }
        let kept = *byte != SPACE || before != SPACE;
        before = *byte;
        kept
    });
    let end = line.len()
        - line
            .iter()
            .rev()
            .take_while(|byte| matches!(byte, b'\r' | b'\n'))
            .count();
    if end > 0 && line[end - 1] == SPACE && end < line.len() {
        line.remove(end - 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(text: &[u8]) -> (String, Start) {
        let (mut lines, start) = Uncommented::open(text).unwrap();
        let mut rest = String::new();
        lines.read_to_string(&mut rest).unwrap();
        (rest, start)
    }

    #[test]
    fn comments_become_empty_lines_so_that_lines_are_still_counted() {
        let (text, start) =
            opened("\u{feff}# made by hand\n%\nt;q\n0;1,5\n # late\n1;2\n".as_bytes());
        assert_eq!(text, "\n\nt;q\n0;1,5\n\n1;2\n");
        assert_eq!(start.delimiter, b';');
        assert!(start.commented_header.is_none());
    }

    #[test]
    fn names_in_a_comment_are_found_where_the_first_line_is_numbers() {
        let (text, start) = opened(b"# run 7\n# t, q\n0, 1\n");
        assert_eq!(text, "\n\n0, 1\n");
        assert_eq!(start.commented_header.as_deref(), Some(&b"t, q"[..]));
        assert!(opened(b"# run 7\n0, 1\n").1.commented_header.is_none());
        let (_, start) = opened(b"%time,name0,position0\n17,elbow,0.5\n");
        assert_eq!(
            start.commented_header.as_deref(),
            Some(&b"time,name0,position0"[..])
        );
        assert!(opened(b"# a,b\nt,q\n0,1\n").1.commented_header.is_none());
    }

    #[test]
    fn spaces_part_fields_where_nothing_else_does_however_many() {
        let (text, start) = opened(b"  t   q1 q2\n 0.0  1,5  -2\n\n10.0 1 2  \r\n");
        assert_eq!(start.delimiter, b' ');
        assert_eq!(text, "t q1 q2\n0.0 1,5 -2\n\n10.0 1 2\r\n");
        let (_, start) = opened(b"# t q\n 0,0  1,5\n 0,1  1,6\n");
        assert_eq!(start.delimiter, b' ');
        assert_eq!(start.commented_header.as_deref(), Some(&b"t q"[..]));
        assert_eq!(opened(b"time stamp\n1\n2\n").1.delimiter, b',');
        assert_eq!(opened(b"2.5, 0.1, 0.4\n2.6, 0.1, 0.3\n").1.delimiter, b',');
        assert_eq!(opened(b"2,5 0,1 0,4\n2,6 0,1 0,3\n").1.delimiter, b' ');
        assert_eq!(opened(b"% t;q\n0,0;1,5\n").1.delimiter, b';');
    }

    #[test]
    fn a_first_line_of_numbers_is_one_of_values_unless_it_counts() {
        let unnamed = |text: &str| opened(text.as_bytes()).1.unnamed;
        assert_eq!(unnamed("0.0,1.5,-2\n0.1,1,2\n"), Some(3));
        assert_eq!(unnamed("0,0  1,5\n0,1  1,6\n"), Some(2));
        for named in [
            "0,1,2\n5,5,5\n",
            "1;2\n5;5\n",
            "t,q\n0,1\n",
            "# t,q\n0.5,1\n",
            "",
        ] {
            assert_eq!(unnamed(named), None, "{named}");
        }
    }

    #[test]
    fn a_line_of_units_is_taken_out_and_still_counted() {
        let units = |text: &str| opened(text.as_bytes()).1.units;
        let (text, start) = opened(b"t;q;i\ns;\"deg\";A\n0;1;2\n");
        assert_eq!(text, "t;q;i\n\n0;1;2\n");
        assert_eq!(start.units.unwrap(), ["s", "deg", "A"]);
        assert_eq!(
            units("t,q,mode\n[ms],[rad/s],-\n").unwrap(),
            ["[ms]", "[rad/s]", "-"]
        );
        assert_eq!(units("# t q\n# s deg\n0 1\n1 2\n").unwrap(), ["s", "deg"]);
        assert_eq!(
            opened(b"# t q\n# s deg\n0 1\n1 2\n")
                .1
                .commented_header
                .unwrap(),
            b"t q"
        );
        for other in [
            "t,q\n0,1\n",
            "t,mode\n0,idle\n",
            "t;i;v\n0,5;a;v\n",
            "t,i,mode\ns,idle,off\n",
            "t,q\n,\n",
            "t,q\ns\n",
            "s,m\n",
        ] {
            assert_eq!(units(other), None, "{other}");
        }
    }

    #[test]
    fn what_stands_before_the_names_is_passed_over_and_still_counted() {
        let opened = |text: &str| opened(text.as_bytes());
        let (text, start) =
            opened("Test rig 3\nSerial,1234\nDate,2021,3\n\nt [s],q1,tau1\n0.0,1,2\n0.1,1,2\n");
        assert_eq!(text, "\n\n\n\nt [s],q1,tau1\n0.0,1,2\n0.1,1,2\n");
        assert_eq!((start.delimiter, start.unnamed), (b',', None));
        let (text, start) = opened("rate: 100\nt;q\ns;deg\n0,0;1,5\n0,1;1,6\n");
        assert_eq!(text, "\nt;q\n\n0,0;1,5\n0,1;1,6\n");
        assert_eq!(start.units.unwrap(), ["s", "deg"]);
        // a unit that is not known among those that are
        let (text, start) = opened("monday\nV,I,T,p\nV,mA,N.mm,bar\n0,1,2,3\n1,1,2,3\n");
        assert_eq!(text, "\nV,I,T,p\n\n0,1,2,3\n1,1,2,3\n");
        assert_eq!(start.units.unwrap(), ["V", "mA", "N.mm", "bar"]);
        let (text, start) = opened("monday\n t  q1 q2\n 0  1  2\n 1  1  2\n");
        assert_eq!(text, "\nt q1 q2\n0 1 2\n1 1 2\n");
        assert_eq!(start.delimiter, b' ');
        // names too few or too many are an error of the rows, not something before them
        for whole in [
            "t,q\n0,1,2\n0,1,2\n",
            "t,q,mode\n0,1,idle\n0,1,idle\n",
            "0,1\n0,1,2\n0,1,2\n",
            "t,q\n0,1\nEND\n",
        ] {
            assert_eq!(opened(whole).0, whole);
        }
    }

    #[test]
    fn a_line_without_an_end_is_read_in_pieces() {
        let long = vec![b'7'; 3 * LINE_BYTES_MAX as usize];
        assert_eq!(opened(&long).0.len(), long.len());
        assert_eq!(opened(b"").0, "");
    }
}
