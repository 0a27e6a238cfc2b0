//! The flags of every command: the output that --quiet omits, the output that --verbose adds, and the use of colour.

use std::fmt::Write as _;

use crate::common::{Call, Ran, fresh_folder};
use tempfile::TempDir;

/// First character of a colour code.
const ESCAPE: char = '\u{1b}';

/// A folder with a recording of the project's arm, and with a column of text that causes a note of the reader.
fn folder() -> TempDir {
    let folder = fresh_folder();
    let mut rows = String::from("t,q1,q2,q3,q4,q5,q6,tau1,tau2,tau3,tau4,tau5,tau6,phase\n");
    for k in 0..800 {
        let (t, word) = (f64::from(k) * 0.01, if k < 400 { "out" } else { "back" });
        let q = 0.3 * (2.0 * t).sin();
        let _ = writeln!(rows, "{t},{q},{q},{q},{q},{q},{q},0,0,0,0,0,0,{word}");
    }
    std::fs::write(folder.path().join("r.csv"), rows).expect("written");
    std::fs::copy(
        concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/arm.urdf"),
        folder.path().join("arm.urdf"),
    )
    .expect("copied");
    folder
}

/// Calls the binary with the words of `line` in such a folder.
fn call(line: &str) -> Ran {
    Call::new(folder(), &line.split_whitespace().collect::<Vec<_>>()).run().expect(0)
}

#[test]
fn every_command_understands_the_common_flags() {
    let help = call("--help").stdout();
    let groups = help.split("Main commands:").nth(1);
    let commands = groups.and_then(|rest| rest.split("Common options:").next()).expect("groups of commands");
    let is_first_line = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let names = commands.lines().filter(is_first_line).filter_map(|line| line.split_whitespace().next());
    let mut count = 0;
    for name in names {
        let help = call(&format!("{name} --help")).stdout();
        for flag in ["-q, --quiet", "-v, --verbose", "--color <WHEN>"] {
            assert!(help.contains(flag), "{name}: no {flag} in {help}");
        }
        count += 1;
    }
    println!("{count} commands");
    assert!(count > 20);
}

#[test]
fn quiet_leaves_results_and_verbose_tells_of_the_work() {
    let commands = [
        "compare --model arm.urdf --recording r.csv",
        "diagnose --seed 4 --model arm.urdf --recording r.csv",
        "record export r.csv --format mcap",
        "doctor --quick",
    ];
    for command in &commands {
        let quiet = call(&format!("{command} --quiet"));
        assert!(quiet.stderr().is_empty() && !quiet.stdout().is_empty(), "{command}: {}", quiet.dump());
        let before = call(&format!("-q {command}"));
        assert!(before.stderr().is_empty(), "{command}: {}", before.dump());
    }
    for command in &commands[..2] {
        let told = call(&format!("{command} -v")).stderr();
        for words in [" s  read arm.urdf: erkaya2018 of 6 joints", " s  read r.csv: 800 samples"] {
            assert!(told.contains(words), "{command}: {words:?} is not in {told}");
        }
    }
    assert!(
        call(commands[2]).stderr().starts_with("note: column phase is not used"),
        "a note without --quiet"
    );
}

#[test]
fn quiet_leaves_errors() {
    let ran = Call::new(folder(), &["compare", "-q", "--model", "arm.urdf", "--recording", "no.csv"])
        .run()
        .expect(3);
    assert!(ran.stderr().contains("no.csv"), "{}", ran.dump());
}

#[test]
fn quiet_and_verbose_exclude_each_other() {
    let ran = Call::new(folder(), &["doctor", "--quick", "-q", "-v"]).run().expect(2);
    assert!(ran.stderr().contains("cannot be used with"), "{}", ran.dump());
}

#[test]
fn colour_is_for_terminals_and_for_those_who_ask_for_it() {
    let doctor = |more: &str| call(&format!("doctor --quick --html page.html {more}"));
    let asked = doctor("--color always");
    assert!(asked.stdout().contains(ESCAPE), "{}", asked.dump());
    let page = std::fs::read_to_string(asked.folder.path().join("page.html")).expect("a page");
    assert!(!page.contains(ESCAPE), "no colour in files");
    for more in ["", "--color auto", "--color never", "--color always --format json"] {
        assert!(!doctor(more).stdout().contains(ESCAPE), "{more}");
    }
    let told = Call::new(folder(), &["doctor", "--quick", "--color", "always"]).env("NO_COLOR", "1").run();
    assert!(told.stdout().contains(ESCAPE), "who asks gets it: {}", told.dump());
    let help = |when: &str| call(&format!("doctor --help --color {when}")).stdout().contains(ESCAPE);
    assert!(help("always") && !help("never"));
}
