//! One chunk of an MCAP file, which is unpacked only if all of it is sound.

use std::borrow::Cow;
use std::io::Read;

use mcap::records::{ChunkHeader, Record, op};

/// The largest permitted record and the largest permitted chunk, decompressed; bytes.
pub(crate) const MAX_RECORD: u64 = 64 << 20;

/// Opcode (1 byte) and length (8 bytes).
pub(crate) const FRAME: usize = 9;

/// Bytes of a chunk before the name of its compression: start, end, size, checksum.
const BEFORE_NAME: usize = 28;

/// The name of the compression as stored in a chunk: its length and its letters.
pub(crate) const ZSTD: [u8; 8] = [4, 0, 0, 0, b'z', b's', b't', b'd'];

/// Offset of [`ZSTD`] from the beginning of a chunk's record.
pub(crate) const ZSTD_AT: usize = FRAME + BEFORE_NAME;

/// The bytes of a zstd chunk's body in front of the compressed ones.
pub(crate) const CHUNK_HEAD: usize = BEFORE_NAME + ZSTD.len() + 8;

/// Reason why a chunk is not unpacked.
pub(crate) enum ChunkFault {
    /// It contradicts itself or its checksum.
    Damaged(String),
    /// This crate does not support its compression.
    Compression(String),
}

impl From<&str> for ChunkFault {
    fn from(what: &str) -> Self {
        ChunkFault::Damaged(what.to_owned())
    }
}

/// The records of a chunk, all of which parse.
pub(crate) struct Chunk<'b> {
    records: Cow<'b, [u8]>,
    /// Length of the body that the chunk itself claims, bytes.
    pub length: usize,
    /// True if a checksum confirmed the content.
    pub is_verified: bool,
}

impl<'b> Chunk<'b> {
    /// Parses the `body` of a chunk; ignores bytes behind its end.
    pub fn parse(body: &'b [u8]) -> Result<Self, ChunkFault> {
        let parsed = mcap::parse_record(op::CHUNK, body);
        let parsed =
            parsed.map_err(|error| ChunkFault::Damaged(format!("a chunk cannot be read: {error}")))?;
        let Record::Chunk { header, data } = parsed else { return Err("no chunk".into()) };
        let Cow::Borrowed(data) = data else { return Err("no chunk".into()) };
        let length = BEFORE_NAME + 4 + header.compression.len() + 8 + data.len();
        let records = decompress(&header, data)?;
        let chunk = Chunk { records, length, is_verified: header.uncompressed_crc != 0 };
        for record in Framed(&chunk.records) {
            let (opcode, body) = record?;
            if carries_data(opcode) {
                let parsed = mcap::parse_record(opcode, body);
                parsed.map_err(|error| ChunkFault::Damaged(format!("a record in a chunk: {error}")))?;
            }
        }
        Ok(chunk)
    }

    /// Length of the body of a zstd chunk, bytes, from the beginning `head` of the body.
    pub fn length_in(head: &[u8]) -> Option<usize> {
        let size: [u8; 8] = head.get(CHUNK_HEAD - 8..CHUNK_HEAD)?.try_into().ok()?;
        let size = u64::from_le_bytes(size);
        (head[BEFORE_NAME..].starts_with(&ZSTD) && size <= MAX_RECORD).then(|| CHUNK_HEAD + size as usize)
    }

    /// Opcode and body of each record that carries data.
    pub fn records(&self) -> impl Iterator<Item = (u8, &[u8])> {
        // `parse` has checked their framing.
        Framed(&self.records).map_while(Result::ok).filter(|(opcode, _)| carries_data(*opcode))
    }
}

fn carries_data(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE)
}

/// Records in memory, one behind the other: opcode and body.
pub(crate) struct Framed<'b>(pub &'b [u8]);

impl<'b> Iterator for Framed<'b> {
    type Item = Result<(u8, &'b [u8]), &'static str>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let record = self.0.split_first_chunk::<FRAME>().and_then(|(frame, behind)| {
            let [opcode, length @ ..] = *frame;
            let length = usize::try_from(u64::from_le_bytes(length)).ok()?;
            let (body, behind) = behind.split_at_checked(length)?;
            self.0 = behind;
            Some((opcode, body))
        });
        Some(record.ok_or("a chunk ends inside a record"))
    }
}

/// The records of a chunk, checked against its checksum.
fn decompress<'b>(header: &ChunkHeader, data: &'b [u8]) -> Result<Cow<'b, [u8]>, ChunkFault> {
    if header.uncompressed_size > MAX_RECORD {
        return Err(ChunkFault::Damaged(format!("a chunk of {} bytes", header.uncompressed_size)));
    }
    let size = header.uncompressed_size as usize;
    let records = match header.compression.as_str() {
        "" => Cow::Borrowed(data),
        "zstd" => zstd::bulk::decompress(data, size)
            .map(Cow::Owned)
            .map_err(|error| ChunkFault::Damaged(format!("a chunk does not decompress: {error}")))?,
        "lz4" => {
            let mut records = Vec::with_capacity(size);
            let decoder = lz4_flex::frame::FrameDecoder::new(data);
            decoder
                .take(header.uncompressed_size + 1)
                .read_to_end(&mut records)
                .map_err(|error| ChunkFault::Damaged(format!("a chunk does not decompress: {error}")))?;
            Cow::Owned(records)
        }
        other => return Err(ChunkFault::Compression(crate::names::shorten(other))),
    };
    if records.len() != size {
        return Err("a chunk has another size than its header states".into());
    }
    if header.uncompressed_crc != 0 && header.uncompressed_crc != crc32fast::hash(&records) {
        return Err("the checksum of a chunk does not match".into());
    }
    Ok(records)
}
