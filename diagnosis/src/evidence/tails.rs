//! Likelihood of rows whose tails may be heavier than those of a normal distribution.

use crate::statistics::MOST_ROUNDS;

/// Degrees of freedom of Student's t that the fit tries: from a distribution without variance to one that no recording distinguishes from a normal,
/// and denser where the tails change most.
const FREEDOMS: [f64; 9] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 100.0];

/// Maximum log-likelihood of `rows` under Student's t, over its degrees of freedom and its scale, which is at least `least` (Lange, Little & Taylor
/// 1989, J. Am. Stat. Assoc. 84:881).
pub(crate) fn log_likelihood(rows: &[f64], least: f64) -> f64 {
    let count = rows.len() as f64;
    let mean = (rows.iter().map(|x| x * x).sum::<f64>() / count.max(1.0)).max(least * least);
    if mean <= 0.0 {
        return 0.0;
    }
    let mut square = mean;
    let of = |freedom: f64| {
        for _ in 0..MOST_ROUNDS {
            let weighed = rows.iter().map(|x| (freedom + 1.0) / (freedom + x * x / square) * x * x);
            let before = square;
            square = (weighed.sum::<f64>() / count).max(least * least);
            if (square - before).abs() <= before * f64::EPSILON.sqrt() {
                break;
            }
        }
        let far: f64 = rows.iter().map(|x| (x * x / square / freedom).ln_1p()).sum();
        let constant = libm::lgamma(0.5 * (freedom + 1.0))
            - libm::lgamma(0.5 * freedom)
            - 0.5 * (freedom * std::f64::consts::PI * square).ln();
        count * constant - 0.5 * (freedom + 1.0) * far
    };
    FREEDOMS.into_iter().rev().map(of).fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::log_likelihood;
    use crate::random::normals;

    /// The log-likelihood of normal rows is that of a normal distribution, except for the gain from the choice of the tails; an outlier costs less
    /// than its square.
    #[test]
    fn normal_rows_are_as_probable_as_under_a_normal() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut rows = normals(&mut rng, 1000, 0.2);
        let square: f64 = rows.iter().map(|x| x * x).sum::<f64>() / 1000.0;
        let exact = -500.0 * ((2.0 * std::f64::consts::PI * square).ln() + 1.0);
        let said = log_likelihood(&rows, 0.0);
        println!("{said:.2}, a normal {exact:.2}");
        assert!((said - exact).abs() < 3.0);
        rows[500] = 4.0;
        let far = log_likelihood(&rows, 0.0);
        println!("one row of 20 deviations costs {:.1}, a normal 200", said - far);
        assert!((3.0..40.0).contains(&(said - far)));
        assert!(log_likelihood(&[0.0; 10], 0.1) > log_likelihood(&[0.0; 10], 0.2));
    }
}
