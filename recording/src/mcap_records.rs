//! The records of a MCAP (<https://mcap.dev/spec>), one after the other, chunks taken apart.
//!
//! The framing is read here and not by the `mcap` crate's readers, because these load whatever length a
//! record claims; here memory is bounded, what is not needed is skipped, and a missing end is told from
//! damage. The contents of the records are parsed by the crate.

use std::borrow::Cow;
use std::io::{self, Read};

use mcap::records::{ChunkHeader, Record, op};

use crate::error::ReadError;
use crate::read::Source;

/// The largest record and the largest chunk, decompressed, that is read; bytes.
const MAX_RECORD: u64 = 64 << 20;

/// Opcode (1 byte) and length (8 bytes).
const FRAME: usize = 9;

/// A MCAP, behind its first magic bytes.
pub(crate) struct Records<'a, R> {
    input: R,
    source: &'a Source<'a>,
    offset: u64,
    body: Vec<u8>,
    /// The file ended inside a record, or before its last magic bytes.
    pub truncated: bool,
}

impl<'a, R: Read> Records<'a, R> {
    /// Reads on behind the magic bytes.
    pub fn new(input: R, source: &'a Source<'a>) -> Self {
        Records { input, source, offset: mcap::MAGIC.len() as u64, body: Vec::new(), truncated: false }
    }

    /// Hands the records that carry data to `take`, in the order of the file.
    pub fn for_each(
        &mut self,
        take: &mut impl FnMut(u64, Record) -> Result<(), ReadError>,
    ) -> Result<(), ReadError> {
        let mut at_data = true;
        while let Some((opcode, length)) = self.frame()? {
            let start = self.offset;
            let whole = match opcode {
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA | op::CHUNK if at_data => {
                    self.load(length)?
                }
                _ => self.skip(length)?,
            };
            if !whole {
                break;
            }
            match opcode {
                0 => return Err(damaged(self.source, start, "a record of kind 0")),
                // What follows repeats what was there.
                op::DATA_END => at_data = false,
                op::FOOTER => {
                    self.truncated = !self.ends_with_magic()?;
                    return Ok(());
                }
                op::CHUNK => take_chunk(self.source, start, &self.body, take)?,
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA if at_data => {
                    take(start, parse(self.source, start, opcode, &self.body)?)?;
                }
                _ => {}
            }
            self.offset += FRAME as u64 + length;
        }
        self.truncated = true;
        Ok(())
    }

    /// The next record's opcode and length; none at the end of the file.
    fn frame(&mut self) -> Result<Option<(u8, u64)>, ReadError> {
        let mut frame = Vec::with_capacity(FRAME);
        let read = (&mut self.input).take(FRAME as u64).read_to_end(&mut frame);
        read.map_err(|error| self.failed(error))?;
        match frame.split_first_chunk::<1>() {
            Some(([opcode], length)) if length.len() == 8 => {
                let length = length.try_into().map_or(0, u64::from_le_bytes);
                Ok(Some((*opcode, length)))
            }
            _ => Ok(None),
        }
    }

    /// Reads a record's body; false if the file ends inside it.
    fn load(&mut self, length: u64) -> Result<bool, ReadError> {
        self.body.clear();
        let read = (&mut self.input).take(length.min(MAX_RECORD + 1)).read_to_end(&mut self.body);
        let read = read.map_err(|error| self.failed(error))? as u64;
        if read > MAX_RECORD {
            return Err(damaged(self.source, self.offset, &format!("a record of {length} bytes")));
        }
        Ok(read == length)
    }

    /// Passes over a record's body; false if the file ends inside it.
    fn skip(&mut self, length: u64) -> Result<bool, ReadError> {
        let skipped = io::copy(&mut (&mut self.input).take(length), &mut io::sink());
        Ok(skipped.map_err(|error| self.failed(error))? == length)
    }

    fn ends_with_magic(&mut self) -> Result<bool, ReadError> {
        let mut end = Vec::new();
        let read = (&mut self.input).take(mcap::MAGIC.len() as u64).read_to_end(&mut end);
        read.map_err(|error| self.failed(error))?;
        Ok(end == mcap::MAGIC)
    }

    fn failed(&self, source: io::Error) -> ReadError {
        ReadError::Io { file: self.source.file.to_path_buf(), source }
    }
}

/// The error for a MCAP that contradicts itself.
pub(crate) fn damaged(source: &Source, offset: u64, what: &str) -> ReadError {
    ReadError::Damaged { file: source.file.to_path_buf(), offset, what: what.to_string() }
}

fn parse<'b>(source: &Source, offset: u64, opcode: u8, body: &'b [u8]) -> Result<Record<'b>, ReadError> {
    mcap::parse_record(opcode, body).map_err(|error| damaged(source, offset, &error.to_string()))
}

/// Takes a chunk apart.
fn take_chunk(
    source: &Source,
    offset: u64,
    body: &[u8],
    take: &mut impl FnMut(u64, Record) -> Result<(), ReadError>,
) -> Result<(), ReadError> {
    let Record::Chunk { header, data } = parse(source, offset, op::CHUNK, body)? else { return Ok(()) };
    let records = decompress(source, offset, &header, &data)?;
    let mut rest = records.as_ref();
    while let Some((frame, behind)) = rest.split_first_chunk::<FRAME>() {
        let [opcode, length @ ..] = *frame;
        let length = usize::try_from(u64::from_le_bytes(length)).unwrap_or(usize::MAX);
        let Some((body, behind)) = behind.split_at_checked(length) else {
            return Err(damaged(source, offset, "a chunk ends inside a record"));
        };
        if matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
            take(offset, parse(source, offset, opcode, body)?)?;
        }
        rest = behind;
    }
    if rest.is_empty() { Ok(()) } else { Err(damaged(source, offset, "a chunk ends inside a record")) }
}

/// The records of a chunk, checked against its checksum.
fn decompress<'b>(
    source: &Source,
    offset: u64,
    header: &ChunkHeader,
    data: &'b [u8],
) -> Result<Cow<'b, [u8]>, ReadError> {
    if header.uncompressed_size > MAX_RECORD {
        return Err(damaged(source, offset, &format!("a chunk of {} bytes", header.uncompressed_size)));
    }
    let size = header.uncompressed_size as usize;
    let records = match header.compression.as_str() {
        "" => Cow::Borrowed(data),
        "zstd" => zstd::bulk::decompress(data, size)
            .map(Cow::Owned)
            .map_err(|error| damaged(source, offset, &format!("a chunk does not decompress: {error}")))?,
        "lz4" => {
            let mut records = Vec::with_capacity(size);
            let decoder = lz4_flex::frame::FrameDecoder::new(data);
            decoder
                .take(header.uncompressed_size + 1)
                .read_to_end(&mut records)
                .map_err(|error| damaged(source, offset, &format!("a chunk does not decompress: {error}")))?;
            Cow::Owned(records)
        }
        other => {
            let compression = crate::names::shorten(other);
            return Err(ReadError::Compression { file: source.file.to_path_buf(), compression });
        }
    };
    if records.len() != size {
        return Err(damaged(source, offset, "a chunk has another size than it says"));
    }
    if header.uncompressed_crc != 0 && header.uncompressed_crc != crc32fast::hash(&records) {
        return Err(damaged(source, offset, "the checksum of a chunk does not match"));
    }
    Ok(records)
}
