//! Rows of which each says something new: what a channel wanders, and so its past says of a row, is taken off it.
//!
//! What laws leave of a real machine wanders, and a push of a tenth of a second hides in it, as long as rows count as alike on the average. Here a channel is
//! the sum of a wandering of some size that forgets in some time (Ornstein & Uhlenbeck 1930, Phys. Rev. 36:823) and of noise. A Kalman filter of that model (Kalman 1960, J. Basic
//! Eng. 82:35) turns rows and columns into what its past does not say of each: neighbours are then independent, generalised least squares are plain ones, and rows that
//! do not count leave a gap of which the filter knows how much it forgets there.

use crate::data::columns::Column;
use crate::data::stacked::Data;
use crate::statistics::{Moments, Quantile};

/// Times in which a wandering forgets that are tried, in periods of the low-pass's cutoff: from the next row to the whole of a motion.
const FORGETS: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];
/// Ratios of the deviation of the wandering to that of the noise that are tried, in factors of two or three: from no wandering to no noise that shows.
const RATIOS: [f64; 8] = [0.0, 0.3, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// The wanderings of all channels.
#[derive(Clone)]
pub(crate) struct Whitening {
    channels: Vec<Wandering>,
}

impl Whitening {
    /// Of what is `left` of the rows that are heard. `sizes` are those of the rows by channel, and `noise` is what the instruments leave of rows that count alike, by channel of
    /// a recording.
    pub fn of(data: &Data, left: &[Vec<f64>], sizes: &[Vec<f64>], noise: &[f64]) -> Self {
        let of_channel = |c: usize| {
            let noise = noise[c % data.per_stage()];
            let shares: Vec<f64> = sizes[c].iter().map(|size| noise / size).collect();
            Wandering::of(data, c, &left[c], &sizes[c], Moments::of(&shares).rms)
        };
        Self { channels: (0..data.channels()).map(of_channel).collect() }
    }

    /// That of the channel number `channel`.
    pub fn channel(&self, channel: usize) -> &Wandering {
        &self.channels[channel]
    }

    /// The deviation that the instruments leave of a white row, by channel.
    pub fn least(&self) -> Vec<f64> {
        self.channels.iter().map(|channel| channel.least).collect()
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
    /// The least that it may be: what the instruments leave.
    least: f64,
}

impl Wandering {
    /// That under which what is `left` of the rows of the channel number `channel` that are heard, of these `sizes`, is most probable; the deviation of a white row is `least`
    /// at least.
    pub fn of(data: &Data, channel: usize, left: &[f64], sizes: &[f64], least: f64) -> Self {
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
                least,
            }
        };
        let tried = FORGETS.iter().flat_map(|forgets| RATIOS.map(|ratio| with(*forgets, ratio)));
        let best = tried.map(|one| (one.lost(left, least), one)).min_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = best.map_or_else(|| with(FORGETS[0], 0.0), |(_, one)| one);
        best.deviation = size(&best.counted(&best.rows(left))).max(least);
        best
    }

    /// One with these numbers, as its fields have them.
    #[cfg(test)]
    pub fn with(remembers: Vec<f64>, sizes: Vec<f64>, heard: Vec<bool>, ratio: f64, deviation: f64) -> Self {
        Self { remembers, heard, sizes, ratio, deviation, least: 0.0 }
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

    /// Its rows that are heard, by number, and the wandering of these alone.
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

    /// WᵀW of a `step` that is zero before the row `first` and one from the row `last` on, all rows being heard: what is less than `over` of it is left out. The first row of it, and
    /// its sums from each row on to the end.
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

    /// By row, the share of what is new that the wandering follows, and the deviation of what is new in units of the noise: zero where the row is not heard.
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

    /// Minus the log-likelihood of what is `left`, the deviation that of its median: pushes do not count.
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

/// The deviation of a normal with the median amount of `rows`.
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
            least: 0.0,
        };
        let white = one.counted(&one.rows(&rows));
        let square: f64 = white.iter().map(|x| x * x).sum();
        let alike = white.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / square;
        println!("size {:.4}, neighbours {alike:.4}", size(&white));
        assert!((size(&white) - 0.3).abs() < 0.01 && alike.abs() < 0.02);
    }

    /// Back and forth are transposes of each other.
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
