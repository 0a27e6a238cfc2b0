//! The documented effects are those that there are.

use std::path::Path;

use freeplay_laws::{kinds, manual};

#[test]
fn the_file_is_the_one_that_the_laws_make() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/effects.md");
    let (found, made) = (std::fs::read_to_string(path).expect("the file is there"), manual());
    let differing = found.lines().zip(made.lines()).position(|(found, made)| found != made);
    let says = "make it again: cargo run -p freeplay-laws --example effects";
    assert!(found == made, "docs/effects.md differs, first in line {differing:?}; {says}");
}

#[test]
fn every_kind_and_parameter_is_in_it() {
    let text = manual();
    for kind in kinds() {
        assert!(text.contains(&format!("## `{}`", kind.name)), "{}", kind.name);
        for parameter in kind.parameters {
            assert!(text.contains(&format!("| `{}` |", parameter.name)), "{}.{}", kind.name, parameter.name);
        }
    }
}
