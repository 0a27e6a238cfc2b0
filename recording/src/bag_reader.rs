//! Bags in files of any kind, and in folders of them.

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::{MessageHeader, Record};

use crate::bag::{Bag, Encoding};
use crate::error::ReadError;
use crate::input::Source;
use crate::mcap_records::{Item, Records, damaged};
use crate::names::list;
use crate::open::{Kind, head, open};
use crate::{bag_folder, ros1_bag, sqlite_bag};

/// Reads the bag at `path`: a file of any kind, or a folder of them.
///
/// # Errors
/// See [`ReadError`].
pub(crate) fn read(path: &Path, source: &Source) -> Result<Bag, ReadError> {
    let mut bag = Bag::default();
    if !path.is_dir() {
        add_file(&mut bag, path, source)?;
        return Ok(bag);
    }
    let folder = bag_folder::files(path)?;
    for file in &folder.there {
        add_file(&mut bag, file, source)?;
    }
    if !folder.gone.is_empty() {
        bag.notes.push(format!("files of the bag that do not exist: {}", list(&folder.gone)));
    }
    Ok(bag)
}

/// Adds the content of the file at `path`.
///
/// # Errors
/// See [`ReadError`].
fn add_file(bag: &mut Bag, path: &Path, source: &Source) -> Result<(), ReadError> {
    let mut file = open(path)?;
    let source = Source { file: path, size: Some(file.length()), ..*source };
    match Kind::of(&head(&mut file, path)?) {
        Kind::Mcap => add_mcap(bag, behind_magic(open(path)?, path)?, &source),
        Kind::Sqlite => sqlite_bag::add(path, &source, bag),
        Kind::Ros1 => ros1_bag::add(BufReader::with_capacity(1 << 16, open(path)?), &source, bag),
        Kind::Foreign(what) if what.contains("zstd") => add_compressed(bag, path, &source),
        Kind::Foreign(what) => Err(ReadError::NotText { file: path.to_path_buf(), what }),
        _ => Err(ReadError::Unusable {
            file: path.to_path_buf(),
            what: "no ROS bag: neither MCAP, SQLite nor ROS 1".to_owned(),
        }),
    }
}

/// Adds a file that is compressed as a whole, as made by `ros2 bag record --compression-mode file`.
fn add_compressed(bag: &mut Bag, path: &Path, source: &Source) -> Result<(), ReadError> {
    let failed = |error| ReadError::Io { file: path.to_path_buf(), source: error };
    let mut inner = zstd::Decoder::new(open(path)?).map_err(failed)?;
    match Kind::of(&head(&mut inner, path)?) {
        Kind::Mcap => {
            let whole = zstd::Decoder::new(open(path)?).map_err(failed)?;
            add_mcap(bag, behind_magic(whole, path)?, source)
        }
        _ => {
            let what = "compressed by zstd as a whole: unzstd it first".to_owned();
            Err(ReadError::Unusable { file: path.to_path_buf(), what })
        }
    }
}

/// Adds the content of an MCAP file behind its first magic bytes; a damaged chunk costs its messages.
fn add_mcap(bag: &mut Bag, input: impl Read, source: &Source) -> Result<(), ReadError> {
    let mut reading = McapBag::new(bag, source);
    let mut records = Records::new(BufReader::with_capacity(1 << 16, input), source);
    records.for_each(&mut |offset, item| reading.take(offset, item))?;
    reading.take_waiting()?;
    bag.truncated |= records.truncated;
    if let (Some(compression), true) = (records.compression, bag.states.is_empty()) {
        return Err(ReadError::Compression { file: source.file.to_path_buf(), compression });
    }
    Ok(())
}

/// The state of reading an MCAP file into a bag: its channels and types, and messages that wait for theirs.
struct McapBag<'a> {
    bag: &'a mut Bag,
    source: &'a Source<'a>,
    types: BTreeMap<u16, String>,
    channels: BTreeMap<u16, (String, String, Encoding)>,
    /// Messages whose channel was described in a lost chunk; the summary describes it again.
    waiting: Vec<(MessageHeader, Vec<u8>)>,
    waiting_bytes: u64,
    is_damaged: bool,
}

impl<'a> McapBag<'a> {
    fn new(bag: &'a mut Bag, source: &'a Source<'a>) -> Self {
        Self {
            bag,
            source,
            types: BTreeMap::new(),
            channels: BTreeMap::new(),
            waiting: Vec::new(),
            waiting_bytes: 0,
            is_damaged: false,
        }
    }

    fn take(&mut self, offset: u64, item: Item) -> Result<(), ReadError> {
        let record = match item {
            Item::Record(record) => record,
            Item::Summary(record) if !self.waiting.is_empty() => record,
            Item::Summary(_) => return Ok(()),
            Item::Damage(what) => {
                self.is_damaged = true;
                let note =
                    format!("the bag is damaged at byte {offset} ({what}): its messages there are lost");
                self.bag.notes.push(note);
                return Ok(());
            }
        };
        match record {
            Record::Schema { header, .. } => {
                self.types.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let kind = self.types.get(&channel.schema_id).cloned().unwrap_or_default();
                let encoding =
                    if channel.message_encoding == "ros1" { Encoding::Ros1 } else { Encoding::Cdr };
                self.bag.topics.insert(channel.topic.clone(), kind.clone());
                self.channels.insert(channel.id, (channel.topic, kind, encoding));
            }
            Record::Message { header, data } => match self.channels.get(&header.channel_id) {
                Some((topic, kind, encoding)) => {
                    self.bag.take(topic, kind, *encoding, header.log_time, &data, self.source)?;
                }
                None if self.is_damaged => {
                    self.waiting_bytes += data.len() as u64;
                    if self.waiting_bytes / 8 <= self.source.limit {
                        self.waiting.push((header, data.into_owned()));
                    }
                }
                None => {
                    return Err(damaged(self.source, offset, "a message of a channel that is not described"));
                }
            },
            _ => {}
        }
        Ok(())
    }

    /// Adds the messages whose channel the summary has described.
    fn take_waiting(&mut self) -> Result<(), ReadError> {
        for (header, data) in std::mem::take(&mut self.waiting) {
            if let Some((topic, kind, encoding)) = self.channels.get(&header.channel_id) {
                self.bag.take(topic, kind, *encoding, header.log_time, &data, self.source)?;
            }
        }
        Ok(())
    }
}

/// The bytes of an MCAP file at `path`, behind the first magic bytes.
fn behind_magic<R: Read>(mut bytes: R, path: &Path) -> Result<R, ReadError> {
    let mut magic = [0; mcap::MAGIC.len()];
    bytes.read_exact(&mut magic).map_err(|source| ReadError::Io { file: path.to_path_buf(), source })?;
    Ok(bytes)
}
