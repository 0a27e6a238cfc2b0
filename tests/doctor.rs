//! `freeplay doctor` on machines made of files, and on the one at hand.

use crate::common::{Call, Ran, fresh_folder};
use serde_json::Value;

/// A folder like `/`, of a machine that is fit for everything except for the `changes`.
fn machine(call: &Call, changes: &[(&str, &str)]) -> String {
    let fit = [
        ("proc/self/status", "CapEff:\t000001ffffffffff\nCpus_allowed_list:\t0-3\n"),
        ("proc/sys/kernel/osrelease", "6.12.0-rt"),
        ("proc/sys/kernel/version", "#1 SMP PREEMPT_RT"),
        ("sys/kernel/realtime", "1"),
        ("proc/loadavg", "0.10 0.10 0.10 1/100 1"),
        ("proc/stat", "cpu  100 0 100 800 0 0 0 0 0 0"),
        ("sys/devices/system/cpu/isolated", "2-3"),
        ("sys/devices/system/cpu/nohz_full", "2-3"),
        ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance"),
        ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc"),
    ];
    let root = call.folder.path().join("machine");
    for (path, text) in fit.iter().chain(changes) {
        let path = root.join(path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, text).expect("written");
    }
    root.display().to_string()
}

fn look(changes: &[(&str, &str)], arguments: &[&str], code: i32) -> Ran {
    let mut call = Call::new(fresh_folder(), &["doctor", "--root"]);
    let root = machine(&call, changes);
    call.command.arg(root).args(arguments);
    call.run().expect(code)
}

fn json(ran: &Ran) -> Value {
    serde_json::from_str(&ran.stdout()).expect("JSON")
}

#[test]
fn a_fit_machine_passes_and_each_fault_is_told_with_its_remedy() {
    let fit = look(&[], &["--require-rt", "--format", "json"], 0);
    let found = json(&fit);
    assert_eq!(found["schema"], "freeplay.doctor/1");
    assert_eq!(found["verdict"]["words"], "fit for lockstep, medians and tails", "{}", fit.dump());
    let stolen = ("proc/stat", "cpu  100 0 100 790 0 0 0 10 0 0");
    let ran = look(&[stolen], &["--require-rt"], 4);
    assert!(ran.stdout().contains("fit for lockstep and for medians; not for tails"), "{}", ran.dump());
    assert!(ran.stderr().contains("time stolen by the hypervisor"), "{}", ran.dump());
    assert!(ran.stdout().contains("→ ask for dedicated cores"), "{}", ran.dump());
    // Without --require-rt the doctor reports it, too, but does not fail.
    let told = json(&look(&[stolen], &["--format", "json"], 0));
    assert_eq!((&told["verdict"]["medians"], &told["verdict"]["tails"]), (&true.into(), &false.into()));
}

#[test]
fn an_ordinary_user_is_told_how_to_get_the_rights() {
    let user = [
        ("proc/self/status", "CapEff:\t0000000000000000\nCpus_allowed_list:\t0-3\n"),
        ("proc/self/limits", "Max locked memory  8388608  8388608  bytes\nMax realtime priority  0  0\n"),
    ];
    let ran = look(&user, &["--require-rt"], 4);
    for words in ["@realtime - rtprio 95", "@realtime - memlock unlimited"] {
        assert!(ran.stdout().contains(words), "{}", ran.dump());
    }
}

#[test]
fn the_machine_at_hand_is_measured_and_shown_as_a_page() {
    let ran =
        Call::new(fresh_folder(), &["doctor", "--format", "json", "--html", "page.html"]).run().expect(0);
    let measured = &json(&ran)["measured"];
    println!("{measured:#}");
    assert!(measured["spun"]["p50"].as_u64().is_some_and(|late| late > 0), "{}", ran.dump());
    let page = std::fs::read_to_string(ran.folder.path().join("page.html")).expect("a page");
    assert!(page.contains("Is this machine fit?"));
}

#[test]
fn what_the_doctor_says_is_stamped_into_results() {
    let ran = Call::lockstep(0.02, &["--controller", "computed-torque"]).run().expect(0);
    let text = std::fs::read_to_string(ran.out().join("summary.json")).expect("a summary");
    let summary: Value = serde_json::from_str(&text).expect("JSON");
    assert!(summary["machine"]["doctor"]["verdict"]["words"].is_string());
    assert!(summary["machine"]["doctor"]["findings"].as_array().is_some_and(|lines| lines.len() > 10));
}
