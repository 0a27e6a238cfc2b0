//! The records of an MCAP file (<https://mcap.dev/spec>) in order, with the chunks unpacked.
//!
//! This module reads the framing itself. The readers of the `mcap` crate load any length that a record claims and stop at the first damage; this module bounds
//! the memory, skips unneeded records, and distinguishes a missing end from damage. The crate parses the contents of the records.
//!
//! Damage costs the chunk that it is in. The reader hands on a chunk only if the whole chunk parses and its checksum matches. After a damaged record it
//! continues at the record's end if another record begins there, else at the next sound chunk, which it finds by content: a chunk stores its own length, so
//! that a damaged frame in front of it costs nothing.

use std::collections::BTreeSet;
use std::io::{self, Read};

use mcap::records::{Record, op};

use crate::error::ReadError;
use crate::input::Source;
use crate::mcap_chunk::{CHUNK_HEAD, Chunk, ChunkFault, FRAME, Framed, MAX_RECORD, ZSTD, ZSTD_AT};
use crate::mcap_window::Window;

/// Bytes of a footer: offset of the summary (8), offset of the summary offsets (8), checksum (4).
const FOOTER: u64 = 20;

/// Bytes of the footer that its checksum covers.
const FOOTER_COVERED: usize = 16;

/// Bytes per step of a search.
const STRETCH: usize = 1 << 16;

/// One item of the file for a reader.
pub(crate) enum Item<'a> {
    /// A record that carries data.
    Record(Record<'a>),
    /// A record of the summary, which repeats the records and counts them; its checksum has been verified.
    Summary(Record<'a>),
    /// A stretch of the file that cannot be read.
    Damage(String),
}

/// A consumer of the items; it receives each with the offset of its record.
pub(crate) trait Take: FnMut(u64, Item) -> Result<(), ReadError> {}
impl<F: FnMut(u64, Item) -> Result<(), ReadError>> Take for F {}

/// An MCAP file, read from behind its first magic bytes.
pub(crate) struct Records<'a, R> {
    window: Window<R>,
    source: &'a Source<'a>,
    has_chunks: bool,
    /// Channels described outside the chunks.
    channels: BTreeSet<u16>,
    /// The records behind the data, frames included; none before the data section has ended.
    summary: Option<Vec<u8>>,
    /// The stretch in front of the next record is unreadable and has been reported.
    is_lost: bool,
    /// The first compression without a decompressor in this crate.
    pub compression: Option<String>,
    /// The summary contradicts its checksum or its form. Its content only repeats the data section.
    pub is_summary_damaged: bool,
    /// The file ended inside a record, or before its last magic bytes.
    pub truncated: bool,
}

/// Outcome of reading one record.
enum Outcome {
    /// The record is sound; the next one begins after so many bytes.
    Next(u64),
    /// The record is damaged; if its frame is right, the next one begins after so many bytes.
    Damaged(String, u64),
    /// The file ends inside the record.
    Short,
    /// The record was the last, and the file is complete.
    End,
}

impl<'a, R: Read> Records<'a, R> {
    /// A reader that starts behind the magic bytes.
    pub fn new(input: R, source: &'a Source<'a>) -> Self {
        Records {
            window: Window::new(input, mcap::MAGIC.len() as u64),
            source,
            has_chunks: false,
            channels: BTreeSet::new(),
            summary: None,
            is_lost: false,
            compression: None,
            is_summary_damaged: false,
            truncated: false,
        }
    }

    /// Passes the records that carry data to `take`, in the order of the file.
    pub fn for_each(&mut self, take: &mut impl Take) -> Result<(), ReadError> {
        loop {
            let offset = self.window.offset;
            let (what, length) = match self.record(take)? {
                Outcome::End => return Ok(()),
                Outcome::Next(length) => {
                    self.is_lost = false;
                    if self.consume(length)? {
                        continue;
                    }
                    self.truncated = true;
                    return Ok(());
                }
                Outcome::Damaged(what, length) => (what, Some(length)),
                Outcome::Short => ("a record is longer than the file".to_owned(), None),
            };
            if self.summary.is_some() {
                self.truncated = !self.ends_with_magic()?;
                self.is_summary_damaged = !self.truncated;
                return Ok(());
            }
            if self.chunk_at(0, take)? {
                continue;
            }
            match length {
                Some(length) => {
                    self.report(offset, what, take)?;
                    if self.is_record_behind(length)? {
                        self.consume(length)?;
                        continue;
                    }
                    if self.find_chunk(take)? {
                        continue;
                    }
                    self.truncated = !self.ends_with_magic()?;
                }
                // A file without its end was cut off; in a file with its end the length is wrong.
                None if self.find_chunk(take)? => {
                    self.report(offset, what, take)?;
                    continue;
                }
                None => {
                    self.truncated = !self.ends_with_magic()?;
                    if !self.truncated {
                        self.report(offset, what, take)?;
                    }
                }
            }
            return Ok(());
        }
    }

    /// Reports a damaged stretch of the file, once per stretch.
    fn report(&mut self, offset: u64, what: String, take: &mut impl Take) -> Result<(), ReadError> {
        if std::mem::replace(&mut self.is_lost, true) { Ok(()) } else { take(offset, Item::Damage(what)) }
    }

    /// Reads the next record.
    fn record(&mut self, take: &mut impl Take) -> Result<Outcome, ReadError> {
        let Some((opcode, length)) = self.frame(0)? else { return Ok(Outcome::Short) };
        let end = length.saturating_add(FRAME as u64);
        match opcode {
            op::CHUNK => {}
            _ if self.summary.is_some() => {}
            // A chunk whose kind is damaged may look like any other record.
            _ if self.chunk_at(0, take)? => return Ok(Outcome::Next(0)),
            op::HEADER..=op::MESSAGE_INDEX | op::METADATA | op::DATA_END => {}
            // Kinds that no writer uses, or that belong behind the data.
            0..0x80 if opcode != op::ATTACHMENT => {
                return Ok(Outcome::Damaged(format!("a record of kind {opcode}"), end));
            }
            // Attachments, and private records of other tools.
            _ if self.is_passable(end)? => return Ok(Outcome::Next(end)),
            _ => return Ok(Outcome::Damaged("a record that nothing follows".to_owned(), end)),
        }
        if length > MAX_RECORD {
            return Ok(Outcome::Damaged(format!("a record of {length} bytes"), end));
        }
        if self.peek(end as usize)?.len() < end as usize {
            return Ok(Outcome::Short);
        }
        if self.summary.is_some() {
            return self.summary_record(opcode, end, take);
        }
        // A chunk stores its own length; any other record must be followed by a record.
        if opcode != op::CHUNK && opcode != op::FOOTER && !self.is_record_behind(end)? {
            return Ok(Outcome::Damaged("a record that nothing follows".to_owned(), end));
        }
        self.data_record(opcode, end, take)
    }

    /// Reads a record of the data section, `end` bytes with its frame.
    fn data_record(&mut self, opcode: u8, end: u64, take: &mut impl Take) -> Result<Outcome, ReadError> {
        let offset = self.window.offset;
        let body = &self.window.peek(end as usize).map_err(|error| failed(self.source, error))?[FRAME..];
        let damaged = |what: &str| Ok(Outcome::Damaged(what.to_owned(), end));
        match opcode {
            op::CHUNK => match Chunk::parse(body) {
                Ok(chunk) => {
                    self.has_chunks = true;
                    hand_over(self.source, offset, &chunk, take)?;
                    Ok(Outcome::Next((FRAME + chunk.length) as u64))
                }
                Err(ChunkFault::Damaged(what)) => Ok(Outcome::Damaged(what, end)),
                Err(ChunkFault::Compression(name)) => {
                    let what = format!("a chunk is compressed with {name:?}");
                    self.compression.get_or_insert(name);
                    Ok(Outcome::Damaged(what, end))
                }
            },
            // A file with chunks has all its messages in them, under a checksum.
            op::SCHEMA | op::CHANNEL | op::MESSAGE if self.has_chunks => {
                damaged("a message outside of the chunks")
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA => match mcap::parse_record(opcode, body) {
                Ok(Record::Message { header, .. }) if !self.channels.contains(&header.channel_id) => {
                    damaged("a message of a channel that is not described")
                }
                Ok(record) => {
                    if let Record::Channel(channel) = &record {
                        self.channels.insert(channel.id);
                    }
                    take(offset, Item::Record(record)).map(|()| Outcome::Next(end))
                }
                Err(error) => Ok(Outcome::Damaged(error.to_string(), end)),
            },
            op::MESSAGE_INDEX if !is_message_index(body) => damaged("an index of a chunk"),
            op::DATA_END if body.len() != 4 => damaged("an end of the data"),
            op::DATA_END => {
                self.summary = Some(Vec::new());
                Ok(Outcome::Next(end))
            }
            // A file that was not finished properly may have its footer here.
            op::FOOTER if body.len() as u64 == FOOTER => self.end(end),
            op::FOOTER => damaged("an end of the file"),
            _ => Ok(Outcome::Next(end)),
        }
    }

    /// Collects a record of the summary. At the footer, hands the summary over if its checksum matches.
    fn summary_record(&mut self, opcode: u8, end: u64, take: &mut impl Take) -> Result<Outcome, ReadError> {
        let offset = self.window.offset;
        let record = self.window.peek(end as usize).map_err(|error| failed(self.source, error))?;
        let Some(summary) = &mut self.summary else { return Ok(Outcome::Next(end)) };
        if opcode != op::FOOTER {
            if (summary.len() + record.len()) as u64 > MAX_RECORD {
                return Ok(Outcome::Damaged("a summary that is too long".to_owned(), end));
            }
            summary.extend_from_slice(record);
            return Ok(Outcome::Next(end));
        }
        let Some((covered, checksum)) = record.split_at_checked(FRAME + FOOTER_COVERED) else {
            return Ok(Outcome::Damaged("an end of the file".to_owned(), end));
        };
        let Ok(checksum) = <[u8; 4]>::try_from(checksum) else {
            return Ok(Outcome::Damaged("an end of the file".to_owned(), end));
        };
        let checksum = u32::from_le_bytes(checksum);
        let mut hash = crc32fast::Hasher::new();
        hash.update(summary);
        hash.update(covered);
        self.is_summary_damaged = checksum != 0 && checksum != hash.finalize();
        if checksum != 0 && !self.is_summary_damaged {
            for (opcode, body) in Framed(summary).map_while(Result::ok) {
                if matches!(opcode, op::SCHEMA | op::CHANNEL | op::STATISTICS) {
                    take(offset, Item::Summary(parse(self.source, offset, opcode, body)?))?;
                }
            }
        }
        self.end(end)
    }

    /// Checks the last magic bytes behind the footer: with them the file is complete.
    fn end(&mut self, length: u64) -> Result<Outcome, ReadError> {
        let whole = length as usize + mcap::MAGIC.len();
        let there = self.peek(whole)?;
        self.truncated = there.len() < whole || !is_magic(&there[length as usize..]);
        Ok(Outcome::End)
    }

    /// Returns true if a sound chunk begins `ahead` bytes further on, whatever its frame claims; then hands the chunk over and advances past it.
    fn chunk_at(&mut self, ahead: usize, take: &mut impl Take) -> Result<bool, ReadError> {
        let begin = ahead + FRAME;
        let offset = self.window.offset + ahead as u64;
        let head = self.peek(begin + CHUNK_HEAD)?;
        let Some(length) = head.get(begin..).and_then(Chunk::length_in) else { return Ok(false) };
        let bytes = self.window.peek(begin + length).map_err(|error| failed(self.source, error))?;
        let Some(body) = bytes.get(begin..begin + length) else { return Ok(false) };
        match Chunk::parse(body) {
            Ok(chunk) if chunk.is_verified => {
                self.has_chunks = true;
                hand_over(self.source, offset, &chunk, take)?;
                self.consume((begin + length) as u64)
            }
            _ => Ok(false),
        }
    }

    /// Searches the next sound chunk. If there is one, hands it over, advances past it and returns true. Else the stream is at its end, or past the longest
    /// stretch that the search covers.
    fn find_chunk(&mut self, take: &mut impl Take) -> Result<bool, ReadError> {
        let begin = self.window.offset;
        // The first byte belongs to the unreadable record.
        while self.consume(1)? && self.window.offset - begin <= 2 * MAX_RECORD {
            let bytes = self.peek(STRETCH)?;
            let is_last = bytes.len() < STRETCH;
            let found = bytes
                .get(ZSTD_AT..)
                .and_then(|bytes| bytes.windows(ZSTD.len()).position(|name| name == ZSTD));
            match found {
                Some(ahead) if self.chunk_at(ahead, take)? => return Ok(true),
                Some(ahead) => drop(self.consume(ahead as u64)?),
                None if is_last => return Ok(false),
                None => drop(self.consume((STRETCH - ZSTD_AT - ZSTD.len()) as u64)?),
            }
        }
        Ok(false)
    }

    /// True if the reader can skip a record of `end` bytes: another record follows it, or, if its end is too far away to look, the file is long enough.
    fn is_passable(&mut self, end: u64) -> Result<bool, ReadError> {
        let rest = self.source.size.map(|size| size.saturating_sub(self.window.offset));
        Ok(self.is_record_behind(end)? || (end > MAX_RECORD && rest.is_some_and(|rest| end < rest)))
    }

    /// True if a record seems to begin `length` bytes further on.
    fn is_record_behind(&mut self, length: u64) -> Result<bool, ReadError> {
        if length > MAX_RECORD + FRAME as u64 {
            return Ok(false);
        }
        let (length, bytes) = (length as usize, self.peek(length as usize + FRAME)?.len());
        let next = self.frame(length)?;
        // The file may end between two records.
        Ok(next.map_or(bytes >= length, |(opcode, length)| {
            ((op::HEADER..=op::DATA_END).contains(&opcode) || opcode >= 0x80) && length <= MAX_RECORD
        }))
    }

    /// Skips the rest of the file; true if it ends with the magic bytes.
    fn ends_with_magic(&mut self) -> Result<bool, ReadError> {
        loop {
            let bytes = self.peek(STRETCH)?;
            if bytes.len() < STRETCH {
                let tail = bytes.len().saturating_sub(mcap::MAGIC.len());
                return Ok(is_magic(&bytes[tail..]));
            }
            if self.window.offset > self.source.size.unwrap_or(0) {
                // The end of a stream is unknown, and the reader does not search for it.
                return Ok(false);
            }
            self.consume((STRETCH - mcap::MAGIC.len()) as u64)?;
        }
    }

    /// Opcode and length of the record `ahead` bytes further on; `None` at the end of the file.
    fn frame(&mut self, ahead: usize) -> Result<Option<(u8, u64)>, ReadError> {
        let bytes = self.peek(ahead + FRAME)?;
        Ok(bytes.get(ahead..).and_then(<[u8]>::first_chunk::<FRAME>).map(|frame| {
            let [opcode, length @ ..] = *frame;
            (opcode, u64::from_le_bytes(length))
        }))
    }

    fn peek(&mut self, length: usize) -> Result<&[u8], ReadError> {
        self.window.peek(length).map_err(|error| failed(self.source, error))
    }

    fn consume(&mut self, length: u64) -> Result<bool, ReadError> {
        self.window.consume(length).map_err(|error| failed(self.source, error))
    }
}

/// True if `bytes` are the magic bytes of MCAP with at most one damaged bit.
pub(crate) fn is_magic(bytes: &[u8]) -> bool {
    let wrong = bytes.iter().zip(mcap::MAGIC).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
    bytes.len() == mcap::MAGIC.len() && wrong <= 1
}

/// True if the index of a chunk has the length that it claims: a channel (2 bytes), a length (4), that many bytes.
fn is_message_index(body: &[u8]) -> bool {
    let length = body.get(2..).and_then(<[u8]>::first_chunk::<4>).map(|length| u32::from_le_bytes(*length));
    length.is_some_and(|length| length as usize + 6 == body.len())
}

fn failed(source: &Source, error: io::Error) -> ReadError {
    ReadError::Io { file: source.file.to_path_buf(), source: error }
}

/// The error for an MCAP file that contradicts itself.
pub(crate) fn damaged(source: &Source, offset: u64, what: &str) -> ReadError {
    ReadError::Damaged { file: source.file.to_path_buf(), offset, what: what.to_string() }
}

fn parse<'b>(source: &Source, offset: u64, opcode: u8, body: &'b [u8]) -> Result<Record<'b>, ReadError> {
    mcap::parse_record(opcode, body).map_err(|error| damaged(source, offset, &error.to_string()))
}

/// Passes the records of a sound chunk to `take`.
fn hand_over(source: &Source, offset: u64, chunk: &Chunk, take: &mut impl Take) -> Result<(), ReadError> {
    for (opcode, body) in chunk.records() {
        take(offset, Item::Record(parse(source, offset, opcode, body)?))?;
    }
    Ok(())
}
