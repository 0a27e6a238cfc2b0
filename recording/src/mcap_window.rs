//! A stream with look-ahead: bytes stay in memory until they are consumed, so that a reader can parse them again in another way.

use std::io::{self, Read};

/// The bytes of a stream from the next unconsumed one on.
pub(crate) struct Window<R> {
    input: R,
    bytes: Vec<u8>,
    start: usize,
    /// Offset of the first unconsumed byte in the stream.
    pub offset: u64,
}

impl<R: Read> Window<R> {
    /// A window on `input`, whose first byte is at `offset` of the file.
    pub fn new(input: R, offset: u64) -> Self {
        Window { input, bytes: Vec::new(), start: 0, offset }
    }

    /// The next bytes: `length` of them, or fewer at the end of the stream.
    pub fn peek(&mut self, length: usize) -> io::Result<&[u8]> {
        let there = self.bytes.len() - self.start;
        if there < length {
            self.bytes.drain(..self.start);
            self.start = 0;
            (&mut self.input).take((length - there) as u64).read_to_end(&mut self.bytes)?;
        }
        let end = self.bytes.len().min(self.start + length);
        Ok(&self.bytes[self.start..end])
    }

    /// Skips `length` bytes; false if the stream ends before.
    pub fn consume(&mut self, length: u64) -> io::Result<bool> {
        let there = (self.bytes.len() - self.start) as u64;
        let from_memory = length.min(there);
        self.start += from_memory as usize;
        let rest = length - from_memory;
        let skipped =
            if rest == 0 { 0 } else { io::copy(&mut (&mut self.input).take(rest), &mut io::sink())? };
        self.offset += from_memory + skipped;
        Ok(skipped == rest)
    }
}

#[cfg(test)]
mod tests {
    use super::Window;

    #[test]
    fn bytes_stay_until_they_are_consumed() {
        let mut window = Window::new(&b"0123456789"[..], 8);
        assert_eq!(window.peek(4).expect("memory"), b"0123");
        assert_eq!(window.peek(6).expect("memory"), b"012345");
        assert!(window.consume(2).expect("memory"));
        assert_eq!(window.peek(3).expect("memory"), b"234");
        assert!(window.consume(7).expect("memory"));
        assert_eq!(window.peek(3).expect("memory"), b"9");
        assert_eq!(window.offset, 17);
        assert!(!window.consume(2).expect("memory"), "only one is left");
    }
}
