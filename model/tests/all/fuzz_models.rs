//! No text makes the readers panic or hang, and every accepted file can be written and read again.

use std::sync::atomic::{AtomicUsize, Ordering};

use freeplay_arm::{Workspace, bias};
use freeplay_model::{ArmFile, ModelError, paper_arm, parse_toml, parse_urdf, to_toml};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Inputs per property.
const CASES: u32 = 4000;

const URDF: &str = r#"<?xml version="1.0"?><robot name="r"><!-- c --><link name="base"/><link name="arm"><inertial>
<origin xyz="0.1 0 0" rpy="0 0 1"/><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="5" velocity="2"/><dynamics damping="1" friction="0.5"/></joint><link name="tool0"/>
<joint name="k" type="fixed"><parent link="arm"/><child link="tool0"/><origin xyz="0.3 0 0"/></joint></robot>"#;

const TOML: &str = r#"name = "r"
gravity = [0, 0, -9.81]
[[joint]]
name = "j"
type = "prismatic"
axis = [0, 0, 1]
origin = { xyz = [0, 0, 1], rpy = [0.1, 0.2, 0.3] }
mass = 2.0
com = [0.1, 0, 0]
inertia = { ixx = 0.01, iyy = 0.02, izz = 0.025, ixy = 0, ixz = 0, iyz = 0 }
limits = { lower = -1, upper = 1, velocity = 2, acceleration = 10, effort = 5 }
damping = 1
friction = 0.5
[tool]
xyz = [0.3, 0, 0]
[[effect]]
kind = "backlash"
joint = "j"
gap = 1e-3
"#;

/// Pieces that a mutation may insert anywhere.
const PIECES: [&str; 24] = [
    "-1",
    "0",
    "1e308",
    "1e-320",
    "nan",
    "inf",
    "1,0",
    "\"",
    "<",
    ">",
    "/",
    "[",
    "]",
    "[[joint]]\n",
    "[[effect]]\n",
    "=",
    "{",
    "}",
    "<link name=\"x\"/>",
    "<joint",
    "type=\"planar\"",
    "\u{0}",
    "é",
    "\n",
];

/// Runs `check` on [`CASES`] inputs from a fixed seed, and prints the number of accepted ones.
fn fuzz<S: Strategy<Value = String>>(what: &str, strategy: S, check: impl Fn(&str) -> bool) {
    let config = Config { cases: CASES, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[42; 32]));
    let accepted = AtomicUsize::new(0);
    let count = |text: String| {
        accepted.fetch_add(usize::from(check(&text)), Ordering::Relaxed);
        Ok(())
    };
    runner.run(&strategy, count).unwrap();
    println!("{what}: {CASES} inputs, {} accepted", accepted.into_inner());
}

/// A valid text with one or two changes: an inserted piece, a deleted or repeated stretch, or a replaced character.
fn mutated(valid: &'static str) -> impl Strategy<Value = String> {
    let change = (0..4_u8, any::<prop::sample::Index>(), 0..20_usize, prop::sample::select(PIECES.to_vec()));
    prop::collection::vec(change, 1..=2).prop_map(move |changes| {
        let mut text: Vec<char> = valid.chars().collect();
        for (kind, at, length, piece) in changes {
            let at = at.index(text.len() + 1);
            let end = (at + length).min(text.len());
            match kind {
                0 => drop(text.splice(at..at, piece.chars())),
                1 => drop(text.drain(at..end)),
                2 => {
                    let copy: Vec<char> = text[at..end].to_vec();
                    drop(text.splice(at..at, copy));
                }
                _ => drop(text.splice(at..end.min(at + 1), piece.chars())),
            }
        }
        text.into_iter().collect()
    })
}

/// A valid text with up to three of its numbers replaced by any others, of any size.
fn renumbered(valid: &'static str) -> impl Strategy<Value = String> {
    let numbers: Vec<(usize, &str)> = valid
        .split(|c: char| !(c.is_ascii_digit() || ".-e".contains(c)))
        .filter(|token| token.parse::<f64>().is_ok())
        .map(|token| (token.as_ptr() as usize - valid.as_ptr() as usize, token))
        .collect();
    let value = prop_oneof![any::<f64>(), -10.0..10.0_f64, Just(0.0), Just(1e300), Just(-1e-300)];
    let change = (prop::sample::select(numbers), value);
    prop::collection::vec(change, 1..=3).prop_map(move |mut changes| {
        let mut text = valid.to_owned();
        changes.sort_by_key(|((at, _), _)| std::cmp::Reverse(*at));
        changes.dedup_by_key(|((at, _), _)| *at);
        for ((at, old), new) in changes {
            text.replace_range(at..at + old.len(), &format!("{new:?}"));
        }
        text
    })
}

/// True if the text was accepted. An accepted arm computes and survives a round trip; a refused text has a message.
fn survives(result: Result<ArmFile, ModelError>) -> bool {
    match result {
        Ok(file) => {
            let n = file.arm.dof();
            let mut ws = Workspace::new(&file.arm);
            bias(&file.arm, &mut ws, &vec![0.3; n], &vec![0.1; n], &mut vec![0.0; n]);
            let text = to_toml(&file);
            let back =
                parse_toml(&text, "back.toml".as_ref()).unwrap_or_else(|error| panic!("{error}\n{text}"));
            assert_eq!(back.arm.joints(), file.arm.joints());
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    }
}

fn urdf(text: &str) -> bool {
    survives(parse_urdf(text, "fuzz.urdf"))
}

fn toml(text: &str) -> bool {
    survives(parse_toml(text, "fuzz.toml".as_ref()))
}

#[test]
fn the_texts_to_be_mutated_are_valid() {
    assert!(urdf(URDF) && toml(TOML) && survives(Ok(paper_arm())));
}

#[test]
fn urdf_of_any_characters() {
    fuzz("URDF, any characters", any::<Vec<char>>().prop_map(String::from_iter), urdf);
}

#[test]
fn urdf_with_changes() {
    fuzz("URDF, changed", mutated(URDF), urdf);
}

#[test]
fn toml_of_any_characters() {
    fuzz("TOML, any characters", any::<Vec<char>>().prop_map(String::from_iter), toml);
}

#[test]
fn toml_with_changes() {
    fuzz("TOML, changed", mutated(TOML), toml);
}

#[test]
fn urdf_with_other_numbers() {
    fuzz("URDF, other numbers", renumbered(URDF), urdf);
}

#[test]
fn toml_with_other_numbers() {
    fuzz("TOML, other numbers", renumbered(TOML), toml);
}
