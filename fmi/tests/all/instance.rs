//! Tests of an instance as an importer uses it: modes, values, steps, and bit-identical restored states.

use std::path::Path;

use freeplay_fmi::{Causality, Fault, Instance, Quantity, Value, description};
use freeplay_model::{ArmFile, paper_arm, parse_toml, to_toml};

/// The paper's arm with play, friction with internal state, and a sensor with internal state.
fn worn() -> ArmFile {
    let effects = "
[[effect]]
kind = \"joint_clearance\"
joint = \"joint_5\"
clearance = 0.0006
[[effect]]
kind = \"presliding_friction\"
joint = \"joint_2\"
stiffness = 1e4
coulomb = 12.0
[[effect]]
kind = \"sensor_lowpass\"
joint = \"joint_3\"
cutoff = 40.0
[[effect]]
kind = \"time_delay\"
delay = 0.0034
channel = \"position\"
";
    parse_toml(&(to_toml(&paper_arm()) + effects), Path::new("worn.toml")).unwrap()
}

fn reference(instance: &Instance, name: &str) -> u32 {
    let variables = &instance.variables().0;
    u32::try_from(variables.iter().position(|variable| variable.name == name).expect(name)).unwrap()
}

fn outputs(instance: &mut Instance) -> Vec<u64> {
    let variables = instance.variables().0.clone();
    let read = variables.iter().enumerate().filter(|(_, variable)| variable.causality == Causality::Output);
    read.map(|(index, _)| match instance.get(u32::try_from(index).unwrap()).unwrap() {
        Value::Real(value) => value.to_bits(),
        Value::Whole(value) => u64::from(value.cast_unsigned()),
        Value::Truth(value) => u64::from(value),
    })
    .collect()
}

/// A running instance of the worn arm, bent at the elbow.
fn running() -> Instance {
    let mut instance = Instance::new(worn()).unwrap();
    for (name, value) in [("start.q.joint_2", 0.4), ("start.q.joint_3", 0.9), ("start.q.joint_5", 0.5)] {
        let reference = reference(&instance, name);
        instance.set(reference, Value::Real(value)).unwrap();
    }
    instance.enter_initialization(0.0).unwrap();
    instance.exit_initialization().unwrap();
    instance
}

/// Makes step number `tick` under oscillating torques.
fn step(instance: &mut Instance, tick: u32) {
    for joint in 1..=6_u8 {
        let reference = reference(instance, &format!("torque.joint_{joint}"));
        let torque = 40.0 * (0.02 * f64::from(tick) + f64::from(joint)).sin() / f64::from(joint);
        instance.set(reference, Value::Real(torque)).unwrap();
    }
    let brakes = reference(instance, "brakes");
    instance.set(brakes, Value::Truth(tick == 0)).unwrap();
    instance.step(f64::from(tick) * 1e-3, 1e-3).unwrap();
}

#[test]
fn a_state_put_back_gives_the_same_bits_from_there_on() {
    let mut one = running();
    let mut rows = Vec::new();
    let mut kept = None;
    for tick in 0..120 {
        if tick == 60 {
            kept = Some(one.fmu_state());
        }
        step(&mut one, tick);
        rows.push(outputs(&mut one));
    }
    let kept = kept.unwrap();
    assert_ne!(rows[59], rows[119], "it moves");
    let bytes = kept.to_bytes();
    let mut other = Instance::new(worn()).unwrap();
    let again = other.state_of(&bytes).unwrap();
    for (instance, state) in [(&mut one, kept), (&mut other, again)] {
        instance.restore(&state).unwrap();
        assert_eq!(outputs(instance), rows[59]);
        for tick in 60..120 {
            step(instance, tick);
            assert_eq!(outputs(instance), rows[tick as usize], "step {tick}");
        }
    }
}

#[test]
fn a_parameter_counts_from_the_start_and_is_refused_later() {
    let sag = |clearance: f64| {
        let play = "\n[[effect]]\nkind = \"joint_clearance\"\njoint = \"joint_5\"\nclearance = 0.0004\n";
        let file = parse_toml(&(to_toml(&paper_arm()) + play), Path::new("worn.toml")).unwrap();
        let mut instance = Instance::new(file).unwrap();
        let parameter = reference(&instance, "joint_clearance.joint_5.clearance");
        instance.set(parameter, Value::Real(clearance)).unwrap();
        instance.enter_initialization(0.0).unwrap();
        instance.exit_initialization().unwrap();
        let brakes = reference(&instance, "brakes");
        instance.set(brakes, Value::Truth(true)).unwrap();
        // The joints are at rest, and the journal falls through its clearance; one call makes many steps.
        instance.step(0.0, 0.3).unwrap();
        assert!((instance.time() - 0.3).abs() < 1e-12);
        let refused = instance.set(parameter, Value::Real(clearance)).unwrap_err();
        assert!(matches!(refused, Fault::ReadOnly(_)), "{refused}");
        let z = reference(&instance, "deviation.z");
        let Value::Real(sag) = instance.get(z).unwrap() else { panic!("a number") };
        sag
    };
    let (narrow, wide) = (sag(0.0002), sag(0.0006));
    assert!((narrow + 0.0002).abs() < 2e-5 && (wide + 0.0006).abs() < 2e-5, "{narrow} {wide}");
}

#[test]
fn what_an_importer_gets_wrong_is_refused_in_words() {
    let mut instance = running();
    let torque = reference(&instance, "torque.joint_1");
    let faults = [
        instance.step(0.0, 0.0015).unwrap_err(),
        instance.step(0.5, 0.001).unwrap_err(),
        instance.step(0.0, -0.001).unwrap_err(),
        instance.set(torque, Value::Real(f64::NAN)).unwrap_err(),
        instance.set(torque, Value::Whole(3)).unwrap_err(),
        instance.set(99_999, Value::Real(0.0)).unwrap_err(),
        instance.enter_initialization(0.0).unwrap_err(),
        instance.state_of(b"fpstate1 and more").unwrap_err(),
    ];
    let words = faults.map(|fault| fault.to_string());
    let expected = [
        "whole multiple",
        "is at 0 s",
        "whole multiple",
        "out of range",
        "value reference",
        "value reference",
        "not allowed in step mode",
        "no state",
    ];
    for (words, expected) in words.iter().zip(expected) {
        assert!(words.contains(expected), "{words}: {expected}");
    }
    instance.terminate().unwrap();
    assert!(instance.step(0.0, 1e-3).is_err());
}

#[test]
fn the_description_lists_every_variable_with_its_unit() {
    let file = worn();
    let xml = description(&file, "model").unwrap();
    let document = roxmltree::Document::parse(&xml).unwrap();
    let instance = Instance::new(file).unwrap();
    let variables = &instance.variables().0;
    let listed = document.descendants().find(|node| node.has_tag_name("ModelVariables")).unwrap();
    let names: Vec<_> = listed.children().filter_map(|node| node.attribute("name")).collect();
    assert_eq!(names, variables.iter().map(|variable| variable.name.as_str()).collect::<Vec<_>>());
    let units: Vec<_> = document
        .descendants()
        .filter(|node| node.has_tag_name("Unit"))
        .filter_map(|node| node.attribute("name"))
        .collect();
    assert!(
        variables.iter().all(|variable| variable.unit.is_empty() || units.contains(&variable.unit.as_str()))
    );
    assert!(variables.iter().any(|variable| matches!(variable.quantity, Quantity::ContactForce(0))));
}
