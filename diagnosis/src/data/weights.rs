//! How much each row says: the noise of the instruments, and the discrepancy δ, by which every law of a real machine is off.
//!
//! A row i of channel c has the variance v = σ² + off² + s²L²: σ is what the instruments leave, off what the samples can't say, L the local size of what the
//! channel models, and s the share of it by which the laws are off (Kennedy & O'Hagan 2001, J. R. Stat. Soc. B 63:425). Neighbouring rows are alike: the
//! log-likelihood of each is weighed by φ, which turns the number of rows into the effective one, κ rows to one for the noise and for the discrepancy
//! each.

use freeplay_servo::DEGREES_OF_FREEDOM;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::data::instruments::read_badly;
use crate::data::noise::effective_samples;
use crate::data::parts::Part;
use crate::data::shapes::{Knots, Shapes};
use crate::data::stacked::Data;
use crate::data::whitening::Whitening;
use crate::signals::channel::Kind;
use crate::statistics::WIDE;

/// Deviation of the half-normal prior of s: laws of rigid bodies and of friction hold to a few per cent on machines that are published.
pub(crate) const USUAL_SHARE: f64 = 0.02;
/// Least share s that is tried: no machine follows its laws to a thousandth.
pub(crate) const LEAST_SHARE: f64 = 1e-3;
/// Factor from one share that is tried to the next: the evidence is flat about its greatest value, so that half such a step changes it by far less than one.
const FINER: f64 = 1.2;
/// Recordings of perfect machines from which the noise of the instruments is taken: their mean square is known to a few per cent.
const DRAWS: u64 = 3;

/// The shares that are tried: none, and from the least on up to a law that says nothing.
fn shares() -> impl Iterator<Item = f64> {
    let grid = (0..).map(|k| LEAST_SHARE * FINER.powi(k));
    std::iter::once(0.0).chain(grid.take_while(|share| *share < FINER))
}

/// How much the rows of one channel say.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    /// What no law could say: σ² + off², by row.
    instrument: Vec<f64>,
    /// Square of the local size of what the channel models, by row.
    size: Vec<f64>,
    /// The weight of each row in the likelihood, φ; zero of rows that don't count.
    phi: Vec<f64>,
    /// How far each row is believed, where some are far out: see [`Rows::distrust`].
    trust: Vec<f64>,
    /// The share s.
    pub share: f64,
    /// Root of the mean square of what the channel models.
    pub scale: f64,
}

/// How much all rows say.
#[derive(Clone, Debug)]
pub(crate) struct Weights {
    /// By channel.
    pub rows: Vec<Rows>,
    /// Deviation of the noise of the instruments, over all rows, by channel of a recording.
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
        let trusted = self.phi.iter().zip(&self.trust).zip(self.variances(self.share));
        trusted.map(|((phi, trust), v)| if *phi > 0.0 { phi * trust / v } else { 0.0 }).collect()
    }

    /// Greatest log-likelihood, over all shares, of rows of which `left` remains, with the tails of Student's t under which rows are believed. The prior of the share is
    /// included.
    pub fn tailed(&self, left: &[f64]) -> f64 {
        let with = |share: f64| {
            let rows =
                self.phi.iter().zip(left).zip(self.variances(share)).filter(|((phi, _), _)| **phi > 0.0);
            let of_row = |((phi, x), v): ((&f64, &f64), f64)| {
                0.5 * phi * (v.ln() + (DEGREES_OF_FREEDOM + 1.0) * (x * x / v / DEGREES_OF_FREEDOM).ln_1p())
            };
            -0.5 * (share / USUAL_SHARE).powi(2) - rows.map(of_row).sum::<f64>()
        };
        shares().map(with).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Believes each row by what `left` remains of it, as under Student's t of four degrees of freedom (Lange, Little & Taylor 1989, J. Am. Stat. Assoc.
    /// 84:881): what shakes at times bends no number.
    pub fn distrust(&mut self, left: &[f64]) {
        let v = self.variances(self.share);
        self.trust = left
            .iter()
            .zip(v)
            .map(|(x, v)| ((DEGREES_OF_FREEDOM + 1.0) / (DEGREES_OF_FREEDOM + x * x / v)).min(1.0))
            .collect();
    }

    /// Believes every row alike.
    pub fn trust_all(&mut self) {
        self.trust.fill(1.0);
    }

    /// The deviation of each row: √v.
    pub fn sizes(&self) -> Vec<f64> {
        self.variances(self.share).map(|v| v.sqrt().max(f64::MIN_POSITIVE)).collect()
    }

    /// Square of how far a perfect model may be off, by row, beside instruments of this `noise`.
    pub fn squares_off(&self, noise: f64) -> impl Iterator<Item = f64> {
        self.instrument.iter().map(move |square| (square - noise * noise).max(0.0))
    }

    /// Effective number of rows.
    pub fn effective(&self) -> f64 {
        self.phi.iter().sum()
    }

    /// Log of the likelihood of rows that leave the squares `left`, by row, with the share `share`, its prior included.
    fn log_likelihood(&self, left: &[f64], share: f64) -> f64 {
        let mut sum = -0.5 * (share / USUAL_SHARE).powi(2);
        for ((phi, left), v) in self.phi.iter().zip(left).zip(self.variances(share)) {
            if *phi > 0.0 {
                sum -= 0.5 * phi * (v.ln() + left / v);
            }
        }
        sum
    }

    /// Log of the likelihood but for the sum of squares.
    pub fn log_volume(&self) -> f64 {
        self.log_likelihood(&vec![0.0; self.phi.len()], self.share)
    }

    /// The most probable share where `left` remains of each row, with `taken` effective rows used up by coefficients, and the log-likelihood with it.
    pub fn best(&self, left: &[f64], taken: f64) -> (f64, f64) {
        let squares = self.squares(left, taken);
        let tried = shares().map(|share| (share, self.log_likelihood(&squares, share)));
        tried.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((self.share, 0.0))
    }

    /// By how much the most probable share is more probable than the present one.
    pub fn to_gain(&self, left: &[f64], taken: f64) -> f64 {
        self.best(left, taken).1 - self.log_likelihood(&self.squares(left, taken), self.share)
    }

    /// By how much the log-likelihood of rows of which `left` remains is greater with the most probable share than with the greatest one up to `most`.
    pub fn beyond(&self, left: &[f64], most: f64) -> f64 {
        let squares = self.squares(left, 0.0);
        let (share, likelihood) = self.best(left, 0.0);
        if share > most { likelihood - self.log_likelihood(&squares, most) } else { 0.0 }
    }

    /// The log-likelihood of rows of which `left` remains.
    pub fn score(&self, left: &[f64]) -> f64 {
        self.log_likelihood(&self.squares(left, 0.0), self.share)
    }

    fn squares(&self, left: &[f64], taken: f64) -> Vec<f64> {
        let scale = self.effective() / (self.effective() - taken).max(1.0);
        left.iter().zip(&self.trust).map(|(x, trust)| trust * scale * x * x).collect()
    }

    /// Sets the share to the most probable one where `left` remains of each row, with `taken` effective rows used up by coefficients; whether it moved by
    /// more than a step.
    pub fn follow(&mut self, left: &[f64], taken: f64) -> bool {
        let (best, _) = self.best(left, taken);
        let step = LEAST_SHARE.max(0.5 * (FINER - 1.0) * self.share);
        let moved = (best - self.share).abs() > step;
        if moved {
            self.share = best;
        }
        moved
    }
}

impl Weights {
    /// The weights of the rows of `data` that are heard, of which `target` is what the model as given leaves, and in which a perfect model may be `off` by so much. Their number is counted by what is `left` with all that
    /// was found, or, before anything is, by what even shapes without a name leave: where a law is missing that all rows share, that would count none.
    pub fn new(
        data: &Data,
        target: &[Vec<f64>],
        left: Option<&[Vec<f64>]>,
        off: &[Vec<f64>],
        seed: u64,
    ) -> Self {
        let draws: Vec<Vec<Vec<f64>>> = (0..DRAWS).map(|k| instruments(data, seed.wrapping_add(k))).collect();
        let knots = data.stages.first().map(Knots::of).unwrap_or_default();
        let squares: Vec<Vec<f64>> = draws
            .iter()
            .map(|draw| data.rms(draw, &data.counts).iter().map(|rms| rms.unwrap_or(0.0).powi(2)).collect())
            .collect();
        let mean = |c: usize| (squares.iter().map(|draw| draw[c]).sum::<f64>() / draws.len() as f64).sqrt();
        let noise: Vec<f64> = (0..data.per_stage()).map(mean).collect();
        let rows: Vec<Rows> = (0..data.channels())
            .map(|channel| {
                let mask = data.heard(channel);
                let count: f64 = mask.iter().sum();
                let masked =
                    |rows: &[f64]| -> Vec<f64> { rows.iter().zip(&mask).map(|(x, m)| x * m).collect() };
                let square = noise[channel % data.per_stage()].powi(2);
                let kappa_noise = draws.iter().map(|draw| alike(&masked(&draw[channel]), &mask)).sum::<f64>()
                    / draws.len() as f64;
                let size = local_size(data, channel, target);
                let instrument: Vec<f64> = off[channel].iter().map(|off| square + off * off).collect();
                let scale = (size.iter().zip(&mask).map(|(x, m)| x * m).sum::<f64>() / count.max(1.0)).sqrt();
                let rest = match left {
                    Some(left) => masked(&left[channel]),
                    None => Shapes::new(data, channel, &mask, &knots).left(&masked(&target[channel])),
                };
                let kappa = alike(&rest, &mask);
                let mut rows = Rows {
                    phi: mask.iter().map(|mask| mask / kappa).collect(),
                    trust: vec![1.0; mask.len()],
                    instrument,
                    size,
                    share: USUAL_SHARE,
                    scale,
                };
                rows.follow(&rest, 0.0);
                let both = |(instrument, size): (&f64, &f64)| {
                    let off = rows.share * rows.share * size;
                    (instrument + off) / (kappa_noise * instrument + kappa * off).max(f64::MIN_POSITIVE)
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

    /// The same rows, in which a perfect model may be `off` by so much instead. As many of them count, so that their evidence may be compared.
    pub fn with_off(&self, off: &[Vec<f64>]) -> Self {
        let of_channel = |(c, rows): (usize, &Rows)| {
            let square = self.noise[c % self.noise.len()].powi(2);
            Rows { instrument: off[c].iter().map(|off| square + off * off).collect(), ..rows.clone() }
        };
        Self { rows: self.rows.iter().enumerate().map(of_channel).collect(), noise: self.noise.clone() }
    }

    /// The error that each row may have, by channel: `off`, and a share of the deviation `apart` between several courses. One share holds for all channels, because one bearing
    /// throws its journal as far in each. It is the share that makes the rows of which `left` remains most probable.
    pub fn most_probable_off(
        &self,
        off: &[Vec<f64>],
        apart: &[Option<Vec<f64>>],
        left: &[Vec<f64>],
    ) -> Vec<Vec<f64>> {
        /// The greatest share that is tried: the courses are then as far from the model as they are apart.
        const MOST: f64 = 2.0;
        /// How many such shares are tried: each is smaller by a factor of √2 than the one before, down to a tenth. Zero is tried, too.
        const COUNT: i32 = 10;
        if apart.iter().all(Option::is_none) {
            return off.to_vec();
        }
        let with = |share: f64| -> Vec<Vec<f64>> {
            let of_channel = |(off, apart): (&Vec<f64>, &Option<Vec<f64>>)| match apart {
                Some(apart) => off.iter().zip(apart).map(|(off, apart)| off.hypot(share * apart)).collect(),
                None => off.clone(),
            };
            off.iter().zip(apart).map(of_channel).collect()
        };
        let shares = (0..COUNT).map(|k| MOST * 0.5_f64.powf(0.5 * f64::from(k))).chain([0.0]);
        let all = shares.map(|share| {
            let off = with(share);
            (self.with_off(&off).tailed(left), off)
        });
        all.reduce(|best, next| if next.0 > best.0 { next } else { best })
            .map_or_else(Vec::new, |best| best.1)
    }

    /// Greatest log-likelihood of rows of which `left` remains: see [`Rows::tailed`].
    pub fn tailed(&self, left: &[Vec<f64>]) -> f64 {
        self.rows.iter().zip(left).map(|(rows, left)| rows.tailed(left)).sum()
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
                trust: vec![1.0; counts.len()],
                phi: counts.iter().map(|counts| if is_known { counts * per_row } else { 0.0 }).collect(),
                share: 0.0,
                scale: if is_known { WIDE * deviation[c] } else { 0.0 },
            }
        };
        Self { rows: (0..data.channels()).map(of_channel).collect(), noise: deviation.to_vec() }
    }

    /// The wandering of what is `left` of the rows of `data` that are heard.
    pub fn whitening(&self, data: &Data, left: &[Vec<f64>]) -> Whitening {
        let sizes: Vec<Vec<f64>> = self.rows.iter().map(Rows::sizes).collect();
        Whitening::of(data, left, &sizes, &self.noise)
    }

    /// Weights of rows that `whitening` made independent: each says as much as its channel's deviation leaves it.
    pub fn white(data: &Data, whitening: &Whitening) -> Self {
        let of_channel = |c: usize| {
            let wandering = whitening.channel(c);
            let deviation = wandering.deviation();
            let is_known = deviation > 0.0;
            let (stage, of_stage) = data.place(c);
            let measured = wandering.rows(&data.stages[stage].channels[of_stage].measured);
            let phi: Vec<f64> = wandering.says().map(|says| if is_known { says } else { 0.0 }).collect();
            let count = phi.iter().filter(|phi| **phi > 0.0).count().max(1) as f64;
            Rows {
                instrument: vec![if is_known { deviation.powi(2) } else { 1.0 }; phi.len()],
                size: vec![0.0; phi.len()],
                trust: vec![1.0; phi.len()],
                phi,
                share: 0.0,
                scale: (measured.iter().map(|x| x * x).sum::<f64>() / count).sqrt(),
            }
        };
        let noise = (0..data.channels()).map(|c| whitening.channel(c).deviation()).collect();
        Self { rows: (0..data.channels()).map(of_channel).collect(), noise }
    }

    /// The same noise and shares for rows in other `parts`.
    pub fn on(&self, data: &Data, parts: &[Part]) -> Self {
        let per_stage = data.per_stage();
        let of_channel = |channel: usize| {
            let mask = data.mask(channel, parts);
            // The share and the number of rows to one are those of the channel in a recording of the fit.
            let same = (channel % per_stage..data.channels()).step_by(per_stage);
            let fitted = same.map(|c| &self.rows[c]).find(|rows| rows.effective() > 0.0);
            let own = &self.rows[channel];
            let share = fitted.map_or(own.share, |rows| rows.share);
            let per_row = fitted.map_or(1.0, |rows| {
                let counted: f64 = rows.phi.iter().filter(|phi| **phi > 0.0).count() as f64;
                rows.effective() / counted.max(1.0)
            });
            Rows {
                phi: mask.iter().map(|mask| mask * per_row).collect(),
                trust: vec![1.0; mask.len()],
                share,
                ..own.clone()
            }
        };
        Self { rows: (0..data.channels()).map(of_channel).collect(), noise: self.noise.clone() }
    }
}

/// How many rows of `residual` where `mask` is one are worth one: 1 + 2Σρ, at least one.
fn alike(residual: &[f64], mask: &[f64]) -> f64 {
    let counted: Vec<f64> = residual.iter().zip(mask).filter(|(_, m)| **m > 0.0).map(|(x, _)| *x).collect();
    (counted.len() as f64 / effective_samples(&counted).max(1.0)).max(1.0)
}

/// Square of the local size of what the channel number `channel` models: of a torque itself; of a pose, which the rigid arm says exactly, of what is left to
/// explain. Nowhere less than a third of the channel's own.
fn local_size(data: &Data, channel: usize, target: &[Vec<f64>]) -> Vec<f64> {
    /// Least local size over that of the whole channel: where a channel is near zero, what makes it up, as gravity and friction against each other, is not;
    /// each of them is off by its share.
    const LEAST: f64 = 1.0 / 3.0;
    let (stage, of_stage) = data.place(channel);
    let stage = &data.stages[stage];
    let modelled = match data.kind(channel) {
        Kind::Torque(_) => stage.channels[of_stage].measured.clone(),
        Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => target[channel].clone(),
    };
    let squares: Vec<f64> = modelled.iter().map(|x| x * x).collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let mut local = vec![0.0; squares.len()];
    for (stretch, step) in data.stretches(channel) {
        // The local size of a row is taken over one settling time of the low-pass on either side: the low-pass makes the row of no other rows.
        let half = ((stage.ground.treatment.filter().settling_time() / step) as usize).max(1);
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

/// Measured minus model in every channel of `data`, were nothing missing and every number of the model exact: what noise and rounding of positions and
/// channels leave, by the random numbers of `seed`.
fn instruments(data: &Data, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut left: Vec<Vec<f64>> = data.stages.iter().flat_map(|stage| read_badly(stage, &mut rng)).collect();
    for (channel, rows) in left.iter_mut().enumerate() {
        data.count(channel, rows);
    }
    left
}

#[cfg(test)]
mod tests {
    use super::{Rows, Weights};
    use crate::random::normals;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Rows that lie off by half of what courses lie apart, where these lie apart at all, are told to lie off by that.
    #[test]
    fn how_far_rows_lie_off_is_told_by_what_is_left() {
        const COUNT: usize = 4000;
        let apart: Vec<f64> = (0..COUNT).map(|k| if k % 400 < 100 { 1.0 } else { 0.0 }).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (noise, far) = (normals(&mut rng, COUNT, 0.01), normals(&mut rng, COUNT, 0.5));
        let left: Vec<f64> = (0..COUNT).map(|k| noise[k] + far[k] * apart[k]).collect();
        let rows = Rows {
            instrument: vec![1e-4; COUNT],
            size: vec![1.0; COUNT],
            phi: vec![1.0; COUNT],
            trust: vec![1.0; COUNT],
            share: 0.0,
            scale: 1.0,
        };
        let weights = Weights { rows: vec![rows], noise: vec![0.01] };
        let off = weights.most_probable_off(&[vec![0.0; COUNT]], &[Some(apart)], &[left]);
        println!("off {}, of which rows were made 0.5, margin a step of √2", off[0][50]);
        assert!((off[0][50] / 0.5).ln().abs() <= 0.5 * 2.0_f64.ln());
        assert!(off[0][200] == 0.0);
    }
}
