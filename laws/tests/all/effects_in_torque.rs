//! Effects in the torque, each against its closed form.
use crate::common;
use std::f64::consts::{E, FRAC_PI_2, PI};

use freeplay_arm::JointKind::Revolute;
use freeplay_laws::{Baseline, DriveFriction, DriveState, Injection, Site, Trajectory};

use crate::common::{added, arm, close, effect, motion, one_link, samples};

const MASS: f64 = 2.0;
const G: f64 = 9.81;

/// The torque that `kind` with `text` adds to one link at each of these positions and velocities.
fn torque(kind: &str, text: &str, q: &[f64], v: &[f64]) -> Vec<f64> {
    let arm = one_link(Revolute, MASS);
    let joint = (freeplay_laws::kind(kind).unwrap().site != Site::Arm).then_some(0);
    added(&arm, &[effect(&arm, kind, joint, text)], &samples(q, v)).torque[0].clone()
}

fn each_close(what: &str, actual: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(actual.len(), expected.len());
    for (actual, expected) in actual.iter().zip(expected) {
        close(what, *actual, *expected, tolerance);
    }
}

#[test]
fn coulomb_friction_is_a_step() {
    let smoothing = DriveFriction::SMOOTHING_SPEED;
    let v = [-2.0, -20.0 * smoothing, -smoothing, 0.0, smoothing, 2.0];
    let shown = torque("coulomb_friction", "coulomb = 3.0", &[0.0; 6], &v);
    let soft = 3.0 * 1.0_f64.tanh();
    each_close("coulomb", &shown, &[-3.0, -3.0, -soft, 0.0, soft, 3.0], 1e-12);
}

#[test]
fn viscous_friction_is_a_line_and_drag_a_parabola() {
    let v = [-2.0, -1.0, 0.0, 0.5, 4.0];
    let shown = torque("viscous_friction", "viscous = 1.5", &[0.0; 5], &v);
    each_close("viscous", &shown, &v.map(|v| 1.5 * v), 1e-12);
    let shown = torque("quadratic_drag", "coefficient = 0.5", &[0.0; 5], &v);
    each_close("drag", &shown, &[-2.0, -0.5, 0.0, 0.125, 8.0], 1e-12);
}

#[test]
fn stribeck_friction_falls_to_one_e_th_at_its_velocity() {
    let v = [-1e-6, -0.1, 0.1, 0.3];
    let shown = torque("stribeck_friction", "extra = 4.0\nvelocity = 0.1", &[0.0; 4], &v);
    let bump = 0.01_f64.tanh() * (-1e-10_f64).exp();
    each_close("stribeck", &shown, &[-4.0 * bump, -4.0 / E, 4.0 / E, 4.0 * (-9.0_f64).exp()], 1e-12);
}

#[test]
fn asymmetric_friction_is_coulomb_friction_with_an_offset() {
    let v = [-2.0, -0.1, 0.0, 0.1, 2.0];
    let shown = torque("asymmetric_friction", "positive = 5.0\nnegative = 2.0", &[0.0; 5], &v);
    each_close("asymmetric", &shown, &[-2.0, -2.0, 1.5, 5.0, 5.0], 1e-12);
    let arm = one_link(Revolute, MASS);
    let pair = [
        effect(&arm, "coulomb_friction", Some(0), "coulomb = 3.5"),
        effect(&arm, "torque_offset", Some(0), "offset = 1.5"),
    ];
    each_close("as a pair", &added(&arm, &pair, &samples(&[0.0; 5], &v)).torque[0], &shown, 1e-12);
}

#[test]
fn load_dependent_friction_follows_the_weight() {
    // The link is horizontal, hangs, and is horizontal on the other side.
    let shown =
        torque("load_dependent_friction", "coefficient = 0.2", &[0.0, FRAC_PI_2, PI], &[1.0, 1.0, -1.0]);
    each_close("load", &shown, &[0.2 * MASS * G * 0.5, 0.0, -0.2 * MASS * G * 0.5], 1e-12);
}

#[test]
fn waves_repeat_n_times_a_turn_and_only_friction_follows_the_direction() {
    let (q, v) = ([0.0, PI / 6.0, 2.0 * PI / 3.0], [1.0, -1.0, -1.0]);
    let text = format!("amplitude = 2.0\nperiods = 3.0\nphase = {FRAC_PI_2:?}");
    each_close("ripple", &torque("torque_ripple", &text, &q, &v), &[2.0, 0.0, 2.0], 1e-12);
    each_close("friction", &torque("position_dependent_friction", &text, &q, &v), &[2.0, 0.0, -2.0], 1e-12);
}

#[test]
fn a_spring_pulls_back_to_its_rest() {
    let shown = torque("joint_spring", "stiffness = 30.0\nrest = 0.5", &[0.0, 0.5, 1.5], &[0.0; 3]);
    each_close("spring", &shown, &[-15.0, 0.0, 30.0], 1e-12);
}

/// A point mass m at r = 1 m: −m g r cos q against gravity (positive q goes down), and m r² q̈.
#[test]
fn a_payload_weighs_and_resists() {
    let shown = torque("payload", "mass = 3.0\ncom = [1.0, 0.0, 0.0]", &[0.0, 1.0], &[0.0; 2]);
    each_close("payload's weight", &shown, &[-3.0 * G, -3.0 * G * 1.0_f64.cos()], 1e-12);
    let mut accelerated = samples(&[FRAC_PI_2], &[0.0]);
    accelerated.a[0][0] = 2.0;
    let arm = one_link(Revolute, MASS);
    let body = "mass = 3.0\ncom = [1.0, 0.0, 0.0]\nmoments = [0.0, 0.4, 0.0]";
    let shown = added(&arm, &[effect(&arm, "payload", None, body)], &accelerated);
    close("payload's inertia", shown.torque[0][0], 2.0 * (3.0 + 0.4), 1e-12);
}

#[test]
fn the_mass_of_a_link_scales_its_torque_and_a_gain_divides_it() {
    let (q, v) = ([0.0, 0.7], [0.3, -0.2]);
    let weight = q.map(|q: f64| -MASS * G * 0.5 * q.cos());
    each_close("mass", &torque("link_mass", "scale = 1.1", &q, &v), &weight.map(|w| 0.1 * w), 1e-12);
    // The centre goes from 0.5 to 0.6 m.
    let shifted = torque("link_mass", "scale = 1.5\ncom_shift = [0.1, 0.0, 0.0]", &q, &v);
    each_close("shifted", &shifted, &weight.map(|w| (1.5 * 0.6 / 0.5 - 1.0) * w), 1e-12);
    each_close("gain", &torque("torque_gain", "gain = 1.25", &q, &v), &weight.map(|w| -0.2 * w), 1e-12);
    each_close("offset", &torque("torque_offset", "offset = -0.4", &q, &v), &[-0.4, -0.4], 1e-12);
}

#[test]
fn a_rotor_resists_acceleration_alone() {
    let arm = one_link(Revolute, MASS);
    let mut motion = samples(&[0.3, 0.3], &[1.0, 1.0]);
    motion.a[0] = vec![0.0, -4.0];
    let shown = added(&arm, &[effect(&arm, "rotor_inertia", Some(0), "inertia = 0.5")], &motion);
    each_close("rotor", &shown.torque[0], &[0.0, -2.0], 1e-12);
    let mut injection = Injection::default();
    effect(&arm, "rotor_inertia", Some(0), "inertia = 0.5").effect.inject(&mut injection);
    assert_eq!(injection.rotors, [(0, 0.5)]);
}

/// For one joint about y, a pitch of the base equals a rotation of the joint: −m g l cos(q + p).
#[test]
fn a_tilted_base_turns_gravity() {
    let q = [0.0, 0.4, 2.0];
    let expected = q.map(|q: f64| -MASS * G * 0.5 * ((q + 0.1).cos() - q.cos()));
    each_close("pitch", &torque("base_tilt", "pitch = 0.1", &q, &[0.0; 3]), &expected, 1e-12);
    let level = torque("base_tilt", "pitch = 0.1\ntracker = \"level\"", &q, &[0.0; 3]);
    each_close("pitch, level tracker", &level, &expected, 1e-12);
    // A roll multiplies the weight by its cosine.
    let expected = q.map(|q: f64| -MASS * G * 0.5 * q.cos() * (0.1_f64.cos() - 1.0));
    each_close("roll", &torque("base_tilt", "roll = 0.1", &q, &[0.0; 3]), &expected, 1e-12);
}

#[test]
fn a_drive_gives_no_more_than_its_limit() {
    let weight = MASS * G * 0.5;
    let shown = torque("actuator_saturation", "limit = 5.0", &[0.0, 1.5, PI], &[0.0; 3]);
    each_close("limit", &shown, &[weight - 5.0, 0.0, 5.0 - weight], 1e-12);
    let soft = torque("actuator_saturation", "limit = 5.0\nshare = 0.5", &[0.0], &[0.0]);
    each_close("soft limit", &soft, &[0.5 * (weight - 5.0)], 1e-12);
}

/// The tool is 1 m out; the force of 10 N points down, and the drive holds 10 N·m within the window only. A sample stands for the time up to halfway to the
/// next: from 0.8 s on, the sample at 1 s has 0.7 of the force.
#[test]
fn a_force_on_the_tool_is_held_through_the_jacobian() {
    for (start, share) in [(0.5, 1.0), (0.8, 0.7)] {
        let text = format!("force = [0.0, 0.0, -10.0]\nstart = {start}\nend = 2.5");
        let shown = torque("external_force", &text, &[0.0, 0.0, 1.0, 1.0], &[0.0; 4]);
        each_close("force", &shown, &[0.0, -10.0 * share, -10.0 * 1.0_f64.cos(), 0.0], 1e-12);
    }
}

/// Losing 1.5 kg at the tool, 1 m out, reduces the holding torque by 1.5 g cos q and the inertia by 1.5 kg·m².
#[test]
fn a_lost_load_is_missing_from_then_on() {
    let shown = torque("load_change", "mass = -1.5\ntime = 1.5", &[0.3, 0.3, 0.0, 1.0], &[0.0; 4]);
    each_close("lost", &shown, &[0.0, 0.0, 1.5 * G, 1.5 * G * 1.0_f64.cos()], 1e-12);
    let arm = one_link(Revolute, MASS);
    let mut pushed = samples(&[FRAC_PI_2; 2], &[0.0; 2]);
    pushed.a[0] = vec![3.0; 2];
    let effect = effect(&arm, "load_change", None, "mass = -1.5\ntime = 0.5");
    each_close("inertia", &added(&arm, &[effect], &pushed).torque[0], &[0.0, -1.5 * 3.0], 1e-12);
}

/// The weight of a load before the time of its loss, and zero after it.
#[test]
fn a_load_that_is_lost_is_there_before() {
    let arm = one_link(Revolute, MASS);
    let still = samples(&[0.0; 2], &[0.0; 2]);
    let of = |text: &str| added(&arm, &[effect(&arm, "load_change", None, text)], &still).torque[0].clone();
    let (before, after) =
        (of("mass = 1.5\ntime = 0.5\nacts = \"before\""), of("mass = 1.5\ntime = 0.5\nacts = \"after\""));
    assert!(before[0].abs() > 1.0 && before[1] == 0.0 && after[0] == 0.0, "{before:?} {after:?}");
    close("both sides", after[1], before[0], 1e-12);
}

/// Across, the shaft's inertia and viscous friction act on each joint through the other's motion; dry friction depends on both.
#[test]
fn a_coupling_across_leaves_each_joint_its_own_share() {
    let (arm, motion) = (arm(), motion(6, 100.0, 6.0));
    let text = |form: &str| {
        format!(
            "with = \"joint_6\"\ninertia = 0.2\nviscous = 0.7\ncoulomb = 0.5\nsign = -1.0\nform = \"{form}\""
        )
    };
    let of = |form: &str| added(&arm, &[effect(&arm, "joint_coupling", Some(3), &text(form))], &motion);
    let (shaft, cross) = (of("shaft"), of("cross"));
    let mut greatest = 0.0_f64;
    for (joint, point) in
        [3, 5].into_iter().flat_map(|joint| (0..motion.len()).map(move |point| (joint, point)))
    {
        let own = 0.2 * motion.a[joint][point] + 0.7 * motion.v[joint][point];
        greatest = greatest.max(own.abs());
        assert!((shaft.torque[joint][point] - cross.torque[joint][point] - own).abs() < 1e-9);
    }
    println!("own shares up to {greatest:.2} N*m");
    assert!(greatest > 0.1);
    let mut injection = Injection::default();
    effect(&arm, "joint_coupling", Some(3), &text("cross")).effect.inject(&mut injection);
    assert!(injection.rotors.is_empty());
    let (v, a) = ([0.0, 0.0, 0.0, 0.3, 0.0, 0.2], [0.0, 0.0, 0.0, 5.0, 0.0, -2.0]);
    let mut torque = [0.0; 6];
    injection.drives[0].act(
        &DriveState {
            t: 0.0,
            step: 1e-5,
            q: &[0.0; 6],
            v: &v,
            sign: &v.map(DriveFriction::sign),
            stopping: &[f64::MAX; 6],
            a: &a,
            load: &[0.0; 6],
        },
        &mut torque,
    );
    close("own", -torque[3], -(0.2 * a[5] + 0.7 * v[5]) + 0.5, 1e-12);
    close("other", -torque[5], -(0.2 * a[3] + 0.7 * v[3]) - 0.5, 1e-12);
}

/// X on the one joint and s X on the other, zero elsewhere; the friction never produces power.
#[test]
fn a_shared_shaft_loads_both_joints() {
    let (arm, motion) = (arm(), motion(6, 100.0, 6.0));
    let text = "with = \"joint_6\"\ninertia = 0.2\nviscous = 0.7\ncoulomb = 0.5\nsign = -1.0";
    let shown = added(&arm, &[effect(&arm, "joint_coupling", Some(3), text)], &motion);
    let mut least = f64::INFINITY;
    for point in 0..motion.len() {
        let (u, du) = (motion.v[3][point] - motion.v[5][point], motion.a[3][point] - motion.a[5][point]);
        let x = 0.2 * du + 0.7 * u + 0.5 * u.signum();
        assert!((shown.torque[3][point] - x).abs() < 1e-9 && (shown.torque[5][point] + x).abs() < 1e-9);
        let power = shown.torque[3][point] * motion.v[3][point] + shown.torque[5][point] * motion.v[5][point];
        least = least.min(power - 0.2 * du * u);
    }
    for joint in [0, 1, 2, 4] {
        assert!(common::greatest(&shown.torque[joint]) < 1e-9, "joint {joint}");
    }
    println!("least power of the friction: {least:.2e} W, margin −1e-6");
    assert!(least > -1e-6);
    let mut injection = Injection::default();
    effect(&arm, "joint_coupling", Some(3), text).effect.inject(&mut injection);
    assert_eq!(injection.rotors, [(3, 0.2), (5, 0.2)]);
    // With the rotors' own torques, the plant's torques are the same.
    let (v, a) = ([0.0, 0.0, 0.0, 0.3, 0.0, 0.2], [0.0, 0.0, 0.0, 5.0, 0.0, -2.0]);
    let mut torque = [0.0; 6];
    injection.drives[0].act(
        &DriveState {
            t: 0.0,
            step: 1e-5,
            q: &[0.0; 6],
            v: &v,
            sign: &v.map(DriveFriction::sign),
            stopping: &[f64::MAX; 6],
            a: &a,
            load: &[0.0; 6],
        },
        &mut torque,
    );
    let x = 0.2 * 7.0 + 0.7 * 0.1 + 0.5;
    close("own", 0.2 * a[3] - torque[3], x, 1e-12);
    close("other", 0.2 * a[5] - torque[5], -x, 1e-12);
}

/// α F at the start, α F/e after T, nothing in the end.
#[test]
fn friction_drifts_to_its_nominal() {
    let mut arm = one_link(Revolute, MASS);
    let mut joints = arm.joints().to_vec();
    joints[0].friction = freeplay_arm::JointFriction { viscous: 2.0, coulomb: 3.0 };
    arm = freeplay_arm::Arm::new("rubs", joints, *arm.tool(), *arm.gravity()).unwrap();
    let mut motion = samples(&[0.0; 4], &[0.5, 0.5, -0.5, 0.5]);
    motion.t = vec![0.0, 20.0, 20.0, 2000.0];
    let drift = effect(&arm, "friction_drift", Some(0), "amount = 0.3\ntime_constant = 20.0");
    let shown = added(&arm, &[drift], &motion);
    each_close("drift", &shown.torque[0], &[1.2, 1.2 / E, -1.2 / E, 0.0], 1e-9);
}

/// One joint back and forth at unit speed, sampled every `step` of travel.
fn to_and_fro(step: f64, way: f64) -> Trajectory {
    let points = (way / step).round() as usize;
    let forth = (0..=points).map(|i| (i as f64 * step, 1.0));
    let back = (1..=points).map(|i| (way - i as f64 * step, -1.0));
    let (q, v): (Vec<f64>, Vec<f64>) = forth.chain(back).unzip();
    let mut motion = samples(&q, &v);
    motion.t.iter_mut().for_each(|t| *t *= step);
    motion
}

/// During sliding the bristles carry the whole level; after a reversal and the travel x they carry F(1 − 2e^{−x/δ}), for any step.
#[test]
fn presliding_friction_builds_up_over_a_way() {
    let arm = one_link(Revolute, MASS);
    let (level, displacement) = (2.0, 0.05);
    let text = format!("stiffness = {:?}\nshare = 0.0\ncoulomb = {level:?}", level / displacement);
    for step in [0.002, 0.02] {
        let motion = to_and_fro(step, 1.0);
        let shown = added(&arm, &[effect(&arm, "presliding_friction", Some(0), &text)], &motion);
        let turn = (1.0 / step).round() as usize;
        close("sliding", shown.torque[0][turn], level, 1e-7);
        for after in [0.02, 0.1, 0.5] {
            let point = turn + (after / step).round() as usize;
            let expected = -level * (1.0 - 2.0 * (-after / displacement).exp());
            close(&format!("{after} rad after the reversal"), shown.torque[0][point], expected, 1e-7);
        }
    }
    // From rest, a small deflection is elastic.
    let mut injection = Injection::default();
    effect(&arm, "presliding_friction", Some(0), &text).effect.inject(&mut injection);
    let now = DriveState {
        t: 0.0,
        step: 1e-3,
        q: &[0.0],
        v: &[1e-3],
        sign: &[DriveFriction::sign(1e-3)],
        stopping: &[f64::MAX],
        a: &[0.0],
        load: &[0.0],
    };
    let mut torque = [0.0];
    injection.drives[0].act(&now, &mut torque);
    close("stiffness at rest", -torque[0] / 1e-6, level / displacement, 1e-3);
}

/// With all of the nominal friction on bristles, only the build-up differs from the nominal.
#[test]
fn presliding_friction_replaces_the_nominal_jump() {
    let arm = arm();
    let motion = motion(6, 200.0, 6.0);
    let shown = added(&arm, &[effect(&arm, "presliding_friction", Some(1), "stiffness = 2000.0")], &motion);
    let (v, torque) = (&motion.v[1], &shown.torque[1]);
    let late = |point: usize| point > 30 && v[point - 30..=point].iter().all(|x| x * v[point] > 0.0);
    let sliding = (0..motion.len()).filter(|&point| late(point)).map(|point| torque[point].abs());
    let turning = common::greatest(torque);
    let sliding = sliding.fold(0.0, f64::max);
    println!("sliding: {sliding:.1e} N·m, margin 0.05; at reversals {turning:.2} N·m of 4");
    assert!(sliding < 0.05 && turning > 2.0 && turning <= 4.0 + 1e-9);
}

/// The drive spends nothing while the motor crosses the gap, F before and after. The flank for negative torque deflects by 6/40 rad, the
/// other one by 4/80; the motor begins on the rear flank.
#[test]
fn friction_behind_a_gap_builds_up_on_either_flank_by_its_own_stiffness() {
    let arm = one_link(Revolute, 0.0);
    let motion = to_and_fro(0.01, 1.0);
    let parameters =
        "gap = 0.2\nfriction = 4.0\nfriction_negative = 6.0\nstiffness = 80.0\nstiffness_negative = 40.0";
    let begun = format!("{parameters}\nstart = -1.0");
    let of = |parameters: &str| {
        added(&arm, &[effect(&arm, "backlash", Some(0), parameters)], &motion).torque[0].clone()
    };
    let (open, begun) = (of(parameters), of(&begun));
    close("it begins on the flank behind", begun[0], -6.0, 1e-12);
    close("or in the middle", open[0], 0.0, 1e-12);
    // The travel of the motor, forth to 1 rad and back: on the way forth the gap of 0.2 rad and both flanks take 0.4 rad.
    let at = |torque: &[f64], way: f64| torque[(100.0 * way).round() as usize];
    close("a third off the flank behind", at(&begun, 0.05), -4.0, 1e-9);
    close("in the gap", at(&begun, 0.25), 0.0, 1e-9);
    close("a part on the flank ahead", at(&begun, 0.38), 2.4, 1e-9);
    close("sliding", at(&begun, 0.6), 4.0, 1e-9);
    close("the same by then", at(&open, 0.6), 4.0, 1e-9);
}

#[test]
fn friction_behind_a_gap_is_missing_after_a_reversal() {
    let arm = one_link(Revolute, MASS);
    let motion = to_and_fro(0.01, 1.0);
    let shown = added(&arm, &[effect(&arm, "backlash", Some(0), "gap = 0.2\nfriction = 3.0")], &motion);
    // The lag of the link also changes its weight; that part is known.
    let weight = |point: usize, lag: f64| {
        let q = motion.q[0][point];
        -MASS * G * 0.5 * ((q - lag).cos() - q.cos())
    };
    for (way, lag, friction) in [(-0.5, 0.1, 3.0), (0.1, 0.0, 0.0), (0.15, -0.05, 0.0), (0.3, -0.1, -3.0)] {
        let point = (100.0 + 100.0 * way) as usize;
        let expected = friction + weight(point, lag);
        close(&format!("{way} rad after the reversal"), shown.torque[0][point], expected, 1e-9);
        close("link", shown.link[0][point], -lag, 1e-9);
    }
}

/// The change of a prediction is the same for a reused and for a new scene: with laws that leave the arm unchanged, and with one that
/// changes it.
#[test]
fn more_effects_upon_a_baseline_say_what_they_say_from_the_start() {
    let arm = one_link(Revolute, MASS);
    let all = [
        effect(&arm, "viscous_friction", Some(0), "viscous = 1.5"),
        effect(&arm, "coulomb_friction", Some(0), "coulomb = 3.0"),
        effect(&arm, "actuator_saturation", Some(0), "limit = 4.0"),
        effect(&arm, "payload", None, "mass = 0.3\ncom = [0.1, 0.0, 0.0]"),
    ];
    let motion = samples(&[0.0, 0.3, 1.2, 2.0], &[-2.0, 0.5, 1.0, 3.0]);
    let as_it_is = |column: &[f64]| column.to_vec();
    for more in [1..2, 1..3, 1..4] {
        let (first, more): (Vec<_>, Vec<_>) = (vec![&all[0]], all[more].iter().collect());
        let upon = Baseline::new(&arm, &first, &motion, &as_it_is).unwrap().with(&more).unwrap();
        let from_the_start: Vec<_> = first.into_iter().chain(more).collect();
        let exact = Baseline::new(&arm, &from_the_start, &motion, &as_it_is).unwrap();
        each_close("torque", &upon.torque[0], &exact.prediction().torque[0], 1e-12);
        for (upon, exact) in upon.tool.iter().zip(&exact.prediction().tool) {
            each_close("tool", upon, exact, 1e-12);
        }
    }
}
