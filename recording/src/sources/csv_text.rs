//! The text of a CSV log as people write it: what stands between the fields, and lines that are comments.

use std::io::{BufRead, Read, Result};

/// What may stand between two fields; the line that names the columns shows which does.
const DELIMITERS: [u8; 3] = [b',', b';', b'\t'];
/// What a line that is a comment begins with.
const COMMENT: [u8; 2] = [b'#', b'%'];
/// A line longer than this is handed over in pieces.
const LINE_BYTES_MAX: u64 = 1 << 20;
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// What begins a CSV file.
pub(crate) struct Start {
    pub(crate) delimiter: u8,
    /// The columns' names, where they are in a comment.
    pub(crate) commented_header: Option<Vec<u8>>,
}

/// A text without its comments and its byte order mark, opened and looked at. Comments become empty lines, which the
/// reader of the fields passes over but counts.
pub(crate) struct Uncommented<R> {
    text: R,
    line: Vec<u8>,
    read: usize,
    /// Whether the next bytes begin a line.
    at_start: bool,
}

impl<R: BufRead> Uncommented<R> {
    /// Passes over the comments before the first line and tells what that looks like.
    pub(crate) fn open(text: R) -> Result<(Self, Start)> {
        let mut lines = Self {
            text,
            line: Vec::new(),
            read: 0,
            at_start: true,
        };
        let (mut comment, mut passed_over) = (None, 0);
        while lines.next_line()? {
            if passed_over == 0 && lines.line.starts_with(BYTE_ORDER_MARK) {
                lines.line.drain(..BYTE_ORDER_MARK.len());
            }
            let line = lines.line.trim_ascii();
            match line.split_first() {
                Some((first, rest)) if COMMENT.contains(first) => {
                    comment = Some(rest.trim_ascii().to_vec());
                }
                Some(_) => break,
                None => {}
            }
            passed_over += 1;
        }
        let delimiter = delimiter(&lines.line);
        // Some writers put the columns' names in a comment.
        let fields = |line: &[u8]| line.split(|byte| *byte == delimiter).count();
        let commented_header = comment.filter(|names| {
            all_numbers(&lines.line, delimiter)
                && !all_numbers(names, delimiter)
                && fields(names) == fields(&lines.line)
        });
        // The lines passed over are still to be counted.
        lines.line.splice(0..0, vec![b'\n'; passed_over]);
        let start = Start {
            delimiter,
            commented_header,
        };
        Ok((lines, start))
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
            }
        }
        let count = into.len().min(self.line.len() - self.read);
        into[..count].copy_from_slice(&self.line[self.read..self.read + count]);
        self.read += count;
        Ok(count)
    }
}

/// The delimiter that the line has most of. Commas of numbers are not in the line that names the columns.
fn delimiter(line: &[u8]) -> u8 {
    let count = |delimiter: &u8| line.iter().filter(|byte| *byte == delimiter).count();
    // `max_by_key` takes the last of equals, so a line without any delimiter counts as comma-separated.
    let most = DELIMITERS.into_iter().rev().max_by_key(count);
    most.unwrap_or(b',')
}

fn all_numbers(line: &[u8], delimiter: u8) -> bool {
    line.trim_ascii()
        .split(|byte| *byte == delimiter)
        .all(|field| {
            let field = String::from_utf8_lossy(field);
            let field = field.trim();
            field.is_empty() || field.parse::<f64>().is_ok()
        })
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
    }

    #[test]
    fn a_line_without_an_end_is_read_in_pieces() {
        let long = vec![b'7'; 3 * LINE_BYTES_MAX as usize];
        assert_eq!(opened(&long).0.len(), long.len());
        assert_eq!(opened(b"").0, "");
    }
}
