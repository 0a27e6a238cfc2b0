//! Computation time of predictions: `cargo run --release -p freeplay-laws --example timing`.
//!
//! The paper's six-axis arm on 4000 points; medians of the time of one prediction, of the change by one more effect, and of all columns of
//! each kind at one joint. No test asserts these figures.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

use freeplay_laws::{Baseline, CATALOGUE, LawError, Place, Site, Trajectory, predict};
use freeplay_model::paper_arm;

const POINTS: usize = 4000;
const RATE: f64 = 250.0;
const JOINT: usize = 2;

/// One sine per joint.
fn motion() -> Trajectory {
    let t: Vec<f64> = (0..POINTS).map(|i| i as f64 / RATE).collect();
    let wave = |joint: usize, order: i32| {
        let w = TAU * (0.31 + 0.07 * joint as f64);
        let turn = f64::from(order) * TAU / 4.0;
        t.iter().map(|t| 0.7 * w.powi(order) * (w * t + joint as f64 + turn).sin()).collect::<Vec<_>>()
    };
    let columns = |order| (0..6).map(|joint| wave(joint, order)).collect();
    Trajectory {
        q: columns(0),
        v: columns(1),
        a: columns(2),
        stretches: std::iter::once(0..POINTS).collect(),
        t,
    }
}

/// Median time of `work`, ms.
fn median_ms(mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..15)
        .map(|_| {
            let start = Instant::now();
            work();
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() -> Result<(), LawError> {
    let (arm, motion) = (paper_arm().arm, motion());
    let raw = |column: &[f64]| column.to_vec();
    let rigid = median_ms(|| drop(black_box(predict(&arm, &[], &motion, &raw))));
    println!("prediction of the rigid arm, six axes, {POINTS} points: {rigid:.2} ms");
    let baseline = Baseline::new(&arm, &[], &motion, &raw)?;
    println!(
        "{:28} {:>7} {:>6} {:>16} {:>18}",
        "kind", "shapes", "terms", "predict, ms", "columns/shape, ms"
    );
    for kind in CATALOGUE {
        let joint = (kind.site != Site::Arm).then_some(JOINT);
        let place = Place { scene: baseline.scene(), joint };
        let shapes = (kind.shapes)(&place);
        let Some(shape) = shapes.first() else {
            println!("{:28} {:>7}", kind.name, "none");
            continue;
        };
        let terms = kind.terms_at(&place, shape);
        let effect = [kind.place(&place, terms[0].plus.clone())?];
        kind.columns(&baseline, joint, shape)?;
        let whole = median_ms(|| drop(black_box(predict(&arm, &effect, &motion, &raw))));
        let columns = median_ms(|| drop(black_box(kind.columns(&baseline, joint, shape))));
        println!("{:28} {:>7} {:>6} {whole:>16.2} {columns:>18.2}", kind.name, shapes.len(), terms.len());
    }
    Ok(())
}
