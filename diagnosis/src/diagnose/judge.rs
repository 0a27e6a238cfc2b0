//! What the search found, judged on held-out data: an effect that does not make the model better there is no finding.

use freeplay_laws::LawError;

use super::case::Case;
use super::search::{Search, Standing};
use super::show::{Coefficients, Gain, HeldOut, gain, held_out};
use super::system::{Column, Fit, System, subtract};

/// Least share of the error that a finding takes away where it shows.
const LEAST_GAIN: f64 = 0.05;
/// How often the search goes on after effects did not prove themselves.
const RENEWALS: usize = 4;
/// The same for one effect beside the others, which the cross-validation has passed.
const LEAST_HELD_OUT: f64 = 0.08;
/// The most by which a finding may make the error of a channel greater on held-out data, as a factor.
const MOST_BENT: f64 = 1.5;
/// Share of an effect's own weight that a channel must carry to count as one in which it shows.
const SHOWS: f64 = 0.1;

/// How an effect does on held-out data.
#[derive(Clone, Debug)]
pub(crate) struct Proof {
    /// Share of the error that it takes away.
    pub gain: Gain,
    /// Whether held-out data could show it; else the data of the fit.
    pub held_out: bool,
    /// Channels within a stage in which it shows.
    pub channels: Vec<usize>,
}

/// The judge: the held-out recordings as a system of their own.
pub(crate) struct Judge<'a, 'b> {
    /// The held-out recordings.
    pub held: &'b Case<'a>,
    /// Their nuisances.
    system: System,
    seed: u64,
}

impl<'a, 'b> Judge<'a, 'b> {
    /// A judge on `held`.
    pub fn new(held: &'b Case<'a>, seed: u64) -> Self {
        Self { system: held.system(held.target()), held, seed }
    }

    /// Weights of the held-out channels: those of the same channel in the first recording of the fit, sample by sample.
    fn weights(&self, search: &Search) -> Vec<f64> {
        (0..self.held.kept.len()).map(|c| search.system.weights[c % self.held.per_stage()]).collect()
    }

    /// The columns of all that `search` has chosen, but for the effect number `left_out`, on the held-out recordings, each with its coefficient
    /// in `fit`.
    ///
    /// # Errors
    /// See [`LawError`].
    fn effects(
        &self,
        search: &Search,
        fit: &Fit,
        left_out: Option<usize>,
    ) -> Result<Vec<(Column, f64)>, LawError> {
        let mut columns = Vec::new();
        for (_, chosen) in search.chosen.iter().enumerate().filter(|(index, _)| Some(*index) != left_out) {
            columns.extend(search.hypotheses[chosen.hypothesis].columns_on(self.held)?);
        }
        Ok(columns.into_iter().zip(fit.eta.iter().skip(search.nuisances().len()).copied()).collect())
    }

    /// The held-out errors of what `search` has chosen, but for the effect number `left_out`.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if the fit is singular.
    pub fn errors(&self, search: &Search, left_out: Option<usize>) -> Result<Option<HeldOut>, LawError> {
        let active = search.active(left_out);
        let (Some(fit), Some(bare)) = (search.system.fit(&active), search.system.fit(&search.nuisances()))
        else {
            return Ok(None);
        };
        let nuisances = bare.eta.len();
        let effects = self.effects(search, &fit, left_out)?;
        let (retuned, tuned) =
            (self.bound(search, bare.eta.as_slice()), self.bound(search, &fit.eta.as_slice()[..nuisances]));
        let coefficients = Coefficients { retuned: &retuned, tuned: &tuned, effects: &effects };
        Ok(Some(held_out(self.held, &self.system, &coefficients, &free(&self.system))))
    }

    /// The held-out errors of the tuned model with an unnamed correction in the place of all effects.
    pub fn black_box(&self, search: &Search, errors: &HeldOut) -> Option<Vec<Vec<f64>>> {
        let bare = search.system.fit(&search.nuisances())?;
        let unnamed = search.case.unnamed_on(self.held, &search.system.residual(&bare));
        Some(less(&errors.retuned, &unnamed))
    }

    /// The coefficients of nuisances with a prior, in the order of the held-out system, in which free ones may be other in number.
    fn bound(&self, search: &Search, eta: &[f64]) -> Vec<f64> {
        let ours = free(&self.system);
        let theirs = free(&search.system);
        let mut bound =
            eta.iter().enumerate().filter(|(index, _)| !theirs.contains(index)).map(|(_, eta)| *eta);
        (0..self.system.base.len())
            .map(|index| if ours.contains(&index) { 0.0 } else { bound.next().unwrap_or(0.0) })
            .collect()
    }

    /// What naming the effect number `index` brings on held-out data, beside the others.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn proof(&self, search: &Search, index: usize) -> Result<Option<Proof>, LawError> {
        let Some(fit) = search.system.fit(&search.active(None)) else { return Ok(None) };
        let Some(without) = search.system.fit(&search.active(Some(index))) else { return Ok(None) };
        let chosen = &search.chosen[index];
        let hypothesis = &search.hypotheses[chosen.hypothesis];
        let beta: Vec<f64> = chosen
            .columns
            .iter()
            .filter_map(|column| fit.active.iter().position(|a| a == column).map(|k| fit.eta[k]))
            .collect();
        let squares = |columns: &[Column], weights: &[f64]| -> Vec<f64> {
            let square = |c: usize| {
                let rows = columns.iter().zip(&beta).fold(Vec::new(), |mut sum: Vec<f64>, (column, beta)| {
                    if let Some(part) = &column[c] {
                        sum.resize(part.len(), 0.0);
                        sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += beta * x);
                    }
                    sum
                });
                weights[c] * rows.iter().map(|x| x * x).sum::<f64>()
            };
            (0..weights.len()).map(square).collect()
        };
        let per_stage = self.held.per_stage();
        let fitted = squares(&hypothesis.block.columns, &search.system.weights);
        let by_channel: Vec<f64> =
            (0..per_stage).map(|c| fitted.iter().skip(c).step_by(per_stage).sum()).collect();
        let strongest = by_channel.iter().copied().fold(0.0, f64::max);
        let shows: Vec<usize> = (0..per_stage).filter(|&c| by_channel[c] > SHOWS * strongest).collect();
        let over = |case: &Case| -> Vec<usize> {
            (0..case.kept.len()).filter(|c| shows.contains(&(c % per_stage))).collect()
        };
        let (Some(errors), Some(errors_without)) =
            (self.errors(search, None)?, self.errors(search, Some(index))?)
        else {
            return Ok(None);
        };
        let weights = self.weights(search);
        let on_held = gain(
            self.held,
            &over(self.held),
            &weights,
            &errors_without.tuned_after,
            &errors.tuned_after,
            self.seed,
        );
        let there: f64 = squares(&hypothesis.columns_on(self.held)?, &weights).iter().sum();
        let left: f64 = over(self.held)
            .iter()
            .map(|&c| weights[c] * errors.tuned_after[c].iter().map(|x| x * x).sum::<f64>())
            .sum();
        // What doubles the error of any channel there bends what the others say, whatever it does elsewhere.
        let (with, without_it) =
            (self.held.rms(&errors.tuned_after), self.held.rms(&errors_without.tuned_after));
        if let Some(bent) = (0..per_stage).find(|&c| with[c] > MOST_BENT * without_it[c]) {
            let over: Vec<usize> = (bent..self.held.kept.len()).step_by(per_stage).collect();
            let (before, after) = (&errors_without.tuned_after, &errors.tuned_after);
            let loss = gain(self.held, &over, &weights, before, after, self.seed);
            return Ok(Some(Proof { gain: loss, held_out: true, channels: shows }));
        }
        if there > 0.1 * left {
            return Ok(Some(Proof { gain: on_held, held_out: true, channels: shows }));
        }
        // It does not act on the held-out data: a push, a drift that is over.
        let (before, after) = (search.system.residual(&without), search.system.residual(&fit));
        let on_fit =
            gain(search.case, &over(search.case), &search.system.weights, &before, &after, self.seed);
        let held_out = on_fit.value < LEAST_GAIN;
        Ok(Some(Proof { gain: if held_out { on_held } else { on_fit }, held_out, channels: shows }))
    }

    /// Drops effects that don't prove themselves and searches for others in their place, a few times; `search` then stands where all that
    /// is left had proved itself and the held-out error was least. The proofs of that.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn sift(
        &self,
        search: &mut Search,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Vec<Proof>>, LawError> {
        let mut best: Option<(f64, Standing, Vec<Proof>)> = None;
        for renewal in 0..=RENEWALS {
            let before = search.chosen.len();
            let Some(proofs) = self.drop_unproven(search, progress)? else { return Ok(None) };
            let is_last = proofs.len() == before || renewal == RENEWALS;
            if is_last && best.is_none() {
                return Ok(Some(proofs));
            }
            let Some(size) = self.size(search, None)? else { return Ok(None) };
            if best.as_ref().is_none_or(|(least, ..)| size < *least) {
                best = Some((size, search.standing(), proofs));
            }
            if is_last {
                break;
            }
            if search.improve_validated(progress).is_none() {
                return Ok(None);
            }
        }
        Ok(best.map(|(_, standing, proofs)| {
            search.go_back(standing);
            proofs
        }))
    }

    /// How large the held-out errors of what `search` has chosen are, but for the effect number `left_out`: the mean logarithm of those
    /// above the noise floor.
    fn size(&self, search: &Search, left_out: Option<usize>) -> Result<Option<f64>, LawError> {
        let Some(errors) = self.errors(search, left_out)? else { return Ok(None) };
        let over: Vec<f64> = self
            .held
            .rms(&errors.tuned_after)
            .iter()
            .zip(&search.null.floor)
            .map(|(rms, floor)| (rms / floor.max(f64::MIN_POSITIVE)).max(1.0).ln())
            .collect();
        Ok(Some(over.iter().sum::<f64>() / over.len().max(1) as f64))
    }

    /// Drops effects that don't prove themselves, one after another, since without it the others may: each time the one without which
    /// the held-out errors are least. What brings least itself may only suffer from another.
    fn drop_unproven(
        &self,
        search: &mut Search,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Vec<Proof>>, LawError> {
        loop {
            let mut proofs = Vec::new();
            for index in 0..search.chosen.len() {
                let Some(proof) = self.proof(search, index)? else { return Ok(None) };
                proofs.push(proof);
            }
            let mut worst: Option<(f64, usize)> = None;
            for index in (0..proofs.len()).filter(|&index| proofs[index].gain.value < LEAST_HELD_OUT) {
                let Some(without) = self.size(search, Some(index))? else { return Ok(None) };
                if worst.is_none_or(|(least, _)| without < least) {
                    worst = Some((without, index));
                }
            }
            let Some((_, index)) = worst else { return Ok(Some(proofs)) };
            let [low, high] = proofs[index].gain.ci95.map(|share| 100.0 * share);
            progress(&format!("{} does not prove itself: {low:.0} to {high:.0} %", search.in_words(index)));
            search.veto(index);
            if search.settle().is_none() {
                return Ok(None);
            }
        }
    }

    /// Gain over all `channels` (numbers within a stage) of `after` against `before`.
    pub fn gain(&self, search: &Search, channels: &[usize], before: &[Vec<f64>], after: &[Vec<f64>]) -> Gain {
        let per_stage = self.held.per_stage();
        let over: Vec<usize> =
            (0..self.held.kept.len()).filter(|c| channels.contains(&(c % per_stage))).collect();
        gain(self.held, &over, &self.weights(search), before, after, self.seed)
    }

    /// What an unnamed correction takes away of what is left after naming, on held-out data: share of the error.
    pub fn unnamed_rest(&self, search: &Search, errors: &HeldOut, channels: &[usize]) -> Option<Gain> {
        let fit = search.system.fit(&search.active(None))?;
        let unnamed = search.case.unnamed_on(self.held, &search.system.residual(&fit));
        let after = less(&errors.tuned_after, &unnamed);
        Some(self.gain(search, channels, &errors.tuned_after, &after))
    }

    /// What the model leaves of the held-out recordings with its parameters tuned to these inside their tolerances: without and with
    /// what `search` has chosen. `None` if a fit is singular.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn retuned_there(&self, search: &Search) -> Result<Option<[Vec<Vec<f64>>; 2]>, LawError> {
        let Some(fit) = search.system.fit(&search.active(None)) else { return Ok(None) };
        let without = self.held.target();
        let mut with = without.clone();
        for (column, eta) in self.effects(search, &fit, None)? {
            subtract(&mut with, &column, eta);
        }
        let all: Vec<usize> = (0..self.system.base.len()).collect();
        let tuned = |target: &[Vec<f64>]| {
            let mut system = self.system.with_other_target(target);
            system.weights = self.weights(search);
            Some(system.residual(&system.fit(&all)?))
        };
        Ok(tuned(&without).zip(tuned(&with)).map(|(without, with)| [without, with]))
    }
}

/// `rows` less what is `said` of them.
fn less(rows: &[Vec<f64>], said: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let pairs = rows.iter().zip(said);
    pairs.map(|(rows, said)| rows.iter().zip(said).map(|(x, said)| x - said).collect()).collect()
}

/// Base columns of a fresh system that no prior binds.
fn free(system: &System) -> Vec<usize> {
    (0..system.base.len())
        .filter(|&index| system.precision[index] > 0.0 && system.precision[index] < 1e-6)
        .collect()
}
