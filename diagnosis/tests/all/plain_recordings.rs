//! Recordings of typical simulations: without noise, with jittering stamps, with an effect that acts in one part only, with a push in one of two recordings.

use std::path::Path;

use freeplay_arm::{Arm, JointFriction, JointKind};
use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, Effect, Settings, Verdict, compare, diagnose};
use freeplay_laws::{Effects, Trajectory, predict};
use freeplay_model::{ArmFile, EffectTable};
use freeplay_recording::Recording;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use toml::Table;

use crate::common::{arm, even, link, sines};

const FRICTION: JointFriction = JointFriction { viscous: 2.0, coulomb: 1.5 };

fn two_joints() -> Arm {
    arm(vec![link("shoulder", JointKind::Revolute, FRICTION), link("elbow", JointKind::Revolute, FRICTION)])
}

/// The recording `name` of `arm` on its sines from the time `begin`, s, with the effects of `tables`, without noise: angles and torques.
fn recorded(name: &str, arm: &Arm, tables: &[EffectTable], begin: f64) -> Recording {
    Recording { tool: None, ..tracked(name, arm, tables, begin) }
}

/// The same with a tracked tool.
fn tracked(name: &str, arm: &Arm, tables: &[EffectTable], begin: f64) -> Recording {
    let t = even(16.0, 250.0);
    let mut motion = Trajectory {
        stretches: std::iter::once(0..t.len()).collect(),
        q: vec![Vec::new(); arm.dof()],
        v: vec![Vec::new(); arm.dof()],
        a: vec![Vec::new(); arm.dof()],
        t: t.clone(),
    };
    for &time in &t {
        let [q, v, a] = sines(arm, begin + time);
        let columns = [(&mut motion.q, q), (&mut motion.v, v), (&mut motion.a, a)];
        columns.into_iter().for_each(|(all, now)| all.iter_mut().zip(now).for_each(|(all, x)| all.push(x)));
    }
    let file = ArmFile { arm: arm.clone(), effects: tables.to_vec(), ignored: Vec::new() };
    let effects = Effects::of(&file).expect("effects");
    let says = predict(arm, &effects.placed, &motion, &|x: &[f64]| x.to_vec()).expect("a prediction");
    let named = |name: &str, columns: Vec<Vec<f64>>| -> Vec<(String, Vec<f64>)> {
        let numbered = columns.into_iter().enumerate();
        numbered.map(|(joint, column)| (format!("{name}{}", joint + 1), column)).collect()
    };
    let mut columns = vec![("t".to_owned(), t)];
    columns.extend(named("q", motion.q));
    columns.extend(named("tau", says.torque));
    columns.extend(["x", "y", "z"].map(str::to_owned).into_iter().zip(says.tool));
    Recording::new(Path::new(name), columns).expect("a recording")
}

/// Two recordings of `arm` with the effects of `tables`, in different motions.
fn in_two_motions(arm: &Arm, tables: &[EffectTable]) -> [Recording; 2] {
    [recorded("one", arm, tables, 0.0), recorded("two", arm, tables, 30.0)]
}

fn table(kind: &str, joint: Option<&str>, parameters: &str) -> EffectTable {
    let parameters: Table = parameters.parse().expect("parameters");
    EffectTable { kind: kind.to_owned(), joint: joint.map(str::to_owned), parameters, line: 0 }
}

fn diagnosed(arm: &Arm, recordings: &[Recording]) -> Diagnosis {
    let file = ArmFile { arm: arm.clone(), effects: Vec::new(), ignored: Vec::new() };
    diagnose(&file, recordings, &DiagnoseSettings::default(), &mut |_| {}).expect("a diagnosis")
}

/// The only named effect, which must be a `kind`.
fn only(diagnosis: &Diagnosis, kind: &str) -> Effect {
    println!("{}", diagnosis.statement);
    assert_eq!(diagnosis.verdict, Verdict::Named);
    let [effect] = diagnosis.effects.as_slice() else { panic!("{} effects", diagnosis.effects.len()) };
    assert_eq!(effect.kind, kind);
    effect.clone()
}

#[test]
fn nothing_is_missing_from_a_perfect_recording_without_noise() {
    let mut shaking = recorded("shaking", &two_joints(), &[], 0.0);
    shaking.t.iter_mut().enumerate().for_each(|(k, t)| *t += 8e-4 * (2.4 * k as f64).sin());
    let paper = freeplay_model::paper_arm().arm;
    for (arm, recordings) in [
        (two_joints(), vec![recorded("one", &two_joints(), &[], 0.0)]),
        (two_joints(), vec![shaking]),
        (paper.clone(), in_two_motions(&paper, &[]).into()),
    ] {
        let diagnosis = diagnosed(&arm, &recordings);
        println!("{}: {}", recordings[0].origin.display(), diagnosis.statement);
        assert_eq!(diagnosis.verdict, Verdict::NothingMissing);
    }
}

/// A planar arm: a force across the plane does no work, which must not hide the forces in the plane.
#[test]
fn a_push_in_one_of_two_recordings_is_named() {
    let push = table("external_force", None, "force = [12.0, 0.0, -20.0]\nstart = 5.0\nend = 7.5");
    let arm = two_joints();
    let recordings = [recorded("pushed", &arm, &[push], 0.0), recorded("repeat", &arm, &[], 30.0)];
    let effect = only(&diagnosed(&arm, &recordings), "external_force");
    for (name, exact, off) in [("start", 5.0, 0.03), ("end", 7.5, 0.03)] {
        let found = effect.parameters[name].value.as_float().expect("a number");
        println!("{name}: {found:.3} s for {exact}");
        assert!((found - exact).abs() < off);
    }
}

#[test]
fn a_coupling_without_inertia_and_dry_friction_is_named() {
    let coupling = table("joint_coupling", Some("elbow"), "with = \"shoulder\"\nviscous = 1.5\nsign = 1.0");
    let arm = two_joints();
    let recordings = in_two_motions(&arm, std::slice::from_ref(&coupling));
    let effect = only(&diagnosed(&arm, &recordings), "joint_coupling");
    let found = effect.parameters["viscous"].value.as_float().expect("a number");
    println!("{found:.3} N*m*s/rad for 1.5");
    assert!((found / 1.5 - 1.0).abs() < 0.05);
}

#[test]
fn one_delay_of_all_torques_is_not_a_low_pass_of_each() {
    let delay = table("time_delay", None, "channel = \"torque\"\ndelay = 0.006");
    let paper = freeplay_model::paper_arm().arm;
    let recordings = in_two_motions(&paper, std::slice::from_ref(&delay));
    let effect = only(&diagnosed(&paper, &recordings), "time_delay");
    let found = effect.parameters["delay"].value.as_float().expect("a number");
    println!("{:.2} ms for 6", 1e3 * found);
    assert!((found / 0.006 - 1.0).abs() < 0.1);
}

/// The delay is longer than a loop could tolerate for its encoders, but a torque may have it.
#[test]
fn a_torque_that_is_read_late_is_no_low_pass() {
    let delay = table("time_delay", None, "channel = \"torque\"\ndelay = 0.035");
    let arm = two_joints();
    let recordings = in_two_motions(&arm, std::slice::from_ref(&delay));
    let effect = only(&diagnosed(&arm, &recordings), "time_delay");
    let found = effect.parameters["delay"].value.as_float().expect("a number");
    println!("{:.2} ms for 35; log odds {:.0}", 1e3 * found, effect.evidence.log_odds);
    assert!((found / 0.035 - 1.0).abs() < 0.05);
    assert!(effect.evidence.log_odds > freeplay_diagnosis::NAMED_FROM);
}

/// The torque with jumping friction after a slow low-pass is no multiple of the torque after a fast one.
#[test]
fn a_slow_low_pass_of_a_torque_with_friction_is_found() {
    let joint = |name| link(name, JointKind::Revolute, JointFriction { viscous: 0.0, coulomb: 30.0 });
    let arm = arm(["shoulder", "elbow"].map(joint).to_vec());
    let slow = table("sensor_lowpass", Some("elbow"), "cutoff = 1.0");
    let recordings = in_two_motions(&arm, std::slice::from_ref(&slow));
    let effect = only(&diagnosed(&arm, &recordings), "sensor_lowpass");
    let found = effect.parameters["cutoff"].value.as_float().expect("a number");
    println!("{found:.4} Hz for 1, margin 5 %");
    assert!((found - 1.0).abs() < 0.05);
}

/// The file has no friction: the delay and the limit act on the torque including the friction that the diagnosis found.
#[test]
fn a_delay_and_a_limit_act_on_the_friction_that_was_found() {
    let links = ["shoulder", "elbow"].map(|name| link(name, JointKind::Revolute, JointFriction::default()));
    let arm = arm(links.to_vec());
    let friction = [
        table("coulomb_friction", Some("shoulder"), "coulomb = 8.0"),
        table("coulomb_friction", Some("elbow"), "coulomb = 6.0"),
        table("viscous_friction", Some("elbow"), "viscous = 4.0"),
    ];
    for (measures, joint, text, name, exact) in [
        ("time_delay", None, "channel = \"torque\"\ndelay = 0.02", "delay", 0.02),
        ("actuator_saturation", Some("elbow"), "limit = 12.0", "limit", 12.0),
    ] {
        let all: Vec<EffectTable> = friction.iter().cloned().chain([table(measures, joint, text)]).collect();
        let recordings = in_two_motions(&arm, &all);
        let diagnosis = diagnosed(&arm, &recordings);
        println!("{}", diagnosis.statement);
        assert_eq!((diagnosis.verdict, diagnosis.effects.len()), (Verdict::Named, 4));
        let effect = diagnosis.effects.iter().find(|effect| effect.kind == measures).expect("it");
        let found = effect.parameters[name].value.as_float().expect("a number");
        println!("{measures}: {found:.5} for {exact}");
        assert!((found / exact - 1.0).abs() < 0.05);
    }
}

/// A lighter link with another centre of mass, as an arm file from a drawing often has it.
#[test]
fn a_centre_of_mass_that_is_elsewhere_is_found() {
    let paper = freeplay_model::paper_arm().arm;
    let joint = paper.joints()[2].name.clone();
    let mass = table("link_mass", Some(&joint), "scale = 0.8\ncom_shift = [0.04, -0.06, 0.05]");
    let recordings = in_two_motions(&paper, std::slice::from_ref(&mass));
    let effect = only(&diagnosed(&paper, &recordings), "link_mass");
    let found = effect.parameters["scale"].value.as_float().expect("a number");
    println!("{found:.4} times as heavy for 0.8, {:?}", effect.parameters["com_shift"].value);
    assert_eq!(effect.joint, Some(joint));
}

/// As a shaft with its own share on each joint it would need negative friction in both joints.
#[test]
fn a_coupling_that_acts_across_only_is_one_effect() {
    let text =
        "with = \"shoulder\"\ninertia = 0.05\nviscous = 1.5\ncoulomb = 0.6\nsign = -1.0\nform = \"cross\"";
    let coupling = table("joint_coupling", Some("elbow"), text);
    let arm = two_joints();
    let recordings = in_two_motions(&arm, std::slice::from_ref(&coupling));
    let effect = only(&diagnosed(&arm, &recordings), "joint_coupling");
    assert_eq!(effect.parameters["form"].value.as_str(), Some("cross"));
    for (name, exact, off) in [("inertia", 0.05, 0.2), ("viscous", 1.5, 0.05), ("coulomb", 0.6, 0.1)] {
        let found = effect.parameters[name].value.as_float().expect("a number");
        println!("{name}: {found:.4} for {exact}");
        assert!((found / exact - 1.0).abs() < off, "{name}");
    }
}

/// Friction of the shoulder grows with the load of the shoulder, payload included: fitted to the load of the bare arm, its coefficient would be far too large.
#[test]
fn friction_grows_with_the_load_of_a_payload_that_was_found() {
    let arm = two_joints();
    let both = [
        table("payload", None, "mass = 3.0\ncom = [0.0, 0.0, 0.3]"),
        table("load_dependent_friction", Some("shoulder"), "coefficient = 0.2"),
    ];
    let recordings = in_two_motions(&arm, &both);
    let diagnosis = diagnosed(&arm, &recordings);
    println!("{}", diagnosis.statement);
    let named = |kind: &str| diagnosis.effects.iter().find(|effect| effect.kind == kind).expect(kind);
    for (kind, parameter, exact) in
        [("payload", "mass", 3.0), ("load_dependent_friction", "coefficient", 0.2)]
    {
        let found = named(kind).parameters[parameter].value.as_float().expect("a number");
        println!("{kind}: {found:.4} for {exact}");
        assert!((found / exact - 1.0).abs() < 0.05);
    }
}

/// As Coulomb friction with an offset it would be two effects instead of one.
#[test]
fn friction_that_differs_by_direction_is_one_effect() {
    let asymmetric = table("asymmetric_friction", Some("elbow"), "positive = 3.0\nnegative = 1.5");
    let arm = two_joints();
    let recordings = in_two_motions(&arm, std::slice::from_ref(&asymmetric));
    let effect = only(&diagnosed(&arm, &recordings), "asymmetric_friction");
    for (name, exact) in [("positive", 3.0), ("negative", 1.5)] {
        let found = effect.parameters[name].value.as_float().expect("a number");
        println!("{name}: {found:.3} N*m for {exact}");
        assert!((found / exact - 1.0).abs() < 0.05);
    }
}

/// A spring in series with a damper (Maxwell 1867): ż = q̇ − z/T, τ = k z. Sliding bristles are similar, and leave far more than noise; the other joints follow
/// their model down to the noise, so that idealised laws are no excuse.
#[test]
fn a_spring_that_relaxes_has_no_name() {
    const STIFFNESS: f64 = 120.0;
    const RELAXATION: f64 = 1.2;
    let arm = freeplay_model::paper_arm().arm;
    let mut recordings = in_two_motions(&arm, &[]);
    for recording in &mut recordings {
        let (t, q) = (recording.t.clone(), recording.q[0].clone());
        let mut deflection = 0.0;
        for k in 1..t.len() {
            // Exact for a constant speed between two samples.
            let decay = ((t[k - 1] - t[k]) / RELAXATION).exp();
            let speed = (q[k] - q[k - 1]) / (t[k] - t[k - 1]);
            deflection = deflection * decay + speed * RELAXATION * (1.0 - decay);
            recording.tau.as_mut().expect("torques")[0][k] += STIFFNESS * deflection;
        }
    }
    let diagnosis = diagnosed(&arm, &recordings);
    println!("{}", diagnosis.statement);
    assert_eq!(diagnosis.verdict, Verdict::Unknown);
}

/// A motor that starts on a flank, in a recording that does not cross the gap for long: a comparison takes the initial state from the torque.
#[test]
fn where_a_motor_begins_in_its_gap_is_taken_from_the_torque() {
    let arm = arm(vec![link("elbow", JointKind::Revolute, JointFriction { viscous: 0.0, coulomb: 0.0 })]);
    let gap = |begin: &str| {
        let parameters = format!("gap = 0.09\nfriction = 4.0\nstiffness = 400.0\n{begin}");
        table("backlash", Some("elbow"), &parameters)
    };
    let mut recording = recorded("begins ahead", &arm, &[gap("start = 1.0")], 0.0);
    // The first way back only.
    let furthest = |rows: &[f64]| (0..rows.len()).find(|&k| (rows[k] - rows[0]).abs() > 0.12);
    let end = furthest(&recording.q[0]).expect("it moves").max(300);
    let cut = |column: &mut Vec<f64>| column.truncate(end);
    cut(&mut recording.t);
    recording.q.iter_mut().chain(recording.tau.iter_mut().flatten()).for_each(cut);
    let left = |begin: &str| {
        let file = ArmFile { arm: arm.clone(), effects: vec![gap(begin)], ignored: Vec::new() };
        let effects = Effects::of(&file).expect("effects");
        let settings = Settings::default();
        compare(&arm, &effects.placed, &recording, &settings).expect("a comparison").0.channels[0].rmse
    };
    let (told, open, wrong) = (left("start = 1.0"), left(""), left("start = -1.0"));
    println!("{told:.4} N*m as it was, {open:.4} left open, {wrong:.4} from the other flank");
    assert!(wrong > 10.0 * told, "the beginning matters");
    assert!((open - told).abs() < 1e-9);
}

/// A journal in thick oil that starts somewhere in its bearing: the diagnosis and a comparison both take the initial state from the tool.
#[test]
fn where_a_journal_begins_in_oil_is_taken_from_the_tool() {
    let arm = two_joints();
    let film = |begin: &str| {
        let parameters = format!("clearance = 4e-4\nviscosity = 12.0\n{begin}");
        table("lubricated_clearance", Some("elbow"), &parameters)
    };
    let recording = tracked("begins above", &arm, &[film("start = [-0.5, 0.0, 0.4]")], 0.0);
    let found = only(&diagnosed(&arm, std::slice::from_ref(&recording)), "lubricated_clearance");
    for (name, expected, margin) in [("clearance", 4e-4, 2e-5), ("viscosity", 12.0, 1.2)] {
        let value = found.parameters[name].value.as_float().expect("a number");
        println!("{name} {value:.4e} for {expected:.4e}, margin {margin:.1e}");
        assert!((value - expected).abs() < margin);
    }
    let left = |begin: &str| {
        let file = ArmFile { arm: arm.clone(), effects: vec![film(begin)], ignored: Vec::new() };
        let effects = Effects::of(&file).expect("effects");
        let (comparison, _) =
            compare(&arm, &effects.placed, &recording, &Settings::default()).expect("a comparison");
        let tool =
            comparison.channels.iter().filter(|channel| ["x", "y", "z"].contains(&channel.name.as_str()));
        tool.map(|channel| channel.rmse.powi(2)).sum::<f64>().sqrt()
    };
    let (told, open, wrong) = (left("start = [-0.5, 0.0, 0.4]"), left(""), left("start = [0.5, 0.0, -0.4]"));
    println!("{told:.1e} m as it was, {open:.1e} left open, {wrong:.1e} from the other side");
    assert!(wrong > 1e-5 && open < 0.02 * wrong);
}

/// Its tensor is 0.16 kg·m² a kilogram about the last joint: without the tensor, a lighter load and a heavier link would be nearly equivalent.
#[test]
fn a_load_at_the_tool_far_from_the_last_joint_is_one_body() {
    let load = table("payload", None, "mass = 0.8\ncom = [0.39, 0.0, -0.02]");
    let arm = two_joints();
    let recordings = in_two_motions(&arm, std::slice::from_ref(&load));
    let effect = only(&diagnosed(&arm, &recordings), "payload");
    let mass = &effect.parameters["mass"];
    let found = mass.value.as_float().expect("a number");
    println!("{found:.3} kg in {:?} for 0.8", mass.ci95);
    assert!((found / 0.8 - 1.0).abs() < 0.1);
}

/// The drive clips at the peaks of the first half. The rest stays below the limit, or reaches it in a row or two, which noise moves to either side.
#[test]
fn a_drive_that_clips_in_the_first_half_alone_is_named() {
    let arm = two_joints();
    let most = |torque: &[f64]| torque.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let halves = |begin: f64| {
        let torques = recorded("clean", &arm, &[], begin).tau.expect("torques");
        let (first, last) = torques[0].split_at(torques[0].len() / 2);
        [most(first), most(last)]
    };
    let begins = (0..60).map(f64::from).map(|begin| (begin, halves(begin)));
    let most_unlike = begins.max_by(|(_, a), (_, b)| (a[0] / a[1]).total_cmp(&(b[0] / b[1])));
    let (begin, [early, late]) = most_unlike.expect("one of sixty");
    println!("at most {early:.1} N*m in the first half, {late:.1} in the second, from {begin} s on");
    let limit = table("actuator_saturation", Some("shoulder"), &format!("limit = {}", 0.998 * late));
    for seed in 1..4 {
        let mut clipped = recorded("clipped", &arm, std::slice::from_ref(&limit), begin);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        for torque in clipped.tau.iter_mut().flatten().flatten() {
            *torque += 0.6 * (rng.random::<f64>() + rng.random::<f64>() - 1.0);
        }
        let effect = only(&diagnosed(&arm, &[clipped]), "actuator_saturation");
        println!("{:?} for {:.2} N*m", effect.parameters["limit"], 0.998 * late);
    }
}

/// A bending link changes the levers by which the drives hold the load. That is no offset of the torques.
#[test]
fn a_link_that_bends_is_one_effect() {
    let bending = table("link_flexure", Some("shoulder"), "stiffness = 4e4");
    let arm = two_joints();
    let recordings = [
        tracked("one", &arm, std::slice::from_ref(&bending), 0.0),
        tracked("two", &arm, std::slice::from_ref(&bending), 30.0),
    ];
    let effect = only(&diagnosed(&arm, &recordings), "link_flexure");
    let found = effect.parameters["stiffness"].value.as_float().expect("a number");
    println!("{found:.0} N/m for 40000");
    assert!((found / 4e4 - 1.0).abs() < 0.02);
}
