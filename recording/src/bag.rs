//! The messages of a ROS bag that matter here: joint states and poses, from whatever it is stored in.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::Record;

use crate::error::ReadError;
use crate::mcap_records::{Records, damaged};
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
        let (mut file, size) = open(path)?;
        let source = Source { file: path, size, ..*source };
        match Kind::of(&head(&mut file, path)?) {
            Kind::Mcap => self.add_mcap(behind_magic(path)?, &source),
            Kind::Sqlite => sqlite_bag::add(path, &source, self),
            Kind::Ros1 => ros1_bag::add(BufReader::with_capacity(1 << 16, open(path)?.0), &source, self),
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
        let mut inner = zstd::Decoder::new(open(path)?.0).map_err(failed)?;
        match Kind::of(&head(&mut inner, path)?) {
            Kind::Mcap => {
                let mut whole = zstd::Decoder::new(open(path)?.0).map_err(failed)?;
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
    pub fn take(
        &mut self,
        topic: &str,
        kind: &str,
        encoding: Encoding,
        log_ns: u64,
        data: impl FnOnce() -> Vec<u8>,
    ) {
        let of_type = match ros2_name(kind).as_str() {
            JOINT_STATE => &mut self.states,
            POSE_STAMPED => &mut self.poses,
            _ => return,
        };
        let messages = of_type.entry(topic.to_owned()).or_default();
        let number = messages.len() as u64 + 1;
        messages.push(Message { log_ns, number, encoding, data: data() });
    }

    /// Adds what a MCAP holds behind its first magic bytes.
    fn add_mcap(&mut self, input: impl Read, source: &Source) -> Result<(), ReadError> {
        let mut types: BTreeMap<u16, String> = BTreeMap::new();
        let mut channels: BTreeMap<u16, (String, String, Encoding)> = BTreeMap::new();
        let mut records = Records::new(BufReader::with_capacity(1 << 16, input), source);
        records.for_each(&mut |offset, record| {
            match record {
                Record::Schema { header, .. } => {
                    types.insert(header.id, header.name);
                }
                Record::Channel(channel) => {
                    let kind = types.get(&channel.schema_id).cloned().unwrap_or_default();
                    let encoding =
                        if channel.message_encoding == "ros1" { Encoding::Ros1 } else { Encoding::Cdr };
                    self.topics.insert(channel.topic.clone(), kind.clone());
                    channels.insert(channel.id, (channel.topic, kind, encoding));
                }
                Record::Message { header, data } => {
                    let Some((topic, kind, encoding)) = channels.get(&header.channel_id) else {
                        return Err(damaged(source, offset, "a message of a channel that is not described"));
                    };
                    self.take(topic, kind, *encoding, header.log_time, || data.into_owned());
                }
                _ => {}
            }
            Ok(())
        })?;
        self.truncated |= records.truncated;
        Ok(())
    }
}

/// The file at `path`, a MCAP, behind its first magic bytes.
fn behind_magic(path: &Path) -> Result<File, ReadError> {
    let (mut file, _) = open(path)?;
    let mut magic = [0; mcap::MAGIC.len()];
    file.read_exact(&mut magic).map_err(|source| ReadError::Io { file: path.to_path_buf(), source })?;
    Ok(file)
}

/// The name of a type as ROS 2 has it: `sensor_msgs/JointState` of ROS 1 is `sensor_msgs/msg/JointState`.
fn ros2_name(kind: &str) -> String {
    match kind.split_once('/') {
        Some((package, name)) if !name.contains('/') => format!("{package}/msg/{name}"),
        _ => kind.to_owned(),
    }
}
