//! The weight of each row: from the noise of the instruments, and from the discrepancy δ between the laws and a real machine.
//!
//! A row i of channel c has the variance v = σ² + e² + s²L². σ is the standard deviation of the instrument noise, and e (`row_error`) that of errors that the
//! samples can't resolve. L is the local size of the modelled quantity, and s the relative error of the laws (Kennedy & O'Hagan 2001, J. R. Stat.
//! Soc. B 63:425). Neighbouring rows are correlated: the log-likelihood of each has the weight φ, which turns the number of rows into the effective
//! number. The weight counts κ rows as one, with a separate κ for the noise and for the discrepancy.

use freeplay_servo::DEGREES_OF_FREEDOM;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::data::instruments::simulated_instrument_residual;
use crate::data::noise::effective_samples;
use crate::data::parts::Part;
use crate::data::shapes::{Knots, Shapes};
use crate::data::stacked::Data;
use crate::data::whitening::Whitening;
use crate::signals::channel::Kind;
use crate::statistics::{TURNS, WIDE};

/// Standard deviation of the half-normal prior of s: published laws of rigid bodies and of friction are correct to a few per cent.
pub(crate) const USUAL_SHARE: f64 = 0.02;
/// Smallest share s that the fit tries: no machine follows its laws to a thousandth.
pub(crate) const LEAST_SHARE: f64 = 1e-3;
/// Factor between two consecutive shares that the fit tries: the evidence is flat near its maximum, so that half such a step changes it by far less
/// than one.
const FINER: f64 = 1.2;
/// Simulated recordings of perfect machines that determine the instrument noise: three of them give their mean square to a few per cent.
const DRAWS: u64 = 3;

/// The shares that the fit tries: zero, and from the smallest up to that of a law that predicts nothing.
fn shares() -> impl Iterator<Item = f64> {
    let grid = (0..).map(|k| LEAST_SHARE * FINER.powi(k));
    std::iter::once(0.0).chain(grid.take_while(|share| *share < FINER))
}

/// The weights of the rows of one channel.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    /// Variance that no law can explain: σ² + e², by row.
    instrument: Vec<f64>,
    /// Square of the local size of the modelled quantity, by row.
    size: Vec<f64>,
    /// The weight of each row in the likelihood, φ; zero for rows that don't count.
    phi: Vec<f64>,
    /// Robust weight of each row, below one for an outlier: see [`Rows::downweight_outliers`].
    robust_weight: Vec<f64>,
    /// The share s.
    pub share: f64,
    /// Root of the mean square of the modelled quantity.
    pub scale: f64,
}

/// The weights of all rows.
#[derive(Clone, Debug)]
pub(crate) struct Weights {
    /// By channel.
    pub rows: Vec<Rows>,
    /// Standard deviation of the instrument noise over all rows, by channel of a recording.
    pub noise: Vec<f64>,
}

impl Rows {
    /// The variance v of each row with the share `share`.
    fn variances(&self, share: f64) -> impl Iterator<Item = f64> {
        self.instrument
            .iter()
            .zip(&self.size)
            .map(move |(instrument, size)| instrument + share * share * size)
    }

    /// The weight of each row in the sum of squares: φ/v.
    pub fn weights(&self) -> Vec<f64> {
        let trusted = self.phi.iter().zip(&self.robust_weight).zip(self.variances(self.share));
        trusted
            .map(|((phi, robust_weight), v)| if *phi > 0.0 { phi * robust_weight / v } else { 0.0 })
            .collect()
    }

    /// Maximum over all shares of the log-likelihood of rows with the `residual`, under Student's t. The prior of the share is included.
    pub fn robust_log_likelihood(&self, residual: &[f64]) -> f64 {
        let with = |share: f64| {
            let rows =
                self.phi.iter().zip(residual).zip(self.variances(share)).filter(|((phi, _), _)| **phi > 0.0);
            let of_row = |((phi, x), v): ((&f64, &f64), f64)| {
                0.5 * phi * (v.ln() + (DEGREES_OF_FREEDOM + 1.0) * (x * x / v / DEGREES_OF_FREEDOM).ln_1p())
            };
            -0.5 * (share / USUAL_SHARE).powi(2) - rows.map(of_row).sum::<f64>()
        };
        shares().map(with).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Sets the robust weight of each row from its residual in `residual`, as under Student's t with four degrees of freedom (Lange, Little & Taylor
    /// 1989, J. Am. Stat. Assoc. 84:881): occasional disturbances then have little influence on the parameters.
    pub fn downweight_outliers(&mut self, residual: &[f64]) {
        let v = self.variances(self.share);
        self.robust_weight = residual
            .iter()
            .zip(v)
            .map(|(x, v)| ((DEGREES_OF_FREEDOM + 1.0) / (DEGREES_OF_FREEDOM + x * x / v)).min(1.0))
            .collect();
    }

    /// Sets the robust weight of every row to one.
    pub fn reset_robust_weights(&mut self) {
        self.robust_weight.fill(1.0);
    }

    /// The standard deviation of each row: √v.
    pub fn sizes(&self) -> Vec<f64> {
        self.variances(self.share).map(|v| v.sqrt().max(f64::MIN_POSITIVE)).collect()
    }

    /// Variance of the error of a perfect model, by row, without the instrument `noise`.
    pub fn row_error_squares(&self, noise: f64) -> impl Iterator<Item = f64> {
        self.instrument.iter().map(move |square| (square - noise * noise).max(0.0))
    }

    /// Effective number of rows.
    pub fn effective(&self) -> f64 {
        self.phi.iter().sum()
    }

    /// Log-likelihood of rows with the squared `residual`, for the share `share`, its prior included.
    fn log_likelihood(&self, residual: &[f64], share: f64) -> f64 {
        let mut sum = -0.5 * (share / USUAL_SHARE).powi(2);
        for ((phi, residual), v) in self.phi.iter().zip(residual).zip(self.variances(share)) {
            if *phi > 0.0 {
                sum -= 0.5 * phi * (v.ln() + residual / v);
            }
        }
        sum
    }

    /// Log-likelihood without the sum of squares.
    pub fn log_volume(&self) -> f64 {
        self.log_likelihood(&vec![0.0; self.phi.len()], self.share)
    }

    /// The most probable share for the `residual`, with `taken` effective rows used up by coefficients, and the log-likelihood with it.
    pub fn best(&self, residual: &[f64], taken: f64) -> (f64, f64) {
        let squares = self.squares(residual, taken);
        let tried = shares().map(|share| (share, self.log_likelihood(&squares, share)));
        tried.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((self.share, 0.0))
    }

    /// Log-likelihood of the most probable share minus that of the present share.
    pub fn share_gain(&self, residual: &[f64], taken: f64) -> f64 {
        self.best(residual, taken).1 - self.log_likelihood(&self.squares(residual, taken), self.share)
    }

    /// Log-likelihood of the `residual` with the most probable share, minus that with the best share up to `most`.
    pub fn beyond(&self, residual: &[f64], most: f64) -> f64 {
        let squares = self.squares(residual, 0.0);
        let (share, likelihood) = self.best(residual, 0.0);
        if share > most { likelihood - self.log_likelihood(&squares, most) } else { 0.0 }
    }

    /// The log-likelihood of the `residual`.
    pub fn score(&self, residual: &[f64]) -> f64 {
        self.log_likelihood(&self.squares(residual, 0.0), self.share)
    }

    fn squares(&self, residual: &[f64], taken: f64) -> Vec<f64> {
        let scale = self.effective() / (self.effective() - taken).max(1.0);
        residual
            .iter()
            .zip(&self.robust_weight)
            .map(|(x, robust_weight)| robust_weight * scale * x * x)
            .collect()
    }

    /// The same rows with the share s and the part of the errors e that make the `residual` most probable. e is an upper bound: each row has the largest error of
    /// the rows around it. The instrument noise has the standard deviation `noise`.
    fn realised(&self, noise: f64, residual: &[f64]) -> Self {
        let errors: Vec<f64> = self.row_error_squares(noise).collect();
        let mut rows = self.clone();
        for _ in 0..TURNS {
            let with = |part: f64| Self {
                instrument: errors.iter().map(|error| noise * noise + part * part * error).collect(),
                ..rows.clone()
            };
            let tried =
                shares().filter(|part| *part <= 1.0).map(with).map(|rows| (rows.score(residual), rows));
            let best = tried.max_by(|a, b| a.0.total_cmp(&b.0));
            rows = best.map_or_else(|| rows.clone(), |(_, rows)| rows);
            rows.share = rows.best(residual, 0.0).0;
        }
        rows
    }

    /// Sets the share to the most probable one for the `residual`, with `taken` effective rows used up by coefficients. Returns true if the
    /// share changed by more than a step.
    pub fn update_share(&mut self, residual: &[f64], taken: f64) -> bool {
        let (best, _) = self.best(residual, taken);
        let step = LEAST_SHARE.max(0.5 * (FINER - 1.0) * self.share);
        let moved = (best - self.share).abs() > step;
        if moved {
            self.share = best;
        }
        moved
    }
}

impl Weights {
    /// The weights of the active rows of `data`. The model as given has the residuals `target`, and a perfect model has errors with the standard
    /// deviation `row_error`. The `residual` of the model with all found laws determines the effective number of rows. Before the search, the
    /// residuals beside shapes without a name determine it: if a law is missing that all rows share, the residuals of the given model would count no
    /// rows at all.
    pub fn new(
        data: &Data,
        target: &[Vec<f64>],
        residual: Option<&[Vec<f64>]>,
        row_error: &[Vec<f64>],
        seed: u64,
    ) -> Self {
        let draws: Vec<Vec<Vec<f64>>> = (0..DRAWS).map(|k| instruments(data, seed.wrapping_add(k))).collect();
        let knots = data.recordings.first().map(Knots::of).unwrap_or_default();
        let squares: Vec<Vec<f64>> = draws
            .iter()
            .map(|draw| data.rms(draw, &data.counts).iter().map(|rms| rms.unwrap_or(0.0).powi(2)).collect())
            .collect();
        let mean = |c: usize| (squares.iter().map(|draw| draw[c]).sum::<f64>() / draws.len() as f64).sqrt();
        let noise: Vec<f64> = (0..data.channels_per_recording()).map(mean).collect();
        let rows: Vec<Rows> = (0..data.channels())
            .map(|channel| {
                let mask = data.active_mask(channel);
                let count: f64 = mask.iter().sum();
                let masked =
                    |rows: &[f64]| -> Vec<f64> { rows.iter().zip(&mask).map(|(x, m)| x * m).collect() };
                let square = noise[channel % data.channels_per_recording()].powi(2);
                let kappa_noise = draws
                    .iter()
                    .map(|draw| rows_per_independent_row(&masked(&draw[channel]), &mask))
                    .sum::<f64>()
                    / draws.len() as f64;
                let size = local_size(data, channel, target);
                let instrument: Vec<f64> =
                    row_error[channel].iter().map(|row_error| square + row_error * row_error).collect();
                let scale = (size.iter().zip(&mask).map(|(x, m)| x * m).sum::<f64>() / count.max(1.0)).sqrt();
                let rest = match residual {
                    Some(residual) => masked(&residual[channel]),
                    None => Shapes::new(data, channel, &mask, &knots).residual(&masked(&target[channel])),
                };
                let kappa = rows_per_independent_row(&rest, &mask);
                let mut rows = Rows {
                    phi: mask.iter().map(|mask| mask / kappa).collect(),
                    robust_weight: vec![1.0; mask.len()],
                    instrument,
                    size,
                    share: USUAL_SHARE,
                    scale,
                };
                rows.update_share(&rest, 0.0);
                let both = |(instrument, size): (&f64, &f64)| {
                    let row_error = rows.share * rows.share * size;
                    (instrument + row_error)
                        / (kappa_noise * instrument + kappa * row_error).max(f64::MIN_POSITIVE)
                };
                let phi = rows.instrument.iter().zip(&rows.size).map(both);
                rows.phi = phi.zip(&mask).map(|(phi, mask)| phi * mask).collect();
                rows
            })
            .collect();
        Self { rows, noise }
    }

    /// The weight of each row in the sum of squares, by channel.
    pub fn by_row(&self) -> Vec<Vec<f64>> {
        self.rows.iter().map(Rows::weights).collect()
    }

    /// The same rows with the standard deviations `row_error` of a perfect model's error instead. The effective number of rows stays the same, so that
    /// their evidence may be compared.
    pub fn with_row_error(&self, row_error: &[Vec<f64>]) -> Self {
        let of_channel = |(c, rows): (usize, &Rows)| {
            let square = self.noise[c % self.noise.len()].powi(2);
            Rows {
                instrument: row_error[c].iter().map(|row_error| square + row_error * row_error).collect(),
                ..rows.clone()
            }
        };
        Self { rows: self.rows.iter().enumerate().map(of_channel).collect(), noise: self.noise.clone() }
    }

    /// Standard deviation of the error of each row, by channel: `row_error`, and a share of the deviation `spread` between several solutions. One share
    /// holds for all channels, because one bearing displaces its journal equally in each. It is the share with the largest likelihood of the
    /// `residual`.
    pub fn most_probable_row_error(
        &self,
        row_error: &[Vec<f64>],
        spread: &[Option<Vec<f64>>],
        residual: &[Vec<f64>],
    ) -> Vec<Vec<f64>> {
        /// The largest share that the fit tries: the solutions then deviate from the model as much as from each other.
        const MOST: f64 = 2.0;
        /// Number of such shares: each is smaller by a factor of √2 than the one before, down to a tenth. The fit tries zero, too.
        const COUNT: i32 = 10;
        if spread.iter().all(Option::is_none) {
            return row_error.to_vec();
        }
        let with = |share: f64| -> Vec<Vec<f64>> {
            let of_channel = |(row_error, spread): (&Vec<f64>, &Option<Vec<f64>>)| match spread {
                Some(spread) => row_error
                    .iter()
                    .zip(spread)
                    .map(|(row_error, spread)| row_error.hypot(share * spread))
                    .collect(),
                None => row_error.clone(),
            };
            row_error.iter().zip(spread).map(of_channel).collect()
        };
        let shares = (0..COUNT).map(|k| MOST * 0.5_f64.powf(0.5 * f64::from(k))).chain([0.0]);
        let all = shares.map(|share| {
            let row_error = with(share);
            (self.with_row_error(&row_error).robust_log_likelihood(residual), row_error)
        });
        all.reduce(|best, next| if next.0 > best.0 { next } else { best })
            .map_or_else(Vec::new, |best| best.1)
    }

    /// Maximum log-likelihood of the `residual`: see [`Rows::robust_log_likelihood`].
    pub fn robust_log_likelihood(&self, residual: &[Vec<f64>]) -> f64 {
        self.rows.iter().zip(residual).map(|(rows, residual)| rows.robust_log_likelihood(residual)).sum()
    }

    /// Weights of rows of which only the noise is known: its `deviation` and the number of `effective` rows, by channel.
    pub fn plain(data: &Data, deviation: &[f64], effective: &[f64]) -> Self {
        let of_channel = |c: usize| {
            let counts = &data.counts[c];
            let per_row = effective[c] / counts.iter().sum::<f64>().max(1.0);
            let is_known = deviation[c].is_finite() && deviation[c] > 0.0;
            Rows {
                instrument: vec![if is_known { deviation[c].powi(2) } else { 1.0 }; counts.len()],
                size: vec![0.0; counts.len()],
                robust_weight: vec![1.0; counts.len()],
                phi: counts.iter().map(|counts| if is_known { counts * per_row } else { 0.0 }).collect(),
                share: 0.0,
                scale: if is_known { WIDE * deviation[c] } else { 0.0 },
            }
        };
        Self { rows: (0..data.channels()).map(of_channel).collect(), noise: deviation.to_vec() }
    }

    /// Fits the drift models to the `residual` of the active rows of `data`, and the part of the errors of a perfect model that these rows have.
    pub fn whitening(&self, data: &Data, residual: &[Vec<f64>]) -> Whitening {
        let noise = |c: usize| self.noise[c % data.channels_per_recording()];
        let of_channel = |(c, rows): (usize, &Rows)| rows.realised(noise(c), &residual[c]).sizes();
        let sizes: Vec<Vec<f64>> = self.rows.iter().enumerate().map(of_channel).collect();
        Whitening::of(data, residual, &sizes, &self.noise)
    }

    /// Weights of the rows that `whitening` made independent: each has the standard deviation of its channel.
    pub fn white(data: &Data, whitening: &Whitening) -> Self {
        let of_channel = |c: usize| {
            let drift = whitening.channel(c);
            let deviation = drift.deviation();
            let is_known = deviation > 0.0;
            let (recording, of_recording) = data.place(c);
            let measured = drift.rows(&data.recordings[recording].channels[of_recording].measured);
            let phi: Vec<f64> = drift.mask().map(|used| if is_known { used } else { 0.0 }).collect();
            let count = phi.iter().filter(|phi| **phi > 0.0).count().max(1) as f64;
            Rows {
                instrument: vec![if is_known { deviation.powi(2) } else { 1.0 }; phi.len()],
                size: vec![0.0; phi.len()],
                robust_weight: vec![1.0; phi.len()],
                phi,
                share: 0.0,
                scale: (measured.iter().map(|x| x * x).sum::<f64>() / count).sqrt(),
            }
        };
        let noise = (0..data.channels()).map(|c| whitening.channel(c).deviation()).collect();
        Self { rows: (0..data.channels()).map(of_channel).collect(), noise }
    }

    /// The log-likelihood of the `residual` of all channels.
    pub fn score(&self, residual: &[Vec<f64>]) -> f64 {
        self.rows.iter().zip(residual).map(|(rows, residual)| rows.score(residual)).sum()
    }

    /// The weights of the rows in other `parts`, with the same noise and shares.
    pub fn on(&self, data: &Data, parts: &[Part]) -> Self {
        let channels_per_recording = data.channels_per_recording();
        let of_channel = |channel: usize| {
            let mask = data.mask(channel, parts);
            // The share and the effective number of rows are those of the same channel in a recording with rows in the fit part.
            let same = (channel % channels_per_recording..data.channels()).step_by(channels_per_recording);
            let fitted = same.map(|c| &self.rows[c]).find(|rows| rows.effective() > 0.0);
            let own = &self.rows[channel];
            let share = fitted.map_or(own.share, |rows| rows.share);
            let per_row = fitted.map_or(1.0, |rows| {
                let counted: f64 = rows.phi.iter().filter(|phi| **phi > 0.0).count() as f64;
                rows.effective() / counted.max(1.0)
            });
            Rows {
                phi: mask.iter().map(|mask| mask * per_row).collect(),
                robust_weight: vec![1.0; mask.len()],
                share,
                ..own.clone()
            }
        };
        Self { rows: (0..data.channels()).map(of_channel).collect(), noise: self.noise.clone() }
    }
}

/// Number of correlated rows of `residual`, where `mask` is one, that are equivalent to one independent row: 1 + 2Σρ, at least one.
fn rows_per_independent_row(residual: &[f64], mask: &[f64]) -> f64 {
    let counted: Vec<f64> = residual.iter().zip(mask).filter(|(_, m)| **m > 0.0).map(|(x, _)| *x).collect();
    (counted.len() as f64 / effective_samples(&counted).max(1.0)).max(1.0)
}

/// Square of the local size of the quantity that the channel number `channel` models: the torque itself; of a pose, which the rigid arm predicts
/// exactly, its residual. It is nowhere below a third of the channel's own size.
fn local_size(data: &Data, channel: usize, target: &[Vec<f64>]) -> Vec<f64> {
    /// Smallest local size over that of the whole channel: where a channel is near zero, its components, such as gravity and friction against each
    /// other, are not; each of them has an error of its share.
    const LEAST: f64 = 1.0 / 3.0;
    let (recording, of_recording) = data.place(channel);
    let recording = &data.recordings[recording];
    let modelled = match data.kind(channel) {
        Kind::Torque(_) => recording.channels[of_recording].measured.clone(),
        Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => target[channel].clone(),
    };
    let squares: Vec<f64> = modelled.iter().map(|x| x * x).collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let mut local = vec![0.0; squares.len()];
    for (stretch, step) in data.stretches(channel) {
        // The local size of a row is taken over one settling time of the low-pass on either side, because the low-pass computes the row from these
        // rows only.
        let half = ((recording.prepared.treatment.filter().settling_time() / step) as usize).max(1);
        let mut sums = vec![0.0];
        for square in &squares[stretch.clone()] {
            sums.push(sums[sums.len() - 1] + square);
        }
        for row in 0..stretch.len() {
            let (from, to) = (row.saturating_sub(half), (row + half + 1).min(stretch.len()));
            local[stretch.start + row] = (sums[to] - sums[from]) / (to - from) as f64;
        }
    }
    local.iter().map(|square| square.max(LEAST * LEAST * mean)).collect()
}

/// Simulated residuals of every channel of `data` for a perfect model, with the random numbers of `seed`: the effect of noise and rounding of
/// positions and channels.
fn instruments(data: &Data, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut residual: Vec<Vec<f64>> = data
        .recordings
        .iter()
        .flat_map(|recording| simulated_instrument_residual(recording, &mut rng))
        .collect();
    for (channel, rows) in residual.iter_mut().enumerate() {
        data.apply_mask(channel, rows);
    }
    residual
}

#[cfg(test)]
mod tests {
    use super::{Rows, Weights};
    use crate::random::normals;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// A fifth of the errors is found where the rows have a fifth, and the share of the laws with it.
    #[test]
    fn the_realised_part_of_the_errors_is_found() {
        let count = 4000;
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let white = normals(&mut rng, count, 1.0);
        let greatest: Vec<f64> = (0..count).map(|k| (k % 50) as f64).collect();
        let size = |k: usize| 1.0 + (k % 7) as f64;
        let deviation: Vec<f64> =
            (0..count).map(|k| 0.5_f64.hypot(0.2 * greatest[k]).hypot(0.1 * size(k))).collect();
        let residual: Vec<f64> = white.iter().zip(&deviation).map(|(x, deviation)| x * deviation).collect();
        let rows = Rows {
            instrument: greatest.iter().map(|error| 0.25 + error * error).collect(),
            size: (0..count).map(|k| size(k).powi(2)).collect(),
            phi: vec![1.0; count],
            robust_weight: vec![1.0; count],
            share: 0.02,
            scale: 1.0,
        };
        let sizes = rows.realised(0.5, &residual).sizes();
        let off = sizes.iter().zip(&deviation).map(|(size, deviation)| (size / deviation - 1.0).abs());
        let most = off.fold(0.0, f64::max);
        println!("the standard deviations are off by {:.1} % at most", 100.0 * most);
        assert!(most < 0.1);
    }

    /// The estimate of the row errors is half of the deviation between solutions, where the rows were made with this error.
    #[test]
    fn how_far_rows_lie_off_is_told_by_what_is_left() {
        const COUNT: usize = 4000;
        let spread: Vec<f64> = (0..COUNT).map(|k| if k % 400 < 100 { 1.0 } else { 0.0 }).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (noise, far) = (normals(&mut rng, COUNT, 0.01), normals(&mut rng, COUNT, 0.5));
        let residual: Vec<f64> = (0..COUNT).map(|k| noise[k] + far[k] * spread[k]).collect();
        let rows = Rows {
            instrument: vec![1e-4; COUNT],
            size: vec![1.0; COUNT],
            phi: vec![1.0; COUNT],
            robust_weight: vec![1.0; COUNT],
            share: 0.0,
            scale: 1.0,
        };
        let weights = Weights { rows: vec![rows], noise: vec![0.01] };
        let row_error = weights.most_probable_row_error(&[vec![0.0; COUNT]], &[Some(spread)], &[residual]);
        println!("off {}, of which rows were made 0.5, margin a step of √2", row_error[0][50]);
        assert!((row_error[0][50] / 0.5).ln().abs() <= 0.5 * 2.0_f64.ln());
        assert!(row_error[0][200] == 0.0);
    }
}
