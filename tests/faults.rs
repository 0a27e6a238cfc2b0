//! Effect of a faulty controller, a killed process or a signal on a run of the real binary: no command that could hurt an arm, a message, the documented exit
//! code, a readable recording, and empty shared memory.
//!
//! The faults are played by `tests/controllers/faulty.rs`.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::Duration;

use crate::common::{
    Call, FREEPLAY, Ran, Started, freeplay, fresh_folder, left_in_shared_memory, runs, send_signal, until,
};
use freeplay_recording::Recording;
use freeplay_shm::RunFolder;
use serde_json::{Value, json};

/// The gate holds the last good command for so many ticks.
const HOLD: u64 = 20;
/// Codes of the column `in_force`.
const HELD: f64 = 2.0;
const BRAKED: f64 = 3.0;
/// Names of the gate's counts.
const COUNTS: [&str; 7] =
    ["missing", "malformed", "stale", "no_answer", "not_finite", "out_of_range", "too_fast"];

/// The executable of the faulty controller.
fn faulty() -> String {
    let test = std::env::current_exe().expect("this test has a path");
    let folder = test.ancestors().nth(2).expect("target/<profile>/deps/test");
    let path = folder.join("examples/faulty");
    assert!(path.is_file(), "build it first: cargo build -p freeplay --example faulty");
    path.display().to_string()
}

/// A run under the faulty controller with `fault`, with more `arguments`: lockstep, 0.3 s of a path that soon moves the arm fast.
fn under(fault: &str, arguments: &[&str]) -> Call {
    let faulty = faulty();
    let mut all = vec!["run", "--quiet", "--out", "out", "--controller", &faulty];
    all.extend(["--set", "pace=lockstep", "--set", "duration=0.3", "--set", "path.period=2"]);
    // A busy machine starts processes late.
    all.extend(["--set", "patience=60"]);
    all.extend(arguments);
    Call::new(fresh_folder(), &all).env("FREEPLAY_FAULT", fault)
}

/// The same run under the same controller without a fault.
fn state_hash_of_a_good_run() -> Value {
    under("none", &[]).run().expect(0).run()["state_hash"].clone()
}

fn column<'a>(recording: &'a Recording, name: &str) -> &'a [f64] {
    recording.column(name).unwrap_or_else(|| panic!("no column {name}"))
}

/// Fails unless all applied commands were within the limits of the paper's arm, holds were no longer than allowed and closed brakes stayed closed with the arm
/// standing still. Returns the greatest joint speed before the brakes closed.
fn assert_safe(recording: &Recording, driven: bool) -> f64 {
    let arm = freeplay_model::paper_arm().arm;
    for (index, joint) in arm.joints().iter().enumerate() {
        let limits = &joint.limits;
        let (lower, upper) =
            if driven { (limits.lower, limits.upper) } else { (-limits.effort, limits.effort) };
        let applied = column(recording, &format!("applied_{}", index + 1));
        let bad = applied.iter().find(|value| !(lower..=upper).contains(*value));
        assert_eq!(bad, None, "applied to {} within {lower} to {upper}", joint.name);
    }
    let in_force = column(recording, "in_force");
    let mut held = 0;
    for (tick, &what) in in_force.iter().enumerate() {
        assert!((0.0..=BRAKED).contains(&what), "in force at tick {tick}: {what}");
        assert!(
            tick == 0 || in_force[tick - 1] != BRAKED || what == BRAKED,
            "the brakes opened at tick {tick}"
        );
        held = if what == HELD { held + 1 } else { 0 };
        assert!(held <= HOLD, "held for {held} ticks at tick {tick}");
    }
    let braked = in_force.iter().position(|&what| what == BRAKED).unwrap_or(in_force.len());
    let mut fastest = 0.0_f64;
    for joint in 1..=arm.dof() {
        let (q, qd) = (column(recording, &format!("q{joint}")), column(recording, &format!("qd{joint}")));
        assert!(q.iter().chain(qd).all(|value| value.is_finite()), "joint {joint} stays finite");
        fastest = qd[..braked].iter().fold(fastest, |most, value| most.max(value.abs()));
        if braked < in_force.len() {
            let last = q.len() - 1;
            assert!(qd[last].abs() < 1e-9, "joint {joint} moves at {} at the end", qd[last]);
            assert!(
                (q[last] - q[last - 20]).abs() < 1e-9,
                "joint {joint} stands still for the last 20 ticks"
            );
        }
    }
    fastest
}

/// Fails unless the run's counts are `expected` and no others.
fn assert_counts(run: &Value, expected: &[(&str, u64)]) {
    for name in COUNTS {
        let count = expected.iter().find(|(of, _)| *of == name).map_or(0, |(_, count)| *count);
        assert_eq!(run["gate"]["rejected"][name], count, "{name}: {:#}", run["gate"]);
    }
}

/// The only run's recording.
fn recording(ran: &Ran) -> Recording {
    ran.recording("faulty.mcap")
}

/// Each fault of a command: its name in `FREEPLAY_FAULT`, the mode, and the name of the gate's count.
const COMMAND_FAULTS: [(&str, &str, &str); 23] = [
    ("nan", "torque", "not_finite"),
    ("nan", "driven", "not_finite"),
    ("infinite", "torque", "not_finite"),
    ("infinite", "driven", "not_finite"),
    ("nan_velocity", "torque", "not_finite"),
    ("nan_velocity", "driven", "not_finite"),
    ("huge", "torque", "out_of_range"),
    ("huge", "driven", "out_of_range"),
    ("jump", "driven", "too_fast"),
    ("speeding", "driven", "too_fast"),
    ("jolting", "driven", "too_fast"),
    ("early", "torque", "stale"),
    ("other_run", "torque", "malformed"),
    ("other_magic", "torque", "malformed"),
    ("other_version", "torque", "malformed"),
    ("more_joints", "torque", "malformed"),
    ("other_kind", "torque", "malformed"),
    ("other_kind", "driven", "malformed"),
    ("no_answer", "torque", "no_answer"),
    ("other_slot", "torque", "malformed"),
    ("other_status", "driven", "malformed"),
    ("nan_deviation", "torque", "not_finite"),
    ("nan_unused", "driven", "not_finite"),
];

/// Plays some of [`COMMAND_FAULTS`]: the gate bridges five bad commands, lasting ones close the brakes.
fn play_command_faults(cases: &[(&str, &str, &str)]) {
    for &(fault, mode, count) in cases {
        let ran = under(&format!("{fault}@150+5,200"), &["--set", &format!("mode={mode}")]).run().expect(1);
        let run = ran.run();
        println!("{mode}, {fault}: {count} {}", run["gate"]["rejected"][count]);
        assert_counts(&run, &[(count, 5 + HOLD + 1)]);
        assert_eq!(run["ending"], json!({ "braked": { "tick": 200 + HOLD, "reason": count } }));
        assert_eq!((&run["ticks"], &run["deadlines"]["missed"]), (&json!(300), &json!(0)));
        assert!(ran.stdout().contains("the brakes closed at tick 220"), "{}", ran.dump());
        let recording = recording(&ran);
        assert_eq!(recording.len(), 300);
        let held = column(&recording, "in_force").iter().filter(|&&what| what == HELD).count();
        assert_eq!(held as u64, 5 + HOLD, "{mode}, {fault}");
        let fastest = assert_safe(&recording, mode == "driven");
        assert!(fastest > 0.1, "the arm moved before the brakes closed: {fastest} rad/s");
    }
}

#[test]
fn bad_commands_are_counted_by_name_and_never_applied() {
    play_command_faults(&COMMAND_FAULTS[..8]);
}

#[test]
fn commands_that_do_not_belong_are_counted_by_name_and_never_applied() {
    play_command_faults(&COMMAND_FAULTS[8..]);
}

#[test]
fn a_few_bad_commands_do_not_fail_a_run() {
    let ran = under("nan@50+3,100+4", &[]).run().expect(0);
    assert_counts(&ran.run(), &[("not_finite", 7)]);
    assert_eq!(ran.run()["ending"], "finished");
    assert!(
        ran.stdout().contains("commands that the gate refused, by reason: not finite 7"),
        "{}",
        ran.dump()
    );
    assert_safe(&recording(&ran), false);
}

#[test]
fn torques_that_jump_are_counted_one_by_one() {
    let ran = under("jump@50+1,60+1,70+1", &[]).run().expect(0);
    assert_counts(&ran.run(), &[("too_fast", 3)]);
    assert_safe(&recording(&ran), false);
}

#[test]
fn a_motion_that_cannot_be_integrated_fails_the_run_and_keeps_its_recording() {
    // An arm without limits lets every finite torque pass.
    let link = |name| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
            <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
        )
    };
    let joint = |name, parent, child| {
        format!(
            r#"<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
            <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/></joint>"#
        )
    };
    let (upper, fore) = (link("upper"), link("fore"));
    let joints = joint("shoulder", "base", "upper") + &joint("elbow", "upper", "fore");
    let urdf = format!(r#"<robot name="free"><link name="base"/>{upper}{fore}{joints}</robot>"#);
    let call = under("huge@100", &["--model", "free.urdf", "--set", "path.kind=joint_sine"]);
    std::fs::write(call.folder.path().join("free.urdf"), urdf).expect("written");
    let ran = call.run().expect(1);
    assert!(ran.stdout().contains("coordinate shoulder is not finite at t = 0.10"), "{}", ran.dump());
    assert_eq!(ran.run()["ending"], json!({ "diverged": { "tick": 101 } }));
    let recording = recording(&ran);
    assert_eq!(recording.len(), 101);
    assert!(column(&recording, "applied_1").iter().all(|value| value.is_finite()));
}

#[test]
fn a_command_sent_twice_changes_nothing() {
    let ran = under("twice", &[]).run().expect(0);
    let run = ran.run();
    assert_eq!(run["state_hash"], state_hash_of_a_good_run());
    assert_counts(&run, &[]);
    assert!(run["deadlines"]["late"].as_u64() > Some(200), "{}", run["deadlines"]);
}

#[test]
fn a_controller_that_dies_or_hangs_leaves_a_braked_arm() {
    // Fault, tick at which the brakes close, and the message.
    let cases = [
        ("abort@0", 0, "ended before the run did (signal: 6"),
        ("abort@200", 200 + HOLD, "ended before the run did (signal: 6"),
        ("kill@200", 200 + HOLD, "ended before the run did (signal: 9"),
        ("exit@200", 200 + HOLD, "did not answer in time"),
        ("stop@200", 200 + HOLD, "did not answer in time"),
        ("sleep@200", 200 + HOLD, "did not answer in time"),
        ("stale@200", 200 + HOLD, "did not answer in time"),
    ];
    for (fault, tick, said) in cases {
        let ran = under(fault, &["--set", "patience=1"]).run().expect(5);
        let run = ran.run();
        println!("{fault}: {}", ran.stderr().trim());
        assert!(ran.stderr().contains(said), "{fault}: {}", ran.dump());
        assert_eq!(run["ending"], json!({ "braked": { "tick": tick, "reason": "missing" } }), "{fault}");
        assert_counts(&run, &[("missing", if tick == 0 { 1 } else { HOLD + 1 })]);
        let recording = recording(&ran);
        assert_eq!(recording.len(), 300, "the run is played to its end");
        assert_safe(&recording, false);
    }
}

/// A controller that does not start cannot be killed: the exam reports this at once, with the exit code of the run.
#[test]
fn runs_whose_controller_never_starts_are_not_killed() {
    for (fault, code, said) in
        [("leave", 5, "ended before it joined the run (exit code 7)"), ("other_arm", 3, "WrongJoints")]
    {
        let arguments = ["faults", &faulty(), "--kills", "1000", "--out", "out"];
        let ran = Call::new(fresh_folder(), &arguments).env("FREEPLAY_FAULT", fault).run().expect(code);
        for words in [said, "so no run was killed"] {
            assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
        }
        assert!(!ran.out().join("kills.json").exists());
    }
}

/// A controller whose commands stop the arm by themselves cannot be examined: here it sends positions although the run requires torques.
#[test]
fn a_controller_that_stops_the_arm_alone_is_not_examined() {
    let team = [&faulty(), "computed-torque"];
    let cases = [
        vec!["faults", team[0], "--kind", "nan", "--seeds", "1"],
        vec!["swap", "--controller", team[0], "--controller", team[1], "--swaps", "2", "--per-run", "2"],
    ];
    for case in cases {
        let ran = Call::new(fresh_folder(), &[&case[..], &["--out", "out"]].concat())
            .env("FREEPLAY_FAULT", "positions")
            .run()
            .expect(1);
        for words in ["faulty alone: the arm was stopped at tick", "mode torque", "--set mode=driven"] {
            assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
        }
    }
}

#[test]
fn a_controller_that_never_comes_is_told_by_name() {
    let faulty = faulty();
    let text = fresh_folder();
    let (plain, broken) = (text.path().join("plain"), text.path().join("broken"));
    for path in [&plain, &broken] {
        std::fs::write(path, "#!/no/such/interpreter\n").expect("written");
    }
    allow_execution(&broken);
    let (plain, broken) = (plain.display().to_string(), broken.display().to_string());
    // Controller, its fault, exit code, and the messages.
    let cases: [(&str, &str, i32, &[&str]); 8] = [
        ("nobody", "", 2, &["no controller \"nobody\"", "computed-torque", "give the path"]),
        ("./nobody", "", 3, &["controller ./nobody", "executable does not exist"]),
        (&plain, "", 3, &["plain", "not executable", "chmod +x"]),
        (&broken, "", 5, &["cannot start the controller", "broken", "ended before it joined the run"]),
        (
            &faulty,
            "leave",
            5,
            &["its process ended before it joined", "ended before it joined the run (exit code 7)"],
        ),
        (&faulty, "mute", 5, &["no controller came within 2s", "did not answer in time"]),
        (
            &faulty,
            "other_layout",
            3,
            &["it speaks layout 2", "the plant speaks layout 1", "build both from one version"],
        ),
        (&faulty, "other_arm", 3, &["made for 7 joints, the arm has 6", "refused: faulty: WrongJoints"]),
    ];
    let play = |&(controller, fault, code, said): &(&str, &str, i32, &[&str])| {
        let arguments = ["--controller", controller, "--set", "patience=2"];
        let ran = Call::lockstep(0.1, &arguments).env("FREEPLAY_FAULT", fault).run().expect(code);
        println!("{controller} {fault}: {}", ran.stderr().trim());
        for words in said {
            assert!(ran.stderr().contains(words), "{fault}: {words:?} is not said: {}", ran.dump());
        }
        assert!(!ran.out().exists(), "{fault}: a second try finds the folder taken: {}", ran.dump());
    };
    // The cases wait most of the time, so that they run in parallel.
    thread::scope(|scope| {
        for case in &cases {
            scope.spawn(move || play(case));
        }
    });
}

fn allow_execution(path: &Path) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o700)).expect("allowed");
}

#[test]
fn in_real_time_late_and_dead_controllers_are_counted() {
    for (fault, codes) in [("late@50", [5, 5]), ("kill@50", [5, 5]), ("nan@50", [1, 5])] {
        let ran = under(fault, &["--set", "pace=realtime"]).run();
        assert!(codes.contains(&ran.code()), "{fault}: {}", ran.dump());
        assert_eq!(ran.left_in_shared_memory(), Vec::<PathBuf>::new());
        let run = ran.run();
        println!("{fault}: {} {}", run["deadlines"], run["gate"]["rejected"]);
        let count = |value: &Value| value.as_u64().expect("a count");
        let rejected: u64 = COUNTS.iter().map(|name| count(&run["gate"]["rejected"][*name])).sum();
        assert!(rejected > HOLD, "{fault}: {rejected} rejected");
        if fault == "late@50" {
            assert!(count(&run["deadlines"]["missed"]) > HOLD);
            // On a busy machine the controller may not have answered at all, or the run may have ended before the fault.
            let starved = run["deadlines"]["by_evidence"]["scheduler"].as_u64().unwrap_or(0);
            let before = count(&run["ticks"]) < 50 + HOLD;
            assert!(count(&run["deadlines"]["late"]) >= 1 || starved > HOLD || before);
        }
        assert_safe(&recording(&ran), false);
    }
}

/// Waits until the first quarter of a second of the motion is in the recording.
fn until_recorded(run: &Started) {
    let path = run.out().join("faulty.mcap");
    run.until("the recording", || freeplay_recording::read(&path, None).ok());
}

#[test]
fn a_second_controller_is_refused_and_does_no_harm() {
    let call = under("pause@50+1", &["--set", "patience=60"]);
    let resume = call.folder.path().join("resume");
    let run = call.env("FREEPLAY_RESUME", &resume).start();
    run.until("the pause", || resume.with_extension("paused").exists().then_some(()));
    let address = run.address();
    let nodes = || {
        let entries =
            std::fs::read_dir(Path::new(&address).join("nodes")).expect("iceoryx2's folder of nodes");
        entries.flatten().filter(|entry| entry.path().is_dir()).count()
    };
    assert_eq!(nodes(), 2, "plant and controller");
    let second = Call::new(fresh_folder(), &["controller", "computed-torque", "--run", &address]).start();
    second.until("the second controller", || (nodes() == 3).then_some(()));
    // The second controller asks to join as soon as it can; the plant checks for new processes every 128 ticks.
    thread::sleep(Duration::from_millis(300));
    std::fs::write(resume, "").expect("written");
    let second = second.wait().expect(3);
    println!("{}", second.stderr().trim());
    assert!(
        second.stderr().contains("slot 0 is held by another controller: end that one"),
        "{}",
        second.dump()
    );
    let ran = run.wait().expect(0);
    let summary = ran.run();
    assert_counts(&summary, &[]);
    assert!(
        summary["notes"].to_string().contains("refused: computed-torque: SlotTaken"),
        "{}",
        summary["notes"]
    );
    assert_eq!(summary["state_hash"], state_hash_of_a_good_run());
    assert_safe(&recording(&ran), false);
}

#[test]
fn a_killed_plant_ends_the_run_and_the_next_one_starts_clean() {
    let run = under("sleep@280", &["--set", "patience=60"]).start();
    until_recorded(&run);
    send_signal(run.child_with("plant"), "KILL");
    let ran = run.wait().expect(70);
    assert!(ran.stderr().contains("the plant failed: signal: 9"), "{}", ran.dump());
    let recording = recording(&ran);
    assert!(recording.truncated && recording.len() >= 250, "{} ticks", recording.len());
    assert_safe(&recording, false);
    under("none", &[]).run().expect(0);
}

#[test]
fn a_controller_whose_plant_is_killed_ends_by_itself() {
    let made = under("none", &["--set", "path.period=6"]).run().expect(0);
    let scenario = std::fs::read_to_string(made.out().join("scenario.toml")).expect("a scenario");
    std::fs::write(made.out().join("long.toml"), scenario.replace("duration = 0.3", "duration = 6.0"))
        .expect("written");
    let root = RunFolder::create().expect("a run");
    let address = root.address().to_string();
    let mut plant = Command::new(FREEPLAY);
    plant.args(["plant", "--run", &address, "--name", "plant", "--scenario", "long.toml"]);
    plant.arg("--task").arg(made.out().join("task.toml")).args(["--out", "."]).current_dir(made.out());
    let mut plant = plant.spawn().expect("a plant");
    let controller = Call::new(fresh_folder(), &["controller", "computed-torque", "--run", &address]).start();
    let recording = made.out().join("plant.mcap");
    controller.until("the recording", || freeplay_recording::read(&recording, None).ok());
    plant.kill().expect("killed");
    plant.wait().expect("gone");
    let controller = controller.wait().expect(5);
    println!("{}", controller.stderr().trim());
    assert!(controller.stderr().contains("the plant is gone"), "{}", controller.dump());
    drop(root);
    assert_eq!(left_in_shared_memory(controller.shm.path(), std::process::id()), Vec::<PathBuf>::new());
}

#[test]
fn a_signal_closes_the_recording_and_keeps_the_summary() {
    // Signal, flag for the whole group as from a terminal, and the controller's fault meanwhile.
    for (signal, to_group, fault) in
        [("INT", true, "none"), ("TERM", false, "none"), ("INT", false, "stop@270")]
    {
        let mut call =
            under(fault, &["--set", "patience=60", "--set", "path.period=6", "--set", "duration=6"]);
        std::os::unix::process::CommandExt::process_group(&mut call.command, 0);
        let run = call.start();
        until_recorded(&run);
        if to_group {
            let group = format!("-{}", run.pid());
            Command::new("kill").args(["-s", signal, "--", &group]).status().expect("kill");
        } else {
            run.signal(signal);
        }
        let ran = run.wait().expect(130);
        let (run, recording) = (ran.run(), recording(&ran));
        println!("SIG{signal}, {fault}: {} ticks", recording.len());
        assert_eq!(run["ending"], json!({ "interrupted": { "tick": recording.len() } }));
        assert!(!recording.truncated && (250..6000).contains(&recording.len()), "{} ticks", recording.len());
        assert!(ran.stdout().contains("interrupted"), "{}", ran.dump());
        assert_safe(&recording, false);
    }
}

#[test]
fn a_signal_while_nobody_has_come_ends_the_run() {
    let run = under("mute", &["--set", "patience=60"]).start();
    run.child_with("plant");
    run.until("the controller", || Path::new(&run.out().join("faulty.mcap")).exists().then_some(()));
    run.signal("TERM");
    let ran = run.wait().expect(130);
    assert_eq!(ran.run()["ending"], json!({ "interrupted": { "tick": 0 } }));
}

/// A run of six seconds under `fault` with a quarter of a second recorded, and the ids of plant and controller.
fn started(fault: &str) -> (Started, [u32; 2]) {
    let arguments = ["--set", "patience=60", "--set", "path.period=6", "--set", "duration=6"];
    let run = under(fault, &arguments).start();
    until_recorded(&run);
    let children = [run.child_with("plant"), run.child_with(&faulty())];
    (run, children)
}

#[test]
fn a_killed_run_takes_its_children_along_and_leaves_nothing() {
    for fault in ["none", "sleep@270"] {
        let (run, children) = started(fault);
        run.signal("KILL");
        let ran = run.wait();
        until("the end of its children", || children.iter().all(|&child| !runs(child)).then_some(()));
        assert_eq!(ran.left_in_shared_memory(), Vec::<PathBuf>::new(), "{fault}");
        let recording = recording(&ran);
        println!("{fault}: {} ticks", recording.len());
        assert!(recording.len() >= 250 && !recording.truncated);
        assert_safe(&recording, false);
    }
}

#[test]
fn what_is_left_when_all_processes_are_killed_at_once_is_swept_by_the_next_run() {
    let (run, [plant, controller]) = started("sleep@270");
    // The parent first, stopped, so that it cannot clean up after its children.
    run.signal("STOP");
    send_signal(plant, "KILL");
    send_signal(controller, "KILL");
    run.signal("KILL");
    let ran = run.wait();
    until("the end of all", || [plant, controller].iter().all(|&child| !runs(child)).then_some(()));
    let left = ran.left_in_shared_memory().len();
    assert!(left > 0, "kill -9 leaves nothing: this tests nothing");
    let recording = recording(&ran);
    println!("{left} things left, {} ticks recorded", recording.len());
    assert!(recording.len() >= 250 && recording.truncated);
    assert_safe(&recording, false);
    let next = under("none", &[]).sharing(ran.shm).run().expect(0);
    assert_eq!(left_in_shared_memory(next.shm.path(), ran.pid), Vec::<PathBuf>::new());
}

/// The exam of `quasi-static` with one fault of each of `kinds`; the slowest detection of each, in ticks.
fn examined(kinds: &[&str]) -> (Ran, Vec<Value>) {
    examined_with(kinds, &["--seeds", "1"])
}

/// The same with more `arguments`.
fn examined_with(kinds: &[&str], more: &[&str]) -> (Ran, Vec<Value>) {
    let mut arguments = vec!["faults", "quasi-static", "--out", "out", "--quiet"];
    arguments.extend(more);
    kinds.iter().for_each(|kind| arguments.extend(["--kind", kind]));
    let ran = Call::new(fresh_folder(), &arguments).run().expect(0);
    let text = std::fs::read_to_string(ran.out().join("faults.json")).expect("written");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    let verdicts = result["verdicts"].as_array().expect("verdicts");
    assert_eq!(verdicts.len(), kinds.len());
    for verdict in verdicts {
        println!("{}: {} {}", verdict["kind"], verdict["slowest"], verdict["applied"]);
        assert_eq!((&verdict["holds"], &verdict["bad_applied"]), (&json!(true), &json!(0)), "{verdict:#}");
        assert_eq!(verdict["most_held"], 0, "{verdict:#}");
    }
    let slowest = verdicts.iter().map(|verdict| verdict["slowest"].clone()).collect();
    (ran, slowest)
}

#[test]
fn the_exam_of_a_controller_has_a_verdict_on_wrong_messages() {
    let (ran, slowest) = examined(&["nan", "stale-version", "flood", "sign-flip"]);
    // A flood does no harm; the exam detects a wrong sign after the second wrong answer.
    assert_eq!(slowest, [json!(1), json!(1), Value::Null, json!(2)]);
    let read = |name: &str| std::fs::read_to_string(ran.out().join(name)).expect("written");
    assert!(read("faults.xml").contains("tests=\"4\" failures=\"0\""), "{}", read("faults.xml"));
    assert!(read("faults.html").contains("every kind of fault was handled as expected"));
}

/// At a corner sound controllers differ by a fifth of a joint's range, so that a tolerance for the whole motion cannot detect a wrong gain.
#[test]
fn wrong_commands_are_told_on_a_path_with_sharp_corners() {
    let sharp = ["--seeds", "6", "--set", "path.kind=square_sharp"];
    let (ran, slowest) = examined_with(&["ok", "drift", "gain"], &sharp);
    assert_eq!(slowest[0], Value::Null, "a sound controller is no alarm");
    assert!(slowest[1..].iter().all(|ticks| ticks.as_u64().is_some_and(|ticks| ticks <= 40)), "{slowest:?}");
    let sound = ran.recording("sound/quasi-static/quasi-static.mcap");
    let difference = sound.column("difference_1_2").expect("what the standby said beside it");
    let greatest =
        |ticks: std::ops::Range<usize>| difference[ticks].iter().fold(0.0, |most: f64, d| most.max(d.abs()));
    println!(
        "joint 2 differs by {:.0} N*m at the corner, {:.0} between",
        greatest(1400..1600),
        greatest(800..1300)
    );
    assert!(greatest(1400..1600) > 10.0 * greatest(800..1300), "no corner: this tests nothing");
}

#[test]
fn the_exam_of_a_controller_has_a_verdict_on_missing_ones() {
    let (_, slowest) = examined(&["off", "hang", "crash", "loan-lost"]);
    assert_eq!(slowest, [json!(1), json!(1), json!(1), json!(1)]);
}

#[test]
fn killed_runs_leave_nothing_that_the_next_run_does_not_remove() {
    let ran = freeplay(&["faults", "computed-torque", "--kills", "2", "--out", "out"]).expect(0);
    let tally: Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    println!("{}", tally["tally"]);
    assert_eq!((&tally["holds"], &tally["tally"]["kills"]), (&json!(true), &json!(2)));
}
