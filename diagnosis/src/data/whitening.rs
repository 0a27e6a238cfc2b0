//! Whitening: a filter subtracts from each row the part that the earlier rows of its channel predict.
//!
//! The residuals of the laws on a real machine drift slowly. A push of a tenth of a second stays hidden in this drift, as long as the likelihood uses
//! one average correlation for all rows. Here a channel is the sum of a drift, an Ornstein–Uhlenbeck process with a size and a time constant
//! (Ornstein & Uhlenbeck 1930, Phys. Rev. 36:823), and of white noise. A Kalman filter of that model (Kalman 1960, J. Basic Eng. 82:35) turns rows
//! and columns into their innovations. Neighbouring innovations are independent, so that generalised least squares become ordinary least squares.
//! Rows that do not count leave a gap, over which the filter lets the drift decay.

use crate::data::columns::Column;
use crate::data::stacked::Data;
use crate::statistics::{Moments, Quantile};

/// Time constants of the drift that the fit tries, in periods of the low-pass's cutoff: from the next row to the whole of a motion.
const FORGETS: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];
/// Ratios of the standard deviation of the drift to that of the noise that the fit tries, in factors of two or three: from no drift to noise too
/// small to see.
const RATIOS: [f64; 8] = [0.0, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// The drift models of all channels.
#[derive(Clone)]
pub(crate) struct Whitening {
    channels: Vec<Wandering>,
}

impl Whitening {
    /// Fits the drift models to the residuals `left` of the active rows. `sizes` are the standard deviations of the rows by channel. `noise` is the
    /// standard deviation of the instrument noise by channel of a recording.
    pub fn of(data: &Data, left: &[Vec<f64>], sizes: &[Vec<f64>], noise: &[f64]) -> Self {
        let of_channel = |c: usize| {
            let noise = noise[c % data.channels_per_recording()];
            let shares: Vec<f64> = sizes[c].iter().map(|size| noise / size).collect();
            Wandering::of(data, c, &left[c], &sizes[c], Moments::of(&shares).rms)
        };
        Self { channels: (0..data.channels()).map(of_channel).collect() }
    }

    /// The drift model of the channel number `channel`.
    pub fn channel(&self, channel: usize) -> &Wandering {
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
pub(crate) struct Wandering {
    /// Correlation of the drift between each row and the row before; zero at the beginning of a stretch.
    remembers: Vec<f64>,
    /// The rows that the model uses.
    heard: Vec<bool>,
    /// The standard deviation of each row: the errors of the laws are larger where an arm moves fast.
    sizes: Vec<f64>,
    /// Square of the ratio of the drift to the noise.
    ratio: f64,
    /// Standard deviation of a white row.
    deviation: f64,
    /// Lower limit of this deviation: the instrument noise.
    least: f64,
}

impl Wandering {
    /// The model with the largest likelihood for the residuals `left` of the active rows of the channel number `channel`. The rows have the standard
    /// deviations `sizes`; a white row has a standard deviation of at least `least`.
    pub fn of(data: &Data, channel: usize, left: &[f64], sizes: &[f64], least: f64) -> Self {
        let mut heard: Vec<bool> = data.heard(channel).iter().map(|heard| *heard > 0.0).collect();
        let period = 1.0 / data.recordings[data.place(channel).0].prepared.treatment.filter().cutoff_hz();
        // Neighbouring rows behind a low-pass are copies of each other. Rows half a period of its cutoff apart are independent if the noise is
        // (Shannon 1949).
        for (stretch, step) in data.stretches(channel) {
            let every = ((0.5 * period / step) as usize).max(1);
            heard[stretch].iter_mut().enumerate().for_each(|(k, heard)| *heard &= k % every == 0);
        }
        let with = |forgets: f64, ratio: f64| {
            let mut remembers = vec![0.0; left.len()];
            for (stretch, step) in data.stretches(channel) {
                remembers[stretch].iter_mut().skip(1).for_each(|x| *x = (-step / (forgets * period)).exp());
            }
            Self {
                remembers,
                heard: heard.clone(),
                sizes: sizes.to_vec(),
                ratio: ratio * ratio,
                deviation: 0.0,
                least,
            }
        };
        let tried = FORGETS.iter().flat_map(|forgets| RATIOS.map(|ratio| with(*forgets, ratio)));
        let best = tried.map(|one| (one.lost(left, least), one)).min_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = best.map_or_else(|| with(FORGETS[0], 0.0), |(_, one)| one);
        best.deviation = size(&best.counted(&best.rows(left))).max(least);
        best
    }

    /// A model with these values of its fields.
    #[cfg(test)]
    pub fn with(remembers: Vec<f64>, sizes: Vec<f64>, heard: Vec<bool>, ratio: f64, deviation: f64) -> Self {
        Self { remembers, heard, sizes, ratio, deviation, least: 0.0 }
    }

    /// Standard deviation of a white row.
    pub fn deviation(&self) -> f64 {
        self.deviation
    }

    /// The mask of the rows that the model uses, 1 or 0: active rows, at most two in a period of the low-pass's cutoff.
    pub fn says(&self) -> impl Iterator<Item = f64> {
        self.heard.iter().map(|heard| f64::from(u8::from(*heard)))
    }

    /// `rows`, whitened; zero where the model does not use them.
    pub fn rows(&self, rows: &[f64]) -> Vec<f64> {
        let mut place = 0.0;
        let steps = self.steps().into_iter().zip(&self.remembers).zip(&self.sizes);
        let mut white = |(((gain, unsure), remembers), size): (((f64, f64), &f64), &f64), x: &f64| {
            place *= remembers;
            if unsure == 0.0 {
                return 0.0;
            }
            let off = x / size - place;
            place += gain * off;
            off / unsure
        };
        steps.zip(rows).map(|(step, x)| white(step, x)).collect()
    }

    /// The transpose of [`Wandering::rows`]: the rows r with r·x = `white`·(white x) for all x.
    pub fn back(&self, white: &[f64]) -> Vec<f64> {
        let steps = self.steps();
        let mut back = vec![0.0; white.len()];
        let mut pull = 0.0;
        for row in (0..white.len()).rev() {
            let (gain, unsure) = steps[row];
            if unsure > 0.0 {
                let off = white[row] / unsure + gain * pull;
                back[row] = off / self.sizes[row];
                pull -= off;
            }
            pull *= self.remembers[row];
        }
        back
    }

    /// The numbers of the rows that the model uses, and the model of these rows alone.
    pub fn condensed(&self) -> (Vec<usize>, Self) {
        let rows: Vec<usize> = (0..self.heard.len()).filter(|&row| self.heard[row]).collect();
        let mut from = 0;
        let remembers = rows.iter().map(|&row| {
            let remembered = self.remembers[from..=row].iter().product();
            from = row + 1;
            remembered
        });
        let condensed = Self {
            remembers: remembers.collect(),
            heard: vec![true; rows.len()],
            sizes: rows.iter().map(|&row| self.sizes[row]).collect(),
            ..*self
        };
        (rows, condensed)
    }

    /// WᵀW applied to a `step` that is zero before the row `first` and one from the row `last` on, if the model uses all rows. The method omits
    /// values below `over`. It returns the first row of the result, and the sums of the result from each row to the end.
    pub fn of_step(
        &self,
        steps: &[(f64, f64)],
        [first, last]: [usize; 2],
        step: impl Fn(usize) -> f64,
        over: f64,
    ) -> (usize, Vec<f64>) {
        let (mut place, mut white) = (0.0, Vec::new());
        for (row, &(gain, unsure)) in steps.iter().enumerate().skip(first) {
            place *= self.remembers[row];
            let off = step(row) / self.sizes[row] - place;
            place += gain * off;
            white.push(off / unsure);
            if row > last && off.abs() * self.sizes[row] < over {
                break;
            }
        }
        let (mut pull, mut sum, mut sums) = (0.0, 0.0, Vec::new());
        for row in (0..first + white.len()).rev() {
            let (gain, unsure) = steps[row];
            let own = row.checked_sub(first).map_or(0.0, |at| white[at] / unsure);
            let off = own + gain * pull;
            sum += off / self.sizes[row];
            pull = (pull - off) * self.remembers[row];
            sums.push(sum);
            if row <= first && pull.abs() < over * sum.abs() * self.sizes[row] {
                break;
            }
        }
        let begin = first + white.len() - sums.len();
        sums.reverse();
        (begin, sums)
    }

    /// By row, the Kalman gain of the drift, and the standard deviation of the innovation in units of the noise; zero for rows that the model does
    /// not use.
    pub fn steps(&self) -> Vec<(f64, f64)> {
        let mut spread = self.ratio;
        let step = |(remembers, heard): (&f64, &bool)| {
            spread = remembers * remembers * (spread - self.ratio) + self.ratio;
            if !heard {
                return (0.0, 0.0);
            }
            let unsure = spread + 1.0;
            let gain = spread / unsure;
            spread /= unsure;
            (gain, unsure.sqrt())
        };
        self.remembers.iter().zip(&self.heard).map(step).collect()
    }

    fn counted(&self, rows: &[f64]) -> Vec<f64> {
        rows.iter().zip(&self.heard).filter(|(_, heard)| **heard).map(|(x, _)| *x).collect()
    }

    /// Negative log-likelihood of the residuals `left`. The median determines the standard deviation, so that pushes have no influence.
    fn lost(&self, left: &[f64], least: f64) -> f64 {
        let (mut volume, mut count) = (0.0, 0.0);
        for (_, unsure) in self.steps().into_iter().filter(|(_, unsure)| *unsure > 0.0) {
            volume += unsure.ln();
            count += 1.0;
        }
        let seen = size(&self.counted(&self.rows(left)));
        let deviation = seen.max(least).max(f64::MIN_POSITIVE);
        volume + count * (deviation.ln() + 0.5 * (seen / deviation).powi(2))
    }
}

/// Standard deviation of the normal distribution that has the median of |x| of `rows`.
fn size(rows: &[f64]) -> f64 {
    let mut amounts: Vec<f64> = rows.iter().map(|x| x.abs()).collect();
    if amounts.is_empty() {
        return 0.0;
    }
    let middle = amounts.len() / 2;
    *amounts.select_nth_unstable_by(middle, f64::total_cmp).1 / Quantile::Median.of_normal()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Wandering, size};
    use crate::random::normal;

    /// Whitened rows of a drift with noise have the standard deviation of the noise, and neighbours are not correlated, with and without gaps.
    #[test]
    fn what_is_filtered_is_white() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (remembers, ratio): (f64, f64) = (0.98, 5.0);
        let mut place = 0.0;
        let mut rows = Vec::new();
        for _ in 0..20_000 {
            place = remembers * place + ratio * (1.0 - remembers * remembers).sqrt() * normal(&mut rng);
            rows.push(0.3 * (place + normal(&mut rng)));
        }
        let heard: Vec<bool> = (0..rows.len()).map(|k| k % 100 > 20).collect();
        let one = Wandering {
            remembers: vec![remembers; rows.len()],
            sizes: vec![1.0; rows.len()],
            heard,
            ratio: ratio * ratio,
            deviation: 0.3,
            least: 0.0,
        };
        let white = one.counted(&one.rows(&rows));
        let square: f64 = white.iter().map(|x| x * x).sum();
        let alike = white.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / square;
        println!("size {:.4}, neighbours {alike:.4}", size(&white));
        assert!((size(&white) - 0.3).abs() < 0.01 && alike.abs() < 0.02);
    }

    /// The two filters are transposes of each other.
    #[test]
    fn back_is_the_transpose() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let one = Wandering {
            remembers: (0..300).map(|k| if k == 150 { 0.0 } else { 0.95 }).collect(),
            sizes: (0..300).map(|k| 1.0 + 0.01 * f64::from(k)).collect(),
            heard: (0..300).map(|k| k % 7 > 1).collect(),
            ratio: 16.0,
            deviation: 1.0,
            least: 0.0,
        };
        let [x, white] = [0, 1].map(|_| (0..300).map(|_| normal(&mut rng)).collect::<Vec<f64>>());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let [there, back] = [dot(&white, &one.rows(&x)), dot(&one.back(&white), &x)];
        println!("{there} {back}");
        assert!((there - back).abs() < 1e-9 * there.abs());
    }
}
