//! Joint states and tool poses of a ROS 2 bag (MCAP) as a recording.
//!
//! Sources: ROS 2 interface definitions `sensor_msgs/msg/JointState` and `geometry_msgs/msg/PoseStamped`; OMG DDSI-RTPS 2.3, §10 (CDR
//! with its four bytes of encapsulation). Positions are rad or m, velocities rad/s or m/s, efforts N·m or N, as ROS says.

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use byteorder::{BigEndian, LittleEndian};
use freeplay_storage::InputFile;
use mcap::records::Record;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::error::{ReadError, Row};
use crate::mcap_records::{Item, Records, damaged, is_magic};
use crate::names::{Group, ORIENTATION, TOOL};
use crate::read::Source;
use crate::recording::Recording;
use crate::table::{MAX_NUMBERS, Table};
use crate::tool_track::{Pose, ToolTrack};

/// The type of joint states.
const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
/// The type of poses.
const POSE_STAMPED: &str = "geometry_msgs/msg/PoseStamped";

/// What to take from a bag.
#[derive(Clone, Debug, Default)]
pub struct BagOptions {
    /// The topic of the joint states; absent: the only one of their type.
    pub topic: Option<String>,
    /// The topic of the tool's poses; absent: the only one of their type, if there is one.
    pub pose_topic: Option<String>,
    /// The joints by name, from base to tool; empty: all, in the order of the first message.
    pub joints: Vec<String>,
}

#[derive(Deserialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

#[derive(Deserialize)]
struct Header {
    stamp: Stamp,
    #[serde(rename = "frame_id")]
    _frame_id: String,
}

#[derive(Deserialize)]
struct JointState {
    header: Header,
    name: Vec<String>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    effort: Vec<f64>,
}

#[derive(Deserialize)]
struct PoseStamped {
    header: Header,
    pose: Pose,
}

/// A message of one topic: its own time, ns, its number on the topic, its bytes.
struct Message {
    log_ns: u64,
    number: u64,
    data: Vec<u8>,
}

/// The messages of one type, by topic.
type Topics = BTreeMap<String, Vec<Message>>;

/// Reads the joint states and, where there are, the tool's poses of the bag at `path`. Time begins at the first joint state; poses are
/// interpolated to the times of the joint states, which end where the poses end.
///
/// # Errors
/// See [`ReadError`].
pub fn import_bag(path: &Path, options: &BagOptions) -> Result<Recording, ReadError> {
    let mut file = crate::read::open_file(path)?;
    let mut magic = [0; mcap::MAGIC.len()];
    if file.read_exact(&mut magic).is_err() || !is_magic(&magic) {
        return Err(ReadError::NotMcap { file: path.to_path_buf() });
    }
    let source = Source { file: path, size: None, joints: None, limit: MAX_NUMBERS, overview: None };
    Bag::read(file, &source)?.into_recording(options, &source)
}

/// What a bag holds of the two types.
struct Bag {
    states: Topics,
    poses: Topics,
    /// Every topic with its type.
    topics: BTreeMap<String, String>,
    /// Where it is damaged, one line each.
    damage: Vec<String>,
    truncated: bool,
}

impl Bag {
    fn read(file: InputFile, source: &Source) -> Result<Self, ReadError> {
        let mut types: BTreeMap<u16, String> = BTreeMap::new();
        let mut channels: BTreeMap<u16, (String, String)> = BTreeMap::new();
        let (mut states, mut poses) = (Topics::new(), Topics::new());
        let mut damage = Vec::new();
        let mut records = Records::new(BufReader::with_capacity(1 << 16, file), source);
        records.for_each(&mut |offset, item| {
            let record = match item {
                Item::Record(record) => record,
                Item::Summary(_) => return Ok(()),
                Item::Damage(what) => {
                    damage.push(format!(
                        "the bag is damaged at byte {offset} ({what}): its messages there are lost"
                    ));
                    return Ok(());
                }
            };
            match record {
                Record::Schema { header, .. } => {
                    types.insert(header.id, header.name);
                }
                Record::Channel(channel) => {
                    let kind = types.get(&channel.schema_id).cloned().unwrap_or_default();
                    channels.insert(channel.id, (channel.topic, kind));
                }
                Record::Message { header, data } => {
                    let Some((topic, kind)) = channels.get(&header.channel_id) else {
                        if !damage.is_empty() {
                            // Its channel was described in a chunk that is lost.
                            return Ok(());
                        }
                        return Err(damaged(source, offset, "a message of a channel that is not described"));
                    };
                    let of_type = match kind.as_str() {
                        JOINT_STATE => states.entry(topic.clone()),
                        POSE_STAMPED => poses.entry(topic.clone()),
                        _ => return Ok(()),
                    };
                    let messages = of_type.or_default();
                    let number = messages.len() as u64 + 1;
                    messages.push(Message { log_ns: header.log_time, number, data: data.into_owned() });
                }
                _ => {}
            }
            Ok(())
        })?;
        let topics = channels.into_values().collect();
        Ok(Bag { states, poses, topics, damage, truncated: records.truncated })
    }

    fn into_recording(mut self, options: &BagOptions, source: &Source) -> Result<Recording, ReadError> {
        let file = || source.file.to_path_buf();
        let topic = choose(&self.states, options.topic.as_deref(), JOINT_STATE, "--topic", source)?;
        let Some((topic, messages)) = topic.and_then(|topic| self.states.remove_entry(&topic)) else {
            let topics: Vec<String> =
                self.topics.iter().map(|(topic, kind)| format!("{topic} ({kind})")).collect();
            let topics = crate::names::list(&topics);
            return Err(ReadError::NoJointStates { file: file(), expected: JOINT_STATE, topics });
        };
        let states = States::decode(&topic, &messages, &options.joints, source)?;
        let pose_topic =
            choose(&self.poses, options.pose_topic.as_deref(), POSE_STAMPED, "--pose-topic", source)?;
        let track = match pose_topic.and_then(|topic| self.poses.remove_entry(&topic)) {
            Some((topic, messages)) => Some(decode_poses(&topic, &messages, source)?),
            None => None,
        };
        let mut recording = states.into_recording(track, self.truncated, source)?;
        recording.notes.extend(self.damage);
        Ok(recording)
    }
}

/// The topic asked for, or the only one; none if there is none and none is asked for.
fn choose(
    topics: &Topics,
    asked: Option<&str>,
    kind: &'static str,
    option: &'static str,
    source: &Source,
) -> Result<Option<String>, ReadError> {
    let names: Vec<String> = topics.keys().cloned().collect();
    let file: PathBuf = source.file.to_path_buf();
    match (asked, names.as_slice()) {
        (Some(asked), _) if topics.contains_key(asked) => Ok(Some(asked.to_owned())),
        (Some(_), _) => {
            Err(ReadError::NoJointStates { file, expected: kind, topics: crate::names::list(&names) })
        }
        (None, []) => Ok(None),
        (None, [only]) => Ok(Some(only.clone())),
        (None, _) => Err(ReadError::ManyTopics { file, kind, topics: names.join(", "), option }),
    }
}

/// The body of `message` in its byte order, or what is wrong with it.
fn decode<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    let read = match data {
        [0, 1, _, _, body @ ..] => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        [0, 0, _, _, body @ ..] => cdr_encoding::from_bytes::<T, BigEndian>(body),
        _ => {
            return Err(format!(
                "the message begins with {:02x?}; it must be CDR",
                &data[..data.len().min(4)]
            ));
        }
    };
    read.map(|(value, _)| value)
        .map_err(|error| format!("the message can't be decoded: {error}; record the bag again"))
}

/// When a message was made, ns: its stamp, or when it was logged if it has none.
fn time_ns(header: &Header, message: &Message) -> i64 {
    let stamp = i64::from(header.stamp.sec) * 1_000_000_000 + i64::from(header.stamp.nanosec);
    if stamp == 0 { message.log_ns as i64 } else { stamp }
}

fn decode_poses(topic: &str, messages: &[Message], source: &Source) -> Result<ToolTrack, ReadError> {
    let poses = messages.iter().map(|message| {
        let decoded: Result<PoseStamped, String> = decode(&message.data);
        let pose = decoded.map_err(|what| bag_error(topic, message.number, what, source))?;
        Ok((time_ns(&pose.header, message), pose.pose))
    });
    Ok(ToolTrack::new(topic, poses.collect::<Result<_, ReadError>>()?))
}

fn bag_error(topic: &str, number: u64, what: String, source: &Source) -> ReadError {
    ReadError::Bag { place: source.place(Row::Message(number)), topic: topic.to_owned(), what }
}

/// Decoded joint states: time, number of the message, and the values of the groups that are there.
struct States {
    joints: Vec<String>,
    groups: Vec<Group>,
    rows: Vec<(i64, u64, Vec<f64>)>,
}

impl States {
    fn decode(
        topic: &str,
        messages: &[Message],
        asked: &[String],
        source: &Source,
    ) -> Result<Self, ReadError> {
        let mut states = States { joints: asked.to_vec(), groups: Vec::new(), rows: Vec::new() };
        for message in messages {
            let fault = |what: String| bag_error(topic, message.number, what, source);
            let state: JointState = decode(&message.data).map_err(fault)?;
            // Another publisher on the same topic, a gripper's say.
            if !asked.is_empty() && !state.name.iter().any(|name| asked.contains(name)) {
                continue;
            }
            if states.rows.is_empty() {
                if states.joints.is_empty() {
                    states.joints.clone_from(&state.name);
                }
                let present = [(Group::Velocity, &state.velocity), (Group::Torque, &state.effort)];
                let present = present.into_iter().filter(|(_, values)| !values.is_empty());
                states.groups =
                    std::iter::once(Group::Position).chain(present.map(|(group, _)| group)).collect();
            }
            let row = states.row(&state).map_err(fault)?;
            states.rows.push((time_ns(&state.header, message), message.number, row));
        }
        Ok(states)
    }

    /// The values of one message in our order.
    fn row(&self, state: &JointState) -> Result<Vec<f64>, String> {
        let mut row = Vec::with_capacity(self.joints.len() * self.groups.len());
        for group in &self.groups {
            let (name, values) = match group {
                Group::Velocity => ("velocity", &state.velocity),
                Group::Torque => ("effort", &state.effort),
                _ => ("position", &state.position),
            };
            if values.len() != state.name.len() {
                return Err(format!("{name} has {} values for {} names", values.len(), state.name.len()));
            }
            for joint in &self.joints {
                let Some(place) = state.name.iter().position(|name| name == joint) else {
                    let (wanted, found) = (self.joints.join(","), state.name.join(","));
                    return Err(format!(
                        "no joint {joint:?}; it has {found}, wanted are {wanted}: name those of the arm with --joints"
                    ));
                };
                row.push(values[place]);
            }
        }
        Ok(row)
    }

    fn into_recording(
        self,
        track: Option<ToolTrack>,
        truncated: bool,
        source: &Source,
    ) -> Result<Recording, ReadError> {
        let mut names = vec!["t".to_owned()];
        for group in &self.groups {
            names.extend((0..self.joints.len()).map(|joint| group.column(joint)));
        }
        if track.is_some() {
            names.extend(TOOL.iter().chain(&ORIENTATION).map(ToString::to_string));
        }
        let mut table = Table::new(source.place(Row::Whole), names, None, source.limit)?;
        let (first, mut left_out) = (self.rows.first().map_or(0, |row| row.0), 0_u64);
        for (time, number, values) in &self.rows {
            let mut row = vec![(time - first) as f64 * 1e-9];
            row.extend(values);
            if let Some(track) = &track {
                let Some(pose) = track.at(*time) else {
                    left_out += 1;
                    continue;
                };
                row.extend(pose);
            }
            table.push(&row, Row::Message(*number))?;
        }
        table.truncated = truncated;
        table.metadata = vec![("joints".to_owned(), self.joints.join(","))];
        table.notes.push(format!("joints q1…q{}: {}", self.joints.len(), self.joints.join(", ")));
        if let Some(track) = &track {
            table.notes.push(format!(
                "tool: {}; {left_out} joint states outside of it are left out",
                track.in_words()
            ));
        }
        table.into_recording()
    }
}
