//! The messages of a ROS bag that matter here: joint states and poses, from whatever it is stored in.

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::Path;

use freeplay_storage::InputFile;
use mcap::records::{MessageHeader, Record};

use crate::error::ReadError;
use crate::mcap_records::{Item, Records, damaged};
use crate::open::{Kind, head, open};
use crate::read::Source;
use crate::{bag_folder, ros1_bag, sqlite_bag};

/// The type of joint states.
pub(crate) const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
/// The type of poses.
pub(crate) const POSE_STAMPED: &str = "geometry_msgs/msg/PoseStamped";

/// How a message is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// ROS 2: CDR with its four bytes of encapsulation.
    Cdr,
    /// ROS 1.
    Ros1,
}

/// A message of one topic: its own time, ns, its number on the topic, its bytes.
#[derive(Debug)]
pub(crate) struct Message {
    pub log_ns: u64,
    pub number: u64,
    pub encoding: Encoding,
    pub data: Vec<u8>,
}

/// The messages of one type, by topic.
pub(crate) type Topics = BTreeMap<String, Vec<Message>>;

/// What a bag holds of the two types.
#[derive(Debug, Default)]
pub(crate) struct Bag {
    pub states: Topics,
    pub poses: Topics,
    /// Every topic with its type.
    pub topics: BTreeMap<String, String>,
    /// It ends before its end was written.
    pub truncated: bool,
    pub notes: Vec<String>,
    /// Bytes of all messages.
    held: u64,
}

impl Bag {
    /// Reads the bag at `path`: a file of any kind, or a folder of them.
    ///
    /// # Errors
    /// See [`ReadError`].
    pub fn read(path: &Path, source: &Source) -> Result<Self, ReadError> {
        let mut bag = Self::default();
        if path.is_dir() {
            bag_folder::read(path, source, &mut bag)?;
        } else {
            bag.add_file(path, source)?;
        }
        Ok(bag)
    }

    /// Adds what the file at `path` holds.
    ///
    /// # Errors
    /// See [`ReadError`].
    pub fn add_file(&mut self, path: &Path, source: &Source) -> Result<(), ReadError> {
        let mut file = open(path)?;
        let source = Source { file: path, size: Some(file.length()), ..*source };
        match Kind::of(&head(&mut file, path)?) {
            Kind::Mcap => self.add_mcap(behind_magic(path)?, &source),
            Kind::Sqlite => sqlite_bag::add(path, &source, self),
            Kind::Ros1 => ros1_bag::add(BufReader::with_capacity(1 << 16, open(path)?), &source, self),
            Kind::Foreign(what) if what.contains("zstd") => self.add_compressed(path, &source),
            Kind::Foreign(what) => Err(ReadError::NotText { file: path.to_path_buf(), what }),
            _ => Err(ReadError::Unusable {
                file: path.to_path_buf(),
                what: "no ROS bag: neither MCAP, SQLite nor ROS 1".to_owned(),
            }),
        }
    }

    /// Adds a file that is compressed as a whole, as `ros2 bag record --compression-mode file` leaves it.
    fn add_compressed(&mut self, path: &Path, source: &Source) -> Result<(), ReadError> {
        let failed = |error| ReadError::Io { file: path.to_path_buf(), source: error };
        let mut inner = zstd::Decoder::new(open(path)?).map_err(failed)?;
        match Kind::of(&head(&mut inner, path)?) {
            Kind::Mcap => {
                let mut whole = zstd::Decoder::new(open(path)?).map_err(failed)?;
                let mut magic = [0; mcap::MAGIC.len()];
                whole.read_exact(&mut magic).map_err(failed)?;
                self.add_mcap(whole, source)
            }
            _ => {
                let what = "compressed by zstd as a whole: unzstd it first".to_owned();
                Err(ReadError::Unusable { file: path.to_path_buf(), what })
            }
        }
    }

    /// Takes a message of `topic`, whose type is `kind`, if it is one that matters.
    ///
    /// # Errors
    /// [`ReadError::Unusable`] where all messages together take more memory than what is read.
    pub fn take(
        &mut self,
        topic: &str,
        kind: &str,
        encoding: Encoding,
        log_ns: u64,
        data: &[u8],
        source: &Source,
    ) -> Result<(), ReadError> {
        let of_type = match ros2_name(kind).as_str() {
            JOINT_STATE => &mut self.states,
            POSE_STAMPED => &mut self.poses,
            _ => return Ok(()),
        };
        let most = source.limit.saturating_mul(8);
        self.held += (data.len() + size_of::<Message>()) as u64;
        if self.held > most {
            let what = format!("its joint states and poses have more than {most} bytes; record shorter bags");
            return Err(ReadError::Unusable { file: source.file.to_path_buf(), what });
        }
        let messages = of_type.entry(topic.to_owned()).or_default();
        let number = messages.len() as u64 + 1;
        messages.push(Message { log_ns, number, encoding, data: data.to_vec() });
        Ok(())
    }

    /// Adds what a MCAP holds behind its first magic bytes; a damaged chunk costs its messages.
    fn add_mcap(&mut self, input: impl Read, source: &Source) -> Result<(), ReadError> {
        let mut reading = McapBag::new(self, source);
        let mut records = Records::new(BufReader::with_capacity(1 << 16, input), source);
        records.for_each(&mut |offset, item| reading.take(offset, item))?;
        reading.take_waiting()?;
        self.truncated |= records.truncated;
        if let (Some(compression), true) = (records.compression, self.states.is_empty()) {
            return Err(ReadError::Compression { file: source.file.to_path_buf(), compression });
        }
        Ok(())
    }
}

/// What is known of a MCAP that is read into a bag.
struct McapBag<'a> {
    bag: &'a mut Bag,
    source: &'a Source<'a>,
    types: BTreeMap<u16, String>,
    channels: BTreeMap<u16, (String, String, Encoding)>,
    /// Messages whose channel was described in a chunk that is lost; the summary describes it again.
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

    /// Takes the messages whose channel the summary has described.
    fn take_waiting(&mut self) -> Result<(), ReadError> {
        for (header, data) in std::mem::take(&mut self.waiting) {
            if let Some((topic, kind, encoding)) = self.channels.get(&header.channel_id) {
                self.bag.take(topic, kind, *encoding, header.log_time, &data, self.source)?;
            }
        }
        Ok(())
    }
}

/// The file at `path`, a MCAP, behind its first magic bytes.
fn behind_magic(path: &Path) -> Result<InputFile, ReadError> {
    let mut file = open(path)?;
    let mut magic = [0; mcap::MAGIC.len()];
    file.read_exact(&mut magic).map_err(|source| ReadError::Io { file: path.to_path_buf(), source })?;
    Ok(file)
}

/// Whether messages of the type `kind` are read.
pub(crate) fn is_read(kind: &str) -> bool {
    [JOINT_STATE, POSE_STAMPED].contains(&ros2_name(kind).as_str())
}

/// The name of a type as ROS 2 has it: `sensor_msgs/JointState` of ROS 1 is `sensor_msgs/msg/JointState`.
fn ros2_name(kind: &str) -> String {
    match kind.split_once('/') {
        Some((package, name)) if !name.contains('/') => format!("{package}/msg/{name}"),
        _ => kind.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Bag, Encoding, JOINT_STATE};
    use crate::read::Source;

    /// A few bytes of a compressed bag may inflate to any number of messages.
    #[test]
    fn messages_take_no_more_memory_than_what_is_read() {
        let source = Source { limit: 1000, ..Source::of(Path::new("run.bag")) };
        let (mut bag, data) = (Bag::default(), [0; 500]);
        let mut take = |kind: &str| bag.take("/joint_states", kind, Encoding::Cdr, 0, &data, &source);
        assert!((0..1000).all(|_| take("sensor_msgs/msg/Image").is_ok()), "nothing is kept of others");
        let taken = (0..1000).take_while(|_| take(JOINT_STATE).is_ok()).count();
        println!("{taken} messages of {} bytes", data.len());
        assert!((10..=16).contains(&taken), "8000 bytes, and what is kept of each");
        let said = take(JOINT_STATE).expect_err("full").to_string();
        assert!(said.contains("run.bag: its joint states and poses have more than 8000 bytes"), "{said}");
    }
}
