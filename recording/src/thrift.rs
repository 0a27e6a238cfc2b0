//! Thrift's compact protocol, as far as a Parquet file uses it for sizes.
//!
//! Source: Apache Thrift, "Thrift compact protocol encoding". The parser keeps no values, so that no length claimed in a file takes memory. It refuses types
//! that Parquet's own structures never contain (sets, maps, lists of booleans): readers differ in their length.

use std::io::{self, Read};

/// Kinds of values.
pub(crate) const I32: u8 = 5;
pub(crate) const LIST: u8 = 9;
pub(crate) const STRUCT: u8 = 12;

/// Largest depth of nested structures.
pub(crate) const DEEPEST: usize = 64;

/// The bytes of a structure; at most `left` may be read.
pub(crate) struct Thrift<R> {
    input: R,
    left: u64,
    taken: u64,
}

impl<R: Read> Thrift<R> {
    /// The structure that begins with `input` and ends within `length` bytes.
    pub fn new(input: R, length: u64) -> Self {
        Self { input, left: length, taken: 0 }
    }

    /// Bytes that were read.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Calls `take` with the number and the kind of each field of a structure. `take` either reads the field and returns `Some(true)`, or leaves it and returns
    /// `Some(false)`. Returns `None` for a damaged structure, like all functions here.
    pub fn fields(
        &mut self,
        mut take: impl FnMut(&mut Self, i64, u8) -> Option<bool>,
        depth: usize,
    ) -> Option<()> {
        let mut number = 0;
        loop {
            let byte = self.byte()?;
            let (step, kind) = (i64::from(byte >> 4), byte & 0xf);
            if kind == 0 {
                return Some(());
            }
            number = if step == 0 { self.integer()? } else { number + step };
            if !take(self, number, kind)? {
                self.skip(kind, depth)?;
            }
        }
    }

    /// Length and kind of a list.
    pub fn list(&mut self) -> Option<(u64, u8)> {
        let byte = self.byte()?;
        let length = if byte >> 4 == 0xf { self.varint()? } else { u64::from(byte >> 4) };
        Some((length, byte & 0xf))
    }

    /// An integer of any size.
    pub fn integer(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// Skips a value of this `kind` with at most `depth` nested structures.
    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        match kind {
            // The field's kind contains a boolean.
            1 | 2 => Some(()),
            3 => self.pass(1),
            4..=6 => self.varint().map(drop),
            7 => self.pass(8),
            8 => {
                let length = self.varint()?;
                self.pass(length)
            }
            LIST => {
                let (length, kind) = self.list()?;
                (kind > 2).then_some(())?;
                (0..length).try_for_each(|_| self.skip(kind, depth))
            }
            STRUCT => self.fields(|_, _, _| Some(false), depth),
            _ => None,
        }
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn byte(&mut self) -> Option<u8> {
        let mut byte = [0];
        self.left = self.left.checked_sub(1)?;
        self.input.read_exact(&mut byte).ok()?;
        self.taken += 1;
        Some(byte[0])
    }

    fn pass(&mut self, length: u64) -> Option<()> {
        self.left = self.left.checked_sub(length)?;
        let passed = io::copy(&mut (&mut self.input).take(length), &mut io::sink()).ok()?;
        self.taken += passed;
        (passed == length).then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::{DEEPEST, Thrift};

    #[test]
    fn numbers_and_kinds_of_fields_are_told_and_the_rest_is_passed_over() {
        // 1: i32 -3; 3: text "ab"; 20: structure with a boolean; 21: list of two i64.
        let bytes = [0x15, 5, 0x28, 2, b'a', b'b', 0x0c, 40, 0x11, 0, 0x19, 0x26, 2, 4, 0, 0xff];
        let mut thrift = Thrift::new(&bytes[..], bytes.len() as u64);
        let mut seen = Vec::new();
        let take = |thrift: &mut Thrift<&[u8]>, number, kind| {
            seen.push((number, kind));
            Some(number == 1 && thrift.integer() == Some(-3))
        };
        assert_eq!(thrift.fields(take, DEEPEST), Some(()));
        assert_eq!(seen, [(1, 5), (3, 8), (20, 12), (21, 9)]);
        assert_eq!(thrift.taken() as usize, bytes.len() - 1);
    }

    #[test]
    fn what_is_cut_too_long_or_too_deep_is_damaged() {
        let deep = [0x1c; 100];
        let cases: [&[u8]; 6] = [
            &[0x15],
            &[0x18, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1],
            &[0x15, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1],
            &[0x1b, 1, 0x55, 0, 0, 0],
            &[0x19, 0xf5, 0xff, 0xff, 0xff, 0x7f, 0],
            &deep,
        ];
        for bytes in cases {
            let mut thrift = Thrift::new(bytes, bytes.len() as u64);
            assert_eq!(thrift.fields(|_, _, _| Some(false), DEEPEST), None, "{bytes:?}");
        }
    }
}
