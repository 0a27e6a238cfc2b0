//! Tests of the states of every kind of effect: a state restored in the middle of a run, into the same instance and, as bytes, into a new
//! one, gives identical bits.

use std::path::Path;
use std::time::{Duration, Instant as Clock};

use freeplay_fmi::{Causality, Fault, Instance, State, Value};
use freeplay_laws::kinds;
use freeplay_model::{ArmFile, paper_arm, parse_toml, to_toml};

/// One table for every kind of effect, at a joint on which it acts; several for a kind with different internal states.
const EFFECTS: &[(&str, &str)] = &[
    ("actuator_saturation", "joint = \"joint_2\"\nlimit = 10.0"),
    ("asymmetric_friction", "joint = \"joint_3\"\npositive = 3.0\nnegative = 5.0"),
    ("backlash", "joint = \"joint_4\"\ngap = 0.01\nstiffness = 500.0\ncourse = \"rest\""),
    ("backlash", "joint = \"joint_4\"\ngap = 0.01\nfriction = 2.0"),
    ("base_tilt", "roll = 0.1\npitch = -0.06"),
    ("coulomb_friction", "joint = \"joint_3\"\ncoulomb = 4.0"),
    ("encoder_eccentricity", "joint = \"joint_2\"\namplitude = 0.01"),
    ("encoder_offset", "joint = \"joint_2\"\noffset = 0.03"),
    ("external_force", "force = [5.0, 0.0, -5.0]\nstart = 0.03\nend = 0.08"),
    ("external_torque", "joint = \"joint_2\"\ntorque = 5.0\nstart = 0.03\nend = 0.08"),
    ("friction_drift", "joint = \"joint_2\"\namount = 2.0\ntime_constant = 0.1"),
    ("joint_clearance", "joint = \"joint_5\"\nclearance = 0.0006"),
    ("joint_coupling", "joint = \"joint_6\"\nwith = \"joint_5\"\nsign = -1.0\ninertia = 0.4\nviscous = 3.0"),
    ("joint_elasticity", "joint = \"joint_2\"\nstiffness = 2e4\ndamping = 60.0"),
    ("joint_spring", "joint = \"joint_2\"\nstiffness = 300.0\nrest = 0.2"),
    ("link_flexure", "joint = \"joint_3\"\nstiffness = 1e5"),
    ("link_length", "joint = \"joint_2\"\noffset = 0.02"),
    ("link_mass", "joint = \"joint_3\"\nscale = 1.3"),
    ("load_change", "mass = 0.05\ntime = 0.05\nacts = \"after\""),
    ("load_dependent_friction", "joint = \"joint_3\"\ncoefficient = 0.1"),
    ("lubricated_clearance", "joint = \"joint_5\"\nclearance = 0.0006\nviscosity = 0.5"),
    ("mount_compliance", "compliance_x = 1e-5\ncompliance_y = 2e-5"),
    ("payload", "mass = 2.0\ncom = [0.05, 0.02, -0.03]\nmoments = [0.02, 0.03, 0.025]"),
    ("position_dependent_friction", "joint = \"joint_3\"\namplitude = 2.0\nperiods = 7.0"),
    ("presliding_friction", "joint = \"joint_2\"\nstiffness = 1e4\ncoulomb = 12.0"),
    ("quadratic_drag", "joint = \"joint_2\"\ncoefficient = 25.0"),
    ("rotor_inertia", "joint = \"joint_3\"\ninertia = 4.0"),
    ("sensor_lowpass", "joint = \"joint_3\"\ncutoff = 40.0"),
    ("stribeck_friction", "joint = \"joint_2\"\nextra = 3.0\nvelocity = 0.1"),
    ("time_delay", "delay = 0.0034\nchannel = \"position\""),
    ("time_delay", "delay = 0.0034\nchannel = \"torque\""),
    ("torque_gain", "joint = \"joint_2\"\ngain = 0.85"),
    ("torque_offset", "joint = \"joint_3\"\noffset = -2.0"),
    ("torque_ripple", "joint = \"joint_3\"\namplitude = 2.0\nperiods = 30.0"),
    ("viscous_friction", "joint = \"joint_2\"\nviscous = 8.0"),
];

/// Number of steps of a run, and the step at which its state is saved.
const STEPS: [u32; 2] = [100, 50];

fn arm(kind: &str, parameters: &str) -> ArmFile {
    let effect = format!("\n[[effect]]\nkind = \"{kind}\"\n{parameters}\n");
    // The wrist gets friction of its own, which a drift changes.
    let text = to_toml(&paper_arm()).replace("limits = ", "damping = 2.0\nfriction = 1.0\nlimits = ");
    parse_toml(&(text + &effect), Path::new("arm.toml")).unwrap()
}

fn set(instance: &mut Instance, name: &str, value: Value) {
    let place = instance.variables().0.iter().position(|variable| variable.name == name).expect(name);
    instance.set(u32::try_from(place).unwrap(), value).unwrap();
}

/// A running instance of the arm of `file`, bent.
fn running(file: &ArmFile) -> Instance {
    let mut instance = Instance::new(file.clone()).unwrap();
    for (joint, value) in [(2, 0.4), (3, 0.9), (5, 0.5)] {
        set(&mut instance, &format!("start.q.joint_{joint}"), Value::Real(value));
    }
    instance.enter_initialization(0.0).unwrap();
    instance.exit_initialization().unwrap();
    instance
}

/// Makes step number `tick` under oscillating torques and returns all outputs after it.
fn step(instance: &mut Instance, tick: u32) -> Vec<u64> {
    for joint in 1..=6_u8 {
        let torque = 40.0 * (0.2 * f64::from(tick) + f64::from(joint)).sin() / f64::from(joint);
        set(instance, &format!("torque.joint_{joint}"), Value::Real(torque));
    }
    set(instance, "brakes", Value::Truth(tick == 0));
    instance.step(f64::from(tick) * 1e-3, 1e-3).unwrap();
    outputs(instance)
}

fn outputs(instance: &mut Instance) -> Vec<u64> {
    let variables = instance.variables().0.iter().enumerate();
    let read = variables.filter(|(_, variable)| variable.causality == Causality::Output);
    let references: Vec<usize> = read.map(|(index, _)| index).collect();
    let value = |index: usize| match instance.get(u32::try_from(index).unwrap()).unwrap() {
        Value::Real(value) => value.to_bits(),
        Value::Whole(value) => u64::from(value.cast_unsigned()),
        Value::Truth(value) => u64::from(value),
    };
    references.into_iter().map(value).collect()
}

#[test]
fn a_state_of_every_kind_of_effect_gives_the_same_bits_from_there_on() {
    for kind in kinds() {
        assert!(EFFECTS.iter().any(|(name, _)| *name == kind.name), "no table for {}", kind.name);
    }
    let [steps, taken] = STEPS;
    for (kind, parameters) in EFFECTS {
        let file = arm(kind, parameters);
        let mut one = running(&file);
        let before: Vec<Vec<u64>> = (0..taken).map(|tick| step(&mut one, tick)).collect();
        let kept = one.fmu_state();
        let after: Vec<Vec<u64>> = (taken..steps).map(|tick| step(&mut one, tick)).collect();
        assert_ne!(before.last(), after.last(), "{kind}: it moves");
        let bytes = kept.to_bytes();
        assert_eq!(bytes.len(), kept.size());
        let mut other = Instance::new(file).unwrap();
        let again = other.state_of(&bytes).unwrap();
        for (instance, state) in [(&mut one, kept), (&mut other, again)] {
            instance.restore(&state).unwrap();
            assert_eq!(Some(&outputs(instance)), before.last(), "{kind}");
            let played: Vec<Vec<u64>> = (taken..steps).map(|tick| step(instance, tick)).collect();
            assert_eq!(played, after, "{kind}, {parameters}");
        }
    }
}

/// An arm whose joints have servos gets positions instead of torques; the state contains delayed commands on their way.
#[test]
fn an_arm_with_servos_gets_positions_and_keeps_those_under_way() {
    let servo = |joint: u8| {
        let [stiffness, damping] = if joint < 4 { [2e4, 400.0] } else { [40.0, 0.5] };
        format!(
            "kind = \"servo\"\njoint = \"joint_{joint}\"\nstiffness = {stiffness:?}\ndamping = {damping:?}\n\
             [[effect]]\nkind = \"command_delay\"\njoint = \"joint_{joint}\"\ndelay = 0.0125\n[[effect]]\n"
        )
    };
    let servos: String = (1..=6).map(servo).collect();
    let text = format!(
        "{}\n[[effect]]\n{servos}kind = \"base_tilt\"\nroll = 0.0\npitch = 0.0\n",
        to_toml(&paper_arm())
    );
    let file = parse_toml(&text, Path::new("servo.toml")).unwrap();
    let command = |instance: &mut Instance, tick: u32| {
        for joint in 1..=6_u8 {
            let swing = 0.1 * (0.02 * f64::from(tick) + f64::from(joint)).sin();
            set(instance, &format!("position.joint_{joint}"), Value::Real(swing));
        }
        instance.step(f64::from(tick) * 1e-3, 1e-3).unwrap();
        outputs(instance)
    };
    let mut one = running(&file);
    one.step(0.0, 1e-3).unwrap();
    let held = one.fmu_state();
    let rows: Vec<Vec<u64>> = (1..60).map(|tick| command(&mut one, tick)).collect();
    let kept = one.fmu_state();
    let after: Vec<Vec<u64>> = (60..90).map(|tick| command(&mut one, tick)).collect();
    assert!(one.variables().0.iter().all(|variable| !variable.name.starts_with("torque.")));
    let mut other = Instance::new(file).unwrap();
    for (state, first, expected) in [(kept, 60, after), (held, 1, rows)] {
        let state = other.state_of(&state.to_bytes()).unwrap();
        other.restore(&state).unwrap();
        let played: Vec<Vec<u64>> =
            (first..).take(expected.len()).map(|tick| command(&mut other, tick)).collect();
        assert_eq!(played, expected);
    }
}

#[test]
fn a_state_of_another_fmu_or_of_changed_bytes_is_refused_and_changes_nothing() {
    let mut instance = running(&arm("coulomb_friction", "joint = \"joint_3\"\ncoulomb = 4.0"));
    let mut foreign = running(&arm("coulomb_friction", "joint = \"joint_3\"\ncoulomb = 4.1"));
    step(&mut instance, 0);
    step(&mut foreign, 0);
    let (row, state) = (outputs(&mut instance), instance.fmu_state());
    let (bytes, other) = (state.to_bytes(), foreign.fmu_state());
    assert!(matches!(instance.restore(&other), Err(Fault::Foreign)));
    assert!(matches!(instance.state_of(&other.to_bytes()), Err(Fault::Foreign)));
    assert!(matches!(instance.state_of(b"fpstate1 of long ago"), Err(Fault::NoState)));
    for length in [8, 40, 71, 80, bytes.len() - 1] {
        assert!(matches!(instance.state_of(&bytes[..length]), Err(Fault::Damaged)), "{length} bytes");
    }
    for place in [45, bytes.len() / 2, bytes.len() - 1] {
        let mut changed = bytes.clone();
        changed[place] ^= 1;
        assert!(matches!(instance.state_of(&changed), Err(Fault::Damaged)), "byte {place}");
    }
    assert_eq!(outputs(&mut instance), row);
    instance.restore(&state).unwrap();
    assert_eq!(outputs(&mut instance), row);
}

/// Least time of ten restorations of `state`.
fn restored_in(instance: &mut Instance, state: &State) -> Duration {
    let timed = |_| {
        let start = Clock::now();
        instance.restore(state).unwrap();
        start.elapsed()
    };
    (0..10).map(timed).min().unwrap()
}

/// Size and time of a state must not grow with the simulated time: a replay of 4,000 steps would take a thousand times as long as one of
/// four.
#[test]
fn a_state_is_put_back_in_a_time_that_does_not_depend_on_the_time_simulated() {
    let file = arm("joint_elasticity", "joint = \"joint_2\"\nstiffness = 2e4\ndamping = 60.0");
    let (mut early, mut late) = (running(&file), running(&file));
    (0..4).for_each(|tick| {
        step(&mut early, tick);
    });
    set(&mut late, "brakes", Value::Truth(true));
    late.step(0.0, 4.0).unwrap();
    let states = [early.fmu_state(), late.fmu_state()];
    assert_eq!(states[0].size(), states[1].size());
    let mut fresh = Instance::new(file).unwrap();
    let times = [0, 1].map(|number: usize| restored_in(&mut fresh, &states[number]));
    println!("{} bytes, {:?} after 4 steps, {:?} after 4,000", states[0].size(), times[0], times[1]);
    assert!(times[1] < 100 * times[0].max(Duration::from_micros(1)), "{times:?}");
}
