//! Rows of which each says something new: what a channel wanders, and so its past says of a row, is taken off it.
//!
//! What laws leave of a real machine wanders, and a push of a tenth of a second hides in it, as long as rows count as alike on the average. Here a channel is
//! the sum of a wandering of some size that forgets in some time (Ornstein & Uhlenbeck 1930, Phys. Rev. 36:823) and of noise. A Kalman filter of that model (Kalman 1960, J. Basic
//! Eng. 82:35) turns rows and columns into what its past does not say of each: neighbours are then independent, generalised least squares are plain ones, and rows that
//! do not count leave a gap of which the filter knows how much it forgets there.

use super::data::{Column, Data};
use super::weights::Weights;

/// Times in which a wandering forgets that are tried, in periods of the low-pass's cutoff: from the next row to the whole of a motion.
const FORGETS: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];
/// Ratios of the deviation of the wandering to that of the noise that are tried.
const RATIOS: [f64; 8] = [0.0, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
/// Share of a push below which what becomes of it is over.
const OVER: f64 = 0.02;
/// The normal's median amount over its deviation.
const MEDIAN: f64 = 0.674_489_750_196_082;

/// The wanderings of all channels.
pub(crate) struct Whitening {
    channels: Vec<Wandering>,
}

impl Whitening {
    /// Of what is `left` of the rows that are heard, whose sizes by row are those of `weights`.
    pub fn of(data: &Data, left: &[Vec<f64>], weights: &Weights) -> Self {
        let of_channel = |c: usize| Wandering::of(data, c, &left[c], &weights.rows[c].sizes());
        Self { channels: (0..data.channels()).map(of_channel).collect() }
    }

    /// That of the channel number `channel`.
    pub fn channel(&self, channel: usize) -> &Wandering {
        &self.channels[channel]
    }

    /// The rows of every channel of a column, white.
    pub fn column(&self, column: &Column) -> Column {
        column
            .iter()
            .enumerate()
            .map(|(c, rows)| rows.as_ref().map(|rows| self.channels[c].rows(rows)))
            .collect()
    }
}

/// The wandering of one channel.
#[derive(Clone)]
pub(crate) struct Wandering {
    /// Share of it that is remembered from each row to the next; zero at the beginning of a stretch.
    remembers: Vec<f64>,
    /// Rows that are heard.
    heard: Vec<bool>,
    /// The size of each row: where an arm moves fast, laws are off by more.
    sizes: Vec<f64>,
    /// Square of the ratio of the wandering to the noise.
    ratio: f64,
    /// Deviation of a white row.
    deviation: f64,
}

impl Wandering {
    /// That under which what is `left` of the rows of the channel number `channel` that are heard, of these `sizes`, is most probable.
    pub fn of(data: &Data, channel: usize, left: &[f64], sizes: &[f64]) -> Self {
        let mut heard: Vec<bool> = data.heard(channel).iter().map(|heard| *heard > 0.0).collect();
        let period = 1.0 / data.stages[data.place(channel).0].ground.treatment.filter().cutoff_hz();
        // Behind a low-pass neighbouring rows say the same; rows half a period of its cutoff apart are independent where the noise is (Shannon 1949).
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
            }
        };
        let tried = FORGETS.iter().flat_map(|forgets| RATIOS.map(|ratio| with(*forgets, ratio)));
        let best = tried.map(|one| (one.lost(left), one)).min_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = best.map_or_else(|| with(FORGETS[0], 0.0), |(_, one)| one);
        best.deviation = size(&best.counted(&best.rows(left)));
        best
    }

    /// Deviation of a white row.
    pub fn deviation(&self) -> f64 {
        self.deviation
    }

    /// Rows that say something: those that are heard, at most two in a period of the low-pass's cutoff; 1 or 0.
    pub fn says(&self) -> impl Iterator<Item = f64> {
        self.heard.iter().map(|heard| f64::from(u8::from(*heard)))
    }

    /// `rows`, white; zero where they are not heard.
    pub fn rows(&self, rows: &[f64]) -> Vec<f64> {
        let (mut place, mut spread) = (0.0, self.ratio);
        let white = |(((x, size), remembers), heard): (((&f64, &f64), &f64), &bool)| {
            (place, spread) = (remembers * place, remembers * remembers * (spread - self.ratio) + self.ratio);
            if !heard {
                return 0.0;
            }
            let unsure = spread + 1.0;
            let off = x / size - place;
            place += spread / unsure * off;
            spread /= unsure;
            off / unsure.sqrt()
        };
        rows.iter().zip(&self.sizes).zip(&self.remembers).zip(&self.heard).map(white).collect()
    }

    /// What becomes of a push of `long` rows of size one amid many others, from its first row on.
    pub fn push(&self, long: usize) -> Vec<f64> {
        self.filtered(
            |row| if row < long { 1.0 } else { 0.0 },
            |row, place| row >= long && place.abs() < OVER,
        )
    }

    /// What becomes of a step of size one amid many rows.
    pub fn step(&self) -> Vec<f64> {
        let longest = self.remembers.len() / 8;
        self.filtered(|_| 1.0, |row, place| row >= longest || (1.0 - place).abs() < OVER)
    }

    /// What becomes of a signal `of` each row amid many others, until it `is_over`, told how far the wandering has followed.
    fn filtered(&self, of: impl Fn(usize) -> f64, is_over: impl Fn(usize, f64) -> bool) -> Vec<f64> {
        let remembers = self.remembers.iter().copied().fold(0.0, f64::max);
        let mut spread = self.ratio;
        for _ in 0..self.remembers.len() {
            spread = remembers * remembers * (spread / (spread + 1.0) - self.ratio) + self.ratio;
        }
        let (unsure, mut place, mut signal) = (spread + 1.0, 0.0, Vec::new());
        while signal.is_empty() || signal.len() < self.remembers.len() && !is_over(signal.len(), place) {
            let off = of(signal.len()) - place;
            place = remembers * (place + spread / unsure * off);
            signal.push(off / unsure.sqrt());
        }
        signal
    }

    fn counted(&self, rows: &[f64]) -> Vec<f64> {
        rows.iter().zip(&self.heard).filter(|(_, heard)| **heard).map(|(x, _)| *x).collect()
    }

    /// Minus the log-likelihood of what is `left`, the deviation that of its median: pushes do not count.
    fn lost(&self, left: &[f64]) -> f64 {
        let (mut spread, mut volume, mut count) = (self.ratio, 0.0, 0.0);
        for (remembers, heard) in self.remembers.iter().zip(&self.heard) {
            spread = remembers * remembers * (spread - self.ratio) + self.ratio;
            if *heard {
                volume += 0.5 * (spread + 1.0).ln();
                spread /= spread + 1.0;
                count += 1.0;
            }
        }
        let deviation = size(&self.counted(&self.rows(left)));
        volume + count * deviation.max(f64::MIN_POSITIVE).ln()
    }
}

/// The deviation of a normal with the median amount of `rows`.
fn size(rows: &[f64]) -> f64 {
    let mut amounts: Vec<f64> = rows.iter().map(|x| x.abs()).collect();
    if amounts.is_empty() {
        return 0.0;
    }
    let middle = amounts.len() / 2;
    *amounts.select_nth_unstable_by(middle, f64::total_cmp).1 / MEDIAN
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Wandering, size};
    use crate::diagnose::noise::normal;

    /// Rows of a wandering and noise are white once filtered: of the size of the noise, and no two neighbours alike, gaps or none.
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
        };
        let white = one.counted(&one.rows(&rows));
        let square: f64 = white.iter().map(|x| x * x).sum();
        let alike = white.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / square;
        println!("size {:.4}, neighbours {alike:.4}", size(&white));
        assert!((size(&white) - 0.3).abs() < 0.01 && alike.abs() < 0.02);
    }

    /// The filtered push is what the filter makes of one.
    #[test]
    fn a_push_is_filtered_as_any_row() {
        let one = Wandering {
            remembers: vec![0.95; 400],
            sizes: vec![1.0; 400],
            heard: vec![true; 400],
            ratio: 16.0,
            deviation: 1.0,
        };
        let rows: Vec<f64> = (0..400).map(|k| if (300..308).contains(&k) { 1.0 } else { 0.0 }).collect();
        let filtered = one.rows(&rows);
        for (k, x) in one.push(8).iter().enumerate() {
            assert!((x - filtered[300 + k]).abs() < 1e-9, "{k}: {x} {}", filtered[300 + k]);
        }
    }
}
