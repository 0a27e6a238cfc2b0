//! No process outlives its run, at whatever moment a process ends the run, and whatever the controller does. SIGTERM and SIGHUP end a run in order. The run
//! reports at once a process that dies on its own, with its exit status.
//!
//! `FREEPLAY_KILLS=N` tests N moments of each sort instead of a few.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::common::{
    Call, FREEPLAY, Ran, Started, assert_recordings_open, fresh_folder, is_busy, left_in_shared_memory,
    processes_with, runs, send_signal, until,
};
use serde_json::Value;

/// A controller that ignores every signal that can be caught; a shell starts it, and it has started another process.
const DEAF: &str = "#!/bin/sh\ntrap '' TERM HUP INT\nsleep 1000 &\nwhile :; do sleep 1000; done\n";

/// The children of a killed run have to end within this time; time in which they run, or in which they or this test wait for a core or the disk, does not
/// count.
const LONGEST: Duration = Duration::from_millis(200);

fn moments() -> u32 {
    std::env::var("FREEPLAY_KILLS").ok().and_then(|count| count.parse().ok()).unwrap_or(3)
}

fn faulty() -> String {
    Path::new(FREEPLAY).with_file_name("examples").join("faulty").display().to_string()
}

/// An executable `text` in `folder`.
fn program(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file");
    std::fs::set_permissions(&path, Permissions::from_mode(0o755)).expect("a mode");
    path.display().to_string()
}

/// The living processes of the run in `shm`, from any parent.
fn members(shm: &Path) -> Vec<u32> {
    processes_with(&format!("FREEPLAY_SHM={}", shm.display()))
}

/// A run under `controller`, in lockstep, that outlasts a test.
fn long_run(controller: &str, folder: tempfile::TempDir) -> Call {
    let sets = ["--set", "patience=60", "--set", "duration=150", "--set", "pace=lockstep"];
    Call::new(folder, &[&["run", "--quiet", "--out", "out", "--controller", controller][..], &sets].concat())
        .env("FREEPLAY_FAULT", "pause@0")
        .env("FREEPLAY_RESUME", "never")
}

/// The controllers of these tests: one that answers, one that plans for ever, and one that ignores signals and has a child.
fn controllers(folder: &Path) -> [String; 3] {
    ["computed-torque".to_owned(), faulty(), program(folder, "deaf", DEAF)]
}

/// Time for which this thread was ready to run without a core.
fn waited() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("scheduler statistics");
    let waited = text.split_whitespace().nth(1).and_then(|text| text.parse().ok());
    Duration::from_nanos(waited.expect("the second number"))
}

/// Waits until no process of the run in `shm` lives. Returns the duration, and the part of it in which all of them slept while this test ran.
fn until_gone(shm: &Path) -> [Duration; 2] {
    let begun = Instant::now();
    let (mut last, mut waited_before, mut asleep) = (begun, waited(), Duration::ZERO);
    until("the end of all processes", || {
        let members = members(shm);
        let (now, waited) = (Instant::now(), waited());
        if !members.iter().any(|&pid| is_busy(pid)) {
            asleep += (now - last).saturating_sub(waited - waited_before);
        }
        (last, waited_before) = (now, waited);
        members.is_empty().then_some(())
    });
    [begun.elapsed(), asleep]
}

/// The run of `ran`, ended by a signal, may leave files that the next run removes.
fn assert_swept_by_the_next(ran: Ran) {
    let arguments =
        ["run", "--quiet", "--out", "out", "--controller", "computed-torque", "--set", "duration=0.02"];
    let pid = ran.pid;
    let next = Call::new(fresh_folder(), &arguments).sharing(ran.shm).run().expect(0);
    assert_eq!(left_in_shared_memory(next.shm.path(), pid), Vec::<PathBuf>::new());
}

fn after(moment: u32) -> Duration {
    // Prime steps, so that the moments fall on many steps of the start and of the loop.
    Duration::from_millis(u64::from(moment) * 97 % 700)
}

#[test]
fn a_killed_run_takes_all_its_processes_along_at_any_moment() {
    for which in 0..3 {
        let mut slowest = [Duration::ZERO; 2];
        for moment in 0..moments() {
            let folder = fresh_folder();
            let controller = controllers(folder.path())[which].clone();
            let run = long_run(&controller, folder).start();
            std::thread::sleep(after(moment * 3 + which as u32));
            run.signal("KILL");
            let shm = run.shm.path().to_owned();
            let took = until_gone(&shm);
            slowest = [slowest[0].max(took[0]), slowest[1].max(took[1])];
            assert!(took[1] < LONGEST, "{controller}: the last process was gone after {took:?}");
            let ran = run.wait();
            assert_recordings_open(&ran.out(), false);
            assert_swept_by_the_next(ran);
        }
        println!(
            "controller {which}: {} kills, all processes gone after at most {:?}, {:?} of it asleep",
            moments(),
            slowest[0],
            slowest[1]
        );
    }
}

/// True if this process was started with SIGHUP ignored.
fn ignores_hang_ups() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").expect("a process");
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).expect("a mask");
    u64::from_str_radix(ignored.trim(), 16).expect("a mask") & 1 != 0
}

#[test]
fn a_run_that_is_asked_to_end_does_so_in_order_at_any_moment() {
    for which in 0..3 {
        for moment in 0..moments() {
            let folder = fresh_folder();
            let controller = controllers(folder.path())[which].clone();
            let run = long_run(&controller, folder).start();
            // Until the program has read its arguments, the system's default action for the signal applies.
            let status = format!("/proc/{}/status", run.pid());
            run.until("handlers of signals", || {
                let text = std::fs::read_to_string(&status).ok()?;
                let caught = text.lines().find_map(|line| line.strip_prefix("SigCgt:"))?;
                (u64::from_str_radix(caught.trim(), 16).ok()? & (1 << 14) != 0).then_some(())
            });
            std::thread::sleep(after(moment * 3 + which as u32));
            // A test that ignores hang-ups, as under `nohup`, passes this on to its runs.
            let signals = if ignores_hang_ups() { ["TERM", "INT", "TERM"] } else { ["TERM", "HUP", "INT"] };
            let signal = signals[moment as usize % 3];
            run.signal(signal);
            let shm = run.shm.path().to_owned();
            let ran = run.wait().expect(130);
            // The system removes a killed child of a controller only after the run has ended.
            let took = until_gone(&shm);
            assert!(took[1] < LONGEST, "{signal} under {controller}: all were gone after {took:?}");
            assert_recordings_open(&ran.out(), true);
        }
    }
}

/// A run under strace, which writes the system calls to `trace`; `options` are those of strace.
fn traced(options: &[&str]) -> Call {
    // A background start of the tests may ignore hang-ups.
    let mut command = std::process::Command::new("env");
    command.args(["--default-signal=HUP", "strace", "-o", "trace", "-e", "trace=rt_sigaction"]);
    command.args(options).arg(FREEPLAY);
    command.args(["run", "--quiet", "--out", "out", "--controller", "computed-torque"]);
    command.args(["--set", "duration=0.02", "--set", "patience=60"]);
    Call::of(fresh_folder(), command)
}

/// The handler and its action are set in an order that leaves no moment at which a signal is lost.
#[test]
fn a_signal_at_the_moment_its_handler_is_set_ends_the_run() {
    let can = std::process::Command::new("strace").args(["-o", "/dev/null", "true"]).output();
    if !can.is_ok_and(|output| output.status.success()) {
        freeplay_skip::skip(freeplay_skip::Need::Strace, "there is no strace here, or it may not trace");
        return;
    }
    let ran = traced(&[]).run().expect(0);
    let trace = std::fs::read_to_string(ran.folder.path().join("trace")).expect("a trace");
    let calls = trace.lines().filter(|line| line.starts_with("rt_sigaction("));
    let handlers: Vec<(usize, &str)> = calls
        .enumerate()
        .filter_map(|(index, line)| {
            let signal =
                ["INT", "TERM", "HUP"].into_iter().find(|it| line.contains(&format!("(SIG{it}, {{")));
            Some((index + 1, signal?))
        })
        .collect();
    assert!(handlers.len() >= 3, "{trace}");
    for (when, signal) in handlers {
        let inject = format!("inject=rt_sigaction:signal=SIG{signal}:when={when}");
        let ran = traced(&["-e", &inject]).run();
        println!("SIG{signal} as its handler is set: {}", ran.output.status);
        assert_eq!(ran.output.status.code(), Some(130), "{}", ran.dump());
    }
}

#[test]
fn a_run_without_a_terminal_takes_no_notice_of_a_hang_up() {
    let folder = fresh_folder();
    let resume = folder.path().join("resume");
    let mut command = std::process::Command::new("sh");
    command.args(["-c", "trap '' HUP; exec \"$@\"", "sh", FREEPLAY, "run", "--quiet", "--out", "out"]);
    command.args(["--controller", &faulty(), "--set", "duration=0.1", "--set", "patience=60"]);
    let call = Call::of(folder, command);
    let run = call.env("FREEPLAY_FAULT", "pause@50+1").env("FREEPLAY_RESUME", &resume).start();
    run.until("the pause", || resume.with_extension("paused").exists().then_some(()));
    run.signal("HUP");
    send_signal(run.child_with("plant"), "HUP");
    std::fs::write(&resume, "").expect("the controller can be told");
    run.wait().expect(0);
}

/// A run under a controller in shell, `text`, with more `arguments`; the plant waits for it for a minute.
fn told_of(text: &str, arguments: &[&str]) -> (Ran, Duration) {
    let folder = fresh_folder();
    let controller = program(folder.path(), "dying", text);
    let begun = Instant::now();
    let all = ["run", "--quiet", "--out", "out", "--set", "patience=60", "--set", "duration=0.05"];
    let dying: Vec<&str> =
        arguments.iter().map(|it| if *it == "DYING" { &*controller } else { it }).collect();
    let ran = Call::new(folder, &[&all[..], &dying].concat()).run();
    (ran, begun.elapsed())
}

#[test]
fn a_controller_that_dies_before_it_joins_is_told_of_at_once() {
    for (text, how) in [
        ("#!/bin/sh\necho \"ModuleNotFoundError: No module named 'numpy'\" >&2\nexit 1\n", "exit code 1"),
        ("#!/bin/sh\necho \"ModuleNotFoundError: No module named 'numpy'\" >&2\nkill -9 $$\n", "signal: 9"),
        ("#!/bin/sh\necho \"ModuleNotFoundError: No module named 'numpy'\" >&2\n", "exit code 0"),
    ] {
        for arguments in
            [&["--controller", "DYING"][..], &["--controller", "computed-torque", "--standby", "DYING"]]
        {
            let (ran, took) = told_of(text, arguments);
            println!("{how}, {arguments:?}: told after {took:?}");
            let said = ran.expect(5).stderr();
            assert!(said.contains("No module named 'numpy'"), "{said}");
            assert!(said.contains("ended before it joined the run") && said.contains(how), "{said}");
            assert!(took < Duration::from_secs(30), "{took:?}, which is the patience");
        }
    }
}

/// Kills the child of `run` whose command line contains `word`.
fn kill_child(run: &Started, word: &str) {
    let pid = run.child_with(word);
    send_signal(pid, "KILL");
    until("its end", || (!runs(pid)).then_some(()));
}

#[test]
fn a_blind_set_outlives_a_killed_generator_and_a_killed_analyst() {
    // Quick cases: the machine with one axis.
    let places =
        ["blind", "--matrix", "--kind", "coulomb_friction", "--machine", "linear_axis", "--negative", "1"];
    let arguments = [&places[..], &["--seed", "6", "--jobs", "1", "--out", "out", "--quiet"]].concat();
    let run = Call::new(fresh_folder(), &arguments).start();
    // The first before it has begun, the second during its work.
    kill_child(&run, "blind-generate");
    let making = run.out().join("making");
    run.until("the first case", || std::fs::read_dir(&making).ok()?.next().map(drop));
    kill_child(&run, "blind-generate");
    kill_child(&run, "blind-analyst");
    let ran = run.wait();
    assert_eq!(ran.code(), 0, "{}", ran.dump());
    let text = std::fs::read_to_string(ran.out().join("receipt.json")).expect("a receipt");
    let receipt: Value = serde_json::from_str(&text).expect("JSON");
    let cases = receipt["cases"].as_object().expect("cases");
    let not_made = receipt["parts"][0]["not_made"].as_array().expect("a list");
    println!("{} cases, not made: {not_made:?}", cases.len());
    assert_eq!(cases.len() + not_made.len(), 4, "every case is accounted for");
    assert!((1..=2).contains(&not_made.len()), "{not_made:?}");
    assert!(not_made.iter().all(|why| why.as_str().is_some_and(|why| why.contains("killed"))));
    let failed: Vec<&Value> = cases.values().filter(|case| case["answer"]["verdict"] == "failed").collect();
    assert_eq!(failed.len(), 1, "{failed:?}");
    assert!(
        failed[0]["answer"]["statement"].as_str().is_some_and(|why| why.contains("signal: 9")),
        "{failed:?}"
    );
    let verified = Call::new(ran.folder, &["blind", "--verify", "out/receipt.json"]).run();
    assert_eq!(verified.code(), 0, "{}", verified.dump());
}
