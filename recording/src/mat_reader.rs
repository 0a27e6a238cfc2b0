//! Reading MATLAB's MAT-files of version 5 (`-v6`, `-v7`), as MATLAB, Octave and SciPy write them.
//!
//! Source: MathWorks, "MAT-File Format", Level 5.

use std::io::Read;

use crate::arrays::{Array, columns};
use crate::error::ReadError;
use crate::foreign::Foreign;
use crate::npz_reader::turned;
use crate::read::Source;

const HEADER: usize = 128;
/// Types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Classes of arrays.
const CELL: u8 = 1;
const STRUCT: u8 = 2;
const CHAR: u8 = 4;
const NUMBERS: std::ops::RangeInclusive<u8> = 6..=15;
/// Structures in structures that are followed.
const DEEPEST: usize = 8;

/// The arrays of the MAT-file in `bytes`.
///
/// # Errors
/// [`ReadError::Unusable`] for a file that is damaged or has no numbers.
pub(crate) fn read(bytes: &[u8], source: &Source) -> Result<Foreign, ReadError> {
    let unusable =
        |what: &str| ReadError::Unusable { file: source.file.to_path_buf(), what: what.to_owned() };
    let damaged = || unusable("this MAT-file is cut or damaged; save it again");
    let is_big = bytes.get(126..HEADER).ok_or_else(damaged)? == b"MI";
    let mut found =
        Found { is_big, arrays: Vec::new(), texts: Vec::new(), room: source.limit.saturating_mul(8) };
    let mut rest = &bytes[HEADER..];
    while let Some(element) = found.element(&mut rest) {
        found.variable(&element, 0).ok_or_else(damaged)?;
    }
    if found.arrays.is_empty() {
        return Err(unusable(
            "no arrays of numbers in this MAT-file; save some: save('run.mat', '-v7', 't', 'q', 'tau')",
        ));
    }
    Ok(columns(found.arrays, found.texts))
}

/// An element of the file: its type and its bytes.
struct Element<'a> {
    kind: u32,
    data: &'a [u8],
}

/// What is found so far.
struct Found {
    is_big: bool,
    arrays: Vec<Array>,
    texts: Vec<Vec<String>>,
    /// Bytes that may still be inflated.
    room: u64,
}

impl Found {
    fn u32(&self, bytes: &[u8]) -> Option<u32> {
        let bytes: [u8; 4] = bytes.get(..4)?.try_into().ok()?;
        Some(if self.is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// Takes the next element off `rest`; none at its end, or where it is cut.
    fn element<'a>(&self, rest: &mut &'a [u8]) -> Option<Element<'a>> {
        let (kind, size) = (self.u32(rest)?, self.u32(rest.get(4..)?)?);
        if kind >> 16 != 0 {
            let data = rest.get(4..4 + (kind >> 16).min(4) as usize)?;
            *rest = rest.get(8..)?;
            return Some(Element { kind: kind & 0xffff, data });
        }
        let data = rest.get(8..8 + size as usize)?;
        let padded = if kind == COMPRESSED { size as usize } else { (size as usize).next_multiple_of(8) };
        *rest = rest.get(8 + padded..).unwrap_or_default();
        Some(Element { kind, data })
    }

    /// Takes a variable, inflating it if it is compressed; none if it is damaged.
    fn variable(&mut self, element: &Element, depth: usize) -> Option<()> {
        match element.kind {
            COMPRESSED if depth == 0 => {
                let mut inflated = Vec::new();
                let decoder = flate2::read::ZlibDecoder::new(element.data);
                decoder.take(self.room + 1).read_to_end(&mut inflated).ok()?;
                self.room = self.room.checked_sub(inflated.len() as u64)?;
                let inner = self.element(&mut inflated.as_slice())?;
                self.variable(&inner, 1)
            }
            MATRIX => self.matrix(element.data, None, depth),
            _ => Some(()),
        }
    }

    /// Takes an array, named `name` or as it names itself.
    fn matrix(&mut self, data: &[u8], name: Option<&str>, depth: usize) -> Option<()> {
        let mut rest = data;
        if data.is_empty() {
            return Some(());
        }
        let class = *self.element(&mut rest)?.data.get(if self.is_big { 3 } else { 0 })?;
        let shape = self.element(&mut rest)?;
        let shape: Vec<usize> = self.numbers(&shape)?.into_iter().map(|size| size as usize).collect();
        let own = String::from_utf8_lossy(self.element(&mut rest)?.data).into_owned();
        let name = name.map_or(own, str::to_owned);
        match class {
            STRUCT if depth < DEEPEST => self.fields(rest, &name, depth),
            CELL => {
                self.cell(rest);
                Some(())
            }
            class if NUMBERS.contains(&class) => {
                let element = self.element(&mut rest)?;
                let values = self.numbers(&element)?;
                let count = shape.iter().try_fold(1_usize, |count, size| count.checked_mul(*size))?;
                if values.len() == count && count > 0 {
                    let (shape, values) = turned(&shape, &values);
                    self.arrays.push(Array { name, shape, values });
                }
                Some(())
            }
            _ => Some(()),
        }
    }

    /// Takes the fields of a structure as `name.field`.
    fn fields(&mut self, mut rest: &[u8], name: &str, depth: usize) -> Option<()> {
        let length = self.element(&mut rest)?;
        let length = (*self.numbers(&length)?.first()? as usize).max(1);
        let names = self.element(&mut rest)?.data;
        for field in names.chunks_exact(length) {
            let field = String::from_utf8_lossy(field).trim_end_matches('\0').to_owned();
            let element = self.element(&mut rest)?;
            self.matrix(element.data, Some(&format!("{name}.{field}")), depth + 1)?;
        }
        Some(())
    }

    /// Takes a cell array of texts.
    fn cell(&mut self, mut rest: &[u8]) {
        let mut texts = Vec::new();
        while let Some(element) = self.element(&mut rest) {
            texts.extend(self.text(element.data));
        }
        self.texts.push(texts);
    }

    /// The text of an array of characters.
    fn text(&self, mut rest: &[u8]) -> Option<String> {
        let class = *self.element(&mut rest)?.data.get(if self.is_big { 3 } else { 0 })?;
        let (_, _) = (self.element(&mut rest)?, self.element(&mut rest)?);
        let characters = self.element(&mut rest)?;
        let codes = self.numbers(&characters)?;
        (class == CHAR).then(|| codes.into_iter().filter_map(|code| char::from_u32(code as u32)).collect())
    }

    /// The numbers of an element of any numeric type.
    fn numbers(&self, element: &Element) -> Option<Vec<f64>> {
        let (size, number): (usize, fn([u8; 8]) -> f64) = match element.kind {
            1 => (1, |b| f64::from(i8::from_le_bytes([b[0]]))),
            2 | 16 => (1, |b| f64::from(b[0])),
            3 => (2, |b| f64::from(i16::from_le_bytes([b[0], b[1]]))),
            4 | 17 => (2, |b| f64::from(u16::from_le_bytes([b[0], b[1]]))),
            5 => (4, |b| f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            6 | 18 => (4, |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            7 => (4, |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            9 => (8, f64::from_le_bytes),
            12 => (8, |b| i64::from_le_bytes(b) as f64),
            13 => (8, |b| u64::from_le_bytes(b) as f64),
            _ => return None,
        };
        let read = |cell: &[u8]| {
            let mut bytes = [0; 8];
            bytes[..size].copy_from_slice(cell);
            if self.is_big {
                bytes[..size].reverse();
            }
            number(bytes)
        };
        Some(element.data.chunks_exact(size).map(read).collect())
    }
}
