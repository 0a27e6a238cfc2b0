//! Bags of ROS 1.
//!
//! Source: ROS wiki, "Bags/Format/2.0": records of a header of named fields and of data; chunks hold records, compressed by bzip2 or LZ4.

use std::collections::BTreeMap;
use std::io::{self, Read};

use crate::bag::{Bag, Encoding};
use crate::error::ReadError;
use crate::input::Source;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Kinds of records.
const MESSAGE: u8 = 2;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;
/// The largest record and the largest chunk, decompressed, bytes.
const MAX_RECORD: u32 = 256 << 20;

/// Topic and type of each connection.
type Connections = BTreeMap<u32, (String, String)>;

/// Adds the content of the bag in `input` to `bag`.
///
/// # Errors
/// [`ReadError::Damaged`], [`ReadError::Compression`], [`ReadError::Io`].
pub(crate) fn add(mut input: impl Read, source: &Source, bag: &mut Bag) -> Result<(), ReadError> {
    let failed = |error| ReadError::Io { file: source.file.to_path_buf(), source: error };
    let damaged = |offset, what: &str| ReadError::Damaged {
        file: source.file.to_path_buf(),
        offset,
        what: format!("{what}; `rosbag reindex` may save what is left"),
    };
    io::copy(&mut (&mut input).take(MAGIC.len() as u64), &mut io::sink()).map_err(failed)?;
    let mut connections = Connections::new();
    let mut offset = MAGIC.len() as u64;
    while let Some(header) = block(&mut input).map_err(failed)? {
        let Some(data) = block(&mut input).map_err(failed)? else { break };
        let record = Record { header: &header, data: &data };
        if record.kind() == Some(CHUNK) {
            let inner = record.inflated(source)?.map_err(|what| damaged(offset, &what))?;
            let mut rest = inner.as_slice();
            while let Some(inner) = Record::split(&mut rest) {
                inner.take(&mut connections, bag, source)?;
            }
        } else {
            record.take(&mut connections, bag, source)?;
        }
        offset += (header.len() + data.len() + 8) as u64;
    }
    Ok(())
}

/// A block with its length before it; `None` if the file ends before the block does.
fn block(input: &mut impl Read) -> io::Result<Option<Vec<u8>>> {
    let mut length = Vec::new();
    input.take(4).read_to_end(&mut length)?;
    let Ok(length) = <[u8; 4]>::try_from(length.as_slice()) else { return Ok(None) };
    let length = u32::from_le_bytes(length);
    if length > MAX_RECORD {
        let what = format!("a record of {length} bytes: the bag is damaged");
        return Err(io::Error::new(io::ErrorKind::InvalidData, what));
    }
    let mut body = Vec::new();
    input.take(u64::from(length)).read_to_end(&mut body)?;
    Ok((body.len() == length as usize).then_some(body))
}

/// A record.
struct Record<'a> {
    header: &'a [u8],
    data: &'a [u8],
}

impl<'a> Record<'a> {
    /// Splits the next record off the content of a chunk.
    fn split(rest: &mut &'a [u8]) -> Option<Self> {
        let mut block = || {
            let (length, behind) = rest.split_first_chunk::<4>()?;
            let (body, behind) = behind.split_at_checked(u32::from_le_bytes(*length) as usize)?;
            *rest = behind;
            Some(body)
        };
        Some(Self { header: block()?, data: block()? })
    }

    /// The value of the field `name` of the header.
    fn field(&self, name: &str) -> Option<&'a [u8]> {
        fields(self.header).find(|(known, _)| *known == name.as_bytes()).map(|(_, value)| value)
    }

    fn number(&self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.field(name)?.try_into().ok()?))
    }

    fn kind(&self) -> Option<u8> {
        self.field("op")?.first().copied()
    }

    /// The decompressed content of a chunk, or its fault.
    fn inflated(&self, source: &Source) -> Result<Result<Vec<u8>, String>, ReadError> {
        let size = self.number("size").unwrap_or(0);
        if size > MAX_RECORD {
            return Ok(Err(format!("a chunk of {size} bytes")));
        }
        let mut inner = Vec::new();
        let limit = u64::from(size) + 1;
        let read = match self.field("compression") {
            Some(b"none") | None => return Ok(Ok(self.data.to_vec())),
            Some(b"lz4") => lz4_flex::frame::FrameDecoder::new(self.data).take(limit).read_to_end(&mut inner),
            Some(b"bz2") => bzip2::read::BzDecoder::new(self.data).take(limit).read_to_end(&mut inner),
            Some(other) => {
                let compression = crate::names::shorten(&String::from_utf8_lossy(other));
                return Err(ReadError::Compression { file: source.file.to_path_buf(), compression });
            }
        };
        Ok(match read {
            Ok(_) if inner.len() == size as usize => Ok(inner),
            Ok(_) => Err("a chunk has another size than its header states".to_owned()),
            Err(error) => Err(format!("a chunk does not decompress: {error}")),
        })
    }

    /// Adds a connection or a message; skips a damaged one.
    fn take(&self, connections: &mut Connections, bag: &mut Bag, source: &Source) -> Result<(), ReadError> {
        match self.kind() {
            Some(CONNECTION) => {
                if let Some((connection, topic, kind)) = self.connection() {
                    bag.topics.insert(topic.clone(), kind.clone());
                    connections.insert(connection, (topic, kind));
                }
            }
            Some(MESSAGE) => {
                let described = self.number("conn").and_then(|connection| connections.get(&connection));
                if let (Some((topic, kind)), Some(time)) = (described, self.time_ns()) {
                    bag.take(topic, kind, Encoding::Ros1, time, self.data, source)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Number, topic and type of the connection that this record describes.
    fn connection(&self) -> Option<(u32, String, String)> {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let kind = fields(self.data).find(|(name, _)| *name == b"type")?.1;
        Some((self.number("conn")?, text(self.field("topic")?), text(kind)))
    }

    /// Log time of this message, ns.
    fn time_ns(&self) -> Option<u64> {
        let (seconds, nanos) = self.field("time")?.split_first_chunk::<4>()?;
        let nanos = u32::from_le_bytes(nanos.try_into().ok()?);
        Some(u64::from(u32::from_le_bytes(*seconds)) * 1_000_000_000 + u64::from(nanos))
    }
}

/// The fields of a header: names and values.
fn fields(mut header: &[u8]) -> impl Iterator<Item = (&[u8], &[u8])> {
    std::iter::from_fn(move || {
        let (length, behind) = header.split_first_chunk::<4>()?;
        let (field, behind) = behind.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        header = behind;
        let equals = field.iter().position(|byte| *byte == b'=')?;
        Some((&field[..equals], &field[equals + 1..]))
    })
}
