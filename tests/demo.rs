//! The loop closed by the real binary: concealed friction is found in the recording alone, and the controller that is given the diagnosed
//! model takes the tool's deviation down.

mod common;

use common::{Call, fresh_folder};

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
