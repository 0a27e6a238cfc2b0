//! The required messages of a ROS bag: joint states and poses, from any kind of storage.

use std::collections::BTreeMap;

use crate::error::ReadError;
use crate::input::Source;

/// The type of joint states.
pub(crate) const JOINT_STATE: &str = "sensor_msgs/msg/JointState";
/// The type of poses.
pub(crate) const POSE_STAMPED: &str = "geometry_msgs/msg/PoseStamped";

/// Encoding of a message.
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

/// The messages of the two types in a bag.
#[derive(Debug, Default)]
pub(crate) struct Bag {
    pub states: Topics,
    pub poses: Topics,
    /// Every topic with its type.
    pub topics: BTreeMap<String, String>,
    /// The file breaks off before its end.
    pub truncated: bool,
    pub notes: Vec<String>,
    /// Bytes of all messages.
    held: u64,
}

impl Bag {
    /// Adds a message of `topic` with the type `kind`, if the type is required.
    ///
    /// # Errors
    /// [`ReadError::Unusable`] if all messages together exceed the memory limit.
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
}

/// True if messages of the type `kind` are read.
pub(crate) fn is_read(kind: &str) -> bool {
    [JOINT_STATE, POSE_STAMPED].contains(&ros2_name(kind).as_str())
}

/// The name of a type in ROS 2: `sensor_msgs/JointState` of ROS 1 is `sensor_msgs/msg/JointState`.
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
    use crate::input::Source;

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
