//! The form of a row in an MCAP file: a ROS 2 message of `float64` fields, one per column.
//!
//! Source: OMG DDSI-RTPS 2.3, §10 (CDR, representation identifier 0x0001 is little-endian); ROS 2
//! "About interfaces" for the definition language. All fields are 8 bytes wide and the first begins at
//! offset 0 behind the 4 bytes of encapsulation header, so there is no padding.

use std::collections::HashSet;

/// The topic of the rows.
pub(crate) const TICK_TOPIC: &str = "/freeplay/tick";
/// The type of the rows.
pub(crate) const TICK_TYPE: &str = "freeplay_msgs/msg/Tick";
/// The topic of the events.
pub(crate) const EVENT_TOPIC: &str = "/freeplay/event";
/// The type of the events.
pub(crate) const EVENT_TYPE: &str = "freeplay.Event";
/// The definition of an event.
pub(crate) const EVENT_SCHEMA: &str = r#"{"title":"freeplay.Event","type":"object","properties":{"t":{"type":"number"},"kind":{"type":"string"},"text":{"type":"string"}},"required":["t","kind","text"]}"#;
/// The metadata record, and the key of a channel's metadata with the exact column names.
pub(crate) const METADATA_NAME: &str = "freeplay";
pub(crate) const COLUMNS_KEY: &str = "columns";

const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// The definition of the message: one `float64` per column. Names of the contract stay, other names become the nearest ones that ROS 2 permits
/// (`[a-z][a-z0-9_]*`, no double and no last underscore).
pub(crate) fn definition(columns: &[String]) -> String {
    let mut taken: HashSet<String> = columns.iter().filter(|name| **name == field(name)).cloned().collect();
    let mut text = String::new();
    for column in columns {
        let mut name = field(column);
        if name != *column {
            let plain = name.clone();
            let mut number = 2;
            while !taken.insert(name.clone()) {
                name = format!("{plain}_{number}");
                number += 1;
            }
        }
        text.push_str("float64 ");
        text.push_str(&name);
        text.push('\n');
    }
    text
}

/// The nearest name that ROS 2 permits.
fn field(column: &str) -> String {
    let plain: String = column
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' })
        .collect();
    let joined = plain.split('_').filter(|part| !part.is_empty()).collect::<Vec<_>>().join("_");
    if joined.starts_with(|c: char| c.is_ascii_lowercase()) { joined } else { format!("c{joined}") }
}

/// The fields of a definition, or the first line with another type than `float64`.
pub(crate) fn fields(definition: &str) -> Result<Vec<String>, String> {
    let lines = definition.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    lines
        .filter(|line| !line.is_empty())
        .map(|line| match line.split_whitespace().collect::<Vec<_>>().as_slice() {
            ["float64", name] => Ok((*name).to_string()),
            _ => Err(line.to_string()),
        })
        .collect()
}

/// Replaces `message` by the row.
pub(crate) fn encode(row: &[f64], message: &mut Vec<u8>) {
    message.clear();
    message.extend_from_slice(&ENCAPSULATION);
    for value in row {
        message.extend_from_slice(&value.to_le_bytes());
    }
}

/// Reads a row with as many values as `row` has; else returns the fault.
pub(crate) fn decode(message: &[u8], row: &mut [f64]) -> Result<(), String> {
    let Some(body) = message.strip_prefix(&ENCAPSULATION) else {
        let head = &message[..message.len().min(4)];
        return Err(format!("the message begins with {head:02x?} instead of {ENCAPSULATION:02x?}"));
    };
    let (values, rest) = body.as_chunks::<8>();
    if values.len() != row.len() || !rest.is_empty() {
        return Err(format!("the message has {} bytes for {} columns of 8", body.len(), row.len()));
    }
    for (value, bytes) in row.iter_mut().zip(values) {
        *value = f64::from_le_bytes(*bytes);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{decode, definition, encode, fields};

    #[test]
    fn fields_are_named_like_the_columns_as_far_as_ros_allows() {
        let columns =
            ["t", "q1", "q_ref1", "u 1", "u-1", "u_1", "Temp", "1st", "°", "a__b_"].map(String::from);
        let names = fields(&definition(&columns)).expect("our own definition");
        assert_eq!(names, ["t", "q1", "q_ref1", "u_1_2", "u_1_3", "u_1", "temp", "c1st", "c", "a_b"]);
    }

    #[test]
    fn a_definition_may_have_comments_and_nothing_but_float64() {
        assert_eq!(
            fields("# units: SI\nfloat64 t # s\n\nfloat64  q1\r\n"),
            Ok(vec!["t".into(), "q1".into()])
        );
        assert_eq!(fields("float64 t\nfloat32 q1"), Err("float32 q1".into()));
        assert_eq!(fields("float64[6] q"), Err("float64[6] q".into()));
    }

    #[test]
    fn a_message_of_another_size_is_refused() {
        let mut message = Vec::new();
        encode(&[1.0, -0.0, f64::NAN], &mut message);
        let mut row = [0.0; 3];
        decode(&message, &mut row).expect("our own message");
        assert_eq!(row.map(f64::to_bits), [1.0, -0.0, f64::NAN].map(f64::to_bits));
        for size in 0..message.len() {
            assert!(decode(&message[..size], &mut row).is_err(), "{size} bytes");
        }
        message[1] = 0;
        assert!(decode(&message, &mut row).expect_err("big-endian").contains("instead of"));
    }
}
