//! Converts columns separated by any number of blanks to columns separated by one.

use std::io::{self, Read};

/// Passes bytes on with one blank for each run of blanks and tabs, and none at either end of a line.
pub(crate) struct Squeeze<R> {
    input: R,
    ready: Vec<u8>,
    taken: usize,
    is_blank_due: bool,
    is_at_start: bool,
}

impl<R: Read> Squeeze<R> {
    pub fn new(input: R) -> Self {
        Self { input, ready: Vec::new(), taken: 0, is_blank_due: false, is_at_start: true }
    }

    fn take(&mut self, byte: u8) {
        match byte {
            b' ' | b'\t' => self.is_blank_due = !self.is_at_start,
            b'\n' | b'\r' => {
                (self.is_blank_due, self.is_at_start) = (false, true);
                self.ready.push(byte);
            }
            _ => {
                if self.is_blank_due {
                    self.ready.push(b' ');
                }
                (self.is_blank_due, self.is_at_start) = (false, false);
                self.ready.push(byte);
            }
        }
    }
}

impl<R: Read> Read for Squeeze<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut block = [0; 1 << 13];
        while self.taken == self.ready.len() {
            let count = self.input.read(&mut block)?;
            if count == 0 {
                return Ok(0);
            }
            (self.taken, self.ready) = (0, Vec::with_capacity(count + 1));
            block[..count].iter().for_each(|&byte| self.take(byte));
        }
        let count = buffer.len().min(self.ready.len() - self.taken);
        buffer[..count].copy_from_slice(&self.ready[self.taken..self.taken + count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::Squeeze;

    #[test]
    fn runs_of_blanks_become_one() {
        let mut text = String::new();
        Squeeze::new(&b"  a \t b\n\n c  \r\nd"[..]).read_to_string(&mut text).expect("text");
        assert_eq!(text, "a b\n\nc\r\nd");
    }
}
