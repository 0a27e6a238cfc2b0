//! A hostile controller with the real binary: whatever it sends, no joint exceeds its speed limit for more than a few ticks, the message about a stop of the
//! arm names joint, value, limit and tick, and the plant ignores impossible times from the controller.
//!
//! The controller is `tests/controllers/hostile.rs`. The test plays every strategy with a few seeds; with a hundred by `cargo test -p freeplay --test command
//! hostile:: -- --ignored --nocapture`.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

use crate::common::{Call, FREEPLAY, Ran, fresh_folder};
use freeplay_recording::Recording;
use serde_json::{Value, json};

/// A speed counts as within its limit up to this share of it; and the number of ticks for which it may be beyond.
const MARGIN: f64 = 1.05;
const MOST_TICKS: usize = 5;
/// The strategies of the hostile controller.
const STRATEGIES: [&str; 7] = ["ride", "push", "shake", "leap", "replay", "future", "lies"];

/// The executable of the faulty controller.
fn faulty() -> String {
    let path = Path::new(FREEPLAY).with_file_name("examples").join("faulty");
    assert!(path.is_file(), "build it first: cargo build -p freeplay --example faulty");
    path.display().to_string()
}

/// A lockstep run of the paper's arm under the faulty controller with `fault`, with more `arguments`.
fn under(fault: &str, arguments: &[&str]) -> Call {
    let faulty = faulty();
    let mut all = vec!["run", "--quiet", "--out", "out", "--controller", &faulty];
    all.extend(["--set", "patience=60", "--set", "duration=0.4", "--set", "path.period=2"]);
    all.extend(arguments);
    Call::new(fresh_folder(), &all).env("FREEPLAY_FAULT", fault)
}

/// Greatest ratio of a joint's speed to its limit, and most ticks in a row beyond [`MARGIN`].
fn speeds(recording: &Recording) -> (f64, usize) {
    let arm = freeplay_model::paper_arm().arm;
    let (mut greatest, mut most) = (0.0_f64, 0);
    for (index, joint) in arm.joints().iter().enumerate() {
        let speeds = recording.column(&format!("qd{}", index + 1)).expect("recorded");
        let mut beyond = 0;
        for speed in speeds {
            let share = speed.abs() / joint.limits.velocity;
            assert!(share.is_finite(), "joint {} at {speed}", joint.name);
            greatest = greatest.max(share);
            // Speeds are sums of rounded numbers.
            beyond = if share > MARGIN * (1.0 + 1e-9) { beyond + 1 } else { 0 };
            most = most.max(beyond);
        }
    }
    (greatest, most)
}

/// Fails unless a stop, if there was one, is reported completely, on the screen and in the summary.
fn assert_stop_is_told(ran: &Ran, run: &Value) {
    let stopped = &run["stopped"];
    let Some(tick) = stopped["tick"].as_u64() else {
        assert_eq!(run["ending"], "finished", "{run:#}");
        return;
    };
    assert_eq!(run["ending"], json!({ "braked": { "tick": tick, "reason": stopped["reason"] } }));
    assert_eq!(run["verdict"], "failed");
    assert_eq!(run["failures"][0]["rule"], "stopped");
    assert!(ran.stdout().contains(&format!("at tick {tick}: ")), "{}", ran.dump());
    let report = std::fs::read_to_string(ran.out().join("report.html")).expect("a report");
    if let Some(joint) = stopped["joint"].as_str() {
        let [value, limit] = ["value", "limit"].map(|key| stopped[key].as_f64().expect("a number"));
        assert!(value.abs() > limit.abs() && stopped["unit"].is_string(), "{stopped}");
        assert!(ran.stdout().contains(&format!("{joint}: ")), "{}", ran.dump());
        assert!(report.contains(&format!("{joint}: ")), "the report names the joint");
    }
    assert!(report.contains("did not finish under control"));
}

/// Plays `strategy` in `mode` with `seed`, on an arm that depends on the seed. Returns the greatest share of a speed limit, and the reason of the stop.
fn play(strategy: &str, mode: &str, seed: u64) -> (f64, String) {
    let mode_set = format!("mode={mode}");
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/arm.urdf").display().to_string();
    let mut arguments = vec!["--set", &mode_set, "--recording", "csv"];
    match seed % 3 {
        0 => {}
        // An arm without acceleration limits, and without play.
        1 => arguments.extend(["--model", &urdf]),
        _ => arguments.extend(["--set", "clearance.joint_2.clearance=0.0003"]),
    }
    let call = under(&format!("{strategy}@20"), &arguments).env("FREEPLAY_SEED", seed.to_string());
    let begun = Instant::now();
    let ran = call.run();
    let took = begun.elapsed();
    assert!([0, 1, 5].contains(&ran.code()), "{strategy}, {mode}, seed {seed}: {}", ran.dump());
    let run = ran.run();
    let (greatest, most) = speeds(&ran.recording("faulty.csv"));
    assert!(
        most <= MOST_TICKS,
        "{strategy}, {mode}, seed {seed}: {greatest} for {most} ticks: {}",
        ran.dump()
    );
    assert_stop_is_told(&ran, &run);
    for (stage, values) in run["latency_us"].as_object().expect("latencies") {
        let longest = values["max"].as_f64().expect("a time");
        // No stage takes longer than the run, whatever times the controller sends.
        assert!(
            longest < took.as_secs_f64() * 1e6,
            "{strategy}, {mode}, seed {seed}: {stage} took {longest} us"
        );
    }
    let reason = run["stopped"]["reason"].as_str().unwrap_or("not stopped").to_owned();
    println!("{strategy}, {mode}, seed {seed}: {reason}, {most} ticks beyond");
    (greatest, reason)
}

/// Plays every strategy in both modes with `seeds` on `threads` threads; counts each reason of a stop.
fn play_all(seeds: std::ops::Range<u64>, threads: usize) {
    let mut cases = Vec::new();
    for seed in seeds {
        for mode in ["torque", "driven"] {
            cases.extend(STRATEGIES.map(|strategy| (strategy, mode, seed)));
        }
    }
    let next = AtomicU32::new(0);
    let found = std::sync::Mutex::new(std::collections::BTreeMap::<String, (u32, f64)>::new());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(&(strategy, mode, seed)) =
                    cases.get(next.fetch_add(1, Ordering::Relaxed) as usize)
                {
                    let (greatest, reason) = play(strategy, mode, seed);
                    let mut found = found.lock().expect("no other case has failed");
                    let entry = found.entry(format!("{mode} {strategy}: {reason}")).or_default();
                    *entry = (entry.0 + 1, entry.1.max(greatest));
                }
            });
        }
    });
    for (what, (count, greatest)) in found.into_inner().expect("no case has failed") {
        println!("{what} {count}, speed at most {:.2} % of its limit", 100.0 * greatest);
    }
}

#[test]
fn a_hostile_controller_takes_no_joint_beyond_its_speed_limit() {
    play_all(0..2, 2);
}

#[test]
#[ignore = "1400 runs: ten minutes on two cores"]
fn a_hundred_hostile_controllers_take_no_joint_beyond_its_speed_limit() {
    play_all(0..100, 2);
}

#[test]
fn full_effort_on_all_joints_stops_the_arm_and_says_what_did() {
    // Without a limit on the rate, so that the commands pass.
    let rates = "reflex.torque_rate=[inf,inf,inf,inf,inf,inf]";
    let ran = under("full@100", &["--set", rates]).run().expect(1);
    let run = ran.run();
    println!("{}", run["stopped"]);
    assert_eq!((&run["stopped"]["reason"], &run["stopped"]["unit"]), (&json!("speed"), &json!("rad/s")));
    assert!(ran.stdout().contains("the arm was stopped at tick 10"), "{}", ran.dump());
    let (greatest, most) = speeds(&ran.recording("faulty.mcap"));
    println!("{greatest} of the limit, {most} ticks beyond");
    assert!(most <= MOST_TICKS && greatest > 0.3, "{greatest}: the arm did move");
    assert_stop_is_told(&ran, &run);
    // With the limits of the arm, the gate refuses the first of these torques.
    let ran = under("full@100", &[]).run().expect(1);
    let first = &ran.run()["gate"]["first"];
    assert_eq!((&first["reason"], &first["quantity"]), (&json!("too_fast"), &json!("torque_rate")));
    assert_eq!(ran.run()["ending"], json!({ "braked": { "tick": 120, "reason": "too_fast" } }));
    assert!(ran.stdout().contains("torque rate"), "{}", ran.dump());
}

#[test]
fn a_run_beyond_a_limit_fails_though_nothing_stops_it() {
    let off = ["speed=inf", "acceleration=inf", "position=false", "torque_rate=[inf,inf,inf,inf,inf,inf]"];
    let sets: Vec<String> = off.iter().map(|off| format!("reflex.{off}")).collect();
    let mut arguments: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    arguments.extend(["--set", "reflex.tracking=[inf,inf,inf,inf,inf,inf]", "--set", "duration=0.2"]);
    let ran = under("full@150", &arguments).run().expect(1);
    let run = ran.run();
    assert_eq!((&run["ending"], &run["verdict"]), (&json!("finished"), &json!("failed")), "{run:#}");
    assert_eq!(run["stopped"], Value::Null);
    let rules: Vec<&str> =
        run["failures"].as_array().expect("failures").iter().filter_map(|f| f["rule"].as_str()).collect();
    println!("{}", run["failures"]);
    assert!(rules.contains(&"speed"), "{rules:?}");
    assert!(
        ran.stdout().contains("failed: joint_") && ran.stdout().contains("ticks in a row"),
        "{}",
        ran.dump()
    );
    let report = std::fs::read_to_string(ran.out().join("report.html")).expect("a report");
    assert!(report.contains("finished, and failed"));
}

#[test]
fn a_tool_that_is_far_off_fails_the_run() {
    // A controller that holds its position while the reference moves on is stopped for its tracking error.
    let ran = under("freeze@100", &["--set", "mode=driven", "--set", "duration=1.5"]).run().expect(1);
    let run = ran.run();
    println!("{}", run["stopped"]);
    assert_eq!((&run["stopped"]["reason"], &run["stopped"]["unit"]), (&json!("tracking"), &json!("rad")));
    assert_stop_is_told(&ran, &run);
}

#[test]
fn a_hand_over_to_a_posture_far_away_is_refused_as_too_fast() {
    let faulty = faulty();
    let arguments = [
        "run",
        "--quiet",
        "--out",
        "out",
        "--controller",
        "computed-torque",
        "--standby",
        &faulty,
        "--set",
        "mode=driven",
        "--set",
        "duration=0.9",
        "--set",
        "path.period=2",
        "--set",
        "swap_blend=0",
        "--set",
        "swap=[{tick=700,to=\"faulty\"}]",
    ];
    // It holds the first posture that it received.
    let ran = Call::new(fresh_folder(), &arguments).env("FREEPLAY_FAULT", "freeze@0").run().expect(0);
    let run = ran.run();
    println!("{}", run["gate"]["first"]);
    let count = run["gate"]["rejected"]["too_fast"].as_u64().expect("a count");
    assert_eq!(count, 200, "each answer from tick 700 on is refused");
    assert_eq!(run["line_up"]["controllers"][1]["rejected"]["too_fast"], count);
    assert_eq!(run["line_up"]["swaps"], json!([]));
    let first = &run["gate"]["first"];
    assert_eq!((&first["tick"], &first["takes_over"]), (&json!(700), &json!(true)));
    assert_eq!((&first["controller"], &first["quantity"]), (&json!("faulty"), &json!("speed")));
    assert!(first["value"].as_f64() > Some(50.0), "a step of decimetres in a millisecond: {first}");
    let said = "tick 700: the hand-over to faulty was refused as too fast (joint_";
    assert!(ran.stdout().contains(said), "{}", ran.dump());
    let (greatest, _) = speeds(&ran.recording("computed-torque.mcap"));
    assert!(greatest < 1.0, "{greatest}");
    // With a blend the arm follows, until it is too far from its reference.
    let mut blended = arguments.to_vec();
    blended[15] = "swap_blend=0.3";
    let ran = Call::new(fresh_folder(), &blended).env("FREEPLAY_FAULT", "freeze@0").run().expect(1);
    assert_eq!(ran.run()["stopped"]["reason"], "tracking", "{}", ran.dump());
}

#[test]
fn times_that_cannot_be_are_counted_and_left_out_of_the_latencies() {
    let good = under("none", &[]).run().expect(0).run();
    let ran = under("times@100", &[]).run().expect(0);
    let run = ran.run();
    println!("{} {}", run["answers"], run["latency_us"]["compute"]);
    assert_eq!(good["answers"]["implausible_times"], 0);
    assert_eq!(run["answers"]["implausible_times"], 300);
    assert_eq!(run["latency_us"]["compute"]["count"], 100);
    assert!(ran.stdout().contains("answers with impossible times, left out of the latencies: 300"));
}

#[test]
fn limits_that_cannot_be_are_refused_before_anything_runs() {
    let cases = [
        ("speed=-1", "reflex.speed = -1 is out of range; it must be above 0"),
        ("acceleration=nan", "reflex.acceleration = NaN is out of range"),
        ("tracking=[0.1]", "reflex.tracking has 1 values; the arm has 6 joints"),
        ("torque_rate=[1,1,0,1,1,1]", "reflex.torque_rate = 0 is out of range"),
    ];
    for (given, said) in cases {
        let ran = under("none", &["--set", &format!("reflex.{given}")]).run().expect(3);
        assert!(ran.stderr().contains(said), "{given}: {}", ran.dump());
        assert!(!ran.out().exists(), "{given}: nothing is written");
    }
}
