//! `freeplay report`: several runs in one report, and its messages about folders without a run.

use crate::common::{Call, Ran, fresh_folder, lockstep};

/// A run into the folder `name`, in the folder of the call before.
fn run_into(before: Option<Ran>, name: &str, more: &[&str]) -> Ran {
    let fixed = ["run", "--quiet", "--controller", "computed-torque", "--set", "duration=0.6", "--out", name];
    let folder = before.map_or_else(fresh_folder, |ran| ran.folder);
    Call::new(folder, &[&fixed[..], more].concat()).run().expect(0)
}

#[test]
fn runs_are_compared_and_what_was_set_differently_is_listed() {
    let ran = run_into(None, "wide", &[]);
    let ran = run_into(Some(ran), "narrow", &["--set", "clearance.joint_5.clearance=0.0004"]);
    let ran = run_into(Some(ran), "again", &[]);
    let ran = Call::new(ran.folder, &["report", "wide", "narrow", "again"]).run().expect(0);
    let page = std::fs::read_to_string(ran.folder.path().join("comparison.html")).expect("a page");
    println!("{} bytes", page.len());
    for words in [
        "wide: computed-torque: finished",
        "narrow: computed-torque: finished",
        "clearance.joint_5.clearance",
        "Runs with identical States and Commands, to the byte: wide: computed-torque, again: computed-torque.",
        "Deviation along z",
        "Controller compute",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // Settings common to all runs do not appear among the differences.
    assert!(!page.contains("path.period"));
    assert!(page.len() < 5_000_000);
}

#[test]
fn the_film_of_a_run_has_a_place_for_every_part_at_every_frame() {
    let ran = lockstep(0.3, &["--controller", "computed-torque"]).expect(0);
    let page = std::fs::read_to_string(ran.out().join("report.html")).expect("a report");
    let film = page.split("<figure class=\"film\">").nth(1).expect("a film");
    let data = film.split("<script type=\"application/json\">").nth(1).expect("data");
    let data: serde_json::Value =
        serde_json::from_str(data.split("</script>").next().expect("an end")).expect("JSON");
    let frames = data["times"].as_array().expect("times").len();
    // The journal falls and bounces for most of the first 0.3 s: each of these ticks is a frame.
    println!("{frames} frames of 300 ticks");
    assert!(frames > 50);
    let scenes = data["scenes"].as_array().expect("scenes");
    assert_eq!(scenes.len(), 2, "the arm and one bearing");
    for scene in scenes {
        for moving in scene["moving"].as_array().expect("parts") {
            let places = moving["frames"].as_array().expect("frames");
            assert_eq!(places.len(), frames);
            assert!(
                places
                    .iter()
                    .all(|place| place.as_array().map(Vec::len) == places[0].as_array().map(Vec::len))
            );
        }
    }
    // The film shows all three states of a journal.
    let states: std::collections::BTreeSet<u64> =
        scenes[1]["state"].as_array().expect("states").iter().filter_map(serde_json::Value::as_u64).collect();
    assert_eq!(states.len(), 3, "{states:?}");
}

#[test]
fn a_folder_without_a_run_is_named() {
    let ran = Call::new(fresh_folder(), &["report", "nowhere"]).run().expect(3);
    assert!(ran.stderr().contains("nowhere/summary.json"), "{}", ran.dump());
    assert!(ran.stderr().contains("give the folders that freeplay run --out left"), "{}", ran.dump());
    assert!(!ran.folder.path().join("comparison.html").exists());
    Call::new(fresh_folder(), &["report"]).run().expect(2);
}
