//! Joint states and tool poses of a ROS bag as a recording.
//!
//! Sources: ROS interface definitions `sensor_msgs/msg/JointState` and `geometry_msgs/msg/PoseStamped`; [`crate::messages`] reads the messages. Units follow
//! ROS: positions in rad or m, velocities in rad/s or m/s, efforts in N·m or N.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::rc::Rc;

use crate::bag::{JOINT_STATE, Message, POSE_STAMPED, Topics};
use crate::bag_reader;
use crate::error::ReadError;
use crate::input::Source;
use crate::joints::places;
use crate::messages::{JointState, PoseStamped, Stamped, decode};
use crate::missing::is_missing;
use crate::names::{Group, ORIENTATION, TOOL, list};
use crate::place::Row;
use crate::recording::Recording;
use crate::table::Table;
use crate::tool_track::ToolTrack;

/// Selection from a bag.
#[derive(Clone, Debug, Default)]
pub struct BagOptions {
    /// The topic of the joint states; absent: the only one of their type.
    pub topic: Option<String>,
    /// The topic of the tool's poses; absent: the only one of their type, if there is one.
    pub pose_topic: Option<String>,
    /// The joints by name, or by a part of the name that no other joint has, from base to tool; empty: all, in the order of the messages.
    pub joints: Vec<String>,
}

/// Reads the joint states and, if present, the tool's poses of the bag at `path`, a file or a folder. Time begins at the first joint state. Poses are
/// interpolated to the times of the joint states, and missing outside of their own.
///
/// # Errors
/// See [`ReadError`].
pub fn import_bag(path: &Path, options: &BagOptions) -> Result<Recording, ReadError> {
    from_bag(options, &Source::of(path))
}

/// [`import_bag`] for the bag `source`.
pub(crate) fn from_bag(options: &BagOptions, source: &Source) -> Result<Recording, ReadError> {
    let mut bag = bag_reader::read(source.file, source)?;
    let topic = choose(&bag.states, options.topic.as_deref(), JOINT_STATE, "--topic", source)?;
    let Some((topic, messages)) = topic.and_then(|topic| bag.states.remove_entry(&topic)) else {
        let topics: Vec<String> =
            bag.topics.iter().map(|(topic, kind)| format!("{topic} ({kind})")).collect();
        let (file, topics) = (source.file.to_path_buf(), list(&topics));
        return Err(ReadError::NoJointStates { file, expected: JOINT_STATE, topics });
    };
    let mut notes = std::mem::take(&mut bag.notes);
    if bag.truncated {
        notes.push(
            "the bag is incomplete: its end is missing, and all messages before it are read".to_owned(),
        );
    }
    if !bag.states.is_empty() && options.topic.is_none() {
        let others: Vec<String> = bag.states.keys().cloned().collect();
        notes.push(format!("topic {topic} is read, not {}: choose with --topic", list(&others)));
    }
    let states = States::decode(&topic, &messages, &options.joints, source)?;
    let pose_topic = choose(&bag.poses, options.pose_topic.as_deref(), POSE_STAMPED, "--pose-topic", source)?;
    let track = match pose_topic.and_then(|topic| bag.poses.remove_entry(&topic)) {
        Some((topic, messages)) => Some(decode_poses(&topic, &messages, source)?),
        None => None,
    };
    states.into_recording(track, bag.truncated, notes, source)
}

/// The requested topic, with or without a leading slash; without a request the only one, or `/joint_states` among several; `None` if there is no topic and no
/// request.
fn choose(
    topics: &Topics,
    asked: Option<&str>,
    kind: &'static str,
    option: &'static str,
    source: &Source,
) -> Result<Option<String>, ReadError> {
    let names: Vec<String> = topics.keys().cloned().collect();
    let file = source.file.to_path_buf();
    let like =
        |wanted: &str| names.iter().find(|name| name.trim_matches('/') == wanted.trim_matches('/')).cloned();
    match (asked, names.as_slice()) {
        (Some(asked), _) => match like(asked) {
            Some(topic) => Ok(Some(topic)),
            None => Err(ReadError::NoJointStates { file, expected: kind, topics: list(&names) }),
        },
        (None, []) => Ok(None),
        (None, [only]) => Ok(Some(only.clone())),
        (None, _) => match like("joint_states") {
            Some(topic) => Ok(Some(topic)),
            None => Err(ReadError::ManyTopics { file, kind, topics: names.join(", "), option }),
        },
    }
}

/// Time of a message, ns: its stamp, or its log time if it has no stamp.
fn time_ns(stamp_ns: i64, message: &Message) -> i64 {
    if stamp_ns == 0 { message.log_ns as i64 } else { stamp_ns }
}

fn decode_poses(topic: &str, messages: &[Message], source: &Source) -> Result<ToolTrack, ReadError> {
    let poses = messages.iter().map(|message| {
        let decoded: Result<PoseStamped, String> = decode(message);
        let pose = decoded.map_err(|what| bag_error(topic, message.number, what, source))?;
        Ok((time_ns(pose.stamp_ns(), message), pose.pose))
    });
    Ok(ToolTrack::new(topic, poses.collect::<Result<_, ReadError>>()?))
}

fn bag_error(topic: &str, number: u64, what: String, source: &Source) -> ReadError {
    ReadError::Bag { place: source.place(Row::Message(number)), topic: topic.to_owned(), what }
}

/// Decoded joint states: time, number of the message, and the values of the present groups.
struct States {
    joints: Vec<String>,
    groups: Vec<Group>,
    rows: Vec<(i64, u64, Vec<f64>)>,
    notes: Vec<String>,
}

impl States {
    fn decode(
        topic: &str,
        messages: &[Message],
        asked: &[String],
        source: &Source,
    ) -> Result<Self, ReadError> {
        let mut decoded: Vec<(&Message, JointState)> = Vec::with_capacity(messages.len());
        for message in messages {
            let state = decode(message).map_err(|what| bag_error(topic, message.number, what, source))?;
            decoded.push((message, state));
        }
        let joints = chosen_joints(&decoded, asked).map_err(|what| {
            bag_error(topic, decoded.first().map_or(1, |(message, _)| message.number), what, source)
        })?;
        let is_there =
            |values: &[f64], state: &JointState| !state.name.is_empty() && values.len() == state.name.len();
        let has = |group: Group, state: &JointState| is_there(state.values(group), state);
        let all = decoded.len();
        let mut seats = Seats { joints: &joints, names: &[], places: None };
        let mut seated: Vec<(&Message, &JointState, Rc<[usize]>)> = Vec::new();
        for (message, state) in &decoded {
            seated.extend(seats.of(&state.name).map(|places| (*message, state, places)));
        }
        let others = all - seated.len();
        let optional = [Group::Velocity, Group::Torque];
        let present =
            optional.into_iter().filter(|&group| seated.iter().any(|(_, state, _)| has(group, state)));
        let groups: Vec<Group> = std::iter::once(Group::Position).chain(present).collect();
        let mut states = Self { joints: joints.clone(), groups, rows: Vec::new(), notes: Vec::new() };
        let mut lacking = 0_u64;
        for (message, state, places) in seated {
            if states.groups.iter().all(|group| has(*group, state)) {
                let of_group = |group: &Group| {
                    let values = state.values(*group);
                    places.iter().map(|&place| values.get(place).copied().unwrap_or(f64::NAN))
                };
                let row = states.groups.iter().flat_map(of_group).collect();
                states.rows.push((time_ns(state.stamp_ns(), message), message.number, row));
            } else {
                lacking += 1;
            }
        }
        if states.rows.is_empty() {
            let what = "no message has a position for each of its names; record the bag again".to_owned();
            return Err(bag_error(topic, 1, what, source));
        }
        if others > 0 {
            states
                .notes
                .push(format!("{others} of {all} messages of {topic} are skipped: they are of other joints"));
        }
        if lacking > 0 {
            states.notes.push(format!(
                "{lacking} of {all} messages of {topic} are skipped: they lack positions, velocities or efforts that others have"
            ));
        }
        Ok(states)
    }

    /// Leaves out joints that never have a position, unless that is all of them.
    fn drop_joints_without_position(&mut self) {
        let column = |joint: usize| self.rows.iter().map(|row| row.2[joint]).collect::<Vec<f64>>();
        let (count, groups) = (self.joints.len(), self.groups.len());
        let kept: Vec<usize> = (0..count).filter(|&joint| !is_missing(&column(joint))).collect();
        if kept.is_empty() || kept.len() == count {
            return;
        }
        let is_gone = |joint: &usize| kept.binary_search(joint).is_err();
        let gone: Vec<String> = (0..count).filter(is_gone).map(|joint| self.joints[joint].clone()).collect();
        self.notes.push(format!("joints without any position are left out: {}", list(&gone)));
        for (_, _, row) in &mut self.rows {
            *row = (0..groups)
                .flat_map(|group| kept.iter().map(move |joint| group * count + joint))
                .map(|place| row[place])
                .collect();
        }
        self.joints = kept.iter().map(|&joint| self.joints[joint].clone()).collect();
    }

    fn into_recording(
        mut self,
        track: Option<ToolTrack>,
        truncated: bool,
        notes: Vec<String>,
        source: &Source,
    ) -> Result<Recording, ReadError> {
        self.drop_joints_without_position();
        let mut names = vec!["t".to_owned()];
        for group in &self.groups {
            names.extend((0..self.joints.len()).map(|joint| group.column(joint)));
        }
        if track.is_some() {
            names.extend(TOOL.iter().chain(&ORIENTATION).map(ToString::to_string));
        }
        let table = Table::new(source.place(Row::Whole), names, source.joints, source.limit)?;
        let mut table = table.with_overview(source.overview);
        let first = self.rows.iter().map(|row| row.0).min().unwrap_or(0);
        for (time, number, values) in &self.rows {
            let mut row = vec![(time - first) as f64 * 1e-9];
            row.extend(values);
            if let Some(track) = &track {
                row.extend(track.at(*time).unwrap_or([f64::NAN; 7]));
            }
            table.push(&row, Row::Message(*number))?;
        }
        table.truncated = truncated;
        table.notes.extend(notes);
        table.notes.extend(self.notes);
        table.notes.extend(track.as_ref().map(|track| format!("tool: {}", track.in_words())));
        table.joint_names = self.joints;
        table.into_recording()
    }
}

/// Indices of the joints in the names of messages. Most messages have the names of the one before.
struct Seats<'a> {
    joints: &'a [String],
    names: &'a [String],
    places: Option<Rc<[usize]>>,
}

impl<'a> Seats<'a> {
    /// Index of the first occurrence of each joint in `names`; `None` if one is missing.
    fn of(&mut self, names: &'a [String]) -> Option<Rc<[usize]>> {
        if self.names != names {
            let mut place_of = HashMap::new();
            for (place, name) in names.iter().enumerate() {
                place_of.entry(name).or_insert(place);
            }
            self.names = names;
            self.places = self.joints.iter().map(|joint| place_of.get(joint).copied()).collect();
        }
        self.places.clone()
    }
}

/// The requested joints under their names in the messages; without a request, those of the messages with most joints.
fn chosen_joints(decoded: &[(&Message, JointState)], asked: &[String]) -> Result<Vec<String>, String> {
    let mut sets: BTreeMap<Vec<&String>, (u64, &JointState)> = BTreeMap::new();
    for (_, state) in decoded {
        let mut names: Vec<&String> = state.name.iter().collect();
        names.sort();
        sets.entry(names).or_insert((0, state)).0 += 1;
    }
    let most = |with: &dyn Fn(&JointState) -> bool| {
        let sets = sets.values().filter(|(_, state)| with(state));
        sets.max_by_key(|(count, state)| count * state.name.len() as u64).map(|(_, state)| *state)
    };
    let all = |_: &JointState| true;
    let Some(largest) = most(&all) else { return Err("it has no messages".to_owned()) };
    if asked.is_empty() {
        return Ok(largest.name.clone());
    }
    let found = |state: &JointState| -> Option<Vec<String>> {
        places(asked, &state.name).into_iter().map(|place| Some(state.name[place?].clone())).collect()
    };
    most(&|state| found(state).is_some()).and_then(found).ok_or_else(|| {
        let missing = asked.iter().zip(places(asked, &largest.name)).find(|(_, place)| place.is_none());
        let missing = missing.map_or("", |(name, _)| name.as_str());
        format!("no joint {missing:?}; it has {}: name those of the arm with --joints", list(&largest.name))
    })
}
