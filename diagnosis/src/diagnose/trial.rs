//! What a search has chosen, laid on held-out recordings: how far off the model is there, with and without each effect.

use std::collections::BTreeSet;
use std::rc::Rc;

use freeplay_laws::LawError;

use super::case::Case;
use super::columns::{Column, left_without, sum_of};
use super::search::Search;
use super::show::{Coefficients, Compared, Gain, HeldOut, gain, held_out};
use super::simplify::FOLLOWED;
use super::system::{Fit, System};

/// Least share of the error that a finding takes away where it shows.
const LEAST_GAIN: f64 = 0.05;
/// The most by which a finding may make the error of a channel greater on held-out data, as a factor.
const MOST_BENT: f64 = 1.5;
/// Share of an effect's own weight that a channel must carry to count as one in which it shows.
const SHOWS: f64 = 0.1;
/// What acts to this share in one held-out part alone can't be judged by fits that have not seen that part: a push, a drift that is over.
const LOCAL: f64 = 0.7;
/// Share of what is left, in squares, that an effect has to say of held-out data to act there.
const ACTS: f64 = 0.1;
/// Share of the mean square that an effect says of the data of the fit which it has to say of held-out data to be judged by them, unless it is more than
/// what is left: of friction in slow motion a fast one shows a trace.
const HARDLY: f64 = 0.1;

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

/// The channels within a stage in which effects with `proofs` show, in order.
pub(crate) fn channels_of(proofs: &[Proof]) -> Vec<usize> {
    let all: BTreeSet<usize> = proofs.iter().flat_map(|proof| proof.channels.iter().copied()).collect();
    all.into_iter().collect()
}

/// What `search` has chosen on the recordings `held`.
pub(crate) struct Trial<'t, 'a, 'b> {
    search: &'t Search<'a, 'b>,
    held: &'t Case<'a>,
    /// The nuisances of `held`.
    system: &'t System,
    /// The noise floor there, by channel of a stage.
    floor: &'t [f64],
    /// Columns of each effect there.
    laid: Vec<Rc<Vec<Column>>>,
    /// Coefficients of the nuisances fitted alone.
    bare: Vec<f64>,
    /// Errors with all effects.
    errors: HeldOut,
}

impl<'t, 'a, 'b> Trial<'t, 'a, 'b> {
    /// A trial of `search` on `held`, whose nuisances are in `system` and whose channels have the noise `floor`.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn new(
        search: &'t Search<'a, 'b>,
        held: &'t Case<'a>,
        system: &'t System,
        floor: &'t [f64],
    ) -> Result<Option<Self>, LawError> {
        let chosen = search.chosen.iter();
        let laid: Vec<Rc<Vec<Column>>> = chosen
            .map(|chosen| search.hypotheses[chosen.hypothesis].columns_on(held))
            .collect::<Result<_, _>>()?;
        let Some(bare) = search.system.fit(&search.nuisances()) else { return Ok(None) };
        let bare = bare.eta.as_slice().to_vec();
        let Some(fit) = search.system.fit(&search.active(None)) else { return Ok(None) };
        let mut trial = Self { search, held, system, floor, laid, bare, errors: HeldOut::default() };
        trial.errors = trial.errors_of(&fit);
        for index in search.in_bearings() {
            trial.begin(index, &search.coefficients(&fit, index), &fit)?;
        }
        Ok(Some(trial))
    }

    /// Lets the journal of the effect number `index` with the coefficients `beta` begin on the held-out data as is best beside the others by `fit`.
    fn begin(&mut self, index: usize, beta: &[f64], fit: &Fit) -> Result<(), LawError> {
        let rest = left_without(&self.errors.tuned_after, &self.laid[index], beta);
        if let Some(columns) = self.search.named(index).begun_on(self.held, beta, &rest)? {
            self.laid[index] = Rc::new(columns);
            self.errors = self.errors_of(fit);
        }
        Ok(())
    }

    /// Errors with all effects.
    pub fn into_errors(self) -> HeldOut {
        self.errors
    }

    /// Whether more than `times` the noise is left of one of `channels`, by their numbers within a stage.
    pub fn is_left(&self, channels: &[usize], times: f64) -> bool {
        let left = self.held.rms(&self.errors.tuned_after);
        channels.iter().any(|&c| left[c] > times * self.floor[c])
    }

    /// How large the errors are without the effect number `left_out`: the mean logarithm of those above the noise floor.
    pub fn size(&self, left_out: Option<usize>) -> Option<f64> {
        let without = if left_out.is_some() { Some(self.errors_without(left_out)?) } else { None };
        let left = self.held.rms(&without.as_ref().unwrap_or(&self.errors).tuned_after);
        let over: Vec<f64> = left
            .iter()
            .zip(self.floor)
            .map(|(rms, floor)| (rms / floor.max(f64::MIN_POSITIVE)).max(1.0).ln())
            .collect();
        Some(over.iter().sum::<f64>() / over.len().max(1) as f64)
    }

    /// Weights of the held-out channels.
    fn weights(&self) -> Vec<f64> {
        self.held.weights_as(&self.search.system.weights)
    }

    /// Errors without the effect number `left_out`; `None` if a fit is singular.
    fn errors_without(&self, left_out: Option<usize>) -> Option<HeldOut> {
        let fit = self.search.system.fit(&self.search.active(left_out))?;
        Some(self.errors_with(&fit, left_out))
    }

    /// Errors with all effects by the coefficients of `fit`.
    pub fn errors_of(&self, fit: &Fit) -> HeldOut {
        self.errors_with(fit, None)
    }

    fn errors_with(&self, fit: &Fit, left_out: Option<usize>) -> HeldOut {
        let (nuisances, effects) = fit.eta.as_slice().split_at(self.bare.len());
        let columns = self.laid.iter().enumerate().filter(|(index, _)| Some(*index) != left_out);
        let effects: Vec<(&Column, f64)> =
            columns.flat_map(|(_, columns)| columns.iter()).zip(effects.iter().copied()).collect();
        errors_by(&self.search.system, [&self.bare, nuisances], &effects, self.held, self.system)
    }

    /// Whether the machine follows the law of the effect number `index` so well here that no richer one is asked for. `None` if a fit is singular.
    pub fn is_followed(&self, index: usize) -> Option<bool> {
        let fit = self.search.system.fit(&self.search.active(None))?;
        let said = self.said(index, &self.search.coefficients(&fit, index));
        let per_stage = self.held.per_stage();
        let shows: Vec<usize> = self.search.named(index).channels().map(|c| c % per_stage).collect();
        let weights = self.weights();
        let square = |c: usize| weights[c] * self.errors.tuned_after[c].iter().map(|x| x * x).sum::<f64>();
        let left: f64 = self.held.all_of(&shows).into_iter().map(square).sum();
        Some(left < FOLLOWED.powi(2) * said)
    }

    /// Weighed square of what the effect number `index` says with the coefficients `beta`.
    fn said(&self, index: usize, beta: &[f64]) -> f64 {
        squares(&self.laid[index], beta, &self.weights()).iter().sum()
    }
}

/// The errors of `held`, whose nuisances are in `system`, by coefficients of `fitted`: those of the nuisances alone, those beside the
/// effects, and those of the effects' columns.
pub(crate) fn errors_by(
    fitted: &System,
    nuisances: [&[f64]; 2],
    effects: &[(&Column, f64)],
    held: &Case,
    system: &System,
) -> HeldOut {
    let [retuned, tuned] = nuisances.map(|eta| bound(fitted, system, eta));
    held_out(held, system, &Coefficients { retuned: &retuned, tuned: &tuned, effects }, &free(system))
}

/// The coefficients `eta` of those nuisances of `fitted` that have a prior, in the order of the held-out `system`, in which free ones may be
/// other in number.
pub(crate) fn bound(fitted: &System, system: &System, eta: &[f64]) -> Vec<f64> {
    let (ours, theirs) = (free(system), free(fitted));
    let mut bound = eta.iter().enumerate().filter(|(index, _)| !theirs.contains(index)).map(|(_, eta)| *eta);
    (0..system.base.len())
        .map(|index| if ours.contains(&index) { 0.0 } else { bound.next().unwrap_or(0.0) })
        .collect()
}

/// Base columns of a fresh system that no prior binds.
pub(crate) fn free(system: &System) -> Vec<usize> {
    (0..system.base.len())
        .filter(|&index| system.precision[index] > 0.0 && system.precision[index] < 1e-6)
        .collect()
}

/// Weighed squares of Σ βᵢ columnᵢ by channel.
pub(crate) fn squares(columns: &[Column], beta: &[f64], weights: &[f64]) -> Vec<f64> {
    let said = sum_of(columns.iter().zip(beta.iter().copied()), weights.len());
    said.iter().zip(weights).map(|(rows, weight)| weight * rows.iter().map(|x| x * x).sum::<f64>()).collect()
}

/// Number of rows of `case` that count in the `channels` of all its stages.
fn rows(case: &Case, channels: &[usize]) -> f64 {
    case.all_of(channels).into_iter().map(|c| case.kept[c].iter().sum::<f64>()).sum()
}

/// What naming the effect number `index` brings beside the others in `trials` of the same effects: the first is that of the fit, the others
/// have held out other parts of the same recording. `None` if a fit is singular.
pub(crate) fn proof(trials: &[Trial], index: usize, seed: u64) -> Option<Proof> {
    let main = trials.first()?;
    let search = main.search;
    let fit = search.system.fit(&search.active(None))?;
    let beta = search.coefficients(&fit, index);
    let per_stage = main.held.per_stage();
    let fitted = squares(&search.named(index).block.columns, &beta, &search.system.weights);
    let by_channel: Vec<f64> =
        (0..per_stage).map(|c| fitted.iter().skip(c).step_by(per_stage).sum()).collect();
    let strongest = by_channel.iter().copied().fold(0.0, f64::max);
    let shows: Vec<usize> = (0..per_stage).filter(|&c| by_channel[c] > SHOWS * strongest).collect();
    let said: Vec<f64> = trials.iter().map(|trial| trial.said(index, &beta)).collect();
    let is_local = said.iter().any(|part| *part > LOCAL * said.iter().sum::<f64>());
    let trials = if is_local { &trials[..1] } else { trials };
    let without: Vec<HeldOut> =
        trials.iter().map(|trial| trial.errors_without(Some(index))).collect::<Option<_>>()?;
    let over = |channels: &[usize]| -> Gain {
        let compared: Vec<Compared> = trials
            .iter()
            .zip(&without)
            .map(|(trial, without)| Compared {
                case: trial.held,
                channels: trial.held.all_of(channels),
                weights: trial.weights(),
                before: &without.tuned_after,
                after: &trial.errors.tuned_after,
            })
            .collect();
        gain(&compared, seed)
    };
    // What doubles the error of any channel there bends what the others say, whatever it does elsewhere.
    let square = |rms: Vec<f64>| -> Vec<f64> { rms.iter().map(|rms| rms * rms).collect() };
    let sum = |all: Vec<Vec<f64>>| -> Vec<f64> {
        (0..per_stage).map(|c| all.iter().map(|of_trial| of_trial[c]).sum::<f64>().sqrt()).collect()
    };
    let with = sum(trials.iter().map(|trial| square(trial.held.rms(&trial.errors.tuned_after))).collect());
    let bare = sum(trials
        .iter()
        .zip(&without)
        .map(|(trial, rows)| square(trial.held.rms(&rows.tuned_after)))
        .collect());
    if let Some(bent) = (0..per_stage).find(|&c| with[c] > MOST_BENT * bare[c]) {
        return Some(Proof { gain: over(&[bent]), held_out: true, channels: shows });
    }
    let on_held = over(&shows);
    let left: f64 = trials
        .iter()
        .flat_map(|trial| trial.held.all_of(&shows).into_iter().map(move |c| (trial, c)))
        .map(|(trial, c)| trial.weights()[c] * trial.errors.tuned_after[c].iter().map(|x| x * x).sum::<f64>())
        .sum();
    let said = said[..trials.len()].iter().sum::<f64>();
    let here = fitted.iter().sum::<f64>() / rows(search.case, &shows);
    let there = said / trials.iter().map(|trial| rows(trial.held, &shows)).sum::<f64>();
    if said > left || said > ACTS * left && there > HARDLY * here {
        return Some(Proof { gain: on_held, held_out: true, channels: shows });
    }
    // It does not act on the held-out data, or hardly: a push, a drift that is over, friction of another speed.
    let bare = search.system.fit(&search.active(Some(index)))?;
    let (before, after) = (search.system.residual(&bare), search.system.residual(&fit));
    let channels = search.case.all_of(&shows);
    let weights = search.system.weights.clone();
    let of_fit = Compared { case: search.case, channels, weights, before: &before, after: &after };
    let on_fit = gain(&[of_fit], seed);
    let held_out = on_fit.value < LEAST_GAIN;
    Some(Proof { gain: if held_out { on_held } else { on_fit }, held_out, channels: shows })
}
