//! Reading MATLAB's MAT-files of version 5 (`-v6`, `-v7`), as MATLAB, Octave and SciPy write them.
//!
//! Source: MathWorks, "MAT-File Format", Level 5. The reader parses elements while it inflates them; it keeps only the numbers of arrays within the memory
//! limit, and short texts.

use std::io::Read;

use crate::arrays::{Array, MemoryBudget, NO_SAMPLES, Number, OverBudget, columns, numbers};
use crate::error::ReadError;
use crate::foreign::Foreign;
use crate::input::Source;
use crate::npz_reader::turned;

const HEADER: usize = 128;
/// Types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Classes of arrays.
const CELL: u8 = 1;
const STRUCT: u8 = 2;
const CHAR: u8 = 4;
const NUMBERS: std::ops::RangeInclusive<u8> = 6..=15;
/// Largest depth of nested structures.
const DEEPEST: usize = 8;
/// Most bytes of a name, of the sizes of an array, of all field names of a structure.
const LONGEST: u64 = 1 << 16;
/// The most texts of a cell array.
const MOST_TEXTS: usize = 1 << 12;

/// The arrays of the MAT-file in `bytes`.
///
/// # Errors
/// [`ReadError::Unusable`] for a file that is damaged or has no numbers.
pub(crate) fn read(bytes: &[u8], source: &Source) -> Result<Foreign, ReadError> {
    let unusable =
        |what: &str| ReadError::Unusable { file: source.file.to_path_buf(), what: what.to_owned() };
    let said = |fault: Fault| {
        unusable(match fault {
            Fault::Damaged => "this MAT-file is cut or damaged; save it again",
            Fault::TooLarge => "it has more numbers than the limit; write fewer rows",
        })
    };
    let (header, mut rest) = bytes.split_at_checked(HEADER).ok_or_else(|| said(Fault::Damaged))?;
    let is_big = header.ends_with(b"MI");
    let budget = MemoryBudget::of(source, bytes.len());
    let mut found = Found { is_big, arrays: Vec::new(), texts: Vec::new(), budget };
    while found.variable(&mut rest).map_err(said)? {}
    if found.arrays.is_empty() && found.budget.too_long.is_empty() {
        return Err(unusable(
            "no arrays of numbers in this MAT-file; save some: save('run.mat', '-v7', 't', 'q', 'tau')",
        ));
    }
    columns(found.arrays, found.texts, found.budget).ok_or_else(|| unusable(NO_SAMPLES))
}

/// Reason why a file can't be read.
#[derive(Debug, Clone, Copy)]
enum Fault {
    Damaged,
    TooLarge,
}

impl From<std::io::Error> for Fault {
    fn from(_: std::io::Error) -> Self {
        Self::Damaged
    }
}

impl From<OverBudget> for Fault {
    fn from(_: OverBudget) -> Self {
        Self::TooLarge
    }
}

/// The head of an element.
struct Tag {
    kind: u32,
    /// Bytes of data.
    size: u64,
    /// The data themselves, if they have at most four bytes and are in the tag.
    within: Option<[u8; 4]>,
}

/// The variables read so far.
struct Found {
    is_big: bool,
    arrays: Vec<Array>,
    texts: Vec<Vec<String>>,
    budget: MemoryBudget,
}

impl Found {
    fn u32(&self, bytes: [u8; 4]) -> u32 {
        if self.is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
    }

    /// The tag of the next element; `None` at the end.
    fn tag(&self, input: &mut dyn Read) -> Result<Option<Tag>, Fault> {
        let mut bytes = [0; 4];
        // A file that ends within a tag has been cut; some writers leave fewer than eight bytes at the end.
        if input.read_exact(&mut bytes).is_err() {
            return Ok(None);
        }
        let kind = self.u32(bytes);
        if input.read_exact(&mut bytes).is_err() {
            return Ok(None);
        }
        if kind >> 16 != 0 {
            let size = u64::from(kind >> 16).min(4);
            return Ok(Some(Tag { kind: kind & 0xffff, size, within: Some(bytes) }));
        }
        Ok(Some(Tag { kind, size: u64::from(self.u32(bytes)), within: None }))
    }

    /// The type and the data of the next element, which has at most `most` bytes.
    fn short(&self, input: &mut dyn Read, most: u64) -> Result<(u32, Vec<u8>), Fault> {
        let tag = self.tag(input)?.ok_or(Fault::Damaged)?;
        if let Some(within) = tag.within {
            return Ok((tag.kind, within[..tag.size as usize].to_vec()));
        }
        if tag.size > most {
            return Err(Fault::Damaged);
        }
        let mut data = vec![0; tag.size as usize];
        input.read_exact(&mut data)?;
        pad(input, tag.size)?;
        Ok((tag.kind, data))
    }

    /// Reads the next variable of the file, inflating it if it is compressed; `false` at the end.
    fn variable(&mut self, rest: &mut &[u8]) -> Result<bool, Fault> {
        let Some(tag) = self.tag(rest)? else { return Ok(false) };
        if tag.within.is_some() {
            return Ok(true);
        }
        // If the last variable is cut off, the reader stops before it.
        let Some((mut data, behind)) = rest.split_at_checked(tag.size as usize) else { return Ok(false) };
        *rest = behind;
        match tag.kind {
            COMPRESSED => {
                let mut inflated = flate2::read::ZlibDecoder::new(data);
                if let Some(Tag { kind: MATRIX, size, .. }) = self.tag(&mut inflated)? {
                    self.matrix(&mut inflated.take(size), None, 1)?;
                }
            }
            MATRIX => self.matrix(&mut data, None, 0)?,
            _ => {}
        }
        Ok(true)
    }

    /// Reads the array in `input`, named `name` or by its own name.
    fn matrix(&mut self, input: &mut dyn Read, name: Option<&str>, depth: usize) -> Result<(), Fault> {
        let (_, flags) = self.short(input, LONGEST)?;
        let class = *flags.get(if self.is_big { 3 } else { 0 }).ok_or(Fault::Damaged)?;
        let shape: Vec<usize> = self.short_numbers(input)?.into_iter().map(|size| size as usize).collect();
        let (_, own) = self.short(input, LONGEST)?;
        let name = name.map_or_else(|| String::from_utf8_lossy(&own).into_owned(), str::to_owned);
        match class {
            STRUCT if depth < DEEPEST => self.fields(input, &name, depth),
            CELL => self.cell(input),
            class if NUMBERS.contains(&class) => self.values(input, name, &shape),
            _ => Ok(()),
        }
    }

    /// Reads the numbers of the array `name` of this `shape`.
    fn values(&mut self, input: &mut dyn Read, name: String, shape: &[usize]) -> Result<(), Fault> {
        let count = self.budget.take(&name, shape)?;
        if count == 0 {
            return Ok(());
        }
        let tag = self.tag(input)?.ok_or(Fault::Damaged)?;
        let (size, number) = number_of(tag.kind).ok_or(Fault::Damaged)?;
        let values = match tag.within {
            Some(within) if tag.size == (size * count) as u64 => {
                numbers(&mut within.as_slice(), count, size, self.is_big, number)?
            }
            None if tag.size == (size * count) as u64 => {
                let values = numbers(input, count, size, self.is_big, number)?;
                pad(input, tag.size)?;
                values
            }
            _ => return Err(Fault::Damaged),
        };
        let (shape, values) = turned(shape, &values);
        self.arrays.push(Array { name, shape, values });
        Ok(())
    }

    /// Reads the fields of a structure as `name.field`.
    fn fields(&mut self, input: &mut dyn Read, name: &str, depth: usize) -> Result<(), Fault> {
        let length = (*self.short_numbers(input)?.first().ok_or(Fault::Damaged)? as usize).max(1);
        let (_, names) = self.short(input, LONGEST)?;
        for field in names.chunks_exact(length) {
            let field = String::from_utf8_lossy(field).trim_end_matches('\0').to_owned();
            let name = format!("{name}.{field}");
            self.element(input, |found, element| found.matrix(element, Some(&name), depth + 1))?;
        }
        Ok(())
    }

    /// Passes the next element of `input` to `take` if it is an array, and advances behind it; false if there was no element.
    fn element(
        &mut self,
        input: &mut dyn Read,
        take: impl FnOnce(&mut Self, &mut dyn Read) -> Result<(), Fault>,
    ) -> Result<bool, Fault> {
        let Some(tag) = self.tag(input)? else { return Ok(false) };
        if tag.within.is_none() && tag.size > 0 {
            let mut element = Read::take(&mut *input, tag.size);
            if tag.kind == MATRIX {
                take(self, &mut element)?;
            }
            std::io::copy(&mut element, &mut std::io::sink())?;
            pad(input, tag.size)?;
        }
        Ok(true)
    }

    /// Reads a cell array of texts.
    fn cell(&mut self, input: &mut dyn Read) -> Result<(), Fault> {
        let mut texts = Vec::new();
        let mut take = |found: &mut Self, element: &mut dyn Read| {
            texts.extend(found.text(element));
            Ok(())
        };
        for _ in 0..MOST_TEXTS {
            if !self.element(input, &mut take)? {
                break;
            }
        }
        self.texts.push(texts);
        Ok(())
    }

    /// The text of an array of characters.
    fn text(&self, input: &mut dyn Read) -> Option<String> {
        let (_, flags) = self.short(input, LONGEST).ok()?;
        let class = *flags.get(if self.is_big { 3 } else { 0 })?;
        let (_, _) = (self.short(input, LONGEST).ok()?, self.short(input, LONGEST).ok()?);
        let codes = self.short_numbers(input).ok()?;
        (class == CHAR).then(|| codes.into_iter().filter_map(|code| char::from_u32(code as u32)).collect())
    }

    /// The numbers of the next element, which is a short one.
    fn short_numbers(&self, input: &mut dyn Read) -> Result<Vec<f64>, Fault> {
        let (kind, data) = self.short(input, LONGEST)?;
        let (size, number) = number_of(kind).ok_or(Fault::Damaged)?;
        Ok(numbers(&mut data.as_slice(), data.len() / size, size, self.is_big, number)?)
    }
}

/// Skips the padding of an element of `size` bytes up to a multiple of eight.
fn pad(input: &mut dyn Read, size: u64) -> Result<(), Fault> {
    std::io::copy(&mut input.take(size.next_multiple_of(8) - size), &mut std::io::sink())?;
    Ok(())
}

/// Bytes of a number of the type `kind`, and its decoder from eight little-endian bytes.
fn number_of(kind: u32) -> Option<(usize, Number)> {
    Some(match kind {
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
    })
}
