//! Whitening: a filter subtracts from each row the part that the earlier rows of its channel predict.
//!
//! The residuals of the laws on a real machine drift slowly. A push of a tenth of a second stays hidden in this drift, as long as the likelihood uses
//! one average correlation for all rows. Here a channel is the sum of a drift, an Ornstein–Uhlenbeck process with a size and a time constant
//! (Ornstein & Uhlenbeck 1930, Phys. Rev. 36:823), and of white noise. A Kalman filter of that model (Kalman 1960, J. Basic Eng. 82:35) turns rows
//! and columns into their innovations. Neighbouring innovations are independent, so that generalised least squares become ordinary least squares.
//! Rows that do not count leave a gap, over which the filter lets the drift decay.

use crate::data::columns::Column;
use crate::data::stacked::Data;
use crate::statistics::{Moments, median_of_normal, quantile};

/// Time constants of the drift that the fit tries, in periods of the low-pass's cutoff: from the next row to the whole of a motion.
const TIME_CONSTANTS: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];
/// Ratios of the standard deviation of the drift to that of the noise that the fit tries, in factors of two or three: from no drift to noise too
/// small to see.
const RATIOS: [f64; 8] = [0.0, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// The drift models of all channels.
#[derive(Clone)]
pub(crate) struct Whitening {
    channels: Vec<DriftModel>,
}

impl Whitening {
    /// Fits the drift models to the `residual` of the active rows. `sizes` are the standard deviations of the rows by channel. `noise` is the
    /// standard deviation of the instrument noise by channel of a recording.
    pub fn of(data: &Data, residual: &[Vec<f64>], sizes: &[Vec<f64>], noise: &[f64]) -> Self {
        let of_channel = |c: usize| {
            let noise = noise[c % data.channels_per_recording()];
            let shares: Vec<f64> = sizes[c].iter().map(|size| noise / size).collect();
            DriftModel::of(data, c, &residual[c], &sizes[c], Moments::of(&shares).rms)
        };
        Self { channels: (0..data.channels()).map(of_channel).collect() }
    }

    /// The drift model of the channel number `channel`.
    pub fn channel(&self, channel: usize) -> &DriftModel {
        &self.channels[channel]
    }

    /// Standard deviation of a white row that the instrument noise alone causes, by channel.
    pub fn least(&self) -> Vec<f64> {
        self.channels.iter().map(|channel| channel.least).collect()
    }

    /// Whitens the rows of every channel of a column.
    pub fn column(&self, column: &Column) -> Column {
        column
            .iter()
            .enumerate()
            .map(|(c, rows)| rows.as_ref().map(|rows| self.channels[c].rows(rows)))
            .collect()
    }
}

/// The drift model of one channel.
#[derive(Clone)]
pub(crate) struct DriftModel {
    /// Correlation of the drift between each row and the row before; zero at the beginning of a stretch.
    correlation: Vec<f64>,
    /// The rows that the model uses.
    used: Vec<bool>,
    /// The standard deviation of each row: the errors of the laws are larger where an arm moves fast.
    sizes: Vec<f64>,
    /// Square of the ratio of the drift to the noise.
    ratio: f64,
    /// Standard deviation of a white row.
    deviation: f64,
    /// Lower limit of this deviation: the instrument noise.
    least: f64,
}

impl DriftModel {
    /// The model with the largest likelihood for the `residual` of the active rows of the channel number `channel`. The rows have the standard
    /// deviations `sizes`; a white row has a standard deviation of at least `least`.
    pub fn of(data: &Data, channel: usize, residual: &[f64], sizes: &[f64], least: f64) -> Self {
        let mut used: Vec<bool> = data.active_mask(channel).iter().map(|used| *used > 0.0).collect();
        let period = 1.0 / data.recordings[data.place(channel).0].prepared.treatment.filter().cutoff_hz();
        // Neighbouring rows behind a low-pass are copies of each other. Rows half a period of its cutoff apart are independent if the noise is
        // (Shannon 1949).
        for (stretch, step) in data.stretches(channel) {
            let every = ((0.5 * period / step) as usize).max(1);
            used[stretch].iter_mut().enumerate().for_each(|(k, used)| *used &= k % every == 0);
        }
        let with = |time_constant: f64, ratio: f64| {
            let mut correlation = vec![0.0; residual.len()];
            for (stretch, step) in data.stretches(channel) {
                correlation[stretch]
                    .iter_mut()
                    .skip(1)
                    .for_each(|x| *x = (-step / (time_constant * period)).exp());
            }
            Self {
                correlation,
                used: used.clone(),
                sizes: sizes.to_vec(),
                ratio: ratio * ratio,
                deviation: 0.0,
                least,
            }
        };
        let tried =
            TIME_CONSTANTS.iter().flat_map(|time_constant| RATIOS.map(|ratio| with(*time_constant, ratio)));
        let best = tried
            .map(|one| (one.negative_log_likelihood(residual, least), one))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = best.map_or_else(|| with(TIME_CONSTANTS[0], 0.0), |(_, one)| one);
        best.deviation = size(&best.used_rows(&best.rows(residual))).max(least);
        best
    }

    /// A model with these values of its fields.
    #[cfg(test)]
    pub fn with(correlation: Vec<f64>, sizes: Vec<f64>, used: Vec<bool>, ratio: f64, deviation: f64) -> Self {
        Self { correlation, used, sizes, ratio, deviation, least: 0.0 }
    }

    /// Standard deviation of a white row.
    pub fn deviation(&self) -> f64 {
        self.deviation
    }

    /// The mask of the rows that the model uses, 1 or 0: active rows, at most two in a period of the low-pass's cutoff.
    pub fn mask(&self) -> impl Iterator<Item = f64> {
        self.used.iter().map(|used| f64::from(u8::from(*used)))
    }

    /// `rows`, whitened; zero where the model does not use them.
    pub fn rows(&self, rows: &[f64]) -> Vec<f64> {
        let mut drift = 0.0;
        let kalman_steps = self.kalman_steps().into_iter().zip(&self.correlation).zip(&self.sizes);
        let mut white = |(((gain, innovation_deviation), correlation), size): (((f64, f64), &f64), &f64),
                         x: &f64| {
            drift *= correlation;
            if innovation_deviation == 0.0 {
                return 0.0;
            }
            let innovation = x / size - drift;
            drift += gain * innovation;
            innovation / innovation_deviation
        };
        kalman_steps.zip(rows).map(|(step, x)| white(step, x)).collect()
    }

    /// The transpose of [`DriftModel::rows`]: the rows r with r·x = `white`·(white x) for all x.
    pub fn transposed(&self, white: &[f64]) -> Vec<f64> {
        let kalman_steps = self.kalman_steps();
        let mut transposed = vec![0.0; white.len()];
        let mut adjoint = 0.0;
        for row in (0..white.len()).rev() {
            let (gain, innovation_deviation) = kalman_steps[row];
            if innovation_deviation > 0.0 {
                let innovation = white[row] / innovation_deviation + gain * adjoint;
                transposed[row] = innovation / self.sizes[row];
                adjoint -= innovation;
            }
            adjoint *= self.correlation[row];
        }
        transposed
    }

    /// The numbers of the rows that the model uses, and the model of these rows alone.
    pub fn condensed(&self) -> (Vec<usize>, Self) {
        let rows: Vec<usize> = (0..self.used.len()).filter(|&row| self.used[row]).collect();
        let mut from = 0;
        let correlation = rows.iter().map(|&row| {
            let remembered = self.correlation[from..=row].iter().product();
            from = row + 1;
            remembered
        });
        let condensed = Self {
            correlation: correlation.collect(),
            used: vec![true; rows.len()],
            sizes: rows.iter().map(|&row| self.sizes[row]).collect(),
            ..*self
        };
        (rows, condensed)
    }

    /// WᵀW applied to a `step` that is zero before the row `first` and one from the row `last` on, if the model uses all rows. The method omits
    /// values below `over`. It returns the first row of the result, and the sums of the result from each row to the end.
    pub fn normal_product_of_step(
        &self,
        kalman_steps: &[(f64, f64)],
        [first, last]: [usize; 2],
        step: impl Fn(usize) -> f64,
        over: f64,
    ) -> (usize, Vec<f64>) {
        let (mut drift, mut white) = (0.0, Vec::new());
        for (row, &(gain, innovation_deviation)) in kalman_steps.iter().enumerate().skip(first) {
            drift *= self.correlation[row];
            let innovation = step(row) / self.sizes[row] - drift;
            drift += gain * innovation;
            white.push(innovation / innovation_deviation);
            if row > last && innovation.abs() * self.sizes[row] < over {
                break;
            }
        }
        let (mut adjoint, mut sum, mut sums) = (0.0, 0.0, Vec::new());
        for row in (0..first + white.len()).rev() {
            let (gain, innovation_deviation) = kalman_steps[row];
            let own = row.checked_sub(first).map_or(0.0, |at| white[at] / innovation_deviation);
            let innovation = own + gain * adjoint;
            sum += innovation / self.sizes[row];
            adjoint = (adjoint - innovation) * self.correlation[row];
            sums.push(sum);
            if row <= first && adjoint.abs() < over * sum.abs() * self.sizes[row] {
                break;
            }
        }
        let begin = first + white.len() - sums.len();
        sums.reverse();
        (begin, sums)
    }

    /// By row, the Kalman gain of the drift, and the standard deviation of the innovation in units of the noise; zero for rows that the model does
    /// not use.
    pub fn kalman_steps(&self) -> Vec<(f64, f64)> {
        let mut variance = self.ratio;
        let step = |(correlation, used): (&f64, &bool)| {
            variance = correlation * correlation * (variance - self.ratio) + self.ratio;
            if !used {
                return (0.0, 0.0);
            }
            let innovation_variance = variance + 1.0;
            let gain = variance / innovation_variance;
            variance /= innovation_variance;
            (gain, innovation_variance.sqrt())
        };
        self.correlation.iter().zip(&self.used).map(step).collect()
    }

    fn used_rows(&self, rows: &[f64]) -> Vec<f64> {
        rows.iter().zip(&self.used).filter(|(_, used)| **used).map(|(x, _)| *x).collect()
    }

    /// Negative log-likelihood of the `residual`. The median determines the standard deviation, so that pushes have no influence.
    fn negative_log_likelihood(&self, residual: &[f64], least: f64) -> f64 {
        let (mut volume, mut count) = (0.0, 0.0);
        for (_, innovation_deviation) in
            self.kalman_steps().into_iter().filter(|(_, innovation_deviation)| *innovation_deviation > 0.0)
        {
            volume += innovation_deviation.ln();
            count += 1.0;
        }
        let seen = size(&self.used_rows(&self.rows(residual)));
        let deviation = seen.max(least).max(f64::MIN_POSITIVE);
        volume + count * (deviation.ln() + 0.5 * (seen / deviation).powi(2))
    }
}

/// Standard deviation of the normal distribution that has the median of |x| of `rows`.
fn size(rows: &[f64]) -> f64 {
    quantile(rows.iter().map(|x| x.abs()).collect(), 0.5) / median_of_normal()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{DriftModel, size};
    use crate::random::normal;

    /// Whitened rows of a drift with noise have the standard deviation of the noise, and neighbours are not correlated, with and without gaps.
    #[test]
    fn what_is_filtered_is_white() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (correlation, ratio): (f64, f64) = (0.98, 5.0);
        let mut drift = 0.0;
        let mut rows = Vec::new();
        for _ in 0..20_000 {
            drift = correlation * drift + ratio * (1.0 - correlation * correlation).sqrt() * normal(&mut rng);
            rows.push(0.3 * (drift + normal(&mut rng)));
        }
        let used: Vec<bool> = (0..rows.len()).map(|k| k % 100 > 20).collect();
        let one = DriftModel {
            correlation: vec![correlation; rows.len()],
            sizes: vec![1.0; rows.len()],
            used,
            ratio: ratio * ratio,
            deviation: 0.3,
            least: 0.0,
        };
        let white = one.used_rows(&one.rows(&rows));
        let square: f64 = white.iter().map(|x| x * x).sum();
        let alike = white.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / square;
        println!("size {:.4}, neighbours {alike:.4}", size(&white));
        assert!((size(&white) - 0.3).abs() < 0.01 && alike.abs() < 0.02);
    }

    /// The two filters are transposes of each other.
    #[test]
    fn back_is_the_transpose() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let one = DriftModel {
            correlation: (0..300).map(|k| if k == 150 { 0.0 } else { 0.95 }).collect(),
            sizes: (0..300).map(|k| 1.0 + 0.01 * f64::from(k)).collect(),
            used: (0..300).map(|k| k % 7 > 1).collect(),
            ratio: 16.0,
            deviation: 1.0,
            least: 0.0,
        };
        let [x, white] = [0, 1].map(|_| (0..300).map(|_| normal(&mut rng)).collect::<Vec<f64>>());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let [there, transposed] = [dot(&white, &one.rows(&x)), dot(&one.transposed(&white), &x)];
        println!("{there} {transposed}");
        assert!((there - transposed).abs() < 1e-9 * there.abs());
    }
}
