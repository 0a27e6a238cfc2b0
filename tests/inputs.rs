//! Effect of bad input on a call of the real binary: it runs nothing and writes nothing, one message names the place, the value and the remedy, and the exit
//! code is the documented one.

use std::fmt::Write as _;
use std::process::Command;

use crate::common::jargon::JARGON;
use crate::common::{Call, FREEPLAY, Ran, fresh_folder};

/// Files of a case: name and contents.
type Files<'a> = &'a [(&'a str, &'a str)];

/// A case: its name, its files, the arguments after those shared by all cases of a table, the exit code, and the required words of the message.
type Case<'a> = (&'a str, Files<'a>, &'a [&'a str], i32, &'a [&'a str]);

/// An arm with a revolute and a prismatic joint; all cases have it as `two.urdf`.
const TWO: &str = r#"<robot name="two"><link name="base"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="200" velocity="3"/></joint>
  <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="fore"/><axis xyz="1 0 0"/>
    <limit lower="-2" upper="2" effort="200" velocity="3"/></joint>
  <link name="fore"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;

/// Plays `cases` after the arguments `shared`.
fn play(shared: &[&str], cases: &[Case]) {
    for &(name, files, arguments, code, said) in cases {
        let folder = fresh_folder();
        for (file, contents) in [("two.urdf", TWO)].iter().chain(files) {
            std::fs::write(folder.path().join(file), contents).expect("written");
        }
        let all: Vec<&str> = shared.iter().chain(arguments).copied().collect();
        let ran = Call::new(folder, &all).run().expect(code);
        let stderr = ran.stderr();
        println!("{code}  {name}: {}", stderr.lines().next().unwrap_or_default());
        for words in said {
            assert!(stderr.contains(words), "{name}: {words:?} is not said: {}", ran.dump());
        }
        // clap writes its own messages about the command line.
        assert!(stderr.starts_with("freeplay: ") || code == 2, "{name}: {}", ran.dump());
        assert!(!stderr.contains("panicked") && stderr.len() < 1500, "{name}: {}", ran.dump());
        assert!(ran.stdout().is_empty() && !ran.out().exists(), "{name} left something: {}", ran.dump());
    }
}

/// A run of the paper's arm.
const RUN: [&str; 9] = [
    "run",
    "--pace",
    "lockstep",
    "--quiet",
    "--out",
    "out",
    "--controller=computed-torque",
    "--set",
    "duration=0.05",
];

/// A run of a custom arm in joint space.
fn run_of(model: &str) -> Vec<&str> {
    [&RUN, ["--set", "path.kind=joint_sine", "--set", "path.period=2", "--model", model].as_slice()].concat()
}

#[test]
fn bad_arm_files() {
    let negative = TWO.replacen("value=\"3\"", "value=\"-3\"", 1);
    let tree = TWO.replace("child link=\"fore\"", "child link=\"upper\"");
    let thirteen = chain_of(13);
    let long = format!("<robot name=\"long\"><!-- {} --></robot>", "x".repeat(5 << 20));
    let deep = "<a>".repeat(100_000);
    let cases: [Case; 10] = [
        ("empty", &[("a.urdf", "")], &["--model", "a.urdf"], 3, &["a.urdf: the file is empty", "URDF"]),
        (
            "broken",
            &[("a.urdf", "<robot name=\"a\">\n<link")],
            &["--model", "a.urdf"],
            3,
            &["a.urdf:", "XML"],
        ),
        ("huge", &[("a.urdf", &long)], &["--model", "a.urdf"], 3, &["a.urdf", "4 MiB"]),
        ("nested", &[("a.urdf", &deep)], &["--model", "a.urdf"], 3, &["a.urdf:", "XML"]),
        (
            "mass",
            &[("a.urdf", &negative)],
            &["--model", "a.urdf"],
            3,
            &["a.urdf:4:", "`upper`", "-3", "must not be"],
        ),
        ("tree", &[("a.urdf", &tree)], &["--model", "a.urdf"], 3, &["a.urdf:", "`upper`", "remove one"]),
        ("missing", &[], &["--model", "a.urdf"], 3, &["a.urdf: No such file", "check the path"]),
        ("folder", &[], &["--model", "."], 3, &[".", "must end in .urdf"]),
        (
            "kind",
            &[("a.dae", "")],
            &["--model", "a.dae"],
            3,
            &["a.dae: unknown kind", ".urdf, .xml, .mjcf or .toml"],
        ),
        (
            "joints",
            &[("a.urdf", &thirteen)],
            &["--model", "a.urdf"],
            3,
            &["a.urdf:", "joint `j13` is one too many", "13 joints", "at most 12", "fixed"],
        ),
    ];
    play(&[&RUN, ["--set", "path.kind=joint_sine"].as_slice()].concat(), &cases);
}

/// A URDF of `joints` revolute joints one after the other.
fn chain_of(joints: usize) -> String {
    let mut urdf = String::from("<robot name=\"chain\"><link name=\"l0\"/>");
    for joint in 1..=joints {
        let _ = write!(
            urdf,
            r#"<joint name="j{joint}" type="revolute"><parent link="l{}"/><child link="l{joint}"/>
            <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="200" velocity="3"/></joint>
            <link name="l{joint}"><inertial><mass value="1"/>
            <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"#,
            joint - 1
        );
    }
    urdf + "</robot>"
}

#[test]
fn bad_effects_in_arm_files() {
    let arm = |effects: &str| format!("urdf = \"two.urdf\"\n{effects}");
    let one = "[[effect]]\nkind = \"joint_clearance\"\njoint = \"shoulder\"\nclearance = 0.0003\n";
    let key = arm(&one.replace("clearance = ", "clearence = "));
    let (kind, joint) =
        (arm(&one.replace("joint_clearance", "wobble")), arm(&one.replace("shoulder", "wrist")));
    let (slide, wide) = (arm(&one.replace("shoulder", "slide")), arm(&one.replace("0.0003", "0.02")));
    let (text, twice) = (arm(&one.replace("0.0003", "\"much\"")), arm(&format!("{one}{one}")));
    let top = arm("gravitty = 3\n");
    let urdf = "urdf = \"none.urdf\"\n";
    let cases: [Case; 9] = [
        (
            "key",
            &[("a.toml", &key)],
            &[],
            3,
            &["a.toml: line 2", "`clearence`", "expected one of `clearance`"],
        ),
        ("kind", &[("a.toml", &kind)], &[], 3, &["a.toml: line 2", "\"wobble\"", "known: joint_clearance"]),
        ("joint", &[("a.toml", &joint)], &[], 3, &["a.toml:2:", "`wrist`", "the arm has shoulder, slide"]),
        ("prismatic", &[("a.toml", &slide)], &[], 3, &["a.toml: line 2", "slide is prismatic", "revolute"]),
        (
            "radius",
            &[("a.toml", &wide)],
            &[],
            3,
            &["a.toml: line 2", "clearance = 0.02", "below the bearing radius"],
        ),
        ("text", &[("a.toml", &text)], &[], 3, &["a.toml: line 2", "\"much\"", "must be a number"]),
        (
            "twice",
            &[("a.toml", &twice)],
            &[],
            3,
            &["a.toml: line 6", "shoulder has this effect twice; remove one"],
        ),
        ("top", &[("a.toml", &top)], &[], 3, &["a.toml:2:", "`gravitty`", "expected one of"]),
        ("urdf", &[("a.toml", urdf)], &[], 3, &["a.toml:1:", "`none.urdf`", "No such file"]),
    ];
    play(&run_of("a.toml"), &cases);
    let clearance = ["--set", "clearance.slide.clearance=1e-4"];
    let said = ["scenario: clearance.slide", "slide is prismatic", "needs a revolute joint"];
    play(&run_of("two.urdf"), &[("prismatic", &[], &clearance, 3, &said)]);
}

#[test]
fn bad_scenarios() {
    let cases: [Case; 10] = [
        (
            "key",
            &[("s.toml", "seed = 1\nsubstep = 3\n")],
            &["s.toml"],
            3,
            &["s.toml", "line 2", "`substep`", "`substeps`"],
        ),
        (
            "inner key",
            &[("s.toml", "[path]\nperod = 3\n")],
            &["s.toml"],
            3,
            &["s.toml", "line 2", "`perod`", "`period`"],
        ),
        (
            "play's key",
            &[("s.toml", "[clearance.joint_5]\nclearance = 1e-4\nradius = 1\n")],
            &["s.toml"],
            3,
            &["s.toml", "line 3", "`radius`", "`bearing_radius`"],
        ),
        (
            "type",
            &[("s.toml", "rate = \"fast\"\n")],
            &["s.toml"],
            3,
            &["s.toml", "line 1", "\"fast\"", "expected a number"],
        ),
        (
            "variant",
            &[("s.toml", "pace = \"slow\"\n")],
            &["s.toml"],
            3,
            &["line 1", "`slow`", "`realtime` or `lockstep`"],
        ),
        (
            "twice",
            &[("s.toml", "seed = 1\nseed = 2\n")],
            &["s.toml"],
            3,
            &["s.toml", "line 2", "duplicate key"],
        ),
        ("syntax", &[("s.toml", "seed = 1\n[path\n")], &["s.toml"], 3, &["s.toml", "line 2", "expected `]`"]),
        ("model", &[("s.toml", "model = \"a.urdf\"\n")], &["s.toml"], 3, &["a.urdf", "No such file"]),
        ("missing", &[], &["s.toml"], 3, &["cannot read the scenario s.toml", "No such file"]),
        ("folder", &[], &["."], 3, &["cannot read the scenario .", "Is a directory"]),
    ];
    play(&RUN, &cases);
}

#[test]
fn values_out_of_range() {
    let set = |given| ["--set", given];
    // The setting, and the required words.
    let cases: [(&str, &[&str]); 22] = [
        ("duration=-1", &["duration = -1", "above 0 to 86400 s"]),
        ("duration=nan", &["duration = NaN", "above 0 to 86400 s"]),
        ("rate=0", &["rate = 0", "1 to 100000"]),
        ("patience=0", &["patience = 0", "above 0 to 3600 s"]),
        ("substeps=0", &["substeps = 0", "1 to 100000"]),
        ("substeps=5", &["substeps = 5", "2e-4 s can't resolve a contact", "more sub-steps"]),
        ("gravity=[0,0,inf]", &["gravity = inf", "three finite numbers"]),
        ("controllers=[]", &["controllers is empty", "name at least one"]),
        ("clearance.wrist.clearance=1e-4", &["clearance.wrist", "no joint of that name", "joint_1, joint_2"]),
        (
            "clearance.joint_5.clearance=0.01",
            &["clearance.joint_5", "clearance = 0.01", "below the bearing radius"],
        ),
        ("clearance.joint_5.clearance=-1", &["clearance.joint_5", "clearance = -1", "0 m to below"]),
        ("clearance.joint_5.clearance=nan", &["clearance.joint_5", "clearance = NaN"]),
        ("clearance.joint_5.restitution=2", &["clearance.joint_5", "restitution = 2", "above 0, to 1"]),
        ("path.period=-3", &["path.period = -3 s", "a lap takes between"]),
        ("path.laps=0", &["path.laps = 0", "1 or more"]),
        ("path.kind=file", &["path.file"]),
        ("path.period=0.5", &["joint_3", "faster than its limit 2.7", "more time"]),
        ("path.centre=[5,0,0]", &["cannot reach (5.", "move path.centre", "path.start"]),
        ("path.size=[5,5,5]", &["cannot reach", "lower path.size"]),
        ("path.start=[0,0]", &["path.start has 2 values", "6 joints"]),
        ("sensors.position.noise=-1", &["sensors", "noise", "-1"]),
        ("realtime.priority=100", &["realtime.priority = 100", "0 (none) to 99"]),
    ];
    // Either the file or --set gives the list of controllers, never both.
    let shared: Vec<&str> = RUN.iter().copied().filter(|word| !word.starts_with("--controller")).collect();
    for (given, said) in cases {
        play(&shared, &[(given, &[], &set(given), 3, said)]);
    }
}

#[test]
fn bad_command_lines() {
    let cases: [Case; 14] = [
        ("no value", &[], &["--set", "rate"], 2, &["--set rate: write key=value"]),
        ("no key", &[], &["--set", "=3"], 2, &["--set =3: the key is empty"]),
        (
            "unknown key",
            &[],
            &["--set", "nonsense=1"],
            2,
            &["--set nonsense=1", "unknown field", "`substeps`"],
        ),
        ("unknown inner key", &[], &["--set", "path.perod=1"], 2, &["--set path.perod=1", "`period`"]),
        ("no table", &[], &["--set", "seed.x=1"], 2, &["--set seed.x=1: seed is not a table"]),
        ("type", &[], &["--set", "path.period=abc"], 2, &["path.period=abc", "\"abc\"", "expected a number"]),
        ("sign", &[], &["--set", "seed=-1"], 2, &["--set seed=-1", "-1"]),
        ("number", &[], &["--seed", "x"], 2, &["--seed", "'x'"]),
        ("flag", &[], &["--fast"], 2, &["--fast", "--help"]),
        ("pace", &[], &["--recording", "wav"], 2, &["wav", "mcap, csv, none"]),
        (
            "controller",
            &[],
            &["--controller", "mpc"],
            2,
            &["\"mpc\"", "computed-torque, quasi-static, narx-qp", "path"],
        ),
        ("executable", &[], &["--controller", "./mpc"], 3, &["./mpc", "executable does not exist"]),
        (
            "no program",
            &[],
            &["--controller", "./two.urdf"],
            3,
            &["./two.urdf", "not executable", "chmod +x"],
        ),
        ("folder", &[], &["--controller", "./"], 3, &["./", "is a folder"]),
    ];
    play(&RUN, &cases);
    play(&[], &[("command", &[], &["fly"], 2, &["'fly'", "--help"])]);
}

#[test]
fn bad_paths() {
    let table = |rows: &str| format!("t,q1,q2\n0,0,0\n{rows}\n2,0,0\n3,0,0\n");
    let (nan, text) = (table("1,nan,0"), table("1,0,zero"));
    let (ragged, back) = (table("1,0"), "t,q1,q2\n0,0,0\n1,0.1,0\n0.5,0,0\n2,0,0\n");
    let far = "t,q1,q2\n0,0,0\n10,2.5,0\n20,0,0\n30,0,0\n";
    let cases: [Case; 11] = [
        ("NaN", &[("p.csv", &nan)], &[], 3, &["p.csv:3:2", "q1", "\"nan\"", "finite number"]),
        ("text", &[("p.csv", &text)], &[], 3, &["p.csv:3:3", "q2", "\"zero\"", "finite number"]),
        ("ragged", &[("p.csv", &ragged)], &[], 3, &["p.csv:3:", "2 fields, the header 3"]),
        ("time", &[("p.csv", back)], &[], 3, &["p.csv:4:1", "0.5 s", "after 1 s", "time has to increase"]),
        (
            "joints",
            &[("p.csv", "t,q1,q2,q3\n0,0,0,0\n")],
            &[],
            3,
            &["p.csv:1:", "3 joint column", "the arm 2"],
        ),
        ("column", &[("p.csv", "t,a\n0,0\n")], &[], 3, &["p.csv:1", "q1", "t,q1…qn"]),
        ("short", &[("p.csv", "t,q1,q2\n0,0,0\n")], &[], 3, &["p.csv: 1 rows", "at least 4"]),
        ("empty", &[("p.csv", "")], &[], 3, &["p.csv:1", "column t is missing"]),
        ("limit", &[("p.csv", far)], &[], 3, &["p.csv:", "shoulder", "limit 2.0"]),
        ("missing", &[], &[], 3, &["p.csv: No such file"]),
        ("folder", &[], &["--set", "path.file=."], 3, &[".: Is a directory"]),
    ];
    let shared =
        [&RUN, ["--model", "two.urdf", "--set", "path.kind=file", "--set", "path.file=p.csv"].as_slice()];
    play(&shared.concat(), &cases);
}

/// A recording of 400 samples of two joints with the row at `line` replaced.
fn recording(header: &str, line: usize, row: &str) -> String {
    let mut csv = format!("{header}\n");
    for sample in 0..400 {
        let t = f64::from(sample) * 0.01;
        let q = (5.0 * t).sin();
        // The header is line 1.
        let _ = match sample as usize + 2 == line {
            true => writeln!(csv, "{row}"),
            false => writeln!(csv, "{t},{q},{},1,2", 0.1 * q),
        };
    }
    csv
}

#[test]
fn bad_recordings() {
    let header = "t,q1,q2,tau1,tau2";
    let text = recording(header, 19, "0.17,0,0,1,high");
    let nan =
        (0..400).fold(format!("{header}\n"), |csv, k| csv + &format!("{},nan,0,1,2\n", 0.01 * f64::from(k)));
    let (joints, bare) = (recording("t,q1,q2,q3,q4", 0, ""), recording("t,q1,q2,a,b", 0, ""));
    let gap = recording("t,q1,q3,tau1,tau2", 0, "");
    let short: String = recording(header, 0, "").lines().take(4).map(|line| format!("{line}\n")).collect();
    let good = recording(header, 0, "");
    let given = ["--model", "two.urdf", "--recording", "r.csv"];
    let filter = [given.as_slice(), &["--lowpass", "1e9"]].concat();
    let trim = [given.as_slice(), &["--trim", "100"]].concat();
    let stamped: String = (0..400).map(|k| format!("{},{},0.1,1,2\n", 10 * k, 0.01 * f64::from(k))).collect();
    let stamped = format!("{header}\n{stamped}");
    let bare_numbers = good[header.len() + 1..].to_owned();
    let cases: [Case; 14] = [
        (
            "NaN",
            &[("r.csv", &nan)],
            &given,
            3,
            &["r.csv:2", "q1 holds no number", "all 400 rows", "no row is left"],
        ),
        ("text", &[("r.csv", &text)], &given, 3, &["r.csv:19", "tau2", "\"high\""]),
        ("no header", &[("r.csv", &bare_numbers)], &given, 3, &["r.csv:1: no header", "t,q1,q2", "mapping"]),
        (
            "joints",
            &[("r.csv", &joints)],
            &given,
            3,
            &["r.csv", "expected 2 joint", "found 4", "of this arm?", "two.urdf are shoulder, slide"],
        ),
        (
            "milliseconds",
            &[("r.csv", &stamped)],
            &given,
            3,
            &["r.csv: column t", "10 apart", "milliseconds?"],
        ),
        (
            "no torque",
            &[("r.csv", &bare)],
            &given,
            3,
            &["r.csv", "nothing to compare", "tau1…tau2", "record one"],
        ),
        ("gap", &[("r.csv", &gap)], &given, 3, &["r.csv:1", "q2"]),
        ("short", &[("r.csv", &short)], &given, 3, &["r.csv: 3 sample", "at least 4"]),
        ("empty", &[("r.csv", "")], &given, 3, &["r.csv: the file is empty", "t,q1,q2"]),
        ("missing", &[], &given, 3, &["r.csv: No such file", "check the path"]),
        (
            "folder",
            &[],
            &["--model", "two.urdf", "--recording", "."],
            3,
            &["is a folder", "name one recording in it"],
        ),
        (
            "filter",
            &[("r.csv", &good)],
            &filter,
            3,
            &["low-pass at 1000000000 Hz", "choose between 0 and 50"],
        ),
        ("trim", &[("r.csv", &good)], &trim, 3, &["r.csv", "3.99"]),
        ("no recording", &[], &["--model", "two.urdf"], 2, &["--recording"]),
    ];
    play(&["compare", "--out", "out"], &cases);
    let absurd = recording(header, 19, "0.17,0,0,1e300,2");
    let cases: [Case; 5] = [
        ("NaN", &[("r.csv", &nan)], &given, 3, &["r.csv:2", "q1 holds no number", "no row is left"]),
        (
            "milliseconds",
            &[("r.csv", &stamped)],
            &given,
            3,
            &["r.csv: column t", "10 apart", "milliseconds?"],
        ),
        ("no torque", &[("r.csv", &bare)], &given, 3, &["r.csv", "nothing to compare", "record one"]),
        ("short", &[("r.csv", &short)], &given, 3, &["r.csv", "at least 4"]),
        ("absurd", &[("r.csv", &absurd)], &given, 3, &["r.csv", "tau1", "not finite"]),
    ];
    // A fault that the program detects only after it made its folder leaves no folder either.
    for out in ["out", "out/deeper/still"] {
        play(&["diagnose", "--out", out], &cases);
    }
}

/// Not an error: the message names the file and the only remedy that helps.
#[test]
fn too_short_a_recording_says_how_much_to_record() {
    let long = recording("t,q1,q2,tau1,tau2", 0, "");
    let short: String = long.lines().take(152).map(|line| format!("{line}\n")).collect();
    let folder = fresh_folder();
    for (file, text) in [("two.urdf", TWO), ("r.csv", short.as_str())] {
        std::fs::write(folder.path().join(file), text).expect("written");
    }
    let ran = Call::new(folder, &["diagnose", "--model", "two.urdf", "--recording", "r.csv"]).run().expect(0);
    let said = ran.stdout();
    println!("{said}");
    for words in ["r.csv: too short: it lasts 1.5 s", "record at least 10 s"] {
        assert!(said.replace(['\n', ' '], "").contains(&words.replace(' ', "")), "{words}: {}", ran.dump());
    }
    assert!(!said.contains("--trim") && !said.contains("--lowpass"), "{}", ran.dump());
}

#[test]
fn what_a_controller_cannot_use_is_bad_input() {
    let cases: [(&str, &[&str]); 3] = [
        ("controller.options.horizon=1", &["options of the controller computed-torque", "`horizon`"]),
        ("controller.model=none.toml", &["none.toml: No such file", "check the path"]),
        ("controller.gains.damping_ratio=-1", &["gains.damping_ratio = -1", "above 0 and at most 10"]),
    ];
    for (given, said) in cases {
        let ran = Call::new(fresh_folder(), &[&RUN, ["--set", given].as_slice()].concat()).run().expect(3);
        println!("3  {given}: {}", ran.stderr().lines().next().unwrap_or_default());
        for words in said {
            assert!(ran.stderr().contains(words), "{given}: {words:?} is not said: {}", ran.dump());
        }
        assert!(!ran.out().exists(), "{given}: a second try finds the folder taken: {}", ran.dump());
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_refused_before_anything_runs() {
    for out in ["two.urdf", "two.urdf/out", "/proc/none/out"] {
        let folder = fresh_folder();
        std::fs::write(folder.path().join("two.urdf"), TWO).expect("written");
        let arguments = ["run", "--pace", "lockstep", "--quiet", "--set", "duration=0.05", "--out", out];
        let ran = Call::new(folder, &arguments).run().expect(3);
        println!("3  {out}: {}", ran.stderr().trim());
        assert!(
            ran.stderr().contains("cannot create the folder") && ran.stderr().contains(out),
            "{}",
            ran.dump()
        );
    }
}

/// Arguments, as a shell line, of a run whose recording exceeds a megabyte.
fn long_run(kind: &str) -> String {
    let set = "--set duration=2 --set path.period=2 --controller computed-torque";
    format!("{FREEPLAY} run --pace lockstep --quiet --out out --recording {kind} {set}")
}

/// Fails unless the run in `ran` continued to its end, reported that its recording ends early and kept the beginning.
fn assert_recorded_in_part(ran: &Ran, kind: &str) {
    println!("3  {kind}: {}", ran.stderr().trim());
    assert!(ran.stderr().contains("the recording ends early"), "{}", ran.dump());
    assert!(ran.stderr().contains("the rows before it stay readable; free some space"), "{}", ran.dump());
    assert!(ran.stdout().contains("the recording ends early"), "{}", ran.dump());
    let recording = ran.recording(&format!("computed-torque.{kind}"));
    assert!((100..2000).contains(&recording.len()), "{} rows", recording.len());
}

#[test]
fn a_file_that_may_not_grow_ends_the_recording_and_not_the_run() {
    for kind in ["csv", "mcap"] {
        let mut shell = Command::new("sh");
        // 1200 blocks of 512 bytes: enough for the largest segment of shared memory and the report, not for the recording.
        shell.args(["-c", &format!("ulimit -f 1200 && exec {}", long_run(kind))]);
        let ran = Call::of(fresh_folder(), shell).run().expect(3);
        assert_recorded_in_part(&ran, kind);
        assert_eq!((&ran.run()["ending"], &ran.run()["ticks"]), (&"finished".into(), &2000.into()));
        assert!(ran.run()["notes"].to_string().contains("the recording ends early"), "{}", ran.dump());
    }
}

#[test]
fn a_full_disk_ends_the_recording_and_not_the_run() {
    // A separate disk needs a namespace, which not every machine allows.
    let mount = "mkdir out kept && mount -t tmpfs -o size=400k none out";
    let may = Command::new("unshare").args(["-rm", "true"]).status().is_ok_and(|status| status.success());
    if !may {
        freeplay_skip::skip(
            freeplay_skip::Need::Namespace,
            "this machine allows no namespace to mount a small disk in",
        );
        return;
    }
    for kind in ["csv", "mcap"] {
        let mut shell = Command::new("unshare");
        shell.args([
            "-rm",
            "sh",
            "-c",
            &format!("{mount} && {}; code=$?; cp out/* kept; exit $code", long_run(kind)),
        ]);
        let ran = Call::of(fresh_folder(), shell).run().expect(3);
        std::fs::remove_dir(ran.out()).expect("what was below the disk is empty");
        std::fs::rename(ran.folder.path().join("kept"), ran.out()).expect("renamed");
        assert_recorded_in_part(&ran, kind);
    }
}

/// A recording of six joints at rest, without a tool.
const RESTING: &str = "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n0.001,0,0,0,0,0,0\n0.002,0,0,0,0,0,0\n";

#[test]
fn bad_training() {
    let cases: [Case; 7] = [
        ("no recording", &[], &[], 2, &["--recording"]),
        ("epochs", &[], &["--recording", "r.csv", "--epochs", "0"], 2, &["--epochs", "at least 1"]),
        (
            "folder",
            &[],
            &["--recording", "r.csv", "--out", "none/w.json"],
            3,
            &["none/w.json", "no folder none"],
        ),
        (
            "arm",
            &[("r.csv", RESTING)],
            &["--recording", "r.csv", "--model", "none.toml", "--out", "w.json"],
            3,
            &["none.toml"],
        ),
        ("no file", &[], &["--recording", "none.csv", "--out", "w.json"], 3, &["none.csv"]),
        ("no tool", &[("r.csv", RESTING)], &["--recording", "r.csv", "--out", "w.json"], 3, &["r.csv", "x"]),
        ("no runs", &[], &["--recording", ".", "--out", "w.json"], 3, &["no recordings of runs"]),
    ];
    play(&["train"], &cases);
}

/// A run whose controller cannot start writes no summary and no report.
#[test]
fn weights_that_do_not_fit_end_a_run_before_its_report() {
    let header = "\"format\": \"freeplay.remainder\", \"version\"";
    let (version, part) = (format!("{{{header}: 99}}"), format!("{{{header}: 2}}"));
    let cases = [
        ("another version", version.as_str(), ["version 99", "train again"]),
        ("half a file", &part, ["w.json", "missing field"]),
        ("no weights", "{}", ["freeplay.remainder", "w.json"]),
        ("no JSON", "weights", ["w.json", "line 1"]),
    ];
    for (name, text, said) in cases {
        let folder = fresh_folder();
        let file = folder.path().join("w.json");
        std::fs::write(&file, text).expect("written");
        let option = format!("controller.weights={}", file.display());
        let arguments = ["run", "--quiet", "--set", "duration=0.05", "--set", &option, "--out", "out"];
        let ran =
            Call::new(folder, &[&arguments, ["--controller", "narx-qp"].as_slice()].concat()).run().expect(3);
        println!("3  {name}: {}", ran.stderr().lines().next().unwrap_or_default());
        for words in said {
            assert!(ran.stderr().contains(words), "{name}: {words:?} is not said: {}", ran.dump());
        }
        for left in ["report.html", "summary.json", "narx-qp.json"] {
            assert!(!ran.out().join(left).exists(), "{name} left {left}: {}", ran.dump());
        }
    }
}

/// The dotted keys of the values in `table` that are not tables.
fn keys(table: &toml::Table, before: &str) -> Vec<String> {
    let of = |(key, value): (&String, &toml::Value)| match value {
        toml::Value::Table(inner) if !inner.is_empty() => keys(inner, &format!("{before}{key}.")),
        _ => vec![format!("{before}{key}")],
    };
    table.iter().flat_map(of).collect()
}

/// Runs `freeplay` with `arguments` in a folder with `files`; true if it refused them in plain words.
fn refused_in_plain_words(files: Files, arguments: &[&str]) -> bool {
    let folder = fresh_folder();
    for (file, contents) in files {
        std::fs::write(folder.path().join(file), contents).expect("written");
    }
    let ran = Call::new(folder, arguments).run();
    let said = ran.stderr();
    // "invalid value" is a plain sentence on the command line; for a file it comes from the parser.
    let jargon: Vec<&&str> =
        JARGON.iter().chain(&["invalid value"]).filter(|word| said.contains(**word)).collect();
    assert!(jargon.is_empty(), "{arguments:?}: {jargon:?} in {said}");
    if ran.output.status.code() == Some(0) {
        return false;
    }
    println!("{}", said.lines().next().unwrap_or_default());
    // An invalid receipt fails its verdict.
    assert!(matches!(ran.output.status.code(), Some(1..=3)), "{}", ran.dump());
    true
}

/// Sets each key of a scenario, and documents, to a value of another type: no message names a type of the program.
#[test]
fn values_of_another_kind_are_refused_in_plain_words() {
    let shown = Call::new(fresh_folder(), &["run", "--show"]).run().expect(0).stdout();
    let all = keys(&shown.parse().expect("TOML"), "");
    let mut refused = 0;
    for key in &all {
        for value in ["x", "-1.5", "[]", "{a=1}", "true"] {
            let set = format!("{key}={value}");
            refused += usize::from(refused_in_plain_words(&[], &["run", "--show", "--set", &set]));
        }
    }
    println!("{refused} of {} values refused", 5 * all.len());
    assert!(all.len() > 30 && refused > 3 * all.len());
    let toml = [
        "name = 3",
        "urdf = []",
        "gravity = [0, 1]",
        "gravity = \"down\"",
        "joint = 3",
        "[[joint]]\nname = 1",
        "[[joint]]\nname = \"a\"\ntype = \"ball\"",
        "[[joint]]\nname = \"a\"\nmass = \"x\"",
        "[[joint]]\nname = \"a\"\nlimits = 3",
        "effect = 1",
        "[tool]\nxyz = 1",
        "a = =",
        "name = x",
        "name = \"x",
    ];
    for text in toml {
        assert!(refused_in_plain_words(&[("a.toml", text)], &["arm", "a.toml"]), "{text}");
    }
    for text in [
        "inputs = 1",
        "[inputs]\na = 1",
        "[inputs",
        "[t]\ncolumns = 1\n[q]\ncolumns = [1]",
        "skip = -1",
        "separator = \";;\"",
    ] {
        let files = [("m.toml", text), ("r.csv", "t,q1\n0,0\n1,1\n")];
        assert!(
            refused_in_plain_words(&files, &["record", "info", "r.csv", "--mapping", "m.toml"]),
            "{text}"
        );
    }
    for text in [
        "[",
        "{",
        "{\"a\":",
        "\"",
        "3",
        "null",
        "{\"schema\": 3}",
        "{\"format\": 1}",
        "{\"schema\": \"freeplay.diagnosis/1\"}",
    ] {
        for command in ["excite", "blind --verify"] {
            let words: Vec<&str> = command
                .split(' ')
                .chain(["d.json", "--out", "out"])
                .filter(|word| command == "excite" || !["--out", "out"].contains(word))
                .collect();
            assert!(refused_in_plain_words(&[("d.json", text)], &words), "{command}: {text}");
        }
    }
}
