//! Every kind of the catalogue: the plant's measurements agree with the prediction of the same effect from the measured motion.
//!
//! The plant follows a smooth motion with the effect injected; its readings are a recording. [`predict`] computes the expected readings
//! from the encoders alone. Prediction and plant share the numbers of the law, not its way through the dynamics, so that the test finds a
//! wrong sign, joint or frame on either side. The same recording against the arm without the effect proves that the effect is large enough
//! to test.

use crate::common;
use freeplay_arm::Arm;
use freeplay_laws::{Effects, Kind, Prediction, Readings, Site, Trajectory, kinds, predict};
use freeplay_model::{ArmFile, EffectTable, paper_arm};
use freeplay_plant::{Input, Motion, System};

const PERIOD: f64 = 1e-3;
const SUBSTEPS: u32 = 40;
const TICKS: usize = 2600;
/// Points omitted at both ends: journals drop, springs settle, filters fill.
const SETTLING: usize = 800;

/// Two sines per joint about a posture.
struct Swing {
    middle: Vec<f64>,
}

impl Motion for Swing {
    fn at(&self, t: f64, q: &mut [f64], v: &mut [f64], a: &mut [f64]) {
        for joint in 0..q.len() {
            let number = joint as f64;
            let waves =
                [(0.35, 2.1 + 0.37 * number, 0.4 * number), (0.08, 5.3 - 0.41 * number, 1.0 + number)];
            [q[joint], v[joint], a[joint]] = [self.middle[joint], 0.0, 0.0];
            for (size, rate, phase) in waves {
                let (sin, cos) = (rate * t + phase).sin_cos();
                q[joint] += size * sin;
                v[joint] += size * rate * cos;
                a[joint] -= size * rate * rate * sin;
            }
        }
    }
}

/// The measurements of the plant's sensors.
struct Recorded {
    motion: Trajectory,
    torque: Vec<Vec<f64>>,
    tool: Vec<Vec<f64>>,
    link: Vec<Vec<f64>>,
}

fn record(arm: &Arm, effects: &Effects, motion: &Swing) -> Recorded {
    let joints = arm.dof();
    let body = effects.changed(arm).expect("an arm");
    let mut injection = effects.injection();
    let mut sensors = std::mem::take(&mut injection.tool);
    sensors.append(&mut injection.sensors);
    let state = || [vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]];
    let posture = |k: usize| {
        let [mut q, mut v, mut a] = state();
        motion.at(k as f64 * 0.05, &mut q, &mut v, &mut a);
        [q, v]
    };
    let postures: Vec<Vec<f64>> = (0..60).map(|k| posture(k)[0].clone()).collect();
    let mut system = System::with_effects(&body, injection, &postures, PERIOD, SUBSTEPS).expect("a system");
    let [q, v] = posture(0);
    system.start(&q, &v);
    let blank = |rows: usize| vec![Vec::with_capacity(TICKS); rows];
    let (mut all_q, mut torque, mut link, mut tool) = (blank(joints), blank(joints), blank(joints), blank(3));
    let (mut t, mut before) = (Vec::new(), vec![0.0; joints]);
    for _ in 0..TICKS {
        let driven = vec![true; joints];
        system.tick(&Input { torque: &vec![0.0; joints], driven: &driven, motion }).expect("finite");
        let [mut q, mut v, mut taken] = [vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]];
        system.encoders(&mut q, &mut v);
        system.drive_torque(&mut taken);
        // The torque is that of the middle of the last sub-step: half a sub-step older than the encoders.
        for (taken, before) in taken.iter_mut().zip(&mut before) {
            let now = *taken;
            *taken += 0.5 / f64::from(SUBSTEPS) * (now - *before);
            *before = now;
        }
        let mut links = vec![0.0; joints];
        system.play().gather(system.q(), &mut links);
        let mut position: [f64; 3] = system.tool().translation.vector.into();
        let mut readings = Readings {
            period: PERIOD,
            q: &mut q,
            v: &mut v,
            torque: &mut taken,
            link: &mut links,
            tool: &mut position,
        };
        sensors.iter_mut().for_each(|law| law.read(&mut readings));
        t.push(system.time());
        for (columns, values) in
            [(&mut all_q, &q[..]), (&mut torque, &taken), (&mut link, &links), (&mut tool, &position)]
        {
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(*value));
        }
    }
    Recorded { motion: derived(t, all_q), torque, tool, link }
}

/// The motion of encoder readings: velocities and accelerations by central differences of fourth order.
fn derived(t: Vec<f64>, q: Vec<Vec<f64>>) -> Trajectory {
    let at = |x: &[f64], k: usize, weights: [f64; 5]| -> f64 {
        let k = k.clamp(2, x.len() - 3);
        weights.iter().zip(&x[k - 2..=k + 2]).map(|(weight, x)| weight * x).sum()
    };
    let first = [1.0, -8.0, 0.0, 8.0, -1.0].map(|weight| weight / (12.0 * PERIOD));
    let second = [-1.0, 16.0, -30.0, 16.0, -1.0].map(|weight| weight / (12.0 * PERIOD * PERIOD));
    let derive = |weights: [f64; 5]| {
        q.iter().map(|x| (0..x.len()).map(|k| at(x, k, weights)).collect()).collect::<Vec<Vec<f64>>>()
    };
    let (v, a) = (derive(first), derive(second));
    let stretches = std::iter::once(0..t.len()).collect();
    Trajectory { t, q, v, a, stretches }
}

/// Root mean square and greatest magnitude of the difference of two groups of columns, without the ends.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> [f64; 2] {
    let range = SETTLING..TICKS - 10;
    let (mut sum, mut most) = (0.0, 0.0_f64);
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a[range.clone()].iter().zip(&b[range.clone()]) {
            sum += (a - b) * (a - b);
            most = most.max((a - b).abs());
        }
    }
    [(sum / (a.len() * range.len()) as f64).sqrt(), most]
}

/// The test parameters of a kind, and the tolerance between plant and prediction, as a share of the effect (RMS).
fn trial(kind: &str, joints: usize) -> Option<(&'static str, f64)> {
    Some(match kind {
        // Impacts of the journal ring on; in the prediction the journal rests.
        "joint_clearance" => ("clearance = 0.5e-3", 0.05),
        // The plant smooths signs over 1 mrad/s.
        "coulomb_friction" => ("coulomb = 5.0", 0.05),
        "payload" => ("mass = 3.0\ncom = [0.02, -0.05, 0.1]", 2e-3),
        "encoder_offset" => ("offset = 0.02", 2e-3),
        "viscous_friction" => ("viscous = 4.0", 2e-3),
        "stribeck_friction" => ("extra = 5.0\nvelocity = 0.2", 0.2),
        "asymmetric_friction" => ("positive = 6.0\nnegative = 3.0", 0.05),
        // The load of the plant's drive includes the rotor's torque, too.
        "load_dependent_friction" => ("coefficient = 0.1", 0.08),
        "position_dependent_friction" => ("amplitude = 4.0\nperiods = 5.0\nphase = 0.3", 0.05),
        "presliding_friction" => ("stiffness = 200.0\nshare = 0.0\ncoulomb = 5.0", 0.05),
        "quadratic_drag" => ("coefficient = 3.0", 2e-3),
        "rotor_inertia" => ("inertia = 0.8", 2e-3),
        "link_mass" => ("scale = 1.2\ncom_shift = [0.01, -0.03, 0.02]", 2e-3),
        "base_tilt" => ("roll = 0.02\npitch = -0.03\ntracker = \"level\"", 2e-3),
        "link_length" => ("offset = 0.01", 2e-3),
        "link_flexure" => ("stiffness = 1e6", 0.02),
        "joint_spring" => ("stiffness = 40.0\nrest = 0.2", 2e-3),
        "torque_offset" => ("offset = 3.0", 2e-3),
        "torque_gain" => ("gain = 1.1", 2e-3),
        "torque_ripple" => ("amplitude = 3.0\nperiods = 20.0\nphase = 0.5", 2e-3),
        // The prediction computes the rotor's own torque from the encoder's readings.
        "encoder_eccentricity" => ("amplitude = 0.01\nphase = 0.4", 0.08),
        "time_delay" => ("delay = 0.012", 0.02),
        "sensor_lowpass" => ("cutoff = 8.0", 0.02),
        "mount_compliance" => ("compliance_x = 1e-5\ncompliance_y = 2e-5", 0.02),
        // The plant's drives use the acceleration of the previous sub-step.
        "load_change" => ("mass = 2.0\ntime = 1.2", 0.1),
        "external_force" => ("force = [8.0, -5.0, 12.0]\nstart = 1.2\nend = 2.0", 0.1),
        "external_torque" => ("torque = 9.0\nstart = 1.2\nend = 2.0", 0.1),
        "lubricated_clearance" => ("clearance = 0.5e-3\nviscosity = 2.0\nstart = [0.2, 0.4, 0.3]", 0.05),
        // The stiffness of a transmission suits the mass that it carries.
        "joint_elasticity" if joints == 6 => ("stiffness = 1e6\ndamping = 8e3", 0.08),
        "joint_elasticity" => ("stiffness = 2e4\ndamping = 40.0", 0.08),
        "backlash" if joints == 6 => ("gap = 2e-4\nstiffness = 1e6\ndamping = 8e3", 0.2),
        "backlash" => ("gap = 2e-3\nstiffness = 2e4\ndamping = 40.0", 0.2),
        _ => return None,
    })
}

/// The kinds that this method cannot test, with the reason; they have tests of their own.
fn elsewhere(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "actuator_saturation" => "it clips what is asked for, and here the motion is prescribed",
        "friction_drift" => "these arms name no friction that could change",
        "joint_coupling" => "it names a joint, and these arms have no name in common",
        _ => return None,
    })
}

/// The kinds whose flanks or journals hit: the torque shows the impacts and the prediction does not, so that the test compares the pose
/// alone.
const HITTING: [&str; 2] = ["backlash", "joint_clearance"];

fn effects(kind: &Kind, parameters: &str, arm: &Arm, joint: usize) -> Effects {
    let joint = (kind.site != Site::Arm).then(|| arm.joints()[joint].name.clone());
    let parameters = toml::from_str(parameters).expect("the trial is TOML");
    let table = EffectTable { kind: kind.name.to_owned(), joint, parameters, line: 0 };
    Effects::of(&ArmFile { arm: arm.clone(), effects: vec![table], ignored: Vec::new() })
        .unwrap_or_else(|error| panic!("{}: {error}", kind.name))
}

/// Compares the plant with the prediction for one kind at one joint; returns the discrepancy.
fn examine(kind: &Kind, arm: &Arm, motion: &Swing, joint: usize) -> Option<String> {
    if let Some(why) = elsewhere(kind.name) {
        println!("{:28} {} joints: not here: {why}", kind.name, arm.dof());
        return None;
    }
    let Some((parameters, tolerance)) = trial(kind.name, arm.dof()) else {
        return Some(format!("{}: there is no trial of it in this test; add its parameters", kind.name));
    };
    let effects = effects(kind, parameters, arm, joint);
    let recorded = record(arm, &effects, motion);
    let says = |effects: &Effects| -> Prediction {
        predict(arm, &effects.placed, &recorded.motion, &|column| column.to_vec()).expect("a prediction")
    };
    let (with, without) = (says(&effects), says(&Effects::default()));
    let pose = |p: &Prediction| p.tool.iter().chain(&p.link).cloned().collect::<Vec<_>>();
    let measured: Vec<Vec<f64>> = recorded.tool.iter().chain(&recorded.link).cloned().collect();
    let channels = [
        (
            "torque",
            kind.seen.torque && !HITTING.contains(&kind.name),
            recorded.torque.clone(),
            with.torque.clone(),
            without.torque.clone(),
        ),
        ("pose", kind.seen.pose, measured, pose(&with), pose(&without)),
    ];
    let (mut faults, mut compared) = (Vec::new(), false);
    for (channel, _, measured, with, without) in channels.into_iter().filter(|(_, seen, ..)| *seen) {
        let ([rms, most], [size, greatest]) = (difference(&measured, &with), difference(&with, &without));
        let [blind, _] = difference(&measured, &without);
        println!(
            "{:28} {} joints, {channel:6}: effect {size:.2e} rms {greatest:.2e} max; off by {:.2e} rms, {:.2e} max of it, \
             {:.3} without; allowed {tolerance:.0e}",
            kind.name,
            arm.dof(),
            rms / size,
            most / greatest,
            blind / size
        );
        compared |= size > 0.0;
        if size > 0.0 && !(rms < tolerance * size && blind > 0.5 * size && blind > 4.0 * rms) {
            faults.push(format!(
                "{} at joint {joint} of {}, {channel}: off by {rms:e} with it, {blind:e} without it; it is {size:e}",
                kind.name,
                arm.dof()
            ));
        }
    }
    if !compared {
        faults.push(format!("{}: shows nothing in this motion", kind.name));
    }
    (!faults.is_empty()).then(|| faults.join("\n"))
}

fn examine_all(arm: &Arm, motion: &Swing, joint: usize) {
    let only = std::env::var("FREEPLAY_KIND").ok();
    let kinds = kinds().filter(|kind| only.as_ref().is_none_or(|only| only == kind.name));
    let faults: Vec<String> = kinds.filter_map(|kind| examine(kind, arm, motion, joint)).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_kind_shows_in_the_paper_arm_as_it_is_predicted() {
    let paper = paper_arm().arm;
    let mut joints = paper.joints().to_vec();
    // With a rotor inertia in the file, a transmission decouples this motor instead of an assumed one.
    joints[1].rotor_inertia = 5.0;
    let arm = Arm::new("paper", joints, *paper.tool(), *paper.gravity()).expect("an arm");
    examine_all(&arm, &Swing { middle: vec![0.2, -0.4, 0.6, 0.3, 0.7, 0.1] }, 1);
}

#[test]
fn every_kind_shows_in_an_arm_of_three_joints_as_it_is_predicted() {
    let mut joints = vec![common::rod("base", 8.0, 0.1, 0.0), common::rod("arm", 6.0, 0.5, 0.1)];
    joints.push(common::rod("forearm", 4.0, 0.4, 0.5));
    joints[0].axis = nalgebra::Vector3::z_axis();
    joints[2].rotor_inertia = 0.05;
    let tool = nalgebra::Isometry3::translation(0.4, 0.0, 0.02);
    let arm = Arm::new("three", joints, tool, nalgebra::Vector3::new(0.0, 0.0, -9.81)).expect("an arm");
    examine_all(&arm, &Swing { middle: vec![0.3, 0.2, -0.8] }, 2);
}
