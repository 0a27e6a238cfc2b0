//! Several controllers in one run of the real binary: the standbys compute in shadow, take over at a tick without a gap, a held command or a jump, and replace
//! the active controller when it fails.

use crate::common::{Call, FREEPLAY, Ran, fresh_folder};
use freeplay_recording::Recording;
use serde_json::{Value, json};

/// Codes of the column `in_force`.
const IN_CONTROL: f64 = 1.0;
const BRAKED: f64 = 3.0;

/// The executable of the faulty controller, which without a fault is an external controller.
fn faulty() -> String {
    let path = std::path::Path::new(FREEPLAY).with_file_name("examples").join("faulty");
    assert!(path.is_file(), "build it first: cargo build -p freeplay --example faulty");
    path.display().to_string()
}

/// A lockstep run of 0.8 s of a fast path with `controllers`, the first one active.
fn together(controllers: &[&str], arguments: &[&str]) -> Call {
    let mut all = vec!["run", "--quiet", "--out", "out", "--set", "duration=0.8", "--set", "path.period=3"];
    for (slot, controller) in controllers.iter().enumerate() {
        all.extend([if slot == 0 { "--controller" } else { "--standby" }, controller]);
    }
    all.extend(arguments);
    Call::new(fresh_folder(), &all)
}

fn swaps(run: &Value) -> &[Value] {
    run["line_up"]["swaps"].as_array().map(Vec::as_slice).expect("swaps")
}

fn column<'a>(recording: &'a Recording, name: &str) -> &'a [f64] {
    recording.column(name).unwrap_or_else(|| panic!("no column {name}"))
}

fn recording_of(ran: &Ran, name: &str) -> Recording {
    ran.recording(&format!("{name}.mcap"))
}

#[test]
fn a_standby_computes_in_shadow_and_changes_nothing() {
    let alone = together(&["quasi-static"], &[]).run().expect(0).run();
    let with = together(&["quasi-static", "computed-torque"], &[]).run().expect(0).run();
    assert_eq!(alone["state_hash"], with["state_hash"]);
    assert_eq!(swaps(&with), &[] as &[Value]);
    let dying = together(&["quasi-static", &faulty()], &[]).env("FREEPLAY_FAULT", "kill@100").run().expect(0);
    assert_eq!(alone["state_hash"], dying.run()["state_hash"], "a standby that dies is not missed");
}

#[test]
fn random_swaps_leave_no_gap_and_hold_nothing() {
    let faulty = faulty();
    let team = ["computed-torque", "quasi-static", &faulty];
    for mode in ["mode=torque", "mode=driven"] {
        let arguments =
            ["--set", mode, "--set", "random_swaps=60", "--set", "swap_blend=0.01", "--seed", "3"];
        let play = || together(&team, &arguments).env("FREEPLAY_FAULT", "none").run().expect(0);
        let (ran, again) = (play(), play());
        let run = ran.run();
        assert_eq!(run["state_hash"], again.run()["state_hash"], "two runs are the same to the byte");
        assert_eq!(swaps(&run).len(), 60);
        let recording = recording_of(&ran, "computed-torque");
        assert!(column(&recording, "in_force")[1..].iter().all(|&what| what == IN_CONTROL));
        let in_charge = column(&recording, "in_charge");
        for swap in swaps(&run) {
            assert_eq!((&swap["gap_ticks"], &swap["held_ticks"]), (&json!(0), &json!(0)), "{swap}");
            let tick = swap["tick"].as_u64().expect("a tick") as usize;
            assert_ne!(
                in_charge[tick],
                in_charge[tick + 1],
                "the new controller is in charge at the next tick"
            );
        }
    }
}

#[test]
fn a_swap_neither_jumps_nor_leads_the_tool_astray() {
    let arguments = ["swap", "--quiet", "--out", "out", "--swaps", "12", "--per-run", "6", "--seed", "5"];
    let team = ["--controller", "computed-torque", "--controller", "quasi-static"];
    let scenario = ["--set", "duration=1.5", "--set", "path.period=2", "--set", "swap_blend=0.15"];
    let ran = Call::new(fresh_folder(), &[&arguments[..], &team[..], &scenario[..]].concat()).run().expect(0);
    let text = std::fs::read_to_string(ran.out().join("swap.json")).expect("a result");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    println!("{:#}", result["verdicts"]);
    assert_eq!((&result["verdicts"]["swaps"], &result["runs"]), (&json!(12), &json!(2)));
    assert!(ran.stdout().contains("held commands: 0"), "{}", ran.dump());
    let all = result["swaps"].as_array().expect("swaps");
    let pairs = |from, to| all.iter().filter(|swap| swap["from"] == from && swap["to"] == to).count();
    assert_eq!(pairs("computed-torque", "quasi-static") + pairs("quasi-static", "computed-torque"), 12);
}

#[test]
fn a_swap_at_a_tick_by_name() {
    let call = together(&["computed-torque", "quasi-static"], &[]);
    let table = "duration = 0.3\ncontrollers = [\"computed-torque\"]\nstandby = [\"quasi-static\"]\n\
                 [[swap]]\ntick = 100\nto = \"quasi-static\"\n[[swap]]\ntick = 200\nto = \"computed-torque\"\n";
    std::fs::write(call.folder.path().join("s.toml"), table).expect("written");
    let ran = Call::new(call.folder, &["run", "s.toml", "--quiet", "--out", "out"]).run().expect(0);
    let run = ran.run();
    let ticks: Vec<u64> = swaps(&run).iter().filter_map(|swap| swap["tick"].as_u64()).collect();
    assert_eq!(ticks, [100, 200]);
    assert_eq!(run["line_up"]["controllers"][1]["ticks_in_charge"], 100);
    assert!(
        ran.stdout().contains("2 planned swaps; the greatest gap is 0 ticks, the longest hold 0 ticks"),
        "{}",
        ran.dump()
    );
    for (bad, said) in [
        ("tick = 300", "the run has 300 ticks"),
        ("tick = 200\nto = \"x\"", "this run has computed-torque, quasi-static"),
    ] {
        let folder = fresh_folder();
        let text = table.replace(
            "tick = 200\nto = \"computed-torque\"",
            &if bad.contains("to") { bad.to_owned() } else { format!("{bad}\nto = \"quasi-static\"") },
        );
        std::fs::write(folder.path().join("s.toml"), text).expect("written");
        let ran = Call::new(folder, &["run", "s.toml", "--quiet", "--out", "out"]).run().expect(3);
        assert!(ran.stderr().contains(said), "{}", ran.dump());
    }
}

#[test]
fn the_standby_is_in_charge_at_the_tick_after_a_failure() {
    // Fault of the active controller, and the reported cause.
    let cases = [
        ("nan", "not_finite"),
        ("huge", "out_of_range"),
        ("early", "stale"),
        ("other_version", "malformed"),
        ("no_answer", "no_answer"),
        ("kill", "missing"),
        ("abort", "missing"),
        ("stop", "missing"),
        ("stale", "missing"),
    ];
    let faulty = faulty();
    for (fault, reason) in cases {
        let ran = together(
            &[&faulty, "computed-torque"],
            &["--set", "duration=0.4", "--set", "answer_patience=0.2"],
        )
        .env("FREEPLAY_FAULT", format!("{fault}@200"))
        .run()
        .expect(0);
        let run = ran.run();
        let first = &swaps(&run)[0];
        println!("{fault}: {} {}", first["cause"], first["tick"]);
        assert_eq!((&first["tick"], &first["to"]), (&json!(200), &json!("computed-torque")), "{fault}");
        assert_eq!(first["cause"], json!({ "failed": reason }), "{fault}");
        assert_eq!((&first["gap_ticks"], &first["held_ticks"]), (&json!(0), &json!(0)), "{fault}");
        assert_eq!((run["ending"].as_str(), swaps(&run).len()), (Some("finished"), 1), "{fault}");
        let recording = recording_of(&ran, "faulty");
        assert!(column(&recording, "in_force")[1..].iter().all(|&what| what == IN_CONTROL), "{fault}");
        assert_eq!(column(&recording, "in_charge")[199..203], [0.0, 0.0, 1.0, 1.0], "{fault}");
        assert!(ran.stdout().contains("tick 200: computed-torque took over from faulty"), "{}", ran.dump());
    }
}

#[test]
fn when_all_fail_the_command_is_held_and_then_the_brakes_close() {
    let faulty = faulty();
    let ran = together(&[&faulty, &faulty], &["--set", "duration=0.4"])
        .env("FREEPLAY_FAULT", "nan@200+5,300")
        .run()
        .expect(1);
    let run = ran.run();
    assert_eq!(run["ending"], json!({ "braked": { "tick": 320, "reason": "not_finite" } }));
    let recording = recording_of(&ran, "faulty");
    let in_force = column(&recording, "in_force");
    assert_eq!(in_force.iter().filter(|&&what| what == 2.0).count(), 25, "5 and 20 ticks held");
    assert_eq!(in_force[in_force.len() - 1], BRAKED);
}

#[test]
fn a_standby_that_does_not_come_is_told() {
    let faulty = faulty();
    let ran = together(&["computed-torque", &faulty], &["--set", "patience=1"])
        .env("FREEPLAY_FAULT", "leave")
        .run()
        .expect(5);
    for words in ["in slot 1", "ended before it joined the run (exit code 7)"] {
        assert!(ran.stderr().contains(words), "{words}: {}", ran.dump());
    }
}

#[test]
fn an_interrupted_campaign_tells_what_there_was() {
    let team = ["--controller", "computed-torque", "--controller", "quasi-static"];
    let size = ["--swaps", "100000", "--per-run", "4", "--set", "duration=0.8", "--set", "swap_blend=0.02"];
    let arguments = [&["swap", "--quiet", "--out", "out", "--pace", "lockstep"][..], &team, &size].concat();
    let run = Call::new(fresh_folder(), &arguments).start();
    let scenario = run.out().join("swapped/scenario.toml");
    run.until("the third run", || {
        std::fs::read_to_string(&scenario).ok().filter(|text| text.contains("seed = 3")).map(drop)
    });
    run.signal("INT");
    let ran = run.wait().expect(130);
    let text = std::fs::read_to_string(ran.out().join("swap.json")).expect("a result");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    let count = result["swaps"].as_array().expect("swaps").len();
    println!("{count} swaps of {}", result["verdicts"]["asked"]);
    assert!((8..100_000).contains(&count) && ran.stdout().contains("swaps in"), "{}", ran.dump());
    assert_eq!(ran.left_in_shared_memory(), Vec::<std::path::PathBuf>::new());
}
