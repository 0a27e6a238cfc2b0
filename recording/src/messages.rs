//! Decoding of the required ROS messages, in the encodings of ROS 2 (CDR) and ROS 1.
//!
//! Sources: OMG DDSI-RTPS 2.3, §10 (CDR with its four bytes of encapsulation); ROS wiki, "msg", serialization.

use byteorder::{BigEndian, LittleEndian};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::bag::{Encoding, Message};
use crate::names::Group;
use crate::tool_track::Pose;

#[derive(Deserialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

/// The header of a message.
#[derive(Deserialize)]
pub(crate) struct Header {
    stamp: Stamp,
    #[serde(rename = "frame_id")]
    _frame_id: String,
}

/// `sensor_msgs/msg/JointState`.
#[derive(Deserialize)]
pub(crate) struct JointState {
    header: Header,
    pub name: Vec<String>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    effort: Vec<f64>,
}

impl JointState {
    /// The values of `group`, in the order of its names; the list may be shorter or empty.
    pub fn values(&self, group: Group) -> &[f64] {
        match group {
            Group::Velocity => &self.velocity,
            Group::Torque => &self.effort,
            Group::Position | Group::Reference | Group::Link => &self.position,
        }
    }
}

/// `geometry_msgs/msg/PoseStamped`.
#[derive(Deserialize)]
pub(crate) struct PoseStamped {
    header: Header,
    pub pose: Pose,
}

/// A message with a header.
pub(crate) trait Stamped: Sized {
    /// Its header.
    fn header(&self) -> &Header;

    /// Decodes a message of ROS 1 behind its header; `None` if it ends too early.
    fn from_ros1(header: Header, body: &mut Ros1) -> Option<Self>;

    /// Its time stamp, ns.
    fn stamp_ns(&self) -> i64 {
        let stamp = &self.header().stamp;
        i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec)
    }
}

impl Stamped for JointState {
    fn header(&self) -> &Header {
        &self.header
    }

    fn from_ros1(header: Header, body: &mut Ros1) -> Option<Self> {
        let count = body.u32()?;
        let mut name = Vec::new();
        for _ in 0..count {
            name.push(body.string()?);
        }
        Some(Self {
            header,
            name,
            position: body.numbers()?,
            velocity: body.numbers()?,
            effort: body.numbers()?,
        })
    }
}

impl Stamped for PoseStamped {
    fn header(&self) -> &Header {
        &self.header
    }

    fn from_ros1(header: Header, body: &mut Ros1) -> Option<Self> {
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = body.f64()?;
        }
        Some(Self { header, pose: Pose::of(numbers) })
    }
}

/// Decodes `message`, or returns its fault.
pub(crate) fn decode<T: DeserializeOwned + Stamped>(message: &Message) -> Result<T, String> {
    if message.encoding == Encoding::Ros1 {
        let mut body = Ros1(&message.data);
        let decoded = body.header().and_then(|header| T::from_ros1(header, &mut body));
        return decoded.ok_or_else(|| "the message ends too early; record the bag again".to_owned());
    }
    let read = match message.data.as_slice() {
        [0, 1, _, _, body @ ..] => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        [0, 0, _, _, body @ ..] => cdr_encoding::from_bytes::<T, BigEndian>(body),
        data => {
            return Err(format!(
                "the message begins with {:02x?}; it must be CDR",
                &data[..data.len().min(4)]
            ));
        }
    };
    read.map(|(value, _)| value)
        .map_err(|error| format!("the message can't be decoded: {error}; record the bag again"))
}

/// The unread rest of a ROS 1 message: little-endian, without padding, lengths before strings and lists.
pub(crate) struct Ros1<'a>(&'a [u8]);

impl Ros1<'_> {
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.bytes().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.bytes().map(f64::from_le_bytes)
    }

    fn string(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(String::from_utf8_lossy(text).into_owned())
    }

    fn numbers(&mut self) -> Option<Vec<f64>> {
        let count = self.u32()? as usize;
        let (cells, rest) = self.0.split_at_checked(count.checked_mul(8)?)?;
        self.0 = rest;
        Some(cells.as_chunks::<8>().0.iter().map(|cell| f64::from_le_bytes(*cell)).collect())
    }

    fn header(&mut self) -> Option<Header> {
        let _sequence = self.u32()?;
        let stamp = Stamp { sec: self.u32()? as i32, nanosec: self.u32()? };
        Some(Header { stamp, _frame_id: self.string()? })
    }
}
