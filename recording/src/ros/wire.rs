//! Bytes of ROS messages: CDR of ROS 2 (DDS-XTypes 1.3, 7.4), and the plain serialization of ROS 1.

/// How messages are written as bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// ROS 2: four bytes say how; values are aligned to their size.
    Cdr,
    /// ROS 1: little end first, nothing between the values.
    Ros1,
}

/// Reads one message's values in order. `None` from any of them: the message ends before, or is none.
pub(crate) struct Wire<'a> {
    rest: &'a [u8],
    /// Bytes read since values are aligned.
    position: usize,
    /// The largest alignment, one if there is none.
    align_max: usize,
    big_end_first: bool,
    encoding: Encoding,
}

impl<'a> Wire<'a> {
    pub(crate) fn new(bytes: &'a [u8], encoding: Encoding) -> Option<Self> {
        let (rest, align_max, big_end_first) = match encoding {
            Encoding::Ros1 => (bytes, 1, false),
            Encoding::Cdr => {
                let (head, rest) = bytes.split_first_chunk::<4>()?;
                match [head[0], head[1]] {
                    [0, 0] => (rest, 8, true),
                    [0, 1] => (rest, 8, false),
                    // The second version aligns to four bytes at most.
                    [0, 6] => (rest, 4, true),
                    [0, 7] => (rest, 4, false),
                    _ => return None,
                }
            }
        };
        Some(Self {
            rest,
            position: 0,
            align_max,
            big_end_first,
            encoding,
        })
    }

    pub(crate) fn encoding(&self) -> Encoding {
        self.encoding
    }

    fn take(&mut self, bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(bytes)?;
        self.rest = rest;
        self.position += bytes;
        Some(taken)
    }

    fn align(&mut self, size: usize) -> Option<()> {
        let size = size.min(self.align_max);
        self.take(self.position.next_multiple_of(size) - self.position)
            .map(|_| ())
    }

    fn word<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.align(N)?;
        let mut word: [u8; N] = self.take(N)?.try_into().ok()?;
        // Words are handed over with the little end first.
        if self.big_end_first {
            word.reverse();
        }
        Some(word)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.word().map(u32::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Option<i32> {
        self.word().map(i32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.word().map(f64::from_le_bytes)
    }

    pub(crate) fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        // CDR ends a text with a zero byte, ROS 1 does not.
        let bytes = match self.encoding {
            Encoding::Cdr => bytes.strip_suffix(&[0]).unwrap_or(bytes),
            Encoding::Ros1 => bytes,
        };
        Some(String::from_utf8_lossy(bytes).into_owned())
    }

    pub(crate) fn texts(&mut self) -> Option<Vec<String>> {
        let count = self.u32()?;
        // What is reserved grows with what is there, not with what is said.
        let mut texts = Vec::new();
        for _ in 0..count {
            texts.push(self.text()?);
        }
        Some(texts)
    }

    pub(crate) fn numbers(&mut self) -> Option<Vec<f64>> {
        let count = self.u32()?;
        let mut numbers = Vec::new();
        for _ in 0..count {
            numbers.push(self.f64()?);
        }
        Some(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_aligned_after_the_head_that_says_how() {
        let little: Vec<u8> = [
            &[0, 1, 0, 0][..],
            &3_u32.to_le_bytes(),
            b"ab\0\0",
            &1_u32.to_le_bytes(),
            &[0; 4],
            &2.5_f64.to_le_bytes(),
        ]
        .concat();
        let mut wire = Wire::new(&little, Encoding::Cdr).unwrap();
        assert_eq!(wire.text().unwrap(), "ab");
        assert_eq!(wire.numbers().unwrap(), [2.5]);
        assert!(wire.u32().is_none());
        let big: Vec<u8> = [
            &[0, 0, 0, 0][..],
            &1_u32.to_be_bytes(),
            &[0; 4],
            &2.5_f64.to_be_bytes(),
        ]
        .concat();
        assert_eq!(
            Wire::new(&big, Encoding::Cdr).unwrap().numbers().unwrap(),
            [2.5]
        );
        let second: Vec<u8> = [
            &[0, 7, 0, 0][..],
            &1_u32.to_le_bytes(),
            &2.5_f64.to_le_bytes(),
        ]
        .concat();
        assert_eq!(
            Wire::new(&second, Encoding::Cdr)
                .unwrap()
                .numbers()
                .unwrap(),
            [2.5]
        );
        assert!(Wire::new(&[0, 3, 0, 0], Encoding::Cdr).is_none());
    }

    #[test]
    fn a_count_is_not_believed() {
        let many: Vec<u8> = [&[0, 1, 0, 0][..], &u32::MAX.to_le_bytes(), &[0; 64]].concat();
        assert!(Wire::new(&many, Encoding::Cdr).unwrap().numbers().is_none());
        assert!(Wire::new(&many, Encoding::Cdr).unwrap().texts().is_none());
    }
}
