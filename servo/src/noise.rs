//! The noise of measured positions against a model: its size for each joint, and the number of rows that count as one.

/// Degrees of freedom of Student's t for the weights of rows: its tails are heavy enough that a contact of a few seconds does not bias a
/// fit, and light enough that it costs little on Gaussian errors (Lange, Little & Taylor 1989, J. Am. Stat. Assoc. 84:881, recommend this
/// value if it is not estimated).
pub const DEGREES_OF_FREEDOM: f64 = 4.0;
/// Passes for size and weights; each reduces the error by a factor, and neither needs to be exact.
const PASSES: usize = 10;

/// Noise of each joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Size σ, rad (m).
    pub size: Vec<f64>,
    /// Number of correlated rows that count as one: 1 + 2 Σ ρ.
    pub rows: Vec<f64>,
}

impl Noise {
    /// The noise in `residuals`, `[window][row][joint]`, not smaller than `least` for each joint.
    pub fn of(residuals: &[Vec<f64>], least: &[f64]) -> Noise {
        let joints = least.len();
        let columns = |joint: usize| {
            residuals.iter().map(move |window| window.iter().skip(joint).step_by(joints).copied())
        };
        let size: Vec<f64> = (0..joints)
            .map(|joint| {
                let all: Vec<f64> = columns(joint).flatten().filter(|r| r.is_finite()).collect();
                size_of(&all).max(least[joint])
            })
            .collect();
        let rows = (0..joints)
            .map(|joint| {
                let weighed = |r: f64| if r.is_finite() { r * weight(r / size[joint]).sqrt() } else { 0.0 };
                let windows: Vec<Vec<f64>> = columns(joint).map(|w| w.map(weighed).collect()).collect();
                correlated(&windows)
            })
            .collect();
        Noise { size, rows }
    }

    /// The noise of `joint` alone.
    #[must_use]
    pub fn alone(&self, joint: usize) -> Noise {
        Noise { size: vec![self.size[joint]], rows: vec![self.rows[joint]] }
    }

    /// Loss of log-likelihood by the residual `r` of `joint`, against a residual of zero; zero without a measurement.
    #[inline]
    pub fn loss(&self, joint: usize, r: f64) -> f64 {
        if r.is_nan() {
            return 0.0;
        }
        let z = r / self.size[joint];
        0.5 * (DEGREES_OF_FREEDOM + 1.0) * (z * z / DEGREES_OF_FREEDOM).ln_1p() / self.rows[joint]
    }

    /// Weight of the square of the residual `r` of `joint` in a fit.
    #[inline]
    pub fn weight(&self, joint: usize, r: f64) -> f64 {
        if r.is_nan() {
            return 0.0;
        }
        weight(r / self.size[joint]) / (self.size[joint].powi(2) * self.rows[joint])
    }
}

fn weight(z: f64) -> f64 {
    (DEGREES_OF_FREEDOM + 1.0) / (DEGREES_OF_FREEDOM + z * z)
}

/// Scale of Student's t for `residuals`, by expectation maximisation from the median of their magnitudes.
fn size_of(residuals: &[f64]) -> f64 {
    if residuals.is_empty() {
        return 0.0;
    }
    let mut amounts: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    amounts.sort_by(f64::total_cmp);
    let mut size = amounts[amounts.len() / 2];
    for _ in 0..PASSES {
        if size == 0.0 {
            return size;
        }
        let square: f64 = residuals.iter().map(|r| weight(r / size) * r * r).sum();
        size = (square / residuals.len() as f64).sqrt();
    }
    size
}

/// Up to this lag the correlation is computed at each lag; beyond, in steps of this share of the lag, since the correlation of so many rows
/// changes little from one lag to the next. The cost thus grows linearly with the rows, but only logarithmically with the length of the
/// windows.
const EACH_LAG: usize = 16;

/// 1 + 2 Σ ρ of all windows together, up to the first uncorrelated lag (Geyer 1992, Stat. Sci. 7:473, initial positive sequence); linear
/// interpolation between the computed lags.
fn correlated(windows: &[Vec<f64>]) -> f64 {
    let product = |lag: usize| {
        let of_window = |w: &Vec<f64>| w.iter().zip(w.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
        windows.iter().map(of_window).sum::<f64>()
    };
    let whole = product(0);
    if whole <= 0.0 {
        return 1.0;
    }
    let longest = windows.iter().map(Vec::len).max().unwrap_or(0);
    let (mut sum, mut last, mut before) = (0.0, 0, 1.0);
    loop {
        let lag = last + 1 + last / EACH_LAG;
        let rho = if lag < longest { product(lag) / whole } else { 0.0 };
        if rho <= 0.0 {
            return 1.0 + 2.0 * sum;
        }
        // The lags from the last computed one to this one, by linear interpolation.
        let steps = (lag - last) as f64;
        sum += 0.5 * (steps - 1.0) * before + 0.5 * (steps + 1.0) * rho;
        (last, before) = (lag, rho);
    }
}

#[cfg(test)]
mod tests {
    use super::correlated;

    /// For an autoregression with coefficient φ the sum is (1 + φ)/(1 − φ).
    #[test]
    fn correlation_of_an_autoregression() {
        let mut state = 12345_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for phi in [0.0, 0.5, 0.9, 0.98] {
            let mut x = 0.0;
            let mut draw = || {
                x = phi * x + uniform();
                x
            };
            let windows: Vec<Vec<f64>> = (0..40).map(|_| (0..5000).map(|_| draw()).collect()).collect();
            let (sum, expected) = (correlated(&windows), (1.0 + phi) / (1.0 - phi));
            println!("{phi}: {sum:.2} of {expected:.2}");
            assert!((sum / expected - 1.0).abs() < 0.15);
        }
    }
}
