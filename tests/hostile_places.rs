//! Hostile acts of another user on shared places: opening files in shared memory gives no hold on a run, full shared memory ends a run in order, and a run
//! reports a results folder that others can change.
//!
//! The cases of another user need root, and report when they are skipped.

mod common;

use std::fs::{self, OpenOptions, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use common::{Call, OWN_SHM_ENV, fresh_folder, in_own_shared_memory, until};
use freeplay_shm::RunFolder;

const SHM: &str = "/dev/shm";

/// Another user: nobody.
const OTHER: u32 = 65_534;

/// Marks the process of the other user, and gives the path for its report.
const INTRUDER_ENV: &str = "FREEPLAY_TEST_INTRUDER";

const RUN: [&str; 11] = [
    "run",
    "--quiet",
    "--force",
    "--out",
    "out",
    "--controller",
    "computed-torque",
    "--set",
    "duration=0.02",
    "--set",
    "patience=60",
];

fn shm(name: &str) -> PathBuf {
    Path::new(SHM).join(name)
}

/// Files of runs in shared memory.
fn left() -> Vec<PathBuf> {
    let entries = fs::read_dir(SHM).expect("shared memory").flatten().map(|entry| entry.path());
    entries.filter(|path| path.to_string_lossy().contains("freeplay-")).collect()
}

/// The other user's process: opens every file of runs that it may write to, truncates it, and writes to it, until it is killed.
#[test]
#[ignore = "a role of another test"]
fn intruder() {
    let Some(told) = std::env::var_os(INTRUDER_ENV).map(PathBuf::from) else { return };
    let mut held = Vec::new();
    fs::write(told.join("ready"), "").expect("told");
    loop {
        for entry in fs::read_dir(SHM).expect("shared memory").flatten() {
            if entry.file_name().to_string_lossy().starts_with("freeplay-")
                && let Ok(file) = OpenOptions::new().read(true).write(true).open(entry.path())
            {
                held.push(file);
                fs::write(told.join("opened"), held.len().to_string()).expect("told");
            }
        }
        // A file that it holds does not belong to a finished set-up of a run.
        for file in &held {
            if file.metadata().is_ok_and(|found| found.nlink() > 0 && found.mode() & 0o077 == 0) {
                fs::write(told.join("holds"), format!("{file:?}")).expect("told");
            }
        }
    }
}

/// Starts [`intruder`] as another user; `None` if this process may not.
fn start_intruder(told: &Path) -> Option<Child> {
    let program = told.join("intruder");
    fs::copy(std::env::current_exe().expect("this test has a path"), &program).expect("copied");
    if chown(told, Some(OTHER), Some(OTHER)).is_err() {
        freeplay_skip::skip(freeplay_skip::Need::Root, "another user's process takes root");
        return None;
    }
    let mut command = Command::new("setpriv");
    command.args([&format!("--reuid={OTHER}"), &format!("--regid={OTHER}"), "--clear-groups"]).arg(&program);
    command.args(["intruder", "--exact", "--include-ignored"]).env(INTRUDER_ENV, told);
    let child =
        command.current_dir(told).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let Ok(mut child) = child else {
        freeplay_skip::skip(freeplay_skip::Need::Root, "another user's process takes setpriv");
        return None;
    };
    let is_ready =
        || (told.join("ready").exists() || child.try_wait().is_ok_and(|it| it.is_some())).then_some(());
    until("the intruder", is_ready);
    told.join("ready").exists().then_some(child)
}

#[test]
fn who_opens_what_appears_in_shared_memory_gets_no_hold_on_a_run() {
    if !in_own_shared_memory("who_opens_what_appears_in_shared_memory_gets_no_hold_on_a_run") {
        return;
    }
    let told = tempfile::Builder::new()
        .permissions(Permissions::from_mode(0o755))
        .tempdir_in("/tmp")
        .expect("a folder");
    let Some(mut intruder) = start_intruder(told.path()) else { return };
    let (mut made, mut runs) = (0, 0);
    for _ in 0..200 {
        // The run refuses a segment that was truncated in time; the next run has another name.
        match RunFolder::create() {
            Ok(_) => made += 1,
            Err(error) => assert!(error.to_string().contains("interferes"), "{error}"),
        }
    }
    for _ in 0..3 {
        let mut call = Call::new(fresh_folder(), &RUN);
        call.command.env_remove("FREEPLAY_SHM");
        let ran = call.run();
        assert!(ran.code() == 0 || ran.stderr().contains("interferes"), "{}", ran.dump());
        runs += usize::from(ran.code() == 0);
    }
    intruder.kill().expect("killed");
    intruder.wait().expect("a child");
    let opened = fs::read_to_string(told.path().join("opened")).unwrap_or_default();
    println!("{made} of 200 runs made and {runs} of 3 played, while another user opened {opened:?} segments");
    assert!(made > 0, "another user keeps every run from being made");
    let holds = fs::read_to_string(told.path().join("holds"));
    assert!(holds.is_err(), "another user has a segment of a run open: {holds:?}");
    assert_eq!(left(), Vec::<PathBuf>::new());
}

#[test]
fn shared_memory_that_is_full_ends_a_run_in_order() {
    if !in_own_shared_memory("shared_memory_that_is_full_ends_a_run_in_order") {
        return;
    }
    if std::env::var_os(OWN_SHM_ENV).is_none() {
        freeplay_skip::skip(freeplay_skip::Need::Namespace, "the shared memory of all stays as it is");
        return;
    }
    let good = Call::new(fresh_folder(), &RUN).run().expect(0);
    let summary = fs::read(good.out().join("summary.json")).expect("a summary");
    let mut folder = good.folder;
    let mut codes = Vec::new();
    for kib in [0, 4, 16, 64, 256, 1024, 4096, 8000, 8192, 8400, 9000, 10_000, 16_000] {
        // Another user has filled all but this amount of it.
        let remounted =
            Command::new("mount").args(["-o", &format!("remount,size={}k", kib.max(4)), SHM]).output();
        if !remounted.is_ok_and(|output| output.status.success()) {
            freeplay_skip::skip(freeplay_skip::Need::Root, "a small shared memory takes root");
            return;
        }
        let ballast = shm("ballast");
        if kib == 0 {
            let _ = fs::write(&ballast, vec![1; 4096]);
        }
        let mut call = Call::new(folder, &RUN);
        call.command.env_remove("FREEPLAY_SHM").env_remove("RUST_BACKTRACE");
        let ran = call.run();
        let code =
            ran.output.status.code().unwrap_or_else(|| panic!("killed with {kib} KiB: {}", ran.dump()));
        assert!([0, 3, 70].contains(&code), "{kib} KiB: {}", ran.dump());
        let told = ran.stderr().lines().filter(|line| line.starts_with("freeplay: ")).count();
        assert!(code == 0 || (1..=3).contains(&told), "{kib} KiB: {}", ran.dump());
        assert!(!ran.stderr().contains("panicked"), "{kib} KiB: {}", ran.dump());
        let now = fs::read(ran.out().join("summary.json")).expect("a summary");
        assert!(code == 0 || now == summary, "{kib} KiB: {}", ran.dump());
        until("nothing in shared memory", || left().is_empty().then_some(()));
        codes.push((kib, code));
        let _ = fs::remove_file(&ballast);
        fs::write(ran.out().join("summary.json"), &summary).expect("a file");
        folder = ran.folder;
    }
    println!("KiB of shared memory and exit code: {codes:?}");
    assert!(codes.iter().any(|(_, code)| *code != 0), "no limit was felt");
}

#[test]
fn results_in_a_folder_that_others_can_change_are_told_of() {
    let note = |mode: u32, owner: Option<u32>| {
        let folder = fresh_folder();
        let out = folder.path().join("out");
        fs::create_dir(&out).expect("a folder");
        fs::set_permissions(&out, Permissions::from_mode(mode)).expect("a mode");
        if chown(&out, owner, None).is_err() {
            freeplay_skip::skip(freeplay_skip::Need::Root, "a folder of another user takes root");
            return None;
        }
        let arguments: Vec<&str> = RUN.into_iter().filter(|word| *word != "--quiet").collect();
        let ran = Call::new(folder, &arguments).run().expect(0);
        Some(ran.stderr().contains("can replace files in"))
    };
    assert_eq!(note(0o755, None), Some(false));
    assert_eq!(note(0o777, None), Some(true));
    assert!(note(0o755, Some(OTHER)).is_none_or(|is_told| is_told));
}
