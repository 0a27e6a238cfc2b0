//! `freeplay run` in lockstep, end to end: two processes, shared memory, recording, summary, report.

use std::fmt::Write as _;

use crate::common::{Call, freeplay, freeplay_in, fresh_folder, lockstep};
use serde_json::Value;

fn run_of<'a>(summary: &'a Value, controller: &str) -> &'a Value {
    let runs = summary["runs"].as_array().expect("runs");
    runs.iter().find(|run| run["controller"] == controller).expect("the controller's run")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn the_default_scenario_runs_every_built_in_controller() {
    let ran = lockstep(1.0, &[]).expect(0);
    let summary = ran.summary();
    assert_eq!(summary["schema"], "freeplay.summary/1");
    for controller in ["computed-torque", "quasi-static", "narx-qp"] {
        let run = run_of(&summary, controller);
        assert_eq!(run["ticks"], 1000);
        assert_eq!(run["ending"], "finished");
        assert_eq!(run["deadlines"]["missed"], 0);
        let joint = &run["contact"]["joints"]["joint_5"];
        let total: f64 = ["free", "impact", "continuous"].iter().map(|key| number(&joint[*key])).sum();
        assert!((total - 1.0).abs() < 1e-9, "fractions add up to {total}");
        assert_eq!(run["answers"]["ok"], 1000, "{}", run["answers"]);
        for name in (1..=6).map(|number| format!("joint_{number}")) {
            let used = &run["joint_use"][&name];
            let share = number(&used["torque"]["share"]);
            let peak = number(&used["torque"]["peak_after_start"]);
            assert!(peak > 0.0 && share <= 1.0 && number(&used["speed"]["share"]) < 1.0, "{name}: {used}");
            assert!((share - peak / number(&used["torque"]["limit"])).abs() < 1e-12, "{name}: {used}");
        }
        assert!(
            ran.stdout().contains(&format!("{controller}: share of the limits used after 0.5 s: speed")),
            "{}",
            ran.dump()
        );
        for file in [format!("{controller}.mcap"), format!("{controller}.hlog"), format!("{controller}.hgrm")]
        {
            assert!(ran.out().join(&file).metadata().expect("written").len() > 100, "{file}");
        }
    }
    let plain = number(&run_of(&summary, "computed-torque")["deviation_mm"]["rms_after_start"]);
    let compensated = number(&run_of(&summary, "quasi-static")["deviation_mm"]["rms_after_start"]);
    println!("after 0.5 s: {plain:.4} mm uncompensated, {compensated:.4} mm with quasi-static compensation");
    assert!((plain - 0.6).abs() < 0.01, "the offset is the clearance: {plain}");
    assert!(compensated < 0.05 * plain, "the compensation removes more than 95 %: {compensated}");
    let report = std::fs::read_to_string(ran.out().join("report.html")).expect("a report");
    assert!(report.contains("quasi-static") && report.len() < 5_000_000, "{} bytes", report.len());
}

/// Without weight no bearing is loaded before a corner, so that the controller cannot plan a passage: every answer in a corner reports this.
#[test]
fn what_a_programme_could_not_solve_is_counted_and_said() {
    let set = ["--set", "path.kind=square_sharp", "--set", "path.period=4", "--set", "gravity=[0,0,0]"];
    let ran = lockstep(0.9, &[["--controller", "narx-qp"].as_slice(), &set].concat()).expect(0);
    let run = &ran.summary()["runs"][0];
    let [ok, failed] = ["ok", "qp_failed"].map(|key| run["answers"][key].as_u64().expect("a count"));
    println!("answers: {}", run["answers"]);
    assert!(failed > 0 && ok > 0 && ok + failed == 900, "{}", run["answers"]);
    let said = format!("narx-qp: answers whose quadratic programme had no solution: {failed}");
    assert!(ran.stdout().contains(&said), "{}", ran.dump());
}

#[test]
fn two_lockstep_runs_are_the_same_to_the_byte_whoever_starts_first() {
    let hash = |arguments: &[&str]| {
        let mut all = vec!["--controller", "quasi-static", "--recording", "none"];
        all.extend(arguments);
        let summary = lockstep(0.3, &all).expect(0).summary();
        summary["runs"][0]["state_hash"].as_str().expect("a hash").to_owned()
    };
    let first = hash(&[]);
    assert_eq!(first.len(), 64);
    assert_eq!(first, hash(&[]), "again");
    assert_eq!(first, hash(&["--controller-delay", "0.7"]), "controller after the plant");
    assert_eq!(first, hash(&["--controller-delay=-0.7"]), "controller before the plant");
    assert_ne!(first, hash(&["--set", "clearance.joint_5.clearance=0.0005"]), "the hash tells runs apart");
}

#[test]
fn noise_repeats_with_its_seed() {
    let hash = |seed: &str| {
        let noisy =
            ["--controller", "computed-torque", "--set", "sensors.position.noise=1e-6", "--seed", seed];
        lockstep(0.1, &noisy).expect(0).summary()["runs"][0]["state_hash"].clone()
    };
    assert_eq!(hash("5"), hash("5"));
    assert_ne!(hash("5"), hash("6"));
}

#[test]
fn driven_joints_follow_the_reference_and_the_deviation_is_the_journal() {
    let ran = lockstep(0.7, &["--set", "mode=driven", "--controller", "computed-torque"]).expect(0);
    let summary = ran.summary();
    let run = &summary["runs"][0];
    // The driven arm at c = 0.6 mm, T = 6 s: the first drop gives 1692 N and 2923 N at joint 1 in the reference.
    let peak = number(&run["contact"]["joints"]["joint_5"]["peak_normal_force_N"]);
    let base = number(&run["base_force_N"]["peak"]);
    println!("peak normal force {peak:.1} N, joint 1 {base:.1} N");
    assert!((peak / 1692.0 - 1.0).abs() < 0.02 && (base / 2923.0 - 1.0).abs() < 0.02);
    let rms = number(&run["deviation_mm"]["rms_after_start"]);
    assert!((rms - 0.6).abs() < 0.006, "{rms}");
}

/// A run that ends within the first 0.5 s reports no deviation after the start: a 0 would look like a perfect result.
#[test]
fn a_short_run_has_no_deviation_after_the_start() {
    let ran = lockstep(0.3, &["--controller", "computed-torque"]).expect(0);
    let deviation = &ran.summary()["runs"][0]["deviation_mm"];
    assert!(deviation["rms_after_start"].is_null() && deviation["max_after_start"].is_null(), "{deviation}");
    assert!(number(&deviation["rms"]) > 0.0);
    let text = ran.stdout();
    let row = text.lines().find(|line| line.trim_start().starts_with("computed-torque")).expect("a row");
    assert!(row.split_whitespace().skip(1).take(3).all(|cell| cell == "–"), "{row}");
    assert!(!text.contains("share of the limits"), "{text}");
}

/// A motion of the tool in addition to that of the joints is no error of the tracker: a journal that has sunk by 0.5 mm in oil adds that much to the tool's deviation,
/// and a controller with a tracker compensates it.
#[test]
fn a_journal_in_oil_moves_the_tool() {
    let folder = fresh_folder();
    let film = "\n[[effect]]\nkind = \"lubricated_clearance\"\njoint = \"joint_2\"\nclearance = 5e-4\nviscosity = 0.5\n";
    let arm = std::fs::canonicalize(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/arm.urdf"))
        .expect("the arm");
    std::fs::write(folder.path().join("film.toml"), format!("urdf = {arm:?}\n{film}")).expect("written");
    let arguments = ["run", "--model", "film.toml", "--set", "path.period=6", "--set", "duration=3"];
    let rest = ["--quiet", "--out", "out", "--controller", "computed-torque", "--controller", "narx-qp"];
    let summary = freeplay_in(folder, &[arguments.as_slice(), &rest].concat()).expect(0).summary();
    let rms = |controller| number(&run_of(&summary, controller)["deviation_mm"]["rms_after_start"]);
    let (plain, tracked) = (rms("computed-torque"), rms("narx-qp"));
    println!("{plain:.4} mm, 0.5 mm of clearance; {tracked:.4} mm with the tracker");
    assert!((plain - 0.5).abs() < 0.01 && tracked < 0.1 * plain);
}

#[test]
fn a_recording_reads_back_as_csv_and_as_mcap() {
    for kind in ["csv", "mcap"] {
        let ran = lockstep(0.1, &["--controller", "computed-torque", "--recording", kind]).expect(0);
        let recording = freeplay_recording::read(&ran.out().join(format!("computed-torque.{kind}")), Some(6))
            .expect("it reads");
        assert_eq!((recording.len(), recording.joints()), (100, 6));
        assert!(recording.column("joint_5_play_2").is_some() && !recording.truncated);
    }
}

#[test]
fn an_arm_of_ones_own_runs_without_the_papers_play() {
    let folder = tempfile::tempdir().expect("a folder");
    let urdf = r#"<robot name="two"><link name="base"/>
      <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
        <limit lower="-2" upper="2" effort="200" velocity="3"/><dynamics damping="0.5" friction="0.2"/></joint>
      <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
        <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
        <limit lower="-2" upper="2" effort="100" velocity="3"/></joint>
      <link name="fore"><inertial><origin xyz="0.15 0 0"/><mass value="2"/>
        <inertia ixx="0.005" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;
    std::fs::write(folder.path().join("two.urdf"), urdf).expect("written");
    let scenario = "model = \"two.urdf\"\nmode = \"driven\"\npace = \"lockstep\"\ncontrollers = [\"computed-torque\", \"quasi-static\"]\n\
                    [path]\nkind = \"joint_sine\"\nperiod = 2\n[clearance.elbow]\nclearance = 0.0004\n";
    std::fs::write(folder.path().join("two.toml"), scenario).expect("written");
    let ran = freeplay_in(folder, &["run", "two.toml", "--quiet", "--out", "out"]).expect(0);
    let summary = ran.summary();
    let plain = number(&run_of(&summary, "computed-torque")["deviation_mm"]["rms_after_start"]);
    let compensated = number(&run_of(&summary, "quasi-static")["deviation_mm"]["rms_after_start"]);
    println!("two joints: {plain:.4} mm, compensated {compensated:.4} mm");
    assert!(plain > 0.2 && compensated < plain, "the play shows: {plain}, {compensated}");
}

#[test]
fn the_effective_scenario_reads_back_as_itself() {
    let shown = freeplay(&[
        "run",
        "--show",
        "--set",
        "path.period=12",
        "--set",
        "clearance.joint_4.clearance=0.0002",
    ])
    .expect(0);
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("s.toml"), &shown.output.stdout).expect("written");
    let again = freeplay_in(folder, &["run", "s.toml", "--show"]).expect(0);
    assert_eq!(shown.stdout(), again.stdout());
    assert!(shown.stdout().contains("period = 12.0") && shown.stdout().contains("[clearance.joint_4]"));
}

#[test]
fn replaying_a_recording_gives_the_same_commands_byte_for_byte() {
    for (mode, controller) in
        [("torque", "computed-torque"), ("torque", "quasi-static"), ("driven", "quasi-static")]
    {
        let mode = format!("mode={mode}");
        let ran = lockstep(0.4, &["--controller", controller, "--set", &mode]).expect(0);
        let recording = ran.out().join(format!("{controller}.mcap"));
        let recording = recording.to_str().expect("UTF-8");
        let replayed =
            freeplay(&["replay", recording, "--against", controller, "--format", "json"]).expect(0);
        let difference: Value = serde_json::from_str(&replayed.stdout()).expect("JSON");
        println!("{mode}, {controller}: {} of {}", difference["identical_ticks"], difference["ticks"]);
        assert_eq!((&difference["ticks"], &difference["identical_ticks"]), (&400.into(), &400.into()));
        let other = if controller == "quasi-static" { "computed-torque" } else { "quasi-static" };
        let replayed = freeplay(&["replay", recording, "--against", other, "--format", "json"]).expect(0);
        let difference: Value = serde_json::from_str(&replayed.stdout()).expect("JSON");
        assert_ne!(difference["identical_ticks"], 400, "another controller commands otherwise");
    }
}

/// A light arm of four joints in a row.
fn light_arm() -> String {
    let mut urdf = String::from("<robot name=\"light\"><link name=\"base\"/>");
    let joints = [
        ("pan", "0 0 1", 0.12, 3.2),
        ("lift", "0 1 0", 0.1, 2.4),
        ("elbow", "0 1 0", 0.3, 1.6),
        ("wrist", "0 1 0", 0.27, 0.7),
    ];
    let mut parent = "base".to_owned();
    for (name, axis, from, mass) in joints {
        let _ = write!(
            urdf,
            r#"<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}_link"/><origin xyz="0 0 {from}"/>
            <axis xyz="{axis}"/><limit lower="-2.4" upper="2.4" effort="90" velocity="2.5"/></joint>
            <link name="{name}_link"><inertial><origin xyz="0 0 0.1"/><mass value="{mass}"/>
            <inertia ixx="0.01" iyy="0.01" izz="0.003" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
        );
        parent = format!("{name}_link");
    }
    urdf + "</robot>"
}

#[test]
fn a_journal_that_does_not_come_to_rest_is_told_with_what_may_be_tried() {
    let folder = fresh_folder();
    std::fs::write(folder.path().join("light.urdf"), light_arm()).expect("written");
    let sets = [
        "path.kind=joint_sine",
        "path.start=[0.2,0.4,0.6,0.5]",
        "clearance.elbow.clearance=0.0004",
        "controller.gains.natural_frequency=20",
    ];
    let fixed =
        ["run", "--quiet", "--controller", "computed-torque", "--set", "duration=1.2", "--out", "out"];
    let mut arguments: Vec<&str> = fixed.into_iter().chain(["--model", "light.urdf"]).collect();
    arguments.extend(sets.iter().flat_map(|set| ["--set", set]));
    let ran = Call::new(folder, &arguments).run().expect(0);
    println!("{}", ran.stdout());
    for words in [
        "the journal of elbow is in free flight for",
        "try another controller.gains.natural_frequency (now 20)",
    ] {
        assert!(ran.stdout().contains(words), "{words}: {}", ran.dump());
    }
    // The paper's arm comes to rest.
    let rested = Call::new(fresh_folder(), &fixed).run().expect(0);
    assert!(!rested.stdout().contains("is in free flight for"), "{}", rested.dump());
}
