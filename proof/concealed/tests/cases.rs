//! Whole cases: the same seed gives the same numbers, severities equal the requests, and the files reveal nothing.

use freeplay_concealed::{
    CATALOGUE, Case, Demand, Machine, Noise, OUTSIDE, Severity, generate, seats, write_case,
};

fn case(kind: Option<&str>, seed: u64) -> Case {
    let effects = kind.map(|kind| Demand { kind: kind.to_owned(), joint: None, severity: Severity::Clear });
    Case {
        machine: Machine::Slide,
        effects: effects.into_iter().collect(),
        family: None,
        noise: Noise::Middle,
        hollow: false,
        seed,
    }
}

#[test]
fn the_same_case_gives_the_same_numbers() {
    let wanted = case(Some("coulomb_friction"), 11);
    let (one, two) = (generate(&wanted).expect("a case"), generate(&wanted).expect("a case"));
    assert_eq!(one.recording, two.recording);
    assert_eq!(one.truth, two.truth);
    let other = generate(&case(Some("coulomb_friction"), 12)).expect("a case");
    assert_ne!(one.recording, other.recording);
    let found = one.truth.effects[0].signal_to_floor;
    println!("signal to floor {found:.3}, asked for 3.6 to 4.6");
    assert!(found > 3.0 && found < 5.5);
    assert!(
        one.recording.t.len() > 1000
            && one.recording.columns.iter().all(|c| c.len() == one.recording.t.len())
    );
    assert!(one.recording.t.windows(2).all(|pair| pair[1] > pair[0]), "time increases");
}

/// The other random draws do not depend on the effect: length, rate and columns are those of the negative control.
#[test]
fn an_effect_leaves_no_mark_on_the_form() {
    let seed = 5;
    let (with, without) = (
        generate(&case(Some("viscous_friction"), seed)).expect("a case"),
        generate(&case(None, seed)).expect("a case"),
    );
    assert_eq!(with.recording.names, without.recording.names);
    assert_eq!(with.recording.t, without.recording.t);
    assert_eq!(with.model, without.model);
    assert_ne!(with.recording.columns, without.recording.columns);
}

#[test]
fn every_kind_has_a_place_in_three_machines() {
    for kind in CATALOGUE.iter().chain(&OUTSIDE) {
        let places = Machine::ALL
            .iter()
            .filter(|machine| !seats(kind, &machine.data_sheet().expect("a data sheet")).is_empty())
            .count();
        assert!(places >= 3, "{kind}: {places}");
    }
}

#[test]
fn files_can_be_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = generate(&case(None, 2)).expect("a case");
    write_case(folder.path(), 7, &made).expect("files");
    let arm = freeplay_model::load(&folder.path().join("0007/model.toml")).expect("a model");
    assert!(arm.effects.is_empty() && arm.arm.dof() == 1);
    for file in ["recording.csv", "second.csv"] {
        let read =
            freeplay_recording::read(&folder.path().join("0007").join(file), Some(1)).expect("a recording");
        assert!(read.len() > 1000);
    }
    let truth = std::fs::read_to_string(folder.path().join("truth/0007.json")).expect("the truth");
    let truth: serde_json::Value = serde_json::from_str(&truth).expect("JSON");
    assert_eq!(truth["effects"].as_array().map(Vec::len), Some(0));
}

/// The same case with and without its effect: the same machine, motion and noise.
fn pair(kind: &str, severity: Severity, seed: u64) -> [freeplay_concealed::Made; 2] {
    let mut wanted = case(Some(kind), seed);
    wanted.effects[0].severity = severity;
    wanted.family = Some(freeplay_concealed::Family::Fourier);
    let hollow = Case { hollow: true, ..wanted.clone() };
    [wanted, hollow].map(|case| generate(&case).expect("a case"))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    values.for_each(|x| (sum, count) = (sum + x * x, count + 1.0));
    f64::sqrt(sum / count)
}

/// The stated strength equals that of the files: with and without the effect they differ by the stated multiple of the floor. The test computes the floor from
/// the file without the effect, with mass, rotor and friction of the data sheet and the measured motion, differentiated here.
#[test]
fn an_effect_is_as_strong_as_is_claimed() {
    let mut looked = 0;
    for (seed, severity) in (1..60).zip(Severity::ALL.into_iter().cycle()) {
        let [with, without] = pair("viscous_friction", severity, seed);
        let (Some(position), Some(torque)) = (place(&with, "q1"), place(&with, "tau1")) else {
            continue;
        };
        let truth = &with.truth.effects[0];
        assert!(truth.channel == "tau1" && without.truth.effects.is_empty());
        let arm =
            freeplay_model::parse_toml(&with.model, std::path::Path::new("model.toml")).expect("a model").arm;
        let (joint, t) = (&arm.joints()[0], &without.recording.t);
        // A parabola through samples 20 ms apart.
        let apart = (0.02 * with.truth.rate) as usize;
        let q = &without.recording.columns[position];
        let tau = &without.recording.columns[torque];
        let gravity = arm.gravity().dot(&(joint.placement.rotation * joint.axis.into_inner()));
        let residual = (apart..t.len() - apart).filter_map(|k| {
            let h = 0.5 * (t[k + apart] - t[k - apart]);
            let v = (q[k + apart] - q[k - apart]) / (2.0 * h);
            let a = (q[k + apart] - 2.0 * q[k] + q[k - apart]) / (h * h);
            let friction = joint.friction.viscous * v + joint.friction.coulomb * v.signum();
            let moves = v.abs() > 0.03 * joint.limits.velocity;
            moves.then(|| tau[k] - joint.inertia.mass * (a - gravity) - joint.rotor_inertia * a - friction)
        });
        let residual: Vec<f64> = residual.collect();
        // Content below some 20 Hz comes from the machine alone; the rest is noise of the sensor, which is part of the floor, and of the servo, which is not.
        let window = 2 * (0.012 * with.truth.rate) as usize + 1;
        let slow = residual.windows(window).map(|values| values.iter().sum::<f64>() / window as f64);
        let (least, most) = (rms(slow), rms(residual.iter().copied()));
        let trace = with.recording.columns[torque].iter().zip(tau).map(|(with, without)| with - without);
        let (trace, claimed) = (rms(trace), truth.signal_to_floor);
        let [low, high] = [trace / most, trace / least];
        println!(
            "seed {seed}: claimed {claimed:.2}, in the files {low:.2} with all noise, {high:.2} without"
        );
        assert!(0.95 * low < claimed && claimed < 1.05 * high, "seed {seed}");
        looked += 1;
        if looked == 3 {
            return;
        }
    }
    panic!("only {looked} recordings with a reference");
}

fn place(made: &freeplay_concealed::Made, name: &str) -> Option<usize> {
    made.recording.names.iter().position(|other| other == name)
}

/// A negative control is the machine drawn for the omitted effect, without further differences.
#[test]
fn a_negative_control_conceals_nothing() {
    let [_, without] = pair("coulomb_friction", Severity::Slight, 9);
    let [_, other] = pair("viscous_friction", Severity::Strong, 9);
    assert!(without.truth.effects.is_empty());
    assert_eq!(without.recording, other.recording, "whatever was left out, the machine is the same");
}
