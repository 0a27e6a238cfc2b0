//! Fits the servos of an arm to recordings and prints the errors of full-length simulations of other recordings.
//!
//! `cargo run --release -p freeplay-servo --example fit -- ARM TRAIN... -- TEST...`
#![allow(clippy::unwrap_used, reason = "an example ends at the first surprise")]

use std::path::Path;
use std::time::Instant;

use freeplay_recording::{Recording, read};
use freeplay_servo::{Commands, Problem, Rollout, ServoArm, Track, servos, sights, unknowns};

/// Longest step of a rollout, s.
const STEP: f64 = 0.01;

fn track(recording: &Recording) -> Track {
    let references = recording.q_ref.as_ref().unwrap();
    let commands = references.iter().map(|column| Commands::new(&recording.t, column)).collect();
    Track { stamps: recording.t.clone(), measured: recording.q.clone(), commands, loads: Vec::new() }
}

fn tracks(names: &[String]) -> Vec<Track> {
    names.iter().map(|name| track(&read(Path::new(name), None).unwrap())).collect()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arm = freeplay_model::load(Path::new(&arguments[0])).unwrap().arm;
    let split = arguments.iter().position(|argument| argument == "--").unwrap_or(arguments.len());
    let train = tracks(&arguments[1..split]);
    let windows = train
        .iter()
        .enumerate()
        .flat_map(|(index, track)| track.windows(0.5, 20.0).into_iter().map(move |rows| (index, rows)));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let rounding = vec![4e-4; arm.dof()];
    let problem = Problem {
        tracks: &train,
        windows: windows.collect(),
        counted: Vec::new(),
        rounding,
        longest_step: STEP,
        threads,
    };
    let began = Instant::now();
    let sights = sights(&arm, &train);
    let model = ServoArm::new(arm.clone(), servos(&arm, &sights, &vec![0.5; arm.dof()]));
    for sight in &sights {
        println!("{sight:.4?}");
    }
    if std::env::var_os("SIGHTS").is_some() {
        return;
    }
    let unknowns = unknowns(&sights, &model, 1e-4);
    let mut say = |step: usize, gain: f64| {
        println!("step {step} gained {gain:.2} after {:.1?}", began.elapsed());
    };
    let fitted = problem.fit(&model, &unknowns, &mut say);
    println!("{} steps, {:.1?}, noise {:.4?}", fitted.steps, began.elapsed(), fitted.noise);
    for (unknown, (value, deviation)) in unknowns.iter().zip(&fitted.values) {
        println!("joint {} {:?}: {value:.5} ± {:.5}", unknown.joint, unknown.parameter, 1.96 * deviation);
    }
    let mut rollout = Rollout::new(&fitted.model, STEP);
    let mut pooled = (0.0, 0);
    for name in &arguments[(split + 1).min(arguments.len())..] {
        let track = track(&read(Path::new(name), None).unwrap());
        let rows = 0..track.stamps.len();
        let residual = track.residual(&fitted.model, &mut rollout, &rows);
        // The fastest of several runs is the least disturbed by other processes.
        let timed = |_| {
            let began = Instant::now();
            let again = track.residual(&fitted.model, &mut rollout, &rows);
            (began.elapsed(), again.len())
        };
        let took = (0..30).map(timed).min();
        pooled.0 += residual.iter().map(|r| r * r).sum::<f64>();
        pooled.1 += residual.len();
        let of_joint = |joint: usize| {
            let squares = residual.iter().skip(joint).step_by(arm.dof()).map(|r| r * r).sum::<f64>();
            (squares / rows.len() as f64).sqrt() * 1e3
        };
        let rms: Vec<f64> = (0..arm.dof()).map(of_joint).collect();
        println!("{name}: {rms:.2?} mrad, {took:?}");
    }
    println!("pooled {:.2} mrad", (pooled.0 / f64::from(pooled.1.max(1) as u32)).sqrt() * 1e3);
}
