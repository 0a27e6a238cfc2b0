//! The handling of files on the command line: links, pipes, odd paths, folders with results or in use, results that are replaced completely.

use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Call, Ran, freeplay_in, fresh_folder};
use tempfile::TempDir;

const RUN: [&str; 9] = [
    "run",
    "--quiet",
    "--out",
    "out",
    "--controller",
    "computed-torque",
    "--set",
    "duration=0.05",
    "--pace=lockstep",
];

fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().expect("mkfifo").success());
}

/// One line on standard error that contains all of `words`.
fn one_line(ran: &Ran, words: &[&str]) {
    let stderr = ran.stderr();
    assert_eq!(stderr.trim().lines().count(), 1, "{}", ran.dump());
    assert!(words.iter().all(|word| stderr.contains(word)), "{words:?}: {}", ran.dump());
}

fn bytes(ran: &Ran, name: &str) -> Vec<u8> {
    std::fs::read(ran.folder.path().join(name)).expect("a file")
}

#[test]
fn a_folder_with_results_is_replaced_by_force_alone() {
    let ran = freeplay_in(fresh_folder(), &RUN).expect(0);
    let summary = bytes(&ran, "out/summary.json");
    let again = freeplay_in(ran.folder, &RUN).expect(2);
    one_line(&again, &["out", "scenario.toml of an earlier command", "--out", "--force"]);
    assert_eq!(bytes(&again, "out/summary.json"), summary);
    // Files of others are no results, and a folder open to all becomes private.
    std::fs::write(again.folder.path().join("out/notes.txt"), "mine").expect("a file");
    let open = std::fs::Permissions::from_mode(0o666);
    std::fs::set_permissions(again.folder.path().join("out/summary.json"), open).expect("open to all");
    let forced = freeplay_in(again.folder, &[&RUN[..], &["--force"]].concat()).expect(0);
    assert_eq!(bytes(&forced, "out/notes.txt"), b"mine");
    let mode = std::fs::metadata(forced.out().join("summary.json")).expect("there").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
}

#[test]
fn a_folder_in_use_is_refused() {
    let folder = fresh_folder();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).expect("a folder");
    let claim = freeplay_storage::Claim { results: &[], force: false };
    let used = freeplay_storage::OutputFolder::claim(&out, claim).expect("free");
    for more in [&[][..], &["--force"]] {
        let folder = TempDir::new().expect("a folder");
        let path = out.display().to_string();
        let arguments: Vec<&str> =
            RUN.iter().map(|&argument| if argument == "out" { path.as_str() } else { argument }).collect();
        let ran = freeplay_in(folder, &[&arguments[..], more].concat()).expect(3);
        one_line(&ran, &["another process is writing to it", "wait"]);
    }
    assert_eq!(std::fs::read_dir(&out).expect("a folder").count(), 0, "nothing was written");
    drop(used);
}

#[test]
fn two_runs_at_once_leave_one_result() {
    let folder = fresh_folder();
    let out = folder.path().join("shared").display().to_string();
    let arguments: Vec<&str> =
        RUN.iter().map(|&argument| if argument == "out" { out.as_str() } else { argument }).collect();
    let started: Vec<_> = (0..4).map(|_| Call::new(fresh_folder(), &arguments).start()).collect();
    let codes: Vec<i32> = started.into_iter().map(|run| run.wait().code()).collect();
    println!("exit codes {codes:?}");
    assert_eq!(codes.iter().filter(|code| **code == 0).count(), 1, "{codes:?}");
    assert!(codes.iter().all(|code| [0, 2, 3].contains(code)), "{codes:?}");
    let recording = Path::new(&out).join("computed-torque.mcap");
    assert_eq!(freeplay_recording::read(&recording, None).expect("whole").len(), 50);
}

#[test]
fn planted_links_are_not_written_through() {
    let folder = fresh_folder();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).expect("a folder");
    let victim = folder.path().join("victim");
    std::fs::write(&victim, "precious").expect("a file");
    for name in ["computed-torque.mcap", "report.html", "computed-torque.json", "computed-torque.hlog"] {
        symlink(&victim, out.join(name)).expect("a link");
    }
    let ran = freeplay_in(folder, &RUN).expect(0);
    assert_eq!(bytes(&ran, "victim"), b"precious");
    assert_eq!(ran.recording("computed-torque.mcap").len(), 50);
    assert!(!ran.out().join("report.html").is_symlink());
}

#[test]
fn links_out_of_a_folder_of_cases_are_not_followed() {
    let folder = fresh_folder();
    let cases = folder.path().join("cases");
    let elsewhere = folder.path().join("elsewhere");
    for path in [&cases, &elsewhere, &cases.join("one")] {
        std::fs::create_dir(path).expect("a folder");
    }
    std::fs::write(elsewhere.join("model.toml"), "secret").expect("a file");
    symlink(&elsewhere, cases.join("two")).expect("a link");
    let ran = freeplay_in(folder, &["blind", "--analyse", "cases", "--quiet"]).expect(3);
    one_line(&ran, &["cases/two", "is a link"]);
    std::fs::remove_file(ran.folder.path().join("cases/two")).expect("removed");
    symlink(elsewhere.join("model.toml"), cases.join("one/model.toml")).expect("a link");
    let ran = freeplay_in(ran.folder, &["blind", "--analyse", "cases", "--quiet"]).expect(3);
    one_line(&ran, &["cases/one/model.toml", "it is a link"]);
    assert!(!cases.join("receipt.json").exists());
}

#[test]
fn pipes_and_devices_are_no_inputs() {
    let made = || {
        let folder = fresh_folder();
        for name in ["r.csv", "m.toml", "s.toml", "p.json"] {
            pipe(&folder.path().join(name));
        }
        std::fs::write(folder.path().join("good.csv"), "t,q1\n0,1\n0.1,2\n").expect("a file");
        folder
    };
    let calls: [(&[&str], &str); 9] = [
        (&["record", "info", "r.csv"], "a pipe"),
        (&["record", "export", "r.csv", "--format", "mcap", "--out", "x.mcap"], "a pipe"),
        (&["record", "import", "r.csv", "--out", "x.mcap"], "a pipe"),
        (&["record", "import", "good.csv", "--mapping", "m.toml", "--out", "x.mcap"], "a pipe"),
        (&["compare", "--model", "m.toml", "--recording", "good.csv"], "a pipe"),
        (&["run", "s.toml", "--out", "out"], "a pipe"),
        (&["blind", "--verify", "p.json"], "a pipe"),
        (&["record", "info", "/dev/zero"], "a device"),
        (&["excite", "p.json", "--out", "out"], "a pipe"),
    ];
    for (arguments, word) in calls {
        let ran = freeplay_in(made(), arguments).expect(3);
        println!("{}", ran.stderr().trim());
        one_line(&ran, &[word]);
        assert!(!ran.folder.path().join("x.mcap").exists() && !ran.out().exists());
    }
}

#[test]
fn odd_paths_are_refused_before_the_start() {
    let long = format!("{}/out", "a".repeat(200)).repeat(6);
    let bytes = PathBuf::from(std::ffi::OsStr::from_bytes(b"a\xff"));
    for (path, word) in [(PathBuf::from(&long), "1024"), (bytes, "UTF-8")] {
        for (before, code) in [(&["run", "--quiet", "--out"][..], 3), (&["record", "info"], 3)] {
            let mut call = Call::new(fresh_folder(), before);
            call.command.arg(&path);
            let ran = call.run().expect(code);
            one_line(&ran, &[word]);
            let entries = std::fs::read_dir(ran.folder.path()).expect("a folder");
            assert_eq!(entries.count(), 2, "standard output and error alone");
        }
    }
    // A short path in a deep folder: results would have a long one.
    let folder = fresh_folder();
    let deep = folder.path().join(["b"; 6].map(|name| name.repeat(180)).join("/"));
    std::fs::create_dir_all(&deep).expect("a deep folder");
    let mut call = Call::new(folder, &RUN);
    call.command.current_dir(&deep);
    one_line(&call.run().expect(3), &["1024"]);
}

#[test]
fn an_export_that_cannot_be_finished_leaves_the_old_file() {
    for form in ["csv", "parquet", "mcap"] {
        let ran = freeplay_in(
            fresh_folder(),
            &["run", "--quiet", "--out", "out", "--controller", "computed-torque", "--set", "duration=0.4"],
        )
        .expect(0);
        let name = format!("old.{form}");
        std::fs::write(ran.folder.path().join(&name), "what was there before").expect("a file");
        // The shell counts in blocks of 512 bytes or of 1 KiB; an ignored SIGXFSZ turns the limit into an error.
        let line = format!(
            "trap '' XFSZ; ulimit -f 8; exec \"$0\" record export out/computed-torque.mcap --format {form} --out {name} --force"
        );
        let mut command = Command::new("sh");
        command.args(["-c", &line, crate::common::FREEPLAY]);
        let stopped = Call::of(ran.folder, command).run().expect(3);
        one_line(&stopped, &[&name, "an existing file is unchanged"]);
        assert_eq!(bytes(&stopped, &name), b"what was there before");
        assert_eq!(std::fs::read_dir(stopped.folder.path()).expect("a folder").count(), 4, "no other file");
    }
}
