//! How much better the model gets on data that took no part in the fit.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::case::{Case, take_mean_off};
use super::columns::{Column, subtract};
use super::system::System;
use super::trial::free;

/// Length of a block of the bootstrap, s.
const BLOCK_S: f64 = 0.5;
/// Draws of the bootstrap.
const DRAWS: usize = 400;

/// Errors on held-out data, by channel: measured minus model at every point.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldOut {
    /// The model as given.
    pub before: Vec<Vec<f64>>,
    /// Its parameters tuned inside their tolerances.
    pub retuned: Vec<Vec<f64>>,
    /// The model as given with the effects.
    pub after: Vec<Vec<f64>>,
    /// Tuned and with the effects.
    pub tuned_after: Vec<Vec<f64>>,
}

/// A gain with its interval: the share of the error that is gone, 1 − after/before.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Gain {
    /// The share.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
}

/// Coefficients on the held-out recordings: those of the nuisances (free ones are fitted anew) and of effect columns.
pub(crate) struct Coefficients<'c> {
    /// Of the nuisances alone.
    pub retuned: &'c [f64],
    /// Of the nuisances beside the effects.
    pub tuned: &'c [f64],
    /// Of the effects' columns.
    pub effects: &'c [(&'c Column, f64)],
}

/// The errors of `held` under what was fitted elsewhere. `free` are the base columns that no prior binds.
pub(crate) fn held_out(held: &Case, system: &System, coefficients: &Coefficients, free: &[usize]) -> HeldOut {
    let before = held.target();
    let centred = |mut rows: Vec<Vec<f64>>| {
        recentre(held, &mut rows);
        rows
    };
    let tuned = |eta: &[f64]| tuned(&before, system, eta, free);
    let with_effects = |mut rows: Vec<Vec<f64>>| {
        coefficients.effects.iter().for_each(|(column, beta)| subtract(&mut rows, column, *beta));
        rows
    };
    let retuned = tuned(coefficients.retuned);
    HeldOut {
        after: centred(with_effects(before.clone())),
        tuned_after: centred(with_effects(tuned(coefficients.tuned))),
        retuned: centred(retuned),
        before: centred(before),
    }
}

/// What the nuisances of `system` leave of its target, which is in the place of what was held out, with coefficients that were fitted
/// elsewhere.
pub(crate) fn tuned_elsewhere(held: &Case, system: &System, eta: &[f64]) -> Vec<Vec<f64>> {
    let mut rows = tuned(&system.target, system, eta, &free(system));
    recentre(held, &mut rows);
    rows
}

/// `rows` less what the nuisances of `system` say with the coefficients `eta`, those of the numbers `free` aside.
fn tuned(rows: &[Vec<f64>], system: &System, eta: &[f64], free: &[usize]) -> Vec<Vec<f64>> {
    let mut rows = rows.to_vec();
    for (index, eta) in eta.iter().enumerate().filter(|(index, _)| !free.contains(index)) {
        subtract(&mut rows, &system.base[index], *eta);
    }
    rows
}

/// Takes the mean off link encoders, whose zero nobody sets against the motors'.
fn recentre(case: &Case, rows: &mut [Vec<f64>]) {
    for (channel, rows) in rows.iter_mut().enumerate().filter(|(channel, _)| case.is_link(*channel)) {
        take_mean_off(rows, &case.kept[channel]);
    }
}

/// Root of the mean square of the rows that count.
pub(crate) fn rms(rows: &[f64], kept: &[f64]) -> f64 {
    let count: f64 = kept.iter().sum();
    (rows.iter().map(|x| x * x).sum::<f64>() / count.max(1.0)).sqrt()
}

/// Errors of the same rows before and after something.
pub(crate) struct Compared<'c, 'a> {
    /// The recordings.
    pub case: &'c Case<'a>,
    /// Channels that count.
    pub channels: Vec<usize>,
    /// Weights of all channels.
    pub weights: Vec<f64>,
    /// Errors before.
    pub before: &'c [Vec<f64>],
    /// Errors after.
    pub after: &'c [Vec<f64>],
}

impl Compared<'_, '_> {
    /// Weighed squares before and after, block by block.
    fn blocks(&self) -> Vec<[f64; 2]> {
        let mut blocks = Vec::new();
        for &channel in &self.channels {
            let (stage, _) = self.case.place(channel);
            let motion = self.case.stages[stage].motion();
            for stretch in &motion.stretches {
                let long = ((BLOCK_S / motion.step(stretch).max(1e-12)) as usize).max(1);
                for (b, a) in self.before[channel][stretch.clone()]
                    .chunks(long)
                    .zip(self.after[channel][stretch.clone()].chunks(long))
                {
                    let square = |x: &[f64]| self.weights[channel] * x.iter().map(|x| x * x).sum::<f64>();
                    blocks.push([square(b), square(a)]);
                }
            }
        }
        blocks
    }
}

/// Share of bootstraps of blocks of `compared` in which `more` than that is left before of what is left after.
pub(crate) fn stability(compared: &Compared, more: f64, seed: u64) -> f64 {
    let less: Vec<f64> = compared.blocks().into_iter().map(|[before, after]| before - after).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || (0..less.len()).map(|_| less[rng.next_u64() as usize % less.len()]).sum::<f64>();
    (0..DRAWS).filter(|_| draw() > more).count() as f64 / DRAWS as f64
}

/// 1 − |after|/|before| over all of `compared`, with the interval of a bootstrap of blocks.
pub(crate) fn gain(compared: &[Compared], seed: u64) -> Gain {
    let blocks: Vec<[f64; 2]> = compared.iter().flat_map(Compared::blocks).collect();
    let share = |sums: [f64; 2]| if sums[0] > 0.0 { 1.0 - (sums[1] / sums[0]).sqrt() } else { 0.0 };
    let sum = |pick: &mut dyn Iterator<Item = usize>| {
        pick.fold([0.0, 0.0], |sum, k| [sum[0] + blocks[k][0], sum[1] + blocks[k][1]])
    };
    let value = share(sum(&mut (0..blocks.len())));
    if blocks.len() < 2 {
        return Gain { value, ci95: [f64::NEG_INFINITY, f64::INFINITY] };
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut drawn: Vec<f64> = (0..DRAWS)
        .map(|_| share(sum(&mut (0..blocks.len()).map(|_| rng.next_u64() as usize % blocks.len()))))
        .collect();
    drawn.sort_by(f64::total_cmp);
    Gain { value, ci95: [drawn[DRAWS / 40], drawn[DRAWS - 1 - DRAWS / 40]] }
}
