//! How sure the coefficients are: a bootstrap of blocks, which minds that neighbours are alike, with the prior's mean drawn anew each time
//! (Bardsley, Solonen, Haario & Laine 2014).

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::case::Case;
use super::columns::dot;
use super::noise::normal as normal_number;
use super::system::{Fit, System};

/// Length of a block, s.
const BLOCK_S: f64 = 0.5;
/// Draws.
const DRAWS: usize = 200;

/// Draws of the coefficients of `fit`: each row of the answer is one draw. What is held at its bound stays there.
pub(crate) fn draws(case: &Case, system: &System, fit: &Fit, seed: u64) -> Option<DMatrix<f64>> {
    let blocks = blocks(case, system, &fit.active);
    let (n, free) = (fit.active.len(), &fit.free);
    let mut held = fit.eta.clone();
    free.iter().for_each(|&k| held[k] = 0.0);
    let precisions = system.precisions(&fit.active);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut drawn = DMatrix::zeros(DRAWS, n);
    for row in 0..DRAWS {
        let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for _ in 0..blocks.len() {
            let (gram, target) = &blocks[rng.next_u64() as usize % blocks.len()];
            normal += gram;
            right += target;
        }
        for (i, (&a, &precision)) in fit.active.iter().zip(&precisions).enumerate() {
            normal[(i, i)] = normal[(i, i)] * (1.0 + 1e-9) + precision + f64::MIN_POSITIVE;
            // Another machine of the same tolerances: without this, what the data leave to the prior would seem sure. One that has gone
            // over into an effect is still that machine's.
            let machine = normal_number(&mut rng) / system.precision[a].max(f64::MIN_POSITIVE).sqrt();
            right[i] += if system.precision[a] > 0.0 { precision * machine } else { 0.0 };
        }
        right -= &normal * &held;
        let part = DMatrix::from_fn(free.len(), free.len(), |i, j| normal[(free[i], free[j])]);
        let solved = Cholesky::new(part)?.solve(&DVector::from_fn(free.len(), |i, _| right[free[i]]));
        let mut whole = held.clone();
        free.iter().zip(solved.iter()).for_each(|(&k, x)| whole[k] = *x);
        drawn.row_mut(row).copy_from(&whole.transpose());
    }
    Some(drawn)
}

/// Weighted inner products of every block: of the columns with each other, and with the target. A block is a stretch of time in
/// all channels of a recording.
fn blocks(case: &Case, system: &System, active: &[usize]) -> Vec<(DMatrix<f64>, DVector<f64>)> {
    let (n, per_stage) = (active.len(), case.per_stage());
    let mut blocks = Vec::new();
    for (number, stage) in case.stages.iter().enumerate() {
        let motion = stage.motion();
        for stretch in &motion.stretches {
            let long = ((BLOCK_S / motion.step(stretch).max(1e-12)) as usize).max(1);
            for begin in stretch.clone().step_by(long) {
                let rows = begin..(begin + long).min(stretch.end);
                let (mut gram, mut target) = (DMatrix::zeros(n, n), DVector::zeros(n));
                for channel in number * per_stage..(number + 1) * per_stage {
                    let weight = system.weights[channel];
                    let y = &system.target[channel][rows.clone()];
                    let part = |a: usize| system.base[a][channel].as_ref().map(|x| &x[rows.clone()]);
                    let parts: Vec<_> = active.iter().map(|&a| part(a)).collect();
                    for (i, left) in parts.iter().enumerate() {
                        let Some(left) = left else { continue };
                        target[i] += weight * dot(left, y);
                        for (j, right) in parts.iter().enumerate().take(i + 1) {
                            let Some(right) = right else { continue };
                            let product = weight * dot(left, right);
                            gram[(i, j)] += product;
                            if i != j {
                                gram[(j, i)] += product;
                            }
                        }
                    }
                }
                blocks.push((gram, target));
            }
        }
    }
    blocks
}
