//! The diagnostic stream: text lines in and bytes out, carried piece by piece in frames.
//!
//! A piece that was asked for by number is sent again until its number is acknowledged, so that a lost frame loses nothing
//! (moteus-protocol, diagnostic.rs, "flow-controlled variant"); one that was asked for without is gone once it was sent.

use std::collections::VecDeque;

/// Bytes of a line that is kept: longer ones are no command.
const LINE_BYTES: usize = 256;
/// Bytes that wait for a reader. What the drive has to say at once is far less; periodic telemetry that nobody reads is dropped.
const WAITING_BYTES: usize = 1 << 16;

/// One drive's diagnostic stream.
#[derive(Clone, Debug, Default)]
pub struct Tunnel {
    line: Vec<u8>,
    is_too_long: bool,
    waiting: VecDeque<u8>,
    /// The piece on its way, and its number.
    sent: Vec<u8>,
    number: u8,
}

impl Tunnel {
    /// Takes bytes from the other side; the lines that they complete. Whoever speaks has read what was on its way: nobody
    /// asks anew before the answer is whole.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<String> {
        self.sent.clear();
        let mut lines = Vec::new();
        for byte in bytes {
            if !matches!(byte, b'\r' | b'\n') {
                self.is_too_long |= self.line.len() >= LINE_BYTES;
                if !self.is_too_long {
                    self.line.push(*byte);
                }
                continue;
            }
            let line = std::mem::take(&mut self.line);
            if !std::mem::take(&mut self.is_too_long) && !line.is_empty() {
                lines.push(String::from_utf8_lossy(&line).into_owned());
            }
        }
        lines
    }

    /// Has bytes to say. Dropped where nobody has read what came before.
    pub fn say(&mut self, bytes: &[u8]) {
        if self.waiting.len() + bytes.len() <= WAITING_BYTES {
            self.waiting.extend(bytes);
        }
    }

    /// Whether somebody reads what is said.
    pub fn is_read(&self) -> bool {
        self.waiting.len() < LINE_BYTES
    }

    /// The next piece, at most so long. Whoever asks without a number does not wait for one that was numbered.
    pub fn piece(&mut self, at_most: usize) -> Vec<u8> {
        self.sent.clear();
        self.cut(at_most)
    }

    fn cut(&mut self, at_most: usize) -> Vec<u8> {
        let length = self.waiting.len().min(at_most);
        self.waiting.drain(..length).collect()
    }

    /// The piece after the one with the number `acknowledged`, or that one again if it was lost; with its number.
    pub fn numbered_piece(&mut self, acknowledged: u8, at_most: usize) -> (u8, Vec<u8>) {
        if acknowledged == self.number || self.sent.is_empty() {
            self.sent = self.cut(at_most);
            if !self.sent.is_empty() {
                self.number = acknowledged.wrapping_add(1);
            } else {
                self.number = acknowledged;
            }
        }
        (self.number, self.sent.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_whole_however_they_are_cut() {
        let mut tunnel = Tunnel::default();
        assert!(tunnel.take(b"d st").is_empty());
        assert_eq!(
            tunnel.take(b"op\r\n\nconf list\nte"),
            ["d stop", "conf list"]
        );
        assert!(tunnel.take(&[b'x'; 300]).is_empty());
        assert_eq!(tunnel.take(b"\ntel stop\n"), ["tel stop"]);
    }

    #[test]
    fn a_piece_comes_again_until_it_is_acknowledged() {
        let mut tunnel = Tunnel::default();
        tunnel.say(b"abcdef");
        assert_eq!(tunnel.numbered_piece(0, 4), (1, b"abcd".to_vec()));
        assert_eq!(tunnel.numbered_piece(0, 4), (1, b"abcd".to_vec()));
        assert_eq!(tunnel.numbered_piece(1, 4), (2, b"ef".to_vec()));
        assert_eq!(tunnel.numbered_piece(2, 4), (2, Vec::new()));
        tunnel.say(b"gh");
        assert_eq!(tunnel.numbered_piece(2, 1), (3, b"g".to_vec()));
        // another reader, who counts from the beginning, and has asked something or has emptied the stream
        tunnel.take(b"d stop\n");
        assert_eq!(tunnel.numbered_piece(0, 4), (1, b"h".to_vec()));
        assert!(tunnel.piece(4).is_empty());
        assert_eq!(tunnel.numbered_piece(0, 4), (0, Vec::new()));
    }

    #[test]
    fn what_nobody_reads_does_not_grow() {
        let mut tunnel = Tunnel::default();
        for _ in 0..1000 {
            tunnel.say(&[0; 1000]);
        }
        assert!(tunnel.piece(usize::MAX).len() <= WAITING_BYTES);
    }
}
