//! False sizes at any place of any file: no length, count or offset causes memory use, delay or a panic.
//!
//! Files of NumPy and MATLAB are in `inflation.rs`, Parquet in `parquet_claims.rs`, SQLite in `sqlite_claims.rs`. In a process of its own, since the kernel
//! counts the peak memory of a process.

use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use freeplay_recording::{Layout, McapWriter, Recording, export, read};
use mcap::WriteOptions;
use mcap::records::MessageHeader;

/// Memory limit for all these files together, KiB: a chunk of the largest size, and its content.
const MOST_KIB: u64 = 160 << 10;

/// A file that takes longer counts as hanging.
const LONGEST: Duration = Duration::from_secs(30);

/// Peak memory of this process, KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("a process");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("the peak");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number")
}

/// Bytes written over a file, at each place: large and negative sizes of four and of eight bytes, and of the length of a varint.
const CLAIMS: [&[u8]; 6] = [
    &[0xff, 0xff, 0xff, 0xff, 7],
    &[0xff, 0xff, 0xff, 0x7f],
    &[0x7f, 0xff, 0xff, 0xff],
    &[0, 0, 0, 0x10],
    &[0, 0, 0, 0, 2, 0, 0, 0],
    &[0xff; 8],
];

const ROWS: usize = 5;

/// A run of our own as MCAP.
fn own_mcap(path: &Path) {
    let layout = Layout::new(["t", "q1"]).expect("a layout");
    let mut writer =
        McapWriter::create(path, &layout, &[("scenario".to_owned(), "paper".to_owned())]).expect("a file");
    (0..ROWS).for_each(|k| writer.write(&[k as f64 * 0.1, 0.5]).expect("written"));
    writer.finish().expect("finished");
}

fn parquet(path: &Path) {
    let column = |factor: f64| (0..ROWS).map(|k| k as f64 * factor).collect::<Vec<f64>>();
    let columns = vec![("t".to_owned(), column(0.1)), ("q1".to_owned(), column(0.2))];
    let recording = Recording::new(Path::new("memory"), columns).expect("a recording");
    let written = path.with_extension("parquet");
    export(&recording, &written).expect("written");
    std::fs::rename(written, path).expect("renamed");
}

/// A joint state of some joints at `time`, s, as ROS 2 or as ROS 1 writes it.
fn joint_state(time: u32, is_ros1: bool, joints: usize) -> Vec<u8> {
    let mut data = if is_ros1 { vec![0; 4] } else { Vec::new() };
    let word = |data: &mut Vec<u8>, word: u32| data.extend(word.to_le_bytes());
    word(&mut data, time);
    word(&mut data, 0);
    let text = |data: &mut Vec<u8>, text: &str| {
        let text = if is_ros1 { text.to_owned() } else { format!("{text}\0") };
        word(data, text.len() as u32);
        data.extend(text.as_bytes());
    };
    let align = |data: &mut Vec<u8>, to: usize| {
        if !is_ros1 {
            data.resize(data.len().next_multiple_of(to), 0);
        }
    };
    text(&mut data, "");
    align(&mut data, 4);
    word(&mut data, joints as u32);
    for joint in 0..joints {
        text(&mut data, &format!("j{joint}"));
        align(&mut data, 4);
    }
    word(&mut data, joints as u32);
    align(&mut data, 8);
    (0..joints).for_each(|joint| data.extend((f64::from(time) + joint as f64).sin().to_le_bytes()));
    word(&mut data, 0);
    word(&mut data, 0);
    if is_ros1 { data } else { [vec![0, 1, 0, 0], data].concat() }
}

/// A bag of ROS 2.
fn ros2(path: &Path, options: WriteOptions, joints: usize) {
    let mut writer = options.create(Cursor::new(Vec::new())).expect("in memory");
    let schema =
        writer.add_schema("sensor_msgs/msg/JointState", "ros2msg", b"float64[] position").expect("added");
    let channel_id = writer.add_channel(schema, "/joint_states", "cdr", &BTreeMap::new()).expect("added");
    for k in 0..ROWS as u32 {
        let log_time = u64::from(k) * 1_000_000_000;
        let header = MessageHeader { channel_id, sequence: k, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &joint_state(k, false, joints)).expect("written");
    }
    writer.finish().expect("finished");
    std::fs::write(path, writer.into_inner().into_inner()).expect("written");
}

/// A record of a bag of ROS 1.
fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let with_length = |bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), bytes].concat();
    let field = |(name, value): &(&str, &[u8])| with_length(&[name.as_bytes(), b"=", value].concat());
    [with_length(&fields.iter().flat_map(field).collect::<Vec<u8>>()), with_length(data)].concat()
}

/// A bag of ROS 1 whose one chunk has this `compression`.
fn ros1(path: &Path, compression: &str) {
    let connection: (&str, &[u8]) = ("conn", &[0; 4]);
    let described = record(&[("type", b"sensor_msgs/JointState")], b"");
    let described = &described[4..described.len() - 4];
    let mut inner = record(&[("op", &[7]), connection, ("topic", b"/joint_states")], described);
    for k in 0..ROWS as u32 {
        let time = [k.to_le_bytes(), [0; 4]].concat();
        inner.extend(record(&[("op", &[2]), connection, ("time", &time)], &joint_state(k, true, 1)));
    }
    let size = (inner.len() as u32).to_le_bytes();
    let data = match compression {
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(&inner).expect("in memory");
            encoder.finish().expect("in memory")
        }
        "bz2" => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
            encoder.write_all(&inner).expect("in memory");
            encoder.finish().expect("in memory")
        }
        _ => inner,
    };
    let chunk = record(&[("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)], &data);
    std::fs::write(path, [b"#ROSBAG V2.0\n".to_vec(), chunk].concat()).expect("written");
}

/// Writes a sound file.
type Write = fn(&Path);

#[test]
fn a_size_claimed_at_any_place_takes_no_memory() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let path = folder.path().join("run");
    let files: [(&str, Write); 9] = [
        ("MCAP", own_mcap),
        ("Parquet", parquet),
        ("ROS 2, Zstandard", |path| ros2(path, WriteOptions::new(), 1)),
        ("ROS 2, chunks", |path| ros2(path, WriteOptions::new().compression(None), 1)),
        ("ROS 2, no chunks", |path| ros2(path, WriteOptions::new().use_chunks(false), 1)),
        ("ROS 2, no checksums", |path| {
            ros2(path, WriteOptions::new().compression(None).calculate_chunk_crcs(false), 1);
        }),
        ("ROS 1", |path| ros1(path, "none")),
        ("ROS 1, LZ4", |path| ros1(path, "lz4")),
        ("ROS 1, bzip2", |path| ros1(path, "bz2")),
    ];
    for (name, write) in files {
        write(&path);
        let sound = std::fs::read(&path).expect("a file");
        assert_eq!(read(&path, None).expect(name).len(), ROWS, "{name}");
        let (mut tried, mut readable, mut slowest) = (0, 0, Duration::ZERO);
        for place in 0..sound.len() {
            for claim in CLAIMS {
                let mut bytes = sound.clone();
                let end = bytes.len().min(place + claim.len());
                bytes[place..end].copy_from_slice(&claim[..end - place]);
                std::fs::write(&path, &bytes).expect("written");
                let begun = Instant::now();
                readable += u32::from(read(&path, None).is_ok());
                slowest = slowest.max(begun.elapsed());
                tried += 1;
                assert!(peak_kib() < MOST_KIB, "{name}: {claim:x?} at byte {place} takes {} KiB", peak_kib());
            }
        }
        println!(
            "{name}: {} bytes, {tried} claims, {readable} of them readable, the slowest {slowest:?}; at most {} KiB of memory",
            sound.len(),
            peak_kib()
        );
        assert!(tried > 1000 && slowest < LONGEST, "{name}: {slowest:?}");
    }
}

#[test]
fn a_message_of_many_joints_takes_no_longer_than_its_length() {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a folder in memory");
    let path = folder.path().join("run");
    ros2(&path, WriteOptions::new(), 100_000);
    let begun = Instant::now();
    let recording = read(&path, None).expect("a recording");
    println!("{} joints in {:?}", recording.joints(), begun.elapsed());
    assert_eq!((recording.len(), recording.joints()), (ROWS, 100_000));
    assert!(begun.elapsed() < LONGEST, "{:?}", begun.elapsed());
}
