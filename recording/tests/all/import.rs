//! Import of foreign recordings: CSVs by a mapping, libfranka logs, ROS 2 bags.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};

use freeplay_recording::{BagOptions, Mapping, Recording, import_bag, import_csv};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn written(folder: &TempDir, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, content).expect("written");
    path
}

/// Imports the CSV `text` by the mapping `toml`; errors as text.
fn mapped(toml: &str, text: &str) -> Result<Recording, String> {
    let folder = folder();
    let mapping = Mapping::load(&written(&folder, "map.toml", toml)).map_err(|error| error.to_string())?;
    import_csv(&written(&folder, "run.csv", text), &mapping).map_err(|error| error.to_string())
}

fn column(recording: &Recording, name: &str) -> Vec<f64> {
    recording.column(name).unwrap_or_else(|| panic!("no column {name}: {:?}", recording.columns())).to_vec()
}

fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 1e-14 * expected.abs().max(1.0), "{found} {expected}");
    }
}

const MAP: &str = r#"
separator = ";"
decimal = ","
skip = 1
[t]
columns = "Time"
unit = "ms"
[q]
columns = "pos_{}"
unit = "deg"
[qd]
columns = ["v_a", "v_b"]
unit = "rpm"
[tau]
columns = "i_{}"
first = 0
scale = [2.0, -4.0]
[tool]
columns = ["X", "Y", "Z"]
unit = "mm"
"#;

const SEMICOLONS: &str = "Log of the arm; 2026\nTime;pos_1;pos_2;v_a;v_b;i_0;i_1;X;Y;Z;q1;temp\n\
                          0;90;-180;60;0;1,5;2;1000;-1;0,5;7;20\n2,5;45;0;-30;1;0;-0,25;0;0;0;8;21\n";

#[test]
fn degrees_millimetres_and_decimal_commas_become_si() {
    let recording = mapped(MAP, SEMICOLONS).expect("it reads");
    assert_close(&column(&recording, "t"), &[0.0, 2.5e-3]);
    assert_close(&column(&recording, "q1"), &[PI / 2.0, PI / 4.0]);
    assert_close(&column(&recording, "q2"), &[-PI, 0.0]);
    assert_close(&column(&recording, "qd1"), &[2.0 * PI, -PI]);
    assert_close(&column(&recording, "tau1"), &[3.0, 0.0]);
    assert_close(&column(&recording, "tau2"), &[-8.0, 1.0]);
    assert_close(&column(&recording, "x"), &[1.0, 0.0]);
    assert_close(&column(&recording, "z"), &[5e-4, 0.0]);
    // A column with a name of the contract that the mapping does not name means something else.
    assert_eq!(
        (column(&recording, "file_q1"), column(&recording, "temp")),
        (vec![7.0, 8.0], vec![20.0, 21.0])
    );
}

#[test]
fn what_a_mapping_gets_wrong_is_said_with_place_and_remedy() {
    let replaced = |from: &str, to: &str| MAP.replacen(from, to, 1);
    let added = |text: &str| format!("{MAP}{text}");
    // The expected message, after the mapping file with line and column.
    let cases = [
        (
            replaced("unit = \"deg\"", "unit = \"grad\""),
            "q.unit = \"grad\" is none of its units: rad, deg, m, mm; give one",
        ),
        (replaced("\"pos_{}\"", "\"joint{}\""), "run.csv:2 has no column \"joint1\"; it has Time, pos_1"),
        (replaced("[\"v_a\", \"v_b\"]", "[\"v_a\"]"), "qd: 1 columns, expected 2; give one for each"),
        (replaced("[2.0, -4.0]", "[2.0]"), "tau: 1 factors in scale, expected 2; give one for each"),
        (replaced("[2.0, -4.0]", "[2.0, nan]"), "tau.scale holds NaN; give finite numbers"),
        (replaced("[2.0, -4.0]", "[2.0, \"x\"]"), "expected a number, or a list of numbers"),
        (replaced("\"X\", \"Y\", \"Z\"", "\"X\", \"Y\""), "tool: 2 columns, expected 3"),
        (replaced("\"v_b\"", "\"pos_1\""), "column \"pos_1\" is named for q1 and for qd2; name it once"),
        (replaced("separator", "seperator"), "unknown field `seperator`, expected one of"),
        (replaced("unit = \"ms\"", "unit = 3"), "expected a unit in quotes, or a list of units"),
        (replaced("decimal = \",\"", "decimal = \"7\""), "decimal = '7' is not possible; give a single"),
        (replaced("decimal = \",\"", "decimal = 7"), "found `7`, expected a single character in quotes"),
        (format!("joints = [\"a\"]\n{MAP}"), "joints: 1 names, expected 2; give one for each"),
        (
            added("\n[[relative]]\njoint = 1\nto = 7\nfactor = 1\n"),
            "there is no joint 7; give a number from 1 to 2",
        ),
        (
            added("\n[[relative]]\njoint = 1\nto = 2\nfactor = inf\n"),
            "relative.factor holds inf; give finite",
        ),
        (added("\n[q_ref]\n"), "missing field `columns`"),
        (added("\n[q_ref\n"), "unclosed table"),
    ];
    for (map, said) in &cases {
        let error = mapped(map, SEMICOLONS).expect_err(said);
        println!("{error}");
        let place =
            error.split_once("map.toml:").and_then(|(_, rest)| rest.split_once(": ")).map(|(place, _)| place);
        let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        assert!(
            place.is_some_and(|place| place.split(':').count() == 2 && place.split(':').all(is_number)),
            "{error}"
        );
        assert!(error.contains(said), "{error}");
        assert!(
            !["untagged", "enum", "usize", "f64", "struct", "variant"]
                .iter()
                .any(|word| error.contains(word)),
            "{error}"
        );
    }
    let error = mapped(MAP, &SEMICOLONS.replace("0,25", "x")).expect_err("a bad cell");
    assert!(error.contains("run.csv:4: column tau2: \"-x\" is not a number"), "{error}");
    let error = mapped(MAP, &SEMICOLONS.replace("\n2,5;", "\n0;")).expect_err("time stands still");
    assert!(error.contains("run.csv:4: column t"), "{error}");
}

/// A mapping renames joints in files that name them already.
#[test]
fn a_mapping_names_joints_whatever_the_file_calls_them() {
    let rows: String = (0..20).map(|k| format!("{k},{k},{},{}\n", 2 * k, 3 * k)).collect();
    let folder = folder();
    let all = freeplay_recording::read(
        &written(&folder, "r.csv", format!("t,q1,q2,q3,joints=x;y;z\n{}", rows.replace('\n', ",0\n"))),
        None,
    );
    let all = all.expect("it reads");
    assert_eq!(all.joint_names.concat(), "xyz");
    let toml = "joints = [\"a\", \"b\"]\n[t]\ncolumns = \"t\"\n[q]\ncolumns = [\"q3\", \"q1\"]\n";
    let mapping = Mapping::load(&written(&folder, "map.toml", toml)).expect("a mapping");
    for ending in ["csv", "parquet", "mcap"] {
        let (file, again) =
            (folder.path().join(format!("all.{ending}")), folder.path().join(format!("m.{ending}")));
        freeplay_recording::export(&all, &file).expect("written");
        let mapped = import_csv(&file, &mapping).unwrap_or_else(|error| panic!("{ending}: {error}"));
        assert_eq!(
            (mapped.joint_names.concat(), mapped.q[0][19], mapped.q[1][19]),
            ("ab".into(), 57.0, 19.0)
        );
        freeplay_recording::export(&mapped, &again).expect("written");
        let again = freeplay_recording::read(&again, None).expect("it reads");
        assert_eq!(again.joint_names.concat(), "ab", "{ending}");
    }
}

/// The header that `franka::logToCSV` writes, blanks included, cut to the columns of the state.
#[test]
fn a_libfranka_log_needs_no_mapping_file() {
    let group = |name: &str| (0..7).map(|j| format!("state.{name}[{j}]")).collect::<Vec<_>>().join(", ");
    let groups = ["q", "q_d", "dq", "dq_d", "tau_J", "tau_ext_hat_filtered"].map(group);
    let mut text = format!("time, success_rate, {}\n", groups.join(","));
    for k in 0..3 {
        let cells = (0..42).map(|cell| format!("{}", f64::from(100 * k + cell) * 0.001));
        text += &format!("{k},1,{}\n", cells.collect::<Vec<_>>().join(","));
    }
    let folder = folder();
    let recording = import_csv(&written(&folder, "log.csv", text), &Mapping::libfranka()).expect("it reads");
    assert_eq!((recording.joints(), recording.len()), (7, 3));
    assert_close(&column(&recording, "t"), &[0.0, 0.001, 0.002]);
    for (name, first) in [("q1", 0.0), ("q_ref1", 0.007), ("qd1", 0.014), ("tau7", 0.034)] {
        assert_close(&column(&recording, name), &[first, first + 0.1, first + 0.2]);
    }
    assert_close(&column(&recording, "state.dq_d[0]"), &[0.021, 0.121, 0.221]);
}

/// CDR, little-endian, as in OMG DDSI-RTPS: every value aligned to its size from the end of the encapsulation.
struct Cdr(Vec<u8>);

impl Cdr {
    fn new() -> Self {
        Cdr(vec![0, 1, 0, 0])
    }

    fn align(mut self, size: usize) -> Self {
        while !(self.0.len() - 4).is_multiple_of(size) {
            self.0.push(0);
        }
        self
    }

    fn u32(self, value: u32) -> Self {
        let mut this = self.align(4);
        this.0.extend(value.to_le_bytes());
        this
    }

    fn f64(self, value: f64) -> Self {
        let mut this = self.align(8);
        this.0.extend(value.to_le_bytes());
        this
    }

    fn string(self, text: &str) -> Self {
        let mut this = self.u32(text.len() as u32 + 1);
        this.0.extend(text.bytes().chain([0]));
        this
    }

    fn numbers(self, values: &[f64]) -> Self {
        values.iter().fold(self.u32(values.len() as u32), |this, value| this.f64(*value))
    }

    fn header(self, ns: u64) -> Self {
        self.u32((ns / 1_000_000_000) as u32).u32((ns % 1_000_000_000) as u32).string("base")
    }
}

fn joint_state(ns: u64, names: &[&str], position: &[f64], velocity: &[f64], effort: &[f64]) -> Vec<u8> {
    let named =
        names.iter().fold(Cdr::new().header(ns).u32(names.len() as u32), |cdr, name| cdr.string(name));
    named.numbers(position).numbers(velocity).numbers(effort).0
}

fn pose(ns: u64, numbers: [f64; 7]) -> Vec<u8> {
    numbers.iter().fold(Cdr::new().header(ns), |cdr, value| cdr.f64(*value)).0
}

/// A bag with these messages: topic, type, log time, bytes.
fn bag(path: &Path, messages: &[(&str, &str, u64, Vec<u8>)]) {
    let mut writer = mcap::Writer::new(fs::File::create(path).expect("created")).expect("a writer");
    let mut channels = BTreeMap::new();
    for (sequence, (topic, kind, log_time, data)) in messages.iter().enumerate() {
        let channel_id = *channels.entry(*topic).or_insert_with(|| {
            let schema = writer.add_schema(kind, "ros2msg", b"").expect("a schema");
            writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("a channel")
        });
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: sequence as u32,
            log_time: *log_time,
            publish_time: *log_time,
        };
        writer.write_to_known_channel(&header, data).expect("written");
    }
    writer.finish().expect("finished");
}

const STATES: &str = "sensor_msgs/msg/JointState";
const POSES: &str = "geometry_msgs/msg/PoseStamped";
const START: u64 = 1_700_000_000_000_000_000;

fn imported(messages: &[(&str, &str, u64, Vec<u8>)], options: &BagOptions) -> Result<Recording, String> {
    let folder = folder();
    let path = folder.path().join("bag.mcap");
    bag(&path, messages);
    import_bag(&path, options).map_err(|error| error.to_string())
}

#[test]
fn joint_states_are_read_by_name_and_poses_come_to_their_times() {
    let order = [["b", "a"], ["a", "b"], ["b", "a"]];
    let mut messages = Vec::new();
    for (k, names) in (0_u64..).zip(order) {
        let of = |name: &str, scale: f64| scale * (k as f64 + if name == "a" { 0.5 } else { 10.5 });
        let values = |scale: f64| names.map(|name| of(name, scale));
        let ns = START + k * 2_000_000;
        messages.push((
            "/joint_states",
            STATES,
            ns,
            joint_state(ns, &names, &values(1.0), &values(-1.0), &values(3.0)),
        ));
        // Another robot part on the same topic.
        messages.push(("/joint_states", STATES, ns, joint_state(ns, &["finger"], &[9.0], &[], &[])));
        let pose_ns = ns + 1_000_000;
        messages.push(("/tool", POSES, pose_ns, pose(pose_ns, [k as f64, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0])));
        messages.push(("/camera", "sensor_msgs/msg/Image", ns, vec![1, 2, 3]));
    }
    let options = BagOptions { joints: vec!["a".into(), "b".into()], ..BagOptions::default() };
    let recording = imported(&messages, &options).expect("it reads");
    println!("{:?}", recording.notes);
    assert_close(&column(&recording, "t"), &[0.0, 0.002, 0.004]);
    assert_close(&column(&recording, "q1"), &[0.5, 1.5, 2.5]);
    assert_close(&column(&recording, "q2"), &[10.5, 11.5, 12.5]);
    assert_close(&column(&recording, "qd2"), &[-10.5, -11.5, -12.5]);
    assert_close(&column(&recording, "tau1"), &[1.5, 4.5, 7.5]);
    // The first joint state is before the first pose.
    let x = column(&recording, "x");
    assert!(x[0].is_nan());
    assert_close(&x[1..], &[0.5, 1.5]);
    let said = recording.notes.join("; ");
    for words in
        ["3 of 6 messages of /joint_states are skipped: they are of other joints", "x…z in 1 of 3 samples"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn what_a_bag_lacks_is_said() {
    let state = |names: &[&str], position: &[f64], velocity: &[f64]| {
        joint_state(START, names, position, velocity, &[])
    };
    let good = state(&["a"], &[1.0], &[]);
    let message = |topic: &'static str, data: &[u8]| (topic, STATES, START, data.to_vec());
    let asked = |joints: &[&str]| BagOptions {
        joints: joints.iter().map(|name| (*name).to_owned()).collect(),
        ..BagOptions::default()
    };
    let cases = [
        (
            vec![("/camera", "sensor_msgs/msg/Image", START, vec![0])],
            asked(&[]),
            "no topic of type sensor_msgs/msg/JointState; found: /camera (sensor_msgs/msg/Image)",
        ),
        (
            vec![message("/a", &good), message("/b", &good)],
            asked(&[]),
            "several topics of type sensor_msgs/msg/JointState: /a, /b; choose one with --topic",
        ),
        (
            vec![message("/a", &good[..20])],
            asked(&[]),
            "bag.mcap, message 1: topic /a: the message can't be decoded",
        ),
        (vec![message("/a", &[0, 7, 0, 0])], asked(&[]), "begins with [00, 07, 00, 00]; it must be CDR"),
        (
            vec![message("/a", &state(&["a", "b"], &[1.0], &[]))],
            asked(&[]),
            "message 1: topic /a: no message has a position for each of its names",
        ),
        (
            vec![message("/a", &state(&["a", "b"], &[1.0, 2.0], &[]))],
            asked(&["a", "c"]),
            "no joint \"c\"; it has a, b",
        ),
        (vec![message("/a", &good), message("/a", &good)], asked(&[]), "message 2: column t"),
    ];
    for (messages, options, said) in cases {
        let error = imported(&messages, &options).expect_err(said);
        println!("{error}");
        assert!(error.contains(said), "{error}");
    }
    let folder = folder();
    let error =
        import_bag(&written(&folder, "x.mcap", "t,q1\n"), &BagOptions::default()).expect_err("no MCAP");
    assert!(error.to_string().contains("no ROS bag: neither MCAP, SQLite nor ROS 1"), "{error}");
}

/// A message that claims greater lengths than it has must not make the reader allocate memory.
#[test]
fn lengths_that_lie_are_refused() {
    let mut lying = Cdr::new().header(START).u32(u32::MAX).0;
    lying.extend([0; 64]);
    let error = imported(&[("/a", STATES, START, lying)], &BagOptions::default()).expect_err("a lie");
    assert!(error.contains("can't be decoded"), "{error}");
}

/// The reading time is proportional to the number of columns: with a search per column, so many would take a quarter of an hour.
#[test]
fn twenty_thousand_columns_are_read_in_seconds() {
    const COLUMNS: usize = 20_000;
    let names = (1..=COLUMNS).map(|joint| format!("q{joint}"));
    let header: Vec<String> = std::iter::once("t".to_owned()).chain(names).collect();
    let row = |t: f64| format!("{t}{}\n", ",0.25".repeat(COLUMNS));
    let text = format!("{}\n{}{}", header.join(","), row(0.0), row(0.1));
    let folder = folder();
    let file = written(&folder, "wide.csv", text);
    let begun = std::time::Instant::now();
    let recording = freeplay_recording::read(&file, None).expect("a recording");
    let columns = recording.columns();
    let found = columns.iter().filter(|name| recording.column(name).is_some()).count();
    println!("{} joints, {found} columns in {:.2} s", recording.joints(), begun.elapsed().as_secs_f64());
    assert_eq!((recording.joints(), found), (COLUMNS, COLUMNS + 1));
    assert!(begun.elapsed().as_secs() < 60);
}

/// One flipped bit in a bag costs the messages of its chunk, wherever the channels were described.
#[test]
fn a_damaged_chunk_of_a_bag_costs_its_messages_alone() {
    const MESSAGES: u64 = 40_000;
    let state = |k: u64| joint_state(START + k * 1_000_000, &["a"], &[(k as f64).sin()], &[], &[]);
    let messages: Vec<_> =
        (0..MESSAGES).map(|k| ("/joint_states", STATES, START + k * 1_000_000, state(k))).collect();
    let folder = folder();
    let path = folder.path().join("bag.mcap");
    bag(&path, &messages);
    let bytes = fs::read(&path).expect("read");
    // In the chunk that describes the channels, and at other places: in a chunk or in the index of one.
    for at in [1_000, bytes.len() / 3, bytes.len() / 2] {
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        fs::write(&path, damaged).expect("written");
        for recording in [import_bag(&path, &BagOptions::default()), freeplay_recording::read(&path, None)] {
            let recording = recording.unwrap_or_else(|error| panic!("{at}: {error}"));
            println!("{at}: {} of {MESSAGES}, {:?}", recording.len(), recording.notes);
            let is_told = recording.notes.iter().any(|note| note.contains("the bag is damaged at byte"));
            assert_eq!(is_told, recording.len() < MESSAGES as usize);
            assert!(recording.len() > MESSAGES as usize / 4 && (is_told || at != 1_000));
        }
    }
}
