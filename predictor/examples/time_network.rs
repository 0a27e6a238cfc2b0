//! Measures computing times of the network: one forward pass (p50, p99) and one Levenberg–Marquardt iteration.
//!
//! `cargo run --release -p freeplay-predictor --example time_network`
//!
//! An iteration is the cost of an epoch whose first step is accepted: JᵀJ and Jᵀe, Cholesky factorisation and solution, and the
//! error at the new weights. Rows of J are samples × outputs. The example times the network with its three outputs and with one
//! output (as many rows as samples). As a reference it also times nalgebra's product of the transposed Jacobian of that shape
//! with itself (both triangles).

use freeplay_predictor::gauss_newton::{NetworkErrors, Samples};
use freeplay_predictor::initialise::nguyen_widrow;
use freeplay_predictor::levenberg_marquardt::LeastSquares;
use freeplay_predictor::normal_equations::{DampedSolver, NormalEquations};
use freeplay_predictor::{Activation, Network};
use hdrhistogram::Histogram;
use nalgebra::DMatrix;
use std::hint::black_box;
use std::time::Instant;

/// Forward passes per reading of the clock, which itself takes some 20 ns.
const PASSES: u32 = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sizes = [40, 10, 10, 10, 10, 3];
    for activation in [Activation::Tanh, Activation::Logistic] {
        forward(&sizes, activation)?;
    }
    println!(
        "\none iteration, ms            samples   rows  weights   JtJ+Jte  Cholesky  error   total    best   yardstick JtJ"
    );
    for samples in [750, 1500] {
        for outputs in [1, 3] {
            iteration(&[40, 10, 10, 10, 10, outputs], samples)?;
        }
    }
    Ok(())
}

fn forward(sizes: &[usize], activation: Activation) -> Result<(), Box<dyn std::error::Error>> {
    let network = Network::new(sizes, activation, nguyen_widrow(sizes, activation, 1))?;
    let mut scratch = network.scratch();
    let rows: Vec<Vec<f64>> =
        (0..16).map(|row| (0..sizes[0]).map(|i| value(row * 100 + i)).collect()).collect();
    let mut histogram = Histogram::<u64>::new(3)?;
    for round in 0..22_000 {
        let start = Instant::now();
        for pass in 0..PASSES {
            black_box(network.forward(black_box(&rows[pass as usize % 16]), &mut scratch));
        }
        let picoseconds = start.elapsed().as_nanos() as u64 * 1000 / u64::from(PASSES);
        if round >= 2000 {
            histogram.record(picoseconds)?;
        }
    }
    let at = |quantile| histogram.value_at_quantile(quantile) as f64 / 1000.0;
    println!(
        "forward {sizes:?} {activation:?}, mean of {PASSES}: min {:.0} p50 {:.0} ns, p99 {:.0} ns, p99.9 {:.0} ns",
        histogram.min() as f64 / 1000.0,
        at(0.5),
        at(0.99),
        at(0.999)
    );
    Ok(())
}

fn iteration(sizes: &[usize], count: usize) -> Result<(), Box<dyn std::error::Error>> {
    let outputs = sizes[sizes.len() - 1];
    let samples = Samples {
        inputs: DMatrix::from_fn(count, sizes[0], |i, j| value(i * 131 + j * 17)),
        outputs: DMatrix::from_fn(count, outputs, |i, j| value(i * 71 + j * 29)),
    };
    let mut errors = NetworkErrors::new(sizes, Activation::Tanh, samples, None);
    let weights = nguyen_widrow(sizes, Activation::Tanh, 1);
    let mut equations = NormalEquations::new(weights.len());
    let mut solver = DampedSolver::new(weights.len());
    let mut step = vec![0.0; weights.len()];
    let mut readings = [const { Vec::new() }; 4];
    for _ in 0..15 {
        let times = [
            timed(|| {
                equations.clear();
                errors.linearise(&weights, &mut equations);
            }),
            timed(|| solver.step(&equations, 1.0e-3, &mut step).expect("damped equations are definite")),
            timed(|| {
                black_box(errors.cost(&weights));
            }),
        ];
        readings.iter_mut().zip(times.into_iter().chain([times.iter().sum()])).for_each(|(r, t)| r.push(t));
    }
    let best = readings[3].iter().copied().fold(f64::INFINITY, f64::min);
    let [form, solve, cost, total] = readings.map(|r| median(&r));
    let rows = count * outputs;
    println!(
        "{:<28} {count:>7} {rows:>6} {:>8} {form:>9.1} {solve:>9.1} {cost:>6.1} {total:>7.1} {best:>7.1} {:>15.1}",
        format!("{sizes:?}"),
        weights.len(),
        rank_k(rows, weights.len())
    );
    Ok(())
}

/// Median time of JᵀJ of a random Jacobian, ms.
fn rank_k(rows: usize, columns: usize) -> f64 {
    let jacobian = DMatrix::from_fn(rows, columns, |i, j| value(i * 31 + j * 37));
    let across = jacobian.transpose();
    let mut product = DMatrix::zeros(columns, columns);
    let mut once = || timed(|| product.gemm(1.0, &across, &jacobian, 0.0));
    median(&(0..7).map(|_| once()).collect::<Vec<_>>())
}

/// Time of `work`, ms.
fn timed(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1.0e3
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// A pseudo-random number in [-1, 1].
fn value(index: usize) -> f64 {
    (index as f64 * 12.9898).sin()
}
