//! Reads the lines of a CSV before the CSV parser: limits their length and counts them.
//!
//! The parser's own count is wrong behind blank lines and CRLF, since it begins a record at the end of the last one.

use std::collections::VecDeque;
use std::fmt;
use std::io::{self, Read};

/// The longest line that is read, bytes: some 40 000 columns.
pub(crate) const MAX_LINE: usize = 1 << 20;

/// A line longer than [`MAX_LINE`]; the CSV parser passes it on inside an [`io::Error`].
#[derive(Debug)]
pub(crate) struct LongLine {
    /// Its number, counted from 1.
    pub line: u64,
}

impl fmt::Display for LongLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {} is longer than {MAX_LINE} bytes", self.line)
    }
}

impl std::error::Error for LongLine {}

/// Passes bytes on and fails at a line that is too long. A line end inside quotes ends no line, so that the guard also detects a quote that is never closed.
pub(crate) struct LineGuard<R> {
    input: R,
    /// Bytes passed on.
    offset: u64,
    /// The current line, counted from 1, and its bytes so far.
    line: u64,
    length: usize,
    quoted: bool,
    /// Line ends inside quotes, since the line began.
    lines_within: u64,
    previous: u8,
    /// Offset and number of the lines that are not blank and not yet requested.
    starts: VecDeque<(u64, u64)>,
}

impl<R: Read> LineGuard<R> {
    /// Guards an `input` whose first line has the number `line`.
    pub fn from_line(input: R, line: u64) -> Self {
        LineGuard {
            input,
            offset: 0,
            line,
            length: 0,
            quoted: false,
            lines_within: 0,
            previous: b'\n',
            starts: VecDeque::new(),
        }
    }

    /// The number of the first line that is not blank and begins at `offset` or behind it. Offsets must not decrease from call to call: the guard forgets
    /// earlier lines.
    pub fn line_from(&mut self, offset: u64) -> u64 {
        while self.starts.front().is_some_and(|(start, _)| *start < offset) {
            self.starts.pop_front();
        }
        self.starts.front().map_or(self.line, |(_, line)| *line)
    }

    /// Processes bytes that neither end a line nor quote anything.
    fn see_plain(&mut self, bytes: &[u8]) {
        let Some(last) = bytes.last() else { return };
        self.begin_line();
        self.previous = *last;
        self.length += bytes.len();
        self.offset += bytes.len() as u64;
    }

    /// Processes a line end or a quote.
    fn see_special(&mut self, byte: u8) {
        if byte == b'"' {
            self.begin_line();
            self.length += 1;
            if self.quoted || matches!(self.previous, b',' | b'\n' | b'\r') {
                self.quoted = !self.quoted;
            }
        } else if self.quoted {
            self.length += 1;
            self.lines_within += u64::from(byte == b'\n');
        } else {
            let second_half = byte == b'\n' && self.previous == b'\r';
            self.line += self.lines_within + u64::from(!second_half);
            self.lines_within = 0;
            self.length = 0;
        }
        self.previous = byte;
        self.offset += 1;
    }

    fn begin_line(&mut self) {
        if self.length == 0 {
            self.starts.push_back((self.offset, self.line));
        }
    }

    fn check_length(&self) -> io::Result<()> {
        if self.length <= MAX_LINE {
            return Ok(());
        }
        Err(io::Error::new(io::ErrorKind::InvalidData, LongLine { line: self.line }))
    }
}

impl<R: Read> Read for LineGuard<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.input.read(buffer)?;
        let mut rest = &buffer[..count];
        while let Some(plain) = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r' | b'"')) {
            self.see_plain(&rest[..plain]);
            self.check_length()?;
            self.see_special(rest[plain]);
            rest = &rest[plain + 1..];
        }
        self.see_plain(rest);
        self.check_length()?;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::LineGuard;

    #[test]
    fn lines_are_numbered_as_an_editor_does() {
        let text = "a\n\nb\r\n\r\nc\rd,\"e\nf\"\n\"\"\"g\"\n h\"\ni";
        let mut guard = LineGuard::from_line(text.as_bytes(), 1);
        guard.read_to_end(&mut Vec::new()).expect("short lines");
        let expected = [("a", 1), ("b", 3), ("c", 5), ("d", 6), ("\"\"\"g", 8), (" h", 9), ("i", 10)];
        for (start, line) in expected {
            let offset = text.find(start).expect("in the text") as u64;
            // As the parser calls it: from the end of the line before, blank lines included.
            assert_eq!(guard.line_from(offset.saturating_sub(u64::from(start == "b"))), line, "{start:?}");
        }
    }
}
