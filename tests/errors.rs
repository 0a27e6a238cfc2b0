//! Every command with invalid input: a missing file, a folder, an empty file, nonsense; a place that can't be written to; values out of range; contradicting
//! flags; unknown names. Each call ends with the documented exit code and one message that names the fault and the next step; it prints nothing else and leaves
//! no file. `inputs` tests faults inside single files, with line and column.

use std::path::Path;

use crate::common::{Call, fresh_folder};
use tempfile::TempDir;

/// The arm that comes with the project.
const ARM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/arm.urdf");

/// Words for the next step; every message has one of them.
const NEXT_STEPS: [&str; 27] = [
    "run it with ",
    "write it as ",
    "add the time",
    "check ",
    "name ",
    "give ",
    "make ",
    "remove ",
    "choose ",
    "correct ",
    "save it",
    "record it again",
    "must end in",
    "begins with",
    "should hold",
    "say with",
    "needs ",
    "try '--help'",
    "is this a recording of this arm",
    "expected ",
    "correct it",
    "separate them",
    "use it as it is",
    "as in ",
    "it must be ",
    "missing field ",
    "between ",
];

/// A folder with one of each wrong file, and a valid recording.
fn folder() -> TempDir {
    let folder = fresh_folder();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    for ending in ["toml", "json", "csv", "mcap", "urdf"] {
        write(&format!("empty.{ending}"), "");
    }
    write("nonsense.toml", "seed = 1\nrate = = 3\n");
    write("nonsense.json", "{\"a\": 1,\n \"b\": }\n");
    write("other.json", "{\"a\": 1}\n");
    write("nonsense.csv", "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n1,zero,0,0,0,0,0\n");
    write("nonsense.mcap", "nothing that begins like a recording");
    write("nonsense.urdf", "<robot name=\"a\">\n<link");
    write("file", "a file where a folder should be");
    write("script.sh", "#!/bin/sh\n");
    std::fs::write(folder.path().join("bytes.toml"), [0xff, 0xfe, 0, 1]).expect("written");
    std::fs::create_dir(folder.path().join("folder")).expect("made");
    let row = |k: u32| {
        let (t, q) = (f64::from(k) * 0.01, f64::from(k) * 1e-3);
        format!("{t},{q},{q},{q},{q},{q},{q},1,1,1,1,1,1\n")
    };
    let rows: String = (0..400).map(row).collect();
    write("good.csv", &format!("t,q1,q2,q3,q4,q5,q6,tau1,tau2,tau3,tau4,tau5,tau6\n{rows}"));
    folder
}

/// Everything in `folder`.
fn listing(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort_unstable();
    names
}

/// Calls in one folder, and the faults of their messages.
struct Tried {
    folder: Option<TempDir>,
    calls: usize,
    faults: Vec<String>,
}

impl Tried {
    fn new() -> Self {
        Self { folder: Some(folder()), calls: 0, faults: Vec::new() }
    }

    /// Calls the binary with the words of `line`; expects `code`, all of `said` and a next step.
    fn refused(&mut self, line: &str, code: i32, said: &[&str]) {
        let arguments: Vec<&str> = line.split_whitespace().collect();
        let call = Call::new(self.folder.take().expect("a folder"), &arguments);
        let before = listing(call.folder.path());
        let ran = call.run();
        let (stderr, found) = (ran.stderr(), ran.output.status.code());
        println!("{found:?}  {line}\n      {}", stderr.trim().replace('\n', "\n      "));
        let mut faults: Vec<String> = Vec::new();
        let mut expect = |holds: bool, what: &str| {
            if !holds {
                faults.push(what.to_owned());
            }
        };
        expect(found == Some(code), "another exit code");
        said.iter().for_each(|words| expect(stderr.contains(words), words));
        let messages = stderr.matches("freeplay: ").count() + stderr.matches("error: ").count();
        expect(messages == 1, "one message");
        expect(!stderr.contains("panicked"), "no panic");
        expect(NEXT_STEPS.iter().any(|step| stderr.contains(step)), "what to do");
        expect(ran.stdout().is_empty(), "nothing on standard output");
        expect(listing(ran.folder.path()) == before, "nothing left behind");
        if !faults.is_empty() {
            self.faults.push(format!("{line}\n  missing: {}\n  exit {found:?}: {stderr}", faults.join("; ")));
        }
        self.calls += 1;
        self.folder = Some(ran.folder);
    }

    /// Fails if a call went wrong.
    fn judge(self) {
        println!("{} calls", self.calls);
        assert!(
            self.faults.is_empty(),
            "{} of {}:\n{}",
            self.faults.len(),
            self.calls,
            self.faults.join("\n")
        );
    }
}

#[test]
fn files_that_cannot_be_used() {
    let scenarios = ["missing.toml", "folder", "nonsense.toml", "bytes.toml", "nonsense.csv"];
    let models = [
        "missing.urdf",
        "folder",
        "empty.urdf",
        "empty.toml",
        "nonsense.toml",
        "nonsense.urdf",
        "other.json",
        "bytes.toml",
    ];
    let recordings = [
        "missing.csv",
        "missing.mcap",
        "folder",
        "empty.csv",
        "empty.mcap",
        "nonsense.csv",
        "nonsense.mcap",
        "other.json",
    ];
    let documents = ["missing.json", "folder", "empty.json", "nonsense.json", "other.json", "bytes.toml"];
    let mappings = ["missing.toml", "folder", "empty.toml", "nonsense.toml", "bytes.toml"];
    let folders = ["missing", "file", "folder"];
    let excite = "excite --kinds backlash,joint_elasticity --joint joint_2 --out out --model";
    let tables: [(&[&str], &[&str]); 6] = [
        (
            &[
                "run --quiet --out out",
                "swap --quiet --out out",
                "bench --quiet --out out",
                "faults computed-torque --quiet --out out --scenario",
                "scenario check",
                "scenario show",
            ],
            &scenarios,
        ),
        (
            &[
                "run --quiet --out out --model",
                "compare --recording good.csv --out out --model",
                "diagnose --recording good.csv --out out --model",
                "train --recording good.csv --out w.json --model",
                "export --to urdf",
                "export --to mjcf --out out.xml",
                excite,
            ],
            &models,
        ),
        (
            &[
                &format!("compare --model {ARM} --out out --recording"),
                &format!("diagnose --model {ARM} --out out --recording"),
                "replay --against computed-torque",
                "train --out w.json --recording",
                "record info",
                "record export --format parquet --out out.parquet",
                "record import --out out.mcap",
            ],
            &recordings,
        ),
        (&["excite --out out", "blind --verify"], &documents),
        (&["record import good.csv --out out.mcap --mapping"], &mappings),
        (&["report", "blind --analyse", "blind --out out --merge"], &folders),
    ];
    let mut tried = Tried::new();
    for (commands, files) in tables {
        for (command, file) in
            commands.iter().flat_map(|command| files.iter().map(move |file| (command, file)))
        {
            tried.refused(&format!("{command} {file}"), 3, &[file]);
        }
    }
    tried.judge();
}

#[test]
fn places_that_cannot_be_written_to() {
    let mut tried = Tried::new();
    for out in ["file", "file/out", "/proc/none/out"] {
        let model = format!("--model {ARM}");
        for command in [
            "run --quiet --out",
            "swap --quiet --swaps 1 --out",
            "bench --quiet --ticks 100 --pairs 1 --out",
            "bench --cost --quiet --ticks 100 --pairs 1 --out",
            "faults computed-torque --quiet --kind nan --out",
            "faults computed-torque --quiet --kills 1 --out",
            &format!("compare {model} --recording good.csv --out"),
            &format!("diagnose {model} --recording good.csv --out"),
            &format!("excite {model} --kinds backlash,joint_elasticity --joint joint_2 --out"),
            "blind --quiet --cases 1 --out",
            "demo --case nothing --out",
            "reproduce --quick --quiet --out",
            "man --out",
        ] {
            tried.refused(&format!("{command} {out}"), 3, &["cannot create the folder", out]);
        }
        for command in [
            "train --recording good.csv --out",
            "export paper --to mjcf --out",
            "demo --case nothing --picture",
            "doctor --quick --html",
            "blind --quiet --cases 1 --history",
        ] {
            let file = format!("{out}/file.svg");
            tried.refused(&format!("{command} {file}"), 3, &["cannot write", &file]);
        }
        let file = format!("{out}/r.mcap");
        tried.refused(
            &format!("record export good.csv --format mcap --out {file}"),
            3,
            &[&file, "cannot be created"],
        );
    }
    for command in [
        "train --recording good.csv --out folder",
        "export paper --to urdf --out folder",
        "doctor --quick --html folder",
    ] {
        tried.refused(command, 3, &["cannot write folder", "a file in it"]);
    }
    tried.refused(
        "record export good.csv --format csv --out good.csv",
        2,
        &["the input cannot be the output as well"],
    );
    tried.judge();
}

#[test]
fn names_that_nobody_has() {
    let mut tried = Tried::new();
    for command in [
        "run --quiet --out out --controller",
        "run --quiet --out out --standby",
        "bench --quiet --out out --controller",
        "swap --quiet --out out --controller computed-torque --controller",
        "faults --quiet --out out",
        "faults computed-torque --quiet --out out --standby",
    ] {
        let built_in = "built-in are computed-torque, quasi-static, narx-qp";
        tried.refused(&format!("{command} mpc"), 2, &["\"mpc\"", built_in, "give the path"]);
        tried.refused(
            &format!("{command} ./mpc"),
            3,
            &["./mpc", "executable does not exist", "check the path"],
        );
        tried.refused(&format!("{command} ./script.sh"), 3, &["./script.sh", "not executable", "chmod +x"]);
        tried.refused(&format!("{command} ./folder"), 3, &["./folder", "is a folder"]);
    }
    let excite = format!("excite --model {ARM} --out out --kinds");
    for (line, code, said) in [
        ("run --quiet --out out --set path.kind=spiral", 2, "`lissajous`"),
        ("cells --path spiral", 2, "lissajous, circle"),
        (
            "cells --option wobble=1 --path lissajous --period 6 --clearance 0.6 --part tracked",
            3,
            "`passages`",
        ),
        ("demo --case wobble", 2, "clearance, friction"),
        ("faults computed-torque --kind boom", 2, "stale-version"),
        ("train --recording good.csv --out w.json --nominal wobble.urdf", 3, "wobble.urdf"),
        ("reference-runs --only wobble", 2, "\"wobble\""),
        ("reproduce --skip wobble", 2, "network, compensation"),
        ("completions tcsh", 2, "fish"),
        (&format!("{excite} backlash,wobble --joint joint_2"), 2, "joint_clearance"),
        (&format!("{excite} backlash,joint_elasticity --joint nobody"), 2, "joint_1, joint_2"),
        (&format!("{excite} backlash,joint_elasticity"), 2, "joint_1, joint_2"),
    ] {
        tried.refused(line, code, &[said]);
    }
    tried.judge();
}

#[test]
fn values_and_flags_that_cannot_be() {
    let excite = format!("excite --model {ARM} --out out --kinds backlash,joint_elasticity --joint joint_2");
    let (compare, diagnose) = (
        format!("compare --model {ARM} --recording good.csv"),
        format!("diagnose --model {ARM} --recording good.csv"),
    );
    let cases: [(&str, i32, &str); 56] = [
        ("swap --quiet --out out --swaps 0", 2, "--swaps 0"),
        ("swap --quiet --out out --swaps -1", 2, "-1"),
        ("swap --quiet --out out --per-run 0", 2, "--per-run 0"),
        ("swap --quiet --out out --controller computed-torque", 2, "two controllers"),
        ("faults computed-torque --quiet --out out --seeds 0", 2, "between 1 and 1000000"),
        ("faults computed-torque --quiet --out out --kills 0", 2, "between 1 and 1000000"),
        ("faults computed-torque --quiet --out out --kills 3 --kind nan", 2, "cannot be used with"),
        ("bench --quiet --out out --ticks 0", 2, "hundred ticks"),
        ("bench --quiet --out out --pairs 0", 2, "a block or more"),
        ("bench --quiet --out out --cpus 98,99", 2, "98"),
        ("bench --quiet --out out --cost --load 100", 2, "cannot be used with"),
        ("bench --quiet --out out --load -3", 2, "from 0 to 1000000"),
        (&format!("{compare} --lowpass -1"), 3, "-1 Hz"),
        (&format!("{compare} --lowpass nan"), 3, "NaN Hz"),
        (&format!("{compare} --trim -1"), 3, "-1"),
        (&format!("{diagnose} --seed -1"), 2, "expected a whole number"),
        (&format!("{diagnose} --lowpass 0"), 3, "choose between"),
        (&format!("{diagnose} --mass-tolerance -1"), 2, "above 0"),
        (&format!("{diagnose} --delay-tolerance nan"), 2, "above 0"),
        ("diagnose --recording good.csv", 2, "--model"),
        (&format!("{diagnose} ./good.csv"), 2, "is given twice"),
        ("swap --quiet --out out --set duration=0.01", 3, "random_swaps = 15"),
        ("demo --period 0", 2, "between 1 and 120 s"),
        ("demo --out out --case play --case clearance", 2, "choose among play, play-detent"),
        ("demo --out out --case clearance --resume", 2, "--resume"),
        (&format!("{excite} --duration 0"), 2, "between 2 and 600 s"),
        (&format!("{excite} --duration -3"), 2, "between 2 and 600 s"),
        (&format!("{excite} --candidates 0"), 2, "between 1 and 100000"),
        (&format!("{excite} --reach -1"), 2, "above 0"),
        (&format!("{excite} --posture 9,9,9,9,9,9"), 2, "joint_1 at 9 is beyond its range"),
        ("excite --out out", 2, "diagnosis.json"),
        ("blind --quiet --out out --cases 0", 2, "at least 1"),
        ("blind --quiet --out out --jobs 0", 2, "at least 1"),
        ("blind --quiet --out out --patience 0", 2, "0"),
        ("blind --quiet --out out --shard 3/2", 2, "1 ≤ I ≤ N"),
        ("blind --quiet --out out --cases 3 --full", 2, "cannot be used with"),
        ("blind --quiet --verify x --merge y", 2, "cannot be used with"),
        ("bound --period 0", 2, "above 0"),
        ("bound --clearance 0", 2, "above 0"),
        ("bound --clearance -1", 2, "above 0"),
        ("bound --clearance 99", 3, "bearing radius"),
        ("cells --period nan", 2, "above 0"),
        ("cells --clearance -1", 2, "above 0"),
        ("cells --pair 2+2", 2, "3+5"),
        ("cells --after -1", 2, "below the shortest --period"),
        ("cells --after 99", 2, "below the shortest --period"),
        ("cells --option x", 2, "--option"),
        ("train --hidden 0", 2, "at least 1"),
        ("train --epochs 0", 2, "at least 1"),
        ("run --live --quiet", 2, "cannot be used with"),
        ("run --seed -1", 2, "-1"),
        ("run --quiet --out out --set rate=1e9", 3, "100000"),
        ("run --quiet --out out --set random_swaps=3", 3, "needs a standby"),
        (&format!("run --quiet --out out {ARM}"), 3, "is an arm file, not a scenario"),
        ("run --quiet --out out --set clearance.joint_5=0.0004", 2, "clearance.JOINT.clearance"),
        ("fly", 2, "'fly'"),
    ];
    let mut tried = Tried::new();
    for (line, code, said) in cases {
        tried.refused(line, code, &[said]);
    }
    tried.judge();
}

#[test]
fn a_machine_that_is_not_fit_is_refused_only_where_that_was_asked_for() {
    // The fitness depends on the machine; the form of the message must not.
    let ran = Call::new(folder(), &["doctor", "--quick", "--require-rt"]).run();
    let code = ran.output.status.code();
    println!("{code:?}  {}", ran.stderr().trim());
    assert!(code == Some(0) || (code == Some(4) && ran.stderr().starts_with("freeplay: this machine is")));
}
