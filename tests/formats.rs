//! Recordings of every kind, from their import to the results of `compare` and `diagnose`.

use std::fmt::Write as _;
use std::process::Command;

use crate::common::{Call, FREEPLAY, Ran, freeplay_in, fresh_folder};
use freeplay_arm::{Arm, Workspace, rnea};
use serde_json::Value;
use tempfile::TempDir;

/// Two joints one after the other in a vertical plane; the first has friction.
const ARM: &str = r#"<robot name="two"><link name="base"/>
  <joint name="shoulder_joint" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="200" velocity="3"/><dynamics damping="2" friction="6"/></joint>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="elbow_joint" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="200" velocity="3"/></joint>
  <link name="fore"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;

const ROWS: usize = 2000;
const STEP: f64 = 0.005;

/// Position, speed and acceleration of joint `joint` at time `t`, s.
fn motion(joint: usize, t: f64) -> [f64; 3] {
    let (amplitude, speed) = [(0.8, 1.3), (1.1, 2.1)][joint];
    let (sin, cos) = (speed * t).sin_cos();
    [amplitude * sin, amplitude * speed * cos, -amplitude * speed * speed * sin]
}

/// Time, positions and torques of `arm` with its own friction, plus 3 N·m of dry friction at the elbow, of every row.
fn samples(arm: &Arm) -> Vec<[f64; 5]> {
    let mut workspace = Workspace::new(arm);
    let sample = |row: usize| {
        let t = row as f64 * STEP;
        let of = |k: usize| [0, 1].map(|joint| motion(joint, t)[k]);
        let (q, v, mut tau) = (of(0), of(1), [0.0; 2]);
        rnea(arm, &mut workspace, &q, &v, &of(2), &mut tau);
        // Repeatable noise like that of an encoder and a current sensor.
        let noise = |k: usize| 2.0 * ((k as f64 * 12.9898).sin() * 43_758.545_3).fract().abs() - 1.0;
        let shoulder = tau[0] + 2.0 * v[0] + 6.0 * v[0].signum() + 0.05 * noise(row);
        let elbow = tau[1] + 3.0 * v[1].signum() + 0.05 * noise(row + 7);
        [t, q[0] + 1e-6 * noise(row + 3), q[1] + 1e-6 * noise(row + 5), shoulder, elbow]
    };
    (0..ROWS).map(sample).collect()
}

/// A folder with `arm.urdf` and, in `log.csv`, `header` and the text of `write` for each row.
fn with_log(header: &str, write: impl Fn(&[f64; 5]) -> String) -> TempDir {
    let folder = fresh_folder();
    let urdf = folder.path().join("arm.urdf");
    std::fs::write(&urdf, ARM).expect("written");
    let arm = freeplay_model::load(&urdf).expect("an arm").arm;
    let mut text = format!("{header}\n");
    for row in samples(&arm) {
        let _ = writeln!(text, "{}", write(&row));
    }
    std::fs::write(folder.path().join("log.csv"), text).expect("written");
    folder
}

/// The elbow comes first, as some drivers publish it.
const NAMED: &str = "stamp;elbow_joint_pos;shoulder_joint_pos;elbow_joint_effort;shoulder_joint_effort";

fn elbow_first(row: &[f64; 5]) -> String {
    let [t, shoulder, elbow, of_shoulder, of_elbow] = row;
    [t, elbow, shoulder, of_elbow, of_shoulder].map(|x| format!("{x}").replace('.', ",")).join(";")
}

/// Errors of the torques of shoulder and elbow, N·m, the JSON, and the call.
fn compared(folder: TempDir, recording: &str) -> ([f64; 2], Value, Ran) {
    let ran = freeplay_in(
        folder,
        &["compare", "--model", "arm.urdf", "--recording", recording, "--format", "json"],
    )
    .expect(0);
    let value: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    let of = |name: &str| {
        let channels = value["channels"].as_array().expect("channels");
        channels
            .iter()
            .find(|channel| channel["joint"] == name)
            .and_then(|c| c["rmse"].as_f64())
            .expect("an error")
    };
    let errors = [of("shoulder_joint"), of("elbow_joint")];
    println!("{recording}: {errors:.4?}");
    (errors, value, ran)
}

/// True if the shoulder agrees with its model and the elbow has 3 N·m more.
fn is_right([shoulder, elbow]: [f64; 2]) -> bool {
    shoulder < 0.5 && (elbow - 3.0).abs() < 0.5
}

#[test]
fn joints_are_paired_by_name_from_any_form_to_any_other() {
    let folder = with_log(NAMED, elbow_first);
    let (errors, value, ran) = compared(folder, "log.csv");
    assert!(is_right(errors), "{errors:?}");
    let said = value["notes"].to_string();
    assert!(
        said.contains("paired by name: q1…q2 are shoulder, elbow") && said.contains("columns by their names"),
        "{said}"
    );
    let mut ran = ran;
    for out in ["r.csv", "r.mcap", "r.parquet"] {
        let imported = freeplay_in(ran.folder, &["record", "import", "log.csv", "--out", out]).expect(0);
        let mapping = imported.folder.path().join("r.mapping.toml");
        let text = std::fs::read_to_string(&mapping).expect("the mapping is written");
        assert!(text.contains("elbow_joint_pos") && imported.stdout().contains(&text), "{}", imported.dump());
        std::fs::remove_file(mapping).expect("removed");
        let (errors, _, compared) = compared(imported.folder, out);
        assert!(is_right(errors), "{out}: {errors:?}");
        ran = compared;
    }
    // The joints in the requested order, by parts of their names; a CSV keeps the names.
    let asked = ["record", "import", "log.csv", "--joints", "shoulder,elbow", "--out", "s.csv"];
    let ran = freeplay_in(ran.folder, &asked).expect(0);
    let info = freeplay_in(ran.folder, &["record", "info", "s.csv"]).expect(0).stdout();
    assert!(info.contains("joints q1…q2: shoulder, elbow") && info.lines().count() < 24, "{info}");
}

#[test]
fn info_reads_a_file_by_its_mapping_and_asks_of_its_model() {
    let folder = with_log(NAMED, elbow_first);
    let ran = freeplay_in(folder, &["record", "import", "log.csv", "--out", "r.csv"]).expect(0);
    let asked = ["record", "info", "log.csv", "--mapping", "r.mapping.toml", "--model", "arm.urdf"];
    let ran = freeplay_in(ran.folder, &[asked.as_slice(), &["--format", "json"]].concat()).expect(0);
    let value: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    assert!(value["joints"] == 2 && value["setup"].is_array(), "{value:#}");
    // A mapping with names of missing columns is bad input.
    let mapping = ran.folder.path().join("r.mapping.toml");
    let text = std::fs::read_to_string(&mapping).expect("a mapping").replace("elbow_joint_pos", "wrist_pos");
    std::fs::write(mapping, text).expect("written");
    let ran = freeplay_in(ran.folder, &asked).expect(3);
    assert!(ran.stderr().contains("wrist_pos"), "{}", ran.dump());
}

#[test]
fn joints_without_names_are_paired_by_number_and_that_is_said() {
    let folder = with_log("t,q1,q2,tau1,tau2", |row| row.map(|x| format!("{x}")).join(","));
    let (errors, value, ran) = compared(folder, "log.csv");
    assert!(is_right(errors), "{errors:?}");
    assert!(value["notes"].to_string().contains("paired by number: the recording has no names"), "{value:#}");
    // Half of the names are not the arm's, so that no pairing would be right.
    std::fs::write(ran.folder.path().join("log.csv"), "t,elbow_joint_pos,hip_joint_pos\n0,0,0\n0.01,0,0\n")
        .expect("written");
    let ran =
        freeplay_in(ran.folder, &["compare", "--model", "arm.urdf", "--recording", "log.csv"]).expect(3);
    for words in ["log.csv: no joint named shoulder_joint", "it has elbow, hip", "--joints"] {
        assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
    }
}

#[test]
fn a_joint_without_torque_is_left_out_and_the_rest_is_compared() {
    let folder = with_log("t,q1,q2,tau1,tau2", |row| format!("{},{},{},{},", row[0], row[1], row[2], row[3]));
    let ran = freeplay_in(folder, &["compare", "--model", "arm.urdf", "--recording", "log.csv"]).expect(0);
    let said = ran.stdout();
    assert!(said.contains("missing values, which are not used: tau2 throughout"), "{said}");
    assert!(said.contains("tau1") && !said.contains("tau2     "), "{said}");
}

/// The import refuses columns that it cannot guess, lists the existing ones, and writes nothing.
#[test]
fn what_is_not_understood_is_said() {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("log.csv"), "a,b,c\n0,1,2\n1,2,3\n").expect("written");
    let ran = freeplay_in(folder, &["record", "import", "log.csv", "--out", "r.mcap"]).expect(3);
    assert!(
        ran.stderr().contains("column t is missing") && ran.stderr().contains("found: a, b, c"),
        "{}",
        ran.dump()
    );
    assert!(
        ["r.mcap", "r.mapping.toml"].iter().all(|name| !ran.folder.path().join(name).exists()),
        "nothing is written"
    );
}

fn python() -> Command {
    Command::new(std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned()))
}

/// Writes the content of `log.csv` in other forms.
const WRITER: &str = r#"
import numpy, pandas, scipy.io
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
names = ["elbow_joint", "shoulder_joint"]
table = pandas.read_csv("log.csv", sep=";", decimal=",").to_numpy()
t, q, tau = table[:, 0], table[:, 1:3], table[:, 3:5]
numpy.savez_compressed("r.npz", t=t, q=q, tau=tau, joint_names=numpy.array(names))
scipy.io.savemat("r.mat", {"t": t, "q": q, "tau": tau, "names": numpy.array(names, dtype=object)}, do_compression=True)
index = pandas.to_datetime("2024-11-20") + pandas.to_timedelta(t, unit="s")
columns = [f"{name}_{what}" for what in ["pos", "torque"] for name in names]
frame = pandas.DataFrame(table[:, 1:], columns=columns, index=index)
frame.to_csv("dated.csv")
frame.reset_index(names="time").to_csv("indexed.csv")
frame.to_parquet("dated.parquet")
store = get_typestore(Stores.ROS2_HUMBLE)
types = store.types
for plugin in [StoragePlugin.SQLITE3, StoragePlugin.MCAP]:
    with Writer(f"bag_{plugin.name.lower()}", version=9, storage_plugin=plugin) as writer:
        topic = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        for k in range(len(t)):
            ns = 1_700_000_000_000_000_000 + round(t[k] * 1e9)
            stamp = types["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
            header = types["std_msgs/msg/Header"](stamp, "base")
            none = numpy.full(2, numpy.nan)
            message = types["sensor_msgs/msg/JointState"](header, names, q[k].copy(), none, tau[k].copy())
            writer.write(topic, ns, store.serialize_cdr(message, message.__msgtype__))
from rosbags.rosbag1 import Writer as Writer1
store = get_typestore(Stores.ROS1_NOETIC)
types = store.types
with Writer1("ros1.bag") as writer:
    topic = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
    for k in range(len(t)):
        ns = 1_700_000_000_000_000_000 + round(t[k] * 1e9)
        stamp = types["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
        header = types["std_msgs/msg/Header"](k, stamp, "base")
        message = types["sensor_msgs/msg/JointState"](header, names, q[k].copy(), numpy.empty(0), tau[k].copy())
        writer.write(topic, ns, store.serialize_ros1(message, message.__msgtype__))
import json, pathlib
root = pathlib.Path("lerobot")
(root / "meta").mkdir(parents=True)
(root / "data/chunk-000").mkdir(parents=True)
features = {
    "observation.state": {"dtype": "float32", "shape": [2], "names": {"motors": [f"{name}.pos" for name in names]}},
    "observation.effort": {"dtype": "float32", "shape": [2], "names": {"motors": [f"{name}.effort" for name in names]}},
    "timestamp": {"dtype": "float32", "shape": [1], "names": None},
}
(root / "meta/info.json").write_text(json.dumps({"codebase_version": "v2.1", "fps": 200, "total_episodes": 1, "features": features}))
episode = pandas.DataFrame({"observation.state": list(q), "observation.effort": list(tau), "timestamp": t, "episode_index": 0, "frame_index": range(len(t))})
episode.to_parquet(root / "data/chunk-000/episode_000000.parquet")
"#;

#[test]
fn what_other_packages_write_is_compared_and_diagnosed() {
    let script = "import numpy, pandas, pyarrow, rosbags.rosbag2, scipy.io";
    if !python().args(["-c", script]).output().is_ok_and(|output| output.status.success()) {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            "no Python with numpy, pandas, pyarrow, rosbags and scipy; FREEPLAY_PYTHON names one",
        );
        return;
    }
    let mut folder = with_log(NAMED, elbow_first);
    let written = python().args(["-c", WRITER]).current_dir(folder.path()).output().expect("it starts");
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    let all = [
        "r.npz",
        "r.mat",
        "dated.csv",
        "indexed.csv",
        "dated.parquet",
        "bag_sqlite3",
        "bag_mcap",
        "ros1.bag",
        "lerobot",
    ];
    for recording in all {
        let (errors, _, ran) = compared(folder, recording);
        assert!(is_right(errors), "{recording}: {errors:?}");
        folder = ran.folder;
        let arguments = ["diagnose", "--model", "arm.urdf", "--recording", recording, "--format", "json"];
        let ran = freeplay_in(folder, &arguments).expect(0);
        let value: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
        assert_eq!(value["effects"][0]["joint"], "elbow_joint", "{recording}: {}", ran.dump());
        assert!(
            value["effects"][0]["kind"].as_str().is_some_and(|kind| kind.contains("friction")),
            "{}",
            ran.dump()
        );
        assert_eq!(value["setup"], serde_json::json!([]), "{recording}: {}", ran.dump());
        folder = ran.folder;
    }
}

/// A Parquet file of a time and a joint, three samples each, whose second page claims a decompressed size of 2 GiB.
const LARGE_PAGE: &str = concat!(
    "504152311500153015302c1506150015061506000000000000000000009a9999999999b93f9a9999999999c93f150015feffffff0f15302c15061500",
    "1506150600000000000000000000000000000000e03f9a9999999999b93f1502193c3500180173150400150a250018017400150a2500180271310016",
    "06191c192c26081c150a19150019180174150016061652165226080000265a1c150a191500191802713115021606165a165a265a0000160016060000",
    "5a00000050415231",
);

/// A claimed size takes no memory: the error under a memory limit is the same as without.
#[test]
fn a_recording_that_claims_more_than_it_holds_is_bad_input() {
    let folder = fresh_folder();
    let byte = |at: usize| u8::from_str_radix(&LARGE_PAGE[at..at + 2], 16).expect("a byte");
    let page: Vec<u8> = (0..LARGE_PAGE.len()).step_by(2).map(byte).collect();
    std::fs::write(folder.path().join("page.parquet"), page).expect("written");
    let topics = "CREATE TABLE topics (id INTEGER, name TEXT, type TEXT);
        INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState');";
    let endless = "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
        SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(100) AS data FROM n;";
    let large = "CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB AS (zeroblob(900000000)));
        INSERT INTO messages VALUES (1, 1, 0), (2, 1, 1), (3, 1, 2);";
    for (name, messages) in [("endless.db3", endless), ("large.db3", large)] {
        let database = rusqlite::Connection::open(folder.path().join(name)).expect("a database");
        database.execute_batch(&format!("{topics}{messages}")).expect("statements");
    }
    let mut folder = folder;
    for (name, said) in [
        ("page.parquet", "a page of 2147483647 bytes in a file of"),
        ("endless.db3", "messages is no table of stored rows"),
        ("large.db3", "messages is no table of stored rows"),
    ] {
        let mut command = Command::new("sh");
        let limited = "ulimit -v 1000000; exec \"$0\" record import \"$1\" --out r.csv";
        command.args(["-c", limited, FREEPLAY, name]);
        let ran = Call::of(folder, command).run().expect(3);
        assert!(ran.stderr().contains(said) && ran.stderr().contains(name), "{}", ran.dump());
        assert!(!ran.folder.path().join("r.csv").exists(), "{name}: nothing is written");
        folder = ran.folder;
    }
}
