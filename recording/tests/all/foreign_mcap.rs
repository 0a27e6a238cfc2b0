//! An MCAP file of another tool, or a damaged one: read if possible, else one clear line.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use freeplay_recording::{ReadError, Recording, read_from};
use mcap::WriteOptions;
use mcap::records::MessageHeader;

/// A channel and its messages.
struct Topic<'a> {
    name: &'a str,
    encoding: &'a str,
    schema: (&'a str, &'a str),
    messages: Vec<Vec<u8>>,
}

/// Rows of little-endian CDR.
fn rows(values: &[&[f64]]) -> Vec<Vec<u8>> {
    let body = |row: &&[f64]| row.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    values.iter().map(|row| [vec![0, 1, 0, 0], body(row)].concat()).collect()
}

fn tick<'a>(definition: &'a str, messages: Vec<Vec<u8>>) -> Topic<'a> {
    Topic { name: "/freeplay/tick", encoding: "cdr", schema: ("ros2msg", definition), messages }
}

fn mcap_of(options: WriteOptions, topics: &[Topic]) -> Vec<u8> {
    let mut writer = options.create(Cursor::new(Vec::new())).expect("in memory");
    for topic in topics {
        let (encoding, definition) = topic.schema;
        let schema = writer.add_schema("some/Type", encoding, definition.as_bytes()).expect("added");
        let channel_id =
            writer.add_channel(schema, topic.name, topic.encoding, &BTreeMap::new()).expect("added");
        for (k, data) in topic.messages.iter().enumerate() {
            let header =
                MessageHeader { channel_id, sequence: k as u32, log_time: k as u64, publish_time: 0 };
            writer.write_to_known_channel(&header, data).expect("written");
        }
    }
    writer.finish().expect("finished");
    writer.into_inner().into_inner()
}

fn read(bytes: &[u8]) -> Result<Recording, ReadError> {
    read_from(bytes, Path::new("run.mcap"), None)
}

fn message_of(topics: &[Topic]) -> String {
    read(&mcap_of(WriteOptions::new(), topics)).expect_err("no recording").to_string()
}

#[test]
fn a_foreign_file_with_our_topic_is_read() {
    let topics = || {
        let image = vec![vec![7; 5000]; 3];
        [
            Topic { name: "/camera", encoding: "cdr", schema: ("ros2idl", "struct"), messages: image },
            tick("# SI\nfloat64 t\nfloat64 q1 # rad\n", rows(&[&[0.0, 1.0], &[0.5, 2.0]])),
        ]
    };
    let attached = mcap::Attachment {
        log_time: 0,
        create_time: 0,
        name: "video".into(),
        media_type: "video/mp4".into(),
        data: vec![1; 300_000].into(),
    };
    let options = [
        WriteOptions::new(),
        WriteOptions::new().compression(None),
        WriteOptions::new().compression(None).calculate_chunk_crcs(false),
        WriteOptions::new().use_chunks(false),
        WriteOptions::new().chunk_size(Some(100)),
        WriteOptions::new().emit_summary_records(false).emit_summary_offsets(false),
    ];
    for options in options {
        let recording = read(&mcap_of(options.clone(), &topics())).expect("read");
        assert_eq!((recording.t, recording.q), (vec![0.0, 0.5], vec![vec![1.0, 2.0]]), "{options:?}");
        assert!(!recording.truncated);
    }
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).expect("in memory");
    writer.attach(&attached).expect("attached");
    writer.finish().expect("finished");
    let error = read(&writer.into_inner().into_inner()).expect_err("an attachment is no recording");
    assert!(error.to_string().starts_with("run.mcap: no topic /freeplay/tick; found: none"), "{error}");
}

#[test]
fn each_foreign_form_has_its_message() {
    let q = || rows(&[&[0.0, 1.0]]);
    let joints = "float64 t\nfloat64 q1\n";
    let topic = |name| Topic { name, encoding: "json", schema: ("jsonschema", "{}"), messages: vec![] };
    let json = Topic { name: "/freeplay/tick", ..topic("") };
    let must = "; it must be written as float64 fields, schema ros2msg, messages cdr (little-endian)";
    let cases = [
        (
            message_of(&[topic("/joint_states"), topic("/tf")]),
            "run.mcap: no topic /freeplay/tick; found: /joint_states, /tf; record with `freeplay run`, or turn a ROS 2 bag into a recording with `freeplay record import`".to_string(),
        ),
        (
            message_of(&[json]),
            format!("run.mcap: topic /freeplay/tick: schema \"jsonschema\", messages \"json\"{must}"),
        ),
        (
            message_of(&[tick("float64 t\nfloat32 q1\n", q())]),
            format!("run.mcap: topic /freeplay/tick: field \"float32 q1\"{must}"),
        ),
        (
            message_of(&[tick(joints, rows(&[&[0.0, 1.0], &[0.5, 2.0, 3.0]]))]),
            format!("run.mcap, message 2: topic /freeplay/tick: the message has 24 bytes for 2 columns of 8{must}"),
        ),
        (
            message_of(&[tick(joints, rows(&[&[0.5, f64::NAN]]))]),
            "run.mcap, message 1: column q1 holds no number, and all 1 rows lack such a value: no row is left; record it, or name another column for it in a mapping file: freeplay record import".into(),
        ),
        (
            message_of(&[tick(joints, rows(&[&[0.5, 1.0], &[0.5, 1.0]]))]),
            "run.mcap, message 2: column t: 0.5 does not come after 0.5 in the row before: the clock stands still, jumps back or begins again here; cut the file into one recording each, or correct the times from here on".into(),
        ),
        (
            message_of(&[tick("float64 t\nfloat64 q2\n", q())]),
            "run.mcap: column q1 is missing (add the position of joint 1, rad); found: t, q2".into(),
        ),
        (message_of(&[tick(joints, vec![])]), "run.mcap: no samples; record some motion".into()),
    ];
    for (found, expected) in cases {
        assert_eq!(found, expected);
    }
}

#[test]
fn damage_is_found_by_the_checksum_and_told_from_a_missing_end() {
    let values: Vec<[f64; 2]> = (0..200).map(|k| [f64::from(k), f64::from(k).sin()]).collect();
    let values: Vec<&[f64]> = values.iter().map(<[f64; 2]>::as_slice).collect();
    let topics = [tick("float64 t\nfloat64 q1\n", rows(&values))];
    for compressed in [true, false] {
        let mut options = WriteOptions::new();
        if !compressed {
            options = options.compression(None);
        }
        let mut bytes = mcap_of(options, &topics);
        let middle = if compressed { 1_500 } else { 3_000 };
        bytes[middle] ^= 1;
        let error = read(&bytes).expect_err("a flipped bit");
        let ReadError::Damaged { offset, what, .. } = &error else { panic!("{error}") };
        println!("byte {middle} of {}: chunk at {offset}, {what}", bytes.len());
        assert!(what.contains("chunk") && *offset < middle as u64, "{error}");
        assert!(error.to_string().contains("`mcap recover`"), "{error}");
        assert!(read(&bytes[..middle + 1]).is_err_and(|e| matches!(e, ReadError::NoSamples { .. })));
    }
}

#[test]
fn a_claim_of_size_is_not_believed() {
    // A chunk that claims a decompressed size of 2^50 bytes, and a record that claims as many.
    let chunk = |size: u64| {
        let name = [&4_u32.to_le_bytes()[..], b"zstd"].concat();
        [&[0; 16][..], &size.to_le_bytes(), &[0; 4], &name, &[0; 8]].concat()
    };
    let record =
        |opcode: u8, length: u64, body: &[u8]| [mcap::MAGIC, &[opcode], &length.to_le_bytes(), body].concat();
    let body = chunk(1 << 50);
    let error = read(&record(6, body.len() as u64, &body)).expect_err("a bomb");
    assert!(error.to_string().contains("a chunk of 1125899906842624 bytes"), "{error}");
    let endless = std::io::Read::chain(Cursor::new(record(3, 1 << 50, b"")), std::io::repeat(0));
    let error = read_from(endless, Path::new("run.mcap"), None).expect_err("a record without end");
    assert!(error.to_string().contains("a record of 1125899906842624 bytes"), "{error}");
}
