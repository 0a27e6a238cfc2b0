//! Effects in the tool's position, in link encoders or in other sensors, each against its closed form.
use crate::common;
use std::f64::consts::{FRAC_PI_2, TAU};

use freeplay_arm::JointKind::Revolute;
use freeplay_arm::{Arm, Inertia, Joint};
use freeplay_laws::{
    ArmWithPlay, Clearance, ClearanceTable, Effects, Injection, Prediction, Readings, Scene, predict,
};
use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::common::{added, arm, close, effect, motion, one_link, raw, samples};

const MASS: f64 = 2.0;
const G: f64 = 9.81;

/// The link is at q − q₀: the tool, 1 m out, deviates by that angle.
#[test]
fn an_encoder_offset_moves_the_tool() {
    let arm = one_link(Revolute, MASS);
    let shown =
        added(&arm, &[effect(&arm, "encoder_offset", Some(0), "offset = 0.01")], &samples(&[0.0], &[0.0]));
    close("link", shown.link[0][0], -0.01, 1e-15);
    // Positive q points down; the link is at a smaller angle than the reading, so that the tool is higher.
    close("tool z", shown.tool[2][0], 0.01_f64.sin(), 1e-12);
    close("torque", shown.torque[0][0], -MASS * G * 0.5 * (0.01_f64.cos() - 1.0), 1e-12);
}

/// At the computed position the encoder gives the original reading.
#[test]
fn an_eccentric_encoder_reads_back() {
    let arm = one_link(Revolute, MASS);
    let readings = [0.0, 1.0, 2.5, -3.0];
    let eccentric = effect(&arm, "encoder_eccentricity", Some(0), "amplitude = 0.05\nphase = 0.7");
    let mut injection = Injection::default();
    eccentric.effect.inject(&mut injection);
    let shown = added(&arm, &[eccentric], &samples(&readings, &[0.0; 4]));
    for (reading, shift) in readings.iter().zip(&shown.link[0]) {
        let (mut q, mut none) = ([reading + shift], [[0.0; 1]; 3]);
        let [v, torque, link] = &mut none;
        let mut of = Readings { period: 1e-3, q: &mut q, v, torque, link, tool: &mut [0.0; 3] };
        injection.sensors[0].read(&mut of);
        close("read back", q[0], *reading, 1e-12);
    }
    assert!(common::greatest(&shown.link[0]) > 0.02);
}

#[test]
fn a_longer_link_moves_the_tool_along_itself() {
    let arm = one_link(Revolute, MASS);
    let length = |text: &str| {
        added(&arm, &[effect(&arm, "link_length", Some(0), text)], &samples(&[FRAC_PI_2], &[0.0]))
    };
    let shown = length("offset = 0.003");
    close("hanging link, z", shown.tool[2][0], -0.003, 1e-12);
    let shown = length("offset = 0.003\nalong = \"y\"");
    close("across, y", shown.tool[1][0], 0.003, 1e-12);
}

/// A link hangs to one side, then to the other: the load changes its sign, and the link steps by the whole gap, plus load/k.
#[test]
fn backlash_is_a_step_of_the_gap_where_the_load_turns() {
    let arm = one_link(Revolute, MASS);
    let q = [FRAC_PI_2 - 0.1, FRAC_PI_2 + 0.1];
    let load = q.map(|q: f64| -MASS * G * 0.5 * q.cos());
    let rigid = added(&arm, &[effect(&arm, "backlash", Some(0), "gap = 0.004")], &samples(&q, &[1.0; 2]));
    close("before", rigid.link[0][0], 0.002, 1e-15);
    close("after", rigid.link[0][1], -0.002, 1e-15);
    let soft = effect(&arm, "backlash", Some(0), "gap = 0.004\nstiffness = 500.0");
    let soft = added(&arm, &[soft], &samples(&q, &[1.0; 2]));
    for (point, side) in [(0, 0.002), (1, -0.002)] {
        close("with give", soft.link[0][point], side - load[point] / 500.0, 1e-12);
    }
    let elastic = effect(&arm, "joint_elasticity", Some(0), "stiffness = 500.0");
    let elastic = added(&arm, &[elastic], &samples(&q, &[1.0; 2]));
    // The weight of the link pulls less where it hangs lower.
    let give = load[0] / (500.0 + MASS * G * 0.5 * q[0].sin());
    close("elasticity", elastic.link[0][0], -give, 1e-10);
    close("tool", elastic.tool[2][0], q[0].sin() - (q[0] - give).sin(), 1e-10);
}

/// A chain of two links of 1 m, the second with its mass at its end.
fn two_links() -> Arm {
    let one = one_link(Revolute, MASS).joints()[0].clone();
    let inertia = Inertia { mass: 3.0, com: Vector3::x(), about_com: Matrix3::zeros() };
    let second = Joint {
        name: "second".into(),
        placement: Isometry3::translation(1.0, 0.0, 0.0),
        inertia,
        ..one.clone()
    };
    Arm::new("two", vec![one, second], Isometry3::translation(1.0, 0.0, 0.0), Vector3::new(0.0, 0.0, -G))
        .unwrap()
}

/// Cantilevers: the link's own weight acts at half of the length, 5/16 W/k; a load P beyond a rigid extension of the same length deflects
/// by P(L³/3 + L²a + La²)/(EI) = 7 P/k, with 3EI = kL³.
#[test]
fn a_link_bends_as_a_cantilever() {
    let k = 1e5;
    let text = "stiffness = 1e5";
    let arm = one_link(Revolute, MASS);
    let shown = added(&arm, &[effect(&arm, "link_flexure", Some(0), text)], &samples(&[0.0], &[0.0]));
    close("own weight", shown.tool[2][0], -MASS * G * 5.0 / 16.0 / k, 1e-15);
    let arm = two_links();
    let mut still = samples(&[0.0], &[0.0]);
    for column in [&mut still.q, &mut still.v, &mut still.a] {
        column.push(vec![0.0]);
    }
    let shown = added(&arm, &[effect(&arm, "link_flexure", Some(0), text)], &still);
    // The link's own weight also tips the second link: slope 3/8 W/(kL) at half of the length.
    let expected = -(7.0 * 3.0 + MASS * (5.0 / 16.0 + 3.0 / 8.0)) * G / k;
    close("load on an extension", shown.tool[2][0], expected, 1e-12);
    // The textbook forms: the force alone, F/k and the slope 3F/(2kL) over an extension of the length L; and without the slope.
    for (form, share) in [("tip_force", 2.5), ("tip_shift", 1.0)] {
        let text = format!("stiffness = 1e5\nform = \"{form}\"");
        let shown = added(&arm, &[effect(&arm, "link_flexure", Some(0), &text)], &still);
        close(form, shown.tool[2][0], -share * 3.0 * G / k, 1e-12);
    }
    let shown = added(&arm, &[effect(&arm, "link_flexure", Some(1), text)], &still);
    close("last link, load at its end", shown.tool[2][0], -3.0 * G / k, 1e-12);
}

/// With the arm along x the weight tips the mount about y by c M, and the tool descends by its distance times that angle. With the arm
/// upright the weight does not tip it, but the inertial force of the accelerated link tips it back.
#[test]
fn a_mount_gives_with_the_overturning_moment() {
    let arm = one_link(Revolute, MASS);
    let mount = || effect(&arm, "mount_compliance", None, "compliance_x = 7e-5\ncompliance_y = 2e-5");
    let shown = added(&arm, &[mount()], &samples(&[0.0], &[0.0]));
    close("down", shown.tool[2][0], -2e-5 * MASS * G * 0.5, 1e-15);
    close("across", shown.tool[1][0], 0.0, 1e-15);
    let mut upright = samples(&[-FRAC_PI_2], &[0.0]);
    upright.a[0] = vec![4.0];
    let shown = added(&arm, &[mount()], &upright);
    // The link's inertia about the axis is m/4 + 0.1; the mount turns the other way, with the tool 1 m above it.
    close("back", shown.tool[0][0], -2e-5 * (MASS * 0.25 + 0.1) * 4.0, 1e-15);
    close("upright", shown.tool[2][0], 0.0, 1e-15);
}

/// Several clearances at once: each journal rests under the force of its own bearing, and the arm with all of them moves by Σ J d.
#[test]
fn several_clearances_add() {
    let (arm, motion) = (arm(), motion(6, 100.0, 3.0));
    let plays = [(1, 2e-4), (2, 3e-4), (4, 4e-4)];
    let effects: Vec<_> = plays
        .iter()
        .map(|(joint, c)| {
            effect(&arm, "joint_clearance", Some(*joint), &format!("clearance = {c:?}\nfriction = 0.0"))
        })
        .collect();
    let shown = added(&arm, &effects, &motion);
    // The same from one arm with all six slides and its journals at rest, by its own forward kinematics.
    let clearances = plays.map(|(joint, c)| {
        let table = ClearanceTable { friction: 0.0, ..ClearanceTable::new(c) };
        (joint, Clearance::new(&table).unwrap())
    });
    let with_play = ArmWithPlay::new(&arm, &clearances).unwrap();
    let n = with_play.arm().dof();
    let mut ws = freeplay_arm::Workspace::new(with_play.arm());
    let mut worst = 0.0_f64;
    for point in 0..motion.len() {
        let [mut q, mut v, mut a] = [const { [0.0; 6] }; 3];
        motion.at(point, &mut q, &mut v, &mut a);
        let mut all = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
        for (all, nominal) in all.iter_mut().zip([q, v, a]) {
            with_play.spread(&nominal, all);
        }
        let mut tau = vec![0.0; n];
        freeplay_arm::rnea(with_play.arm(), &mut ws, &all[0], &all[1], &all[2], &mut tau);
        let centred = freeplay_arm::forward_kinematics(with_play.arm(), &mut ws, &all[0]).translation.vector;
        for play in with_play.plays() {
            let force = play.slides.map(|slide| tau[slide]);
            let size = force[0].hypot(force[1]);
            let reach = play.clearance.clearance + play.clearance.normal.static_penetration(size);
            for (slide, force) in play.slides.into_iter().zip(force) {
                all[0][slide] = -reach * force / size;
            }
        }
        let moved =
            freeplay_arm::forward_kinematics(with_play.arm(), &mut ws, &all[0]).translation.vector - centred;
        for axis in 0..3 {
            worst = worst.max((moved[axis] - shown.tool[axis][point]).abs());
        }
    }
    println!("worst {worst:.1e} m of 9e-4 m, margin 1e-9 m");
    assert!(worst < 1e-9);
}

/// Two links along x rotate about the first joint: the second journal moves outwards under the centripetal force and downwards under the
/// weight, and the first drive carries the weight on a longer lever.
#[test]
fn a_journal_that_gives_lengthens_the_lever_of_its_load() {
    let (slim, c, speed) = (two_links(), 4e-4, 3.0);
    // A point mass turns about its journal without inertia: such a play has no effect.
    let mut joints = slim.joints().to_vec();
    joints[1].inertia.about_com = Matrix3::identity() * 0.1;
    let arm = Arm::new("two", joints, *slim.tool(), *slim.gravity()).unwrap();
    let mut still = samples(&[0.0], &[speed]);
    for column in [&mut still.q, &mut still.v, &mut still.a] {
        column.push(vec![0.0]);
    }
    let table = ClearanceTable { friction: 0.0, ..ClearanceTable::new(c) };
    let law = Clearance::new(&table).unwrap();
    let (outwards, weight) = (3.0 * 2.0 * speed * speed, 3.0 * G);
    let force = f64::hypot(outwards, weight);
    let length = c + law.normal.static_penetration(force);
    let (reach, drop) = (length * outwards / force, length * weight / force);
    for course in ["rest", "flight"] {
        let text = format!("clearance = {c:?}\nfriction = 0.0\ncourse = \"{course}\"");
        let shown = added(&arm, &[effect(&arm, "joint_clearance", Some(1), &text)], &still);
        close("outwards", shown.tool[0][0], reach, 1e-12);
        close("torque below", shown.torque[0][0], -weight * reach, 1e-9);
        // The second link circles below the first axis; its mass, 1 m out, is pulled up.
        close("own torque", shown.torque[1][0], -3.0 * speed * speed * drop, 1e-9);
    }
}

/// Rest over a tick with friction in the prediction is the controller's law: the offset keeps the length c + δ and turns by at most atan μ.
#[test]
fn a_clearance_is_as_long_as_its_play() {
    let (arm, motion) = (arm(), motion(6, 500.0, 2.0));
    let shown =
        added(&arm, &[effect(&arm, "joint_clearance", Some(4), "clearance = 4e-4\nfriction = 0.1")], &motion);
    let smooth =
        added(&arm, &[effect(&arm, "joint_clearance", Some(4), "clearance = 4e-4\nfriction = 0.0")], &motion);
    let (mut longest, mut turned) = (0.0_f64, 0.0_f64);
    for point in 0..motion.len() {
        let at = |p: &Prediction| Vector3::new(p.tool[0][point], p.tool[1][point], p.tool[2][point]);
        longest = longest.max(at(&shown).norm());
        turned = turned.max(at(&shown).angle(&at(&smooth)));
    }
    println!(
        "longest {longest:.4e} m (4e-4 and some µm), turned {turned:.4} rad (atan 0.1 = {:.4})",
        0.1_f64.atan()
    );
    assert!(longest > 4e-4 && longest < 4.2e-4 && turned > 0.05 && turned < 0.1_f64.atan() + 1e-3);
}

/// A sine with the delay d, and the gain and phase of a first-order lag.
#[test]
fn delays_and_filters_act_on_a_sine_as_they_should() {
    let arm = one_link(Revolute, MASS);
    let motion = motion(1, 1000.0, 10.0);
    let scene = Scene::new(arm.clone(), &motion);
    let w = TAU * 2.0;
    let sine =
        |lag: f64, gain: f64| motion.t.iter().map(|t| gain * (w * (t - lag)).sin()).collect::<Vec<_>>();
    let measured = |kind: &str, joint, text: &str| {
        let mut prediction = Prediction::blank(1, motion.len());
        prediction.torque[0] = sine(0.0, 1.0);
        prediction.link[0] = sine(0.0, 1.0);
        effect(&arm, kind, joint, text).effect.measure(&scene, &mut prediction);
        prediction
    };
    let worst = |a: &[f64], b: &[f64]| {
        a.iter().zip(b).skip(5000).take(4000).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()))
    };
    let late = measured("time_delay", None, "delay = 0.0123");
    close("torque late", worst(&late.torque[0], &sine(0.0123, 1.0)), 0.0, 1e-6);
    assert_eq!(late.link[0], sine(0.0, 1.0));
    let early = measured("time_delay", None, "delay = 0.0123\nchannel = \"position\"");
    close("all early", worst(&early.link[0], &sine(-0.0123, 1.0)), 0.0, 1e-6);
    let cutoff = 3.0;
    let filtered = measured("sensor_lowpass", Some(0), "cutoff = 3.0");
    let ratio: f64 = 2.0 / cutoff;
    let expected = sine(ratio.atan() / w, 1.0 / (1.0 + ratio * ratio).sqrt());
    close("filtered", worst(&filtered.torque[0], &expected), 0.0, 2e-5);
}

/// The plant's sensors, tick by tick, agree with the prediction for a whole recording.
#[test]
fn late_and_filtered_sensors_of_the_plant_say_the_same() {
    // Without friction, since no interpolation follows its jump.
    let (arm, motion) = (freeplay_model::paper_arm().arm, motion(6, 1000.0, 3.0));
    let clean = predict(&arm, &[], &motion, &raw).unwrap();
    for (kind, joint, text, margin) in [
        ("time_delay", None, "delay = 0.0045", 1e-2),
        ("time_delay", None, "delay = 0.0045\nchannel = \"tool\"", 1e-5),
        ("sensor_lowpass", Some(1), "cutoff = 20.0", 1e-9),
        ("link_flexure", Some(1), "stiffness = 1e6", 2e-5),
        ("mount_compliance", None, "compliance_x = 1e-6\ncompliance_y = 1e-6", 2e-5),
    ] {
        let placed = effect(&arm, kind, joint, text);
        let mut injection = Injection::default();
        placed.effect.inject(&mut injection);
        let shown = predict(&arm, &[placed], &motion, &raw).unwrap();
        let (mut worst, mut changed) = (0.0_f64, 0.0_f64);
        for point in 0..motion.len() {
            let row = |columns: &[Vec<f64>]| columns.iter().map(|column| column[point]).collect::<Vec<_>>();
            let (mut q, mut v, mut link) = (row(&motion.q), row(&motion.v), row(&clean.link));
            let (mut torque, mut tool) = (row(&clean.torque), row(&clean.tool));
            injection.tool.iter_mut().chain(&mut injection.sensors).next().unwrap().read(&mut Readings {
                period: 1e-3,
                q: &mut q,
                v: &mut v,
                torque: &mut torque,
                link: &mut link,
                tool: &mut tool,
            });
            if point < 10 {
                continue;
            }
            // Loads on the drives do not belong to the sensors.
            let torques = if injection.drives.is_empty() { arm.dof() } else { 0 };
            let said = torque.iter().zip(&shown.torque).take(torques).chain(tool.iter().zip(&shown.tool));
            let before = clean.torque.iter().take(torques).chain(&clean.tool);
            for ((said, shown), before) in said.zip(before) {
                worst = worst.max((said - shown[point]).abs());
                changed = changed.max((before[point] - shown[point]).abs());
            }
        }
        println!("{kind} {text:?}: worst {worst:.1e} of a change of {changed:.1e}, margin {margin:.0e}");
        assert!(worst <= margin && changed > 3.0 * margin, "{kind}");
    }
}

/// The second of two clearances of one joint is refused with its line.
#[test]
fn a_second_effect_of_a_kind_is_refused_with_its_line() {
    let text = "name = \"a\"\n[[joint]]\nname = \"j\"\ntype = \"revolute\"\naxis = [0, 1, 0]\nmass = 1.0\ncom = [0.5, 0, 0]\n\
                [[effect]]\nkind = \"coulomb_friction\"\njoint = \"j\"\ncoulomb = 1.0\n\
                [[effect]]\nkind = \"coulomb_friction\"\njoint = \"j\"\ncoulomb = 2.0\n";
    let file = freeplay_model::parse_toml(text, std::path::Path::new("twice.toml")).unwrap();
    let error = Effects::of(&file).unwrap_err();
    println!("{error}");
    assert_eq!(error.line(), Some(12));
    assert!(error.to_string().starts_with("line 12: "));
}
