//! Time of one update and solve of the compensation programme: six joints, with 36 rows (position, speed and acceleration limits one
//! by one) and with 12 (their intersection, as the controller has it).
//!
//! `cargo run --release -p freeplay-controller --example qp_timing`

use std::time::Instant;

use freeplay_controller::qp::{Qp, QpStatus};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const JOINTS: usize = 6;
const SOLVES: usize = 20_000;

fn main() {
    println!("clarabel, {JOINTS} variables, {SOLVES} solves, µs of update and solve");
    println!("{:>5} {:>8} {:>8} {:>8} {:>8} {:>12}", "rows", "p50", "p99", "p99.9", "max", "iterations");
    for blocks in [3, 1] {
        measure(blocks);
    }
}

/// Times programmes with `blocks` intervals per joint: the first wide, the second and third narrower.
fn measure(blocks: usize) {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let rows = DMatrix::from_fn(2 * blocks * JOINTS, JOINTS, |row, column| {
        let sign = if (row / JOINTS).is_multiple_of(2) { 1.0 } else { -1.0 };
        if row % JOINTS == column { sign } else { 0.0 }
    });
    let mut qp = Qp::new(&rows).expect("the rows are finite");
    let jacobian = DMatrix::from_fn(6, JOINTS, |_, _| random.random_range(-1.0..1.0));
    let mut times = Vec::with_capacity(SOLVES);
    let mut iterations = 0;
    for _ in 0..SOLVES {
        let drift = DMatrix::from_fn(6, JOINTS, |_, _| random.random_range(-0.01..0.01));
        let j = &jacobian + drift;
        let cost = j.transpose() * &j + DMatrix::identity(JOINTS, JOINTS) * 1e-3;
        let deviation = DVector::from_fn(6, |_, _| random.random_range(-0.6..0.6));
        let linear = j.transpose() * deviation;
        let bounds: Vec<f64> = (0..rows.nrows()).map(|row| [500.0, 2.0, 0.5][row / (2 * JOINTS)]).collect();
        let begun = Instant::now();
        let report = qp.solve(&cost, linear.as_slice(), &bounds);
        times.push(begun.elapsed().as_nanos());
        assert_eq!(report.status, QpStatus::Solved);
        iterations += report.iterations as usize;
    }
    times.sort_unstable();
    let at = |share: f64| times[((SOLVES - 1) as f64 * share) as usize] as f64 / 1e3;
    println!(
        "{:>5} {:>8.1} {:>8.1} {:>8.1} {:>8.1} {:>12.1}",
        rows.nrows(),
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0),
        iterations as f64 / SOLVES as f64
    );
}
