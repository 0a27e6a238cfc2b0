//! A short bench of the real binary: its counts are complete, whatever the times on this machine.

use crate::common::{Call, fresh_folder};
use serde_json::Value;

#[test]
fn every_tick_is_accounted_for_and_every_miss_has_a_line() {
    // No priority and no reserved cores: tests run in parallel.
    let polite = ["--set", "realtime.priority=0", "--set", "realtime.lock_memory=false"];
    let size = ["--ticks", "600", "--pairs", "2", "--load", "0,5000", "--controller", "computed-torque"];
    let arguments = [&["bench", "--quiet", "--out", "out"][..], &polite[..], &size[..]].concat();
    let ran = Call::new(fresh_folder(), &arguments).run();
    // The ratios depend on the load of the machine: a test accepts 0 and 1, both regular ends of a bench.
    assert!(matches!(ran.code(), 0 | 1), "{}", ran.dump());
    let text = std::fs::read_to_string(ran.out().join("bench.json")).expect("a result");
    let bench: Value = serde_json::from_str(&text).expect("JSON");
    let of = &bench["latency_us"]["computed-torque"];
    // Tick 0 of each block starts the schedule, so that it has no scheduled round trip.
    assert_eq!((&of["round_trip"]["count"], &of["wake_up"]["count"]), (&598.into(), &598.into()), "{of:#}");
    assert_eq!(bench["latency_us"]["bare clock loop"]["wake_up"]["count"], 600);
    let contest = &bench["controllers"][0];
    // For each tick, the loop waited or was catching up; the same holds for the bare loop.
    for (of, ticks, caught_up) in
        [(of, 598, "caught_up"), (&bench["latency_us"]["bare clock loop"], 600, "bare_caught_up")]
    {
        // On a busy machine, a loop may catch up all the time.
        let waits = &of["wake_up_uncorrected"];
        let waited = if waits.is_null() { 0 } else { waits["count"].as_u64().expect("a count") };
        println!("{caught_up}: {} of {ticks}", contest[caught_up]);
        assert_eq!(Some(ticks - waited), contest[caught_up].as_u64(), "{of:#}");
    }
    let causes: u64 = contest["causes"].as_object().expect("causes").values().filter_map(Value::as_u64).sum();
    assert_eq!(contest["missed"], causes, "{contest:#}");
    assert!(
        bench["cliff"][1]["missed_share"].as_f64().is_some_and(|share| share > 0.5),
        "5 ms do not fit into 1 ms"
    );
    let late = bench["latency_us"]["computed-torque"]["round_trip"]["max"].as_f64().expect("a number");
    println!("slowest round trip {late} µs; causes {}", contest["causes"]);
    for file in ["computed-torque.hlog", "computed-torque.hgrm", "bare-clock-loop.hlog", "report.html"] {
        assert!(ran.out().join(file).is_file(), "{file}");
    }
}

#[test]
fn looking_on_is_set_against_not_looking() {
    let polite = ["--set", "realtime.priority=0", "--set", "realtime.lock_memory=false"];
    let size = ["--cost", "--ticks", "300", "--pairs", "3", "--controller", "computed-torque"];
    let arguments = [&["bench", "--quiet", "--out", "out"][..], &polite[..], &size[..]].concat();
    let ran = Call::new(fresh_folder(), &arguments).run();
    assert!(matches!(ran.code(), 0 | 1), "{}", ran.dump());
    let text = std::fs::read_to_string(ran.out().join("cost.json")).expect("a result");
    let cost: Value = serde_json::from_str(&text).expect("JSON");
    let costs = cost["costs"].as_array().expect("costs");
    for looking in ["control", "recorded", "watched"] {
        let step = costs.iter().find(|cost| cost["looking"] == looking && cost["stage"] == "plant_step");
        let p99 = &step.expect("a row")["ratios"][1];
        let [least, median, greatest] =
            [&p99["bounds"][0], &p99["median"], &p99["bounds"][1]].map(Value::as_f64);
        println!("{looking}: plant step, p99 over plain {median:?} ({least:?} … {greatest:?})");
        assert!(least > Some(0.0) && least <= median && median <= greatest, "{p99:#}");
    }
    assert_eq!(ran.code() == 1, cost["verdict"] == "fails", "{}", cost["verdict"]);
}

#[test]
fn what_cannot_be_measured_is_refused() {
    for (arguments, words) in [
        (&["--ticks", "100", "--pairs", "2"][..], "a hundred ticks"),
        (&["--load=-1"], "--load: give"),
        (&["--load", "5", "--controller", "/bin/true"], "built-in controllers alone"),
    ] {
        let ran = Call::new(fresh_folder(), &[&["bench", "--quiet"], arguments].concat()).run().expect(2);
        assert!(ran.stderr().contains(words), "{}", ran.dump());
    }
}
