//! The chart library in `vendor/uplot` is the one that `ORIGIN.md` names, unmodified.

use sha2::{Digest, Sha256};

const FILES: [(&str, &[u8], &str); 3] = [
    (
        "uPlot.iife.min.js",
        include_bytes!("../../vendor/uplot/uPlot.iife.min.js"),
        "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    ),
    (
        "uPlot.min.css",
        include_bytes!("../../vendor/uplot/uPlot.min.css"),
        "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    ),
    (
        "LICENSE",
        include_bytes!("../../vendor/uplot/LICENSE"),
        "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
    ),
];

#[test]
fn files_are_the_published_ones() {
    let origin = include_str!("../../vendor/uplot/ORIGIN.md");
    for (name, content, expected) in FILES {
        let sum: String = Sha256::digest(content).iter().map(|byte| format!("{byte:02x}")).collect();
        println!("{name}: {sum}");
        assert_eq!(sum, expected, "{name} was changed; take it from the npm package again");
        assert!(origin.contains(expected), "ORIGIN.md does not give the sum of {name}");
    }
}

#[test]
fn script_can_stand_inside_a_page() {
    let script = String::from_utf8_lossy(FILES[0].1);
    assert!(!script.contains("</script") && !script.contains("<!--"));
    let licence = String::from_utf8_lossy(FILES[2].1);
    assert!(!licence.contains("*/") && !licence.contains('<'), "it travels as a comment of the script");
}
