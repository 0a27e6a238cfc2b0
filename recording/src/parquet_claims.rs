//! Checks the sizes claimed in a Parquet file before decoding: the decoder allocates any length that a footer or a page header claims.
//!
//! Source: Apache Parquet, `parquet.thrift`.

use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};
use parquet::file::reader::ChunkReader;

use crate::mcap_chunk::MAX_RECORD;
use crate::thrift::{DEEPEST, I32, LIST, STRUCT, Thrift};

/// Bytes of a number in memory.
const NUMBER: u64 = 8;
/// The end of the file behind the footer: its length, and the magic bytes.
const TAIL: u64 = 8;
/// Types of pages.
const DATA_PAGE: i32 = 0;
const DICTIONARY_PAGE: i32 = 2;
const DATA_PAGE_V2: i32 = 3;

/// An impossible claim.
pub(crate) struct Refused(pub String);

impl From<ParquetError> for Refused {
    fn from(error: ParquetError) -> Self {
        Self(error.to_string())
    }
}

/// Largest number of values in a file. Encodings store any number of equal values in a few bytes; a recording of a moving machine has at least one bit per
/// value on average. A file of any length may have as many as a chunk of an MCAP file.
#[derive(Debug)]
pub(crate) struct Claims {
    /// Bytes of the file.
    length: u64,
    /// Permitted number of values.
    most: u64,
    /// Remaining number of values.
    left: u64,
}

impl Claims {
    /// The limit for a file of `length` bytes, and at most `limit` values.
    pub fn new(length: u64, limit: u64) -> Self {
        let most = length.saturating_mul(8).max(MAX_RECORD / NUMBER).min(limit);
        Self { length, most, left: most }
    }

    /// Subtracts `count` from the remaining values.
    pub fn take(&mut self, count: u64) -> Result<(), Refused> {
        self.fits(count)?;
        self.left -= count;
        Ok(())
    }

    /// Fails unless `count` further values are permitted.
    pub fn fits(&self, count: u64) -> Result<(), Refused> {
        if count > self.left { Err(self.too_many(count)) } else { Ok(()) }
    }

    fn too_many(&self, count: u64) -> Refused {
        Refused(format!("{count} numbers and more in a file of {} bytes", self.length))
    }

    /// Number of values in the pages of `chunk` in `file`; fails unless all pages are within the chunk, and small enough.
    pub fn check_chunk(&self, file: &impl ChunkReader, chunk: &ColumnChunkMetaData) -> Result<u64, Refused> {
        let name = || chunk.column_path().string();
        let start = chunk.dictionary_page_offset().unwrap_or(chunk.data_page_offset());
        let range = u64::try_from(start).ok().zip(u64::try_from(chunk.compressed_size()).ok());
        let within =
            range.filter(|(start, size)| start.checked_add(*size).is_some_and(|end| end <= self.length));
        let Some((mut offset, mut left)) = within else {
            let (size, length) = (chunk.compressed_size(), self.length);
            let what =
                format!("column {} has {size} bytes from byte {start} on, the file {length} bytes", name());
            return Err(Refused(what));
        };
        let mut values = 0;
        while left > 0 {
            let mut header = Thrift::new(file.get_read(offset)?, left);
            let page = Page::read(&mut header)
                .ok_or_else(|| Refused(format!("the header of a page of column {} is damaged", name())))?;
            let length = header.taken();
            values += self.check_page(&page, left - length)?;
            self.fits(values)?;
            let passed = length + page.compressed;
            (offset, left) = (offset + passed, left - passed);
        }
        Ok(values)
    }

    /// Number of values in `page`, of a chunk with `left` bytes behind the page's header.
    fn check_page(&self, page: &Page, left: u64) -> Result<u64, Refused> {
        if page.compressed > left {
            return Err(Refused(format!("a page of {} bytes is longer than its column", page.compressed)));
        }
        if page.uncompressed > self.most.saturating_mul(NUMBER) {
            let (page, length) = (page.uncompressed, self.length);
            return Err(Refused(format!("a page of {page} bytes in a file of {length}")));
        }
        match page.kind {
            DATA_PAGE | DATA_PAGE_V2 => Ok(page.values),
            // A dictionary stores its values one by one.
            DICTIONARY_PAGE if page.values > page.uncompressed => Err(self.too_many(page.values)),
            _ => Ok(0),
        }
    }
}

/// The header of a page.
#[derive(Default)]
struct Page {
    kind: i32,
    uncompressed: u64,
    compressed: u64,
    values: u64,
}

impl Page {
    /// The header at the start of `thrift`; `None` if it is damaged.
    fn read(thrift: &mut Thrift<impl std::io::Read>) -> Option<Self> {
        let (mut kind, mut sizes, mut values) = (None, [None; 2], [None; 9]);
        let take = |thrift: &mut Thrift<_>, number: i64, field: u8| {
            match (number, field) {
                (1, I32) => kind = Some(i32::try_from(thrift.integer()?).ok()?),
                (2 | 3, I32) => sizes[number as usize - 2] = Some(size(thrift.integer()?)?),
                // The description of the page, by its type.
                (5 | 7 | 8, STRUCT) => {
                    let values = &mut values[number as usize];
                    let take = |thrift: &mut Thrift<_>, number: i64, field: u8| {
                        if (number, field) != (1, I32) {
                            return Some(false);
                        }
                        *values = Some(size(thrift.integer()?)?);
                        Some(true)
                    };
                    thrift.fields(take, DEEPEST)?;
                }
                _ => return Some(false),
            }
            Some(true)
        };
        thrift.fields(take, DEEPEST)?;
        let (kind, [uncompressed, compressed]) = (kind?, sizes);
        let values = match kind {
            DATA_PAGE => values[5]?,
            DICTIONARY_PAGE => values[7]?,
            DATA_PAGE_V2 => values[8]?,
            _ => 0,
        };
        Some(Self { kind, uncompressed: uncompressed?, compressed: compressed?, values })
    }
}

/// A size stored as a signed 32-bit number.
fn size(value: i64) -> Option<u64> {
    i32::try_from(value).ok().and_then(|value| u64::try_from(value).ok())
}

/// Number of rows; fails unless the row groups of `metadata` have as many rows as the file claims.
pub(crate) fn check_rows(metadata: &ParquetMetaData) -> Result<u64, Refused> {
    let said = metadata.file_metadata().num_rows();
    let mut sum = Some(0_u64);
    for group in metadata.row_groups() {
        let rows = u64::try_from(group.num_rows()).ok();
        sum = sum.zip(rows).and_then(|(sum, rows)| sum.checked_add(rows));
    }
    sum.filter(|&rows| i64::try_from(rows) == Ok(said)).ok_or_else(|| {
        Refused(format!("its footer states {said} rows, but its row groups have another number"))
    })
}

/// Fails if the schema in the footer of `file` nests groups more deeply than the stack of the recursive decoder permits.
pub(crate) fn check_depth(file: &impl ChunkReader) -> Result<(), Refused> {
    let cut = || Refused("its footer is cut or damaged".to_owned());
    let behind = file.len().checked_sub(TAIL).ok_or_else(cut)?;
    let tail = file.get_bytes(behind, TAIL as usize)?;
    let length = tail.first_chunk::<4>().map_or(0, |length| u64::from(u32::from_le_bytes(*length)));
    let start = behind.checked_sub(length).ok_or_else(cut)?;
    let mut footer = Thrift::new(file.get_read(start)?, length);
    let mut is_deep = false;
    let take = |thrift: &mut Thrift<_>, number: i64, kind: u8| {
        if (number, kind) != (2, LIST) {
            return Some(false);
        }
        is_deep |= depth(thrift)? > DEEPEST;
        Some(true)
    };
    // The decoder refuses a footer that is unreadable up to its end, if the form and not the schema is at fault.
    footer.fields(take, DEEPEST).ok_or_else(cut)?;
    if is_deep {
        return Err(Refused(format!("its columns are nested more than {DEEPEST} times")));
    }
    Ok(())
}

/// Depth of the schema that follows in `thrift`: a list of the nodes of a tree, each before its children.
fn depth(thrift: &mut Thrift<impl std::io::Read>) -> Option<usize> {
    let (length, kind) = thrift.list()?;
    (kind == STRUCT).then_some(())?;
    // Number of children still to come, for each ancestor node.
    let mut above: Vec<i64> = Vec::new();
    let mut deepest = 0;
    for _ in 0..length {
        let mut children = 0;
        let take = |thrift: &mut Thrift<_>, number: i64, kind: u8| {
            if (number, kind) != (5, I32) {
                return Some(false);
            }
            children = thrift.integer()?;
            Some(true)
        };
        thrift.fields(take, DEEPEST)?;
        while above.last() == Some(&0) {
            above.pop();
        }
        if let Some(left) = above.last_mut() {
            *left -= 1;
        }
        if children > 0 {
            above.push(children);
        }
        deepest = deepest.max(above.len());
    }
    Some(deepest)
}
