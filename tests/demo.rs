//! The closed loop with the real binary: the diagnosis finds concealed friction in the recording alone, and the controller with the diagnosed model reduces the
//! tool's deviation.

use crate::common::{Call, fresh_folder, send_signal};

#[test]
fn what_is_found_helps_the_controller() {
    let call = Call::new(
        fresh_folder(),
        &["demo", "--case", "friction", "--period", "3", "--out", "out", "--format", "json"],
    );
    let ran = call.run().expect(0);
    let said: serde_json::Value = serde_json::from_str(&ran.stdout()).expect("JSON");
    let case = &said["cases"][0];
    assert_eq!((case["verdict"].as_str(), case["right"].as_bool()), (Some("named"), Some(true)), "{case:#}");
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let found = number(&case["effects"][0]["parameters"]["coulomb"]["value"]);
    let (before, after) = (number(&case["deviation_mm"]["before"]), number(&case["deviation_mm"]["after"]));
    println!("found {found:.2} of 40 N·m, deviation {before:.3} -> {after:.3} mm");
    assert!((found / 40.0 - 1.0).abs() < 0.02);
    assert!(before > 0.1 && after < 0.2 * before);
    for file in ["report.html", "friction/diagnosis.json", "friction/model.toml", "friction/report.html"] {
        assert!(ran.out().join(file).is_file(), "{file} is missing: {}", ran.dump());
    }
}

/// A run of the demonstration that loses its controller, as on a busy machine: this is no fault of the program, and no result blocks a second attempt.
#[test]
fn a_run_that_loses_its_controller_ends_with_the_code_of_a_missing_peer() {
    let demo = ["demo", "--case", "friction", "--period", "3", "--out", "out"];
    let started = Call::new(fresh_folder(), &demo).start();
    send_signal(started.child_with("controller"), "KILL");
    let ran = started.wait().expect(5);
    assert!(ran.stderr().contains("lost its controller"), "{}", ran.dump());
    let mut again = Call::new(fresh_folder(), &demo);
    again.command.current_dir(ran.folder.path());
    let again = again.start();
    send_signal(again.child_with("controller"), "KILL");
    again.wait().expect(5);
}

/// At half of the usual periods: a detent in addition to the play has no name; the trained network removes its deviation on other paths without a tracker, a second
/// call reuses the outcome of the first, and the pages exist.
#[test]
fn what_has_no_name_is_learned_and_taken_out() {
    let place = fresh_folder();
    let demo = |more: &[&str]| {
        let mut arguments =
            vec!["demo", "--case", "play-detent", "--period", "3", "--out", "out", "--format", "json"];
        arguments.extend(more);
        let mut call = Call::new(fresh_folder(), &arguments);
        call.command.current_dir(place.path());
        let ran = call.run().expect(0);
        serde_json::from_str::<serde_json::Value>(&ran.stdout()).expect("JSON")
    };
    let said = demo(&[]);
    let machine = &said["machines"][0];
    assert_eq!(
        (machine["machine"].as_str(), machine["proved"][1].as_bool()),
        (Some("play-detent"), Some(true))
    );
    for cell in machine["cells"].as_array().expect("cells") {
        let rms = |way: usize| cell["reached"][way]["rms"].as_f64().expect("a run");
        println!("{}: {:.4} -> {:.4} mm", cell["path"], rms(2), rms(4));
        assert!(rms(4) < 0.3 * rms(2));
    }
    let checks = said["checks"][0].as_array().expect("checks");
    assert!(checks.len() == 3 && checks.iter().all(|check| check["holds"] == true), "{checks:#?}");
    for (file, words) in
        [("report.html", "play-detent"), ("play-detent/report.html", "Permitted use of the network")]
    {
        let page = std::fs::read_to_string(place.path().join("out").join(file)).expect("a page");
        assert!(page.contains(words), "{file}");
    }
    assert_eq!(said, demo(&["--resume"]), "the outcome that was left");
}
