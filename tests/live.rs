//! The live view of a run: its messages, its requests, and a run that is unaffected by it.

use std::fs::File;
use std::process::{Command, Stdio};

use crate::common::{Call, FREEPLAY, fresh_folder, lockstep};
use freeplay_shm::RunFolder;
use serde_json::Value;

#[test]
fn a_watched_run_without_a_terminal_tells_lines_and_moves_as_one_that_nobody_watches() {
    let settings = [
        "run",
        "--pace",
        "lockstep",
        "--controller",
        "computed-torque",
        "--set",
        "duration=0.6",
        "--out",
        "out",
    ];
    let run = |more: &[&str]| Call::new(fresh_folder(), &[&settings, more].concat()).run().expect(0);
    let (alone, watched) = (run(&["--quiet"]), run(&["--live"]));
    assert_eq!(alone.run()["state_hash"], watched.run()["state_hash"]);
    let told = watched.stderr();
    let line =
        told.lines().find(|line| line.contains("deviation")).unwrap_or_else(|| panic!("no line in {told:?}"));
    for part in [" s  deviation ", " mm (rms ", "joint_5 in ", "computed-torque active"] {
        assert!(line.contains(part), "{part:?} is not in {line:?}");
    }
    assert!(!told.contains('\u{1b}'), "no codes of a terminal where there is none: {told:?}");
}

#[test]
fn quiet_and_live_exclude_each_other() {
    let told = Call::new(fresh_folder(), &["run", "--live", "--quiet"]).run().expect(2).stderr();
    assert!(told.contains("--quiet"), "{told}");
}

/// The plant's process by itself, with requests on its standard input before the controllers join.
#[test]
fn operator_requests_are_heard_and_snapshots_sent() {
    let scenario = lockstep(0.3, &["--controller", "computed-torque", "--standby", "quasi-static"]).expect(0);
    let root = RunFolder::create().expect("shared memory");
    let address = root.address().to_string();
    let folder = fresh_folder();
    let requests = folder.path().join("requests");
    std::fs::write(&requests, "{\"swap\":{\"to\":1}}\n\"mark\"\nnonsense\n\"mark\"\n").expect("written");
    let files = scenario.out();
    let mut plant = Command::new(FREEPLAY);
    plant.args([
        "plant",
        "--live",
        "--run",
        &address,
        "--name",
        "watched",
        "--controller",
        "computed-torque",
    ]);
    plant.arg("--scenario").arg(files.join("scenario.toml")).arg("--task").arg(files.join("task.toml"));
    plant.arg("--out").arg(folder.path());
    let mut call = Call::of(folder, plant);
    call.command.stdin(File::open(&requests).expect("requests"));
    let plant = call.start();
    // The plant reads the queue at tick 0, which waits for the controllers.
    plant.until("a request that is none", || {
        std::fs::read_to_string(plant.folder.path().join("stderr"))
            .ok()
            .filter(|told| told.contains("nonsense"))
    });
    let controller = |name: &str, slot: &str| {
        let mut command = Command::new(FREEPLAY);
        command.args(["controller", name]).env("FREEPLAY_RUN", &address).env("FREEPLAY_SLOT", slot);
        command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().expect("it starts")
    };
    let mut controllers = [controller("computed-torque", "0"), controller("quasi-static", "1")];
    let ran = plant.wait().expect(0);
    controllers.iter_mut().for_each(|controller| drop(controller.wait()));

    let folder = ran.folder.path();
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("watched.json")).expect("a summary"))
            .expect("JSON");
    let swaps = summary["line_up"]["swaps"].as_array().expect("swaps");
    assert_eq!(swaps.len(), 1, "{swaps:?}");
    assert_eq!(
        (&swaps[0]["to"], &swaps[0]["cause"]),
        (&Value::from("quasi-static"), &Value::from("planned"))
    );
    let recording = freeplay_recording::read(&folder.join("watched.mcap"), None).expect("a recording");
    let marks = recording.column("marks").expect("marks");
    assert_eq!(marks.last(), Some(&2.0), "both marks, in spite of the line between them");
    let snapshots: Vec<Value> =
        ran.stdout().lines().map(|line| serde_json::from_str(line).expect("a glance")).collect();
    let last = snapshots.last().expect("a glance");
    assert_eq!(last["tick"], Value::from(299), "the last snapshot is of the last tick");
    assert_eq!(last["in_charge"], Value::from(1));
    let traced: usize =
        snapshots.iter().map(|snapshot| snapshot["trace"].as_array().map_or(0, Vec::len)).sum();
    assert_eq!(traced, 30, "a point every ten ticks, each told once");
}

/// The value of `field` in kB from the status of the process `pid`; `None` if the process has ended.
fn kilobytes(pid: u32, field: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let value = status.lines().find_map(|line| line.strip_prefix(field)?.strip_prefix(':'))?;
    value.trim().strip_suffix(" kB")?.parse().ok()
}

/// The allocator takes 1 GiB of address space at a time. A process that locks its memory does not fill all of it with pages.
#[test]
fn a_process_that_locks_its_memory_stays_small() {
    let settings =
        ["--set", "realtime.lock_memory=true", "--set", "realtime.priority=0", "--set", "duration=1"];
    let command = ["run", "--pace", "realtime", "--controller", "computed-torque", "--quiet", "--out", "out"];
    let started = Call::new(fresh_folder(), &[&command[..], &settings[..]].concat()).start();
    let plant = started.child_with("plant");
    let (mut locked, mut peak) = (0, 0);
    while let Some(now) = kilobytes(plant, "VmHWM") {
        peak = peak.max(now);
        locked = locked.max(kilobytes(plant, "VmLck").unwrap_or(0));
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    println!("locked {locked} kB, resident at most {peak} kB");
    if locked == 0 {
        freeplay_skip::skip(freeplay_skip::Need::Root, "locking memory takes root");
        return;
    }
    assert!(peak < 512 << 10, "{peak} kB are resident");
}
