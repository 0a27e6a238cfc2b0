//! Significance test of the improvement of simulated runs by the weights.
//!
//! A path is one independent sample: its laps and repeated runs are alike, and the learned remainder must hold on unrecorded paths. For each path, d = mean
//! ln ((with + δ)/without) over its runs, where `with` and `without` are the deviations with and without the weights and δ is the negligible improvement.
//! Student's one-sided test asks whether the mean of d over the paths is below zero: t = d̄ √n / s with n − 1 degrees of freedom (Student 1908, Biometrika
//! 6:1). Ratios give paths of any size the same weight, so that one large path cannot prove the others.

use std::f64::consts::FRAC_PI_2;

/// The p-value of `ratios` (logarithms, one a path): the probability of a mean this far below zero or farther if the weights had no effect; 1 for fewer than
/// two paths.
pub fn chance(ratios: &[f64]) -> f64 {
    let count = ratios.len() as f64;
    if ratios.len() < 2 || ratios.iter().any(|ratio| !ratio.is_finite()) {
        return 1.0;
    }
    let mean = ratios.iter().sum::<f64>() / count;
    let variance = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / (count - 1.0);
    if variance <= 0.0 {
        return if mean < 0.0 { 0.0 } else { 1.0 };
    }
    below(mean / (variance / count).sqrt(), ratios.len() - 1)
}

/// The probability that Student's t with `freedom` degrees of freedom is below `t`, by the finite sums of Abramowitz and Stegun 1964, 26.7.3 and 26.7.4.
fn below(t: f64, freedom: usize) -> f64 {
    let angle = (t.abs() / (freedom as f64).sqrt()).atan();
    let (sin, cos) = angle.sin_cos();
    let is_odd = freedom % 2 == 1;
    // 1 + a₁ cos²θ + a₁a₂ cos⁴θ + …, a = 2/3, 4/5, … for odd degrees of freedom and 1/2, 3/4, … for even ones.
    let first = if is_odd { 2.0 } else { 1.0 };
    let terms = (freedom - usize::from(is_odd)) / 2;
    let (mut sum, mut term) = (0.0, 1.0);
    for k in 0..terms {
        sum += term;
        let numerator = first + 2.0 * k as f64;
        term *= cos * cos * numerator / (numerator + 1.0);
    }
    let within = if is_odd { (angle + sin * cos * sum) / FRAC_PI_2 } else { sin * sum };
    if t < 0.0 { 0.5 - 0.5 * within } else { 0.5 + 0.5 * within }
}

#[cfg(test)]
mod tests {
    use super::{below, chance};
    use rand::{RngExt, SeedableRng};

    /// Values of published tables: 5 % and 1 % of the distribution are below −t.
    #[test]
    fn the_distribution_is_that_of_tables() {
        let table = [
            (1, 6.314, 31.821),
            (2, 2.920, 6.965),
            (3, 2.353, 4.541),
            (4, 2.132, 3.747),
            (7, 1.895, 2.998),
            (10, 1.812, 2.764),
            (30, 1.697, 2.457),
        ];
        for (freedom, five, one) in table {
            let found = [below(-five, freedom), below(-one, freedom), below(five, freedom)];
            println!("{freedom}: {found:?}");
            assert!((found[0] - 0.05).abs() < 5e-5 && (found[1] - 0.01).abs() < 2e-5);
            assert!((found[0] + found[2] - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn one_path_proves_nothing_and_alike_paths_prove_much() {
        assert!(chance(&[-3.0]) >= 1.0 && chance(&[]) >= 1.0 && chance(&[-1.0, f64::NAN]) >= 1.0);
        assert!(chance(&[-2.0, -2.2, -1.9]) < 0.01);
        assert!(chance(&[-2.0, -0.1, 0.1]) > 0.05, "one path alone is better");
        assert!(chance(&[0.2, 0.3, 0.1]) > 0.95);
        assert!(chance(&[-0.5, -0.5]) <= 0.0 && chance(&[0.0, 0.0]) >= 1.0);
    }

    /// If only chance changes the runs, the test accepts the weights in 5 of 100 cases.
    #[test]
    fn chance_alone_passes_as_often_as_it_says() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(39);
        // The sum of twelve uniform numbers minus six is approximately normal.
        let mut normal = || (0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0;
        for paths in [2, 3, 5] {
            let trials = 20_000;
            let passed = (0..trials)
                .filter(|_| {
                    let ratios: Vec<f64> = (0..paths).map(|_| 0.3 * normal()).collect();
                    chance(&ratios) < 0.05
                })
                .count();
            let share = passed as f64 / f64::from(trials);
            println!("{paths} paths: {share:.4}");
            assert!((share - 0.05).abs() < 0.006);
        }
    }
}
