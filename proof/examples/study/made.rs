//! Simulated recordings: a machine within the tolerances of its model, on random sines, with noise and rounding. Its laws are those of the catalogue, so that
//! the study measures the method alone, without errors of the laws.

use std::f64::consts::TAU;
use std::path::Path;

use freeplay_arm::Arm;
use freeplay_laws::{ArmParts, CATALOGUE, Effects, Kind, Place, Scene, Trajectory, predict};
use freeplay_model::{ArmFile, EffectTable};
use freeplay_recording::Recording;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Samples per second, Hz, and length, s.
const RATE: f64 = 250.0;
const SECONDS: f64 = 16.0;

/// A simulated case.
pub struct Made {
    /// The given model.
    pub model: ArmFile,
    /// The recording.
    pub recording: Recording,
    /// The effect of the machine that the model lacks.
    pub truth: Option<EffectTable>,
}

/// The arms: the paper's, with and without friction, and its first two and three joints.
pub fn arm(number: usize) -> Arm {
    let paper = freeplay_model::paper_arm().arm;
    let mut parts = ArmParts::of(&paper);
    let joints = [6, 2, 3, 6][number % 4];
    parts.joints.truncate(joints);
    if number % 4 != 3 {
        for (index, joint) in parts.joints.iter_mut().enumerate() {
            joint.friction.coulomb = 4.0 / (1.0 + index as f64);
            joint.friction.viscous = 3.0 / (1.0 + index as f64);
        }
    }
    parts.into_arm("made").expect("an arm")
}

/// The case of `seed`; with a missing effect if `concealed`.
pub fn make(seed: u64, concealed: bool) -> Made {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let nominal = arm(seed as usize);
    let machine = drawn(&nominal, &mut rng);
    let t: Vec<f64> = (0..(SECONDS * RATE) as usize).map(|k| k as f64 / RATE).collect();
    let motion = sines(&nominal, &t, &mut rng);
    let truth = concealed.then(|| effect(&nominal, &motion, &mut rng));
    let file = ArmFile { arm: machine, effects: truth.iter().cloned().collect(), ignored: Vec::new() };
    let effects = Effects::of(&file).expect("effects");
    let says = predict(&file.arm, &effects.placed, &motion, &|x: &[f64]| x.to_vec()).expect("a prediction");
    let level = [0.0005, 0.0015, 0.004][rng.random_range(0..3)];
    let mut columns = vec![("t".to_owned(), t)];
    for (joint, q) in motion.q.iter().enumerate() {
        columns.push((format!("q{}", joint + 1), rounded(q, 1e-6, 1e-6, &mut rng)));
    }
    for (joint, torque) in says.torque.iter().enumerate() {
        let most = torque.iter().fold(1e-3_f64, |most, x| most.max(x.abs()));
        columns.push((format!("tau{}", joint + 1), rounded(torque, level * most, 1e-4 * most, &mut rng)));
    }
    for (axis, tool) in ["x", "y", "z"].into_iter().zip(&says.tool) {
        columns.push((axis.to_owned(), rounded(tool, 3e-5, 1e-6, &mut rng)));
    }
    let recording = Recording::new(Path::new("made.csv"), columns).expect("a recording");
    let model = ArmFile { arm: nominal, effects: Vec::new(), ignored: Vec::new() };
    Made { model, recording, truth }
}

fn even(rng: &mut ChaCha8Rng) -> f64 {
    rng.random_range(-1.0..1.0)
}

/// A machine within the tolerances.
fn drawn(nominal: &Arm, rng: &mut ChaCha8Rng) -> Arm {
    let mut parts = ArmParts::of(nominal);
    for joint in &mut parts.joints {
        joint.inertia.mass *= 1.0 + 0.02 * even(rng);
        joint.inertia.about_com *= 1.0 + 0.02 * even(rng);
        joint.friction.coulomb *= 1.0 + 0.05 * even(rng);
        joint.friction.viscous *= 1.0 + 0.05 * even(rng);
        if let Some(way) = joint.placement.translation.vector.try_normalize(1e-6) {
            joint.placement.translation.vector += way * (1e-4 * even(rng));
        }
    }
    parts.into_arm("machine").expect("an arm")
}

/// Four sines a joint.
fn sines(arm: &Arm, t: &[f64], rng: &mut ChaCha8Rng) -> Trajectory {
    let mut motion = Trajectory {
        t: t.to_vec(),
        stretches: std::iter::once(0..t.len()).collect(),
        ..Trajectory::default()
    };
    for _ in 0..arm.dof() {
        let waves: Vec<[f64; 3]> = (0..4)
            .map(|_| {
                [
                    rng.random_range(0.1..0.5),
                    TAU * rng.random_range(0.08..0.7),
                    TAU * rng.random_range(0.0..1.0),
                ]
            })
            .collect();
        let sum = |of: &dyn Fn([f64; 3], f64) -> f64| -> Vec<f64> {
            t.iter().map(|t| waves.iter().map(|wave| of(*wave, *t)).sum()).collect()
        };
        motion.q.push(sum(&|[a, w, p], t| a * (w * t + p).sin()));
        motion.v.push(sum(&|[a, w, p], t| a * w * (w * t + p).cos()));
        motion.a.push(sum(&|[a, w, p], t| -a * w * w * (w * t + p).sin()));
    }
    motion
}

/// A random effect of visible size.
fn effect(arm: &Arm, motion: &Trajectory, rng: &mut ChaCha8Rng) -> EffectTable {
    let scene = Scene::new(arm.clone(), motion);
    loop {
        let kind: &'static Kind = CATALOGUE[rng.random_range(0..CATALOGUE.len())];
        let joint = match kind.site {
            freeplay_laws::Site::Arm => None,
            _ => Some(rng.random_range(0..arm.dof())),
        };
        let place = Place { scene: &scene, joint };
        let shapes = (kind.shapes)(&place);
        if !kind.fits(place.joint()) || shapes.is_empty() {
            continue;
        }
        let shape = &shapes[rng.random_range(0..shapes.len())];
        let terms = kind.terms_at(&place, shape);
        let low_pass = |x: &[f64]| x.to_vec();
        let baseline = freeplay_laws::Baseline::new(arm, &[], motion, &low_pass).expect("a baseline");
        let Ok(columns) = kind.columns(&baseline, joint, shape) else { continue };
        let size = rng.random_range(0.1..0.5);
        let spread = |x: &[f64]| {
            let mean = x.iter().sum::<f64>() / x.len() as f64;
            (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
        };
        let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
        // Each coefficient contributes this share of a channel's measured size, or of 1 mm.
        let beta: Vec<f64> = columns
            .iter()
            .map(|(_, column)| {
                let of_torque = |(joint, c): (usize, &[f64])| {
                    rms(c) / spread(&baseline.prediction().torque[joint]).max(1e-9)
                };
                let torque = column.torque.all_written().map(of_torque).fold(0.0, f64::max);
                let tool = column.tool.all_written().map(|(_, c)| rms(c) / 1e-3).fold(0.0, f64::max);
                let sign = if rng.random_range(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
                sign * size / torque.max(tool).max(1e-12)
            })
            .collect();
        let inside = |beta: &[f64]| {
            terms.iter().zip(beta).all(|(term, beta)| *beta >= term.least && *beta <= term.most)
        };
        let flipped: Vec<f64> = beta.iter().map(|beta| beta.abs()).collect();
        let Some(beta) = [beta, flipped].into_iter().find(|beta| inside(beta)) else { continue };
        let parameters = kind.compose(shape, &beta);
        let table = EffectTable {
            kind: kind.name.to_owned(),
            joint: place.joint().map(|joint| joint.name.clone()),
            parameters,
            line: 0,
        };
        if freeplay_laws::Placed::new(&table, arm).is_ok() {
            return table;
        }
    }
}

/// `x` plus noise of `deviation`, rounded to `step`.
fn rounded(x: &[f64], deviation: f64, step: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    // The sum of twelve uniform numbers is close to a normal distribution of standard deviation one.
    let mut noise = || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>() * deviation;
    x.iter().map(|x| ((x + noise()) / step).round() * step).collect()
}
