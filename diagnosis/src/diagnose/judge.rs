//! What the search found, judged on held-out data: an effect that does not make the model better there is no finding.
//!
//! Of an only recording each part is held out in turn (Stone 1974): a joint that hardly turns in the last of them is judged by the others.

use freeplay_laws::LawError;

use super::case::Case;
use super::columns::{less, subtract};
use super::engine::DiagnoseSettings;
use super::floor::HeldFloor;
use super::search::{Search, Standing};
use super::show::{Compared, Gain, HeldOut, gain};
use super::system::{Fit, System};
use super::trial::{Proof, Trial, proof};

/// By which share of the error of one channel something else has to leave less to take the place of an effect.
const LEAST_LESS: f64 = 0.05;

/// From how many times the noise on what is left of a channel shows that the model is wrong there.
pub(super) const FAR: f64 = 3.0;

/// Another parting of the only recording.
pub(crate) struct Turn<'a> {
    /// What is fitted.
    pub fitted: Case<'a>,
    /// What is held out.
    pub held: Case<'a>,
}

/// What proved itself.
pub(super) struct Sifted {
    /// How large the held-out errors are with it.
    pub size: f64,
    pub standing: Standing,
    pub proofs: Vec<Proof>,
}

impl Sifted {
    /// That of both which leaves less; `other` if they are alike.
    pub fn or_smaller(self, other: Option<Self>) -> Self {
        match other {
            Some(other) if self.size >= other.size => other,
            _ => self,
        }
    }

    /// Puts `search` there; the proofs.
    fn restore(self, search: &mut Search) -> Vec<Proof> {
        search.go_back(self.standing);
        self.proofs
    }
}

/// The judge: the held-out recordings as systems of their own.
pub(crate) struct Judge<'a, 'b> {
    /// The held-out recordings.
    pub held: &'b Case<'a>,
    /// Their nuisances.
    pub system: System,
    /// What a perfect model leaves of them.
    pub floor: HeldFloor,
    /// Other partings, with the nuisances of what is fitted and of what is held out.
    turns: Vec<(&'b Turn<'a>, [System; 2])>,
    pub(super) seed: u64,
}

impl<'a, 'b> Judge<'a, 'b> {
    /// A judge on `held`, and on `turns`, of what `search` chooses; `None` if a fit is singular.
    pub fn new(
        search: &Search,
        held: &'b Case<'a>,
        turns: &'b [Turn<'a>],
        settings: &DiagnoseSettings,
    ) -> Option<Self> {
        let system_of = |case: &Case| case.system(case.target());
        let system = system_of(held);
        let floor = HeldFloor::of(&search.null, &search.system, held, &system, &settings.tolerances)?;
        let turns = turns.iter().map(|turn| (turn, [&turn.fitted, &turn.held].map(system_of))).collect();
        Some(Self { held, system, floor, turns, seed: settings.seed })
    }

    /// The held-out errors of what `search` has chosen with the coefficients of `fit`.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn errors(&self, search: &Search<'a, 'b>, fit: &Fit) -> Result<Option<HeldOut>, LawError> {
        Ok(Trial::new(search, self.held, &self.system, &self.floor.tuned_there)?
            .map(|trial| trial.errors_of(fit)))
    }

    /// The held-out errors of the tuned model with an unnamed correction in the place of all effects.
    pub fn black_box(&self, search: &Search, errors: &HeldOut) -> Option<Vec<Vec<f64>>> {
        let bare = search.system.fit(&search.nuisances())?;
        let unnamed = search.case.unnamed_on(self.held, &search.system.residual(&bare));
        Some(less(&errors.retuned, &unnamed))
    }

    /// Leaves `search` where all that is taken in has proved itself and the held-out error is least; the proofs of that. Where much is left,
    /// what the search found from its other start is judged, too, and what every joint has is preferred to rarer laws.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn sift(
        &self,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Vec<Proof>>, LawError> {
        let Some(mut best) = self.sift_one(search, progress)? else { return Ok(None) };
        if self.where_much_is_left(search, (0..search.hypotheses.len()).collect())?.is_empty() {
            return Ok(Some(best.restore(search)));
        }
        if search.turn_to_runner_up().unwrap_or(false) {
            progress("judging what was found from the other start");
            if let Some(second) = self.sift_one(search, progress)? {
                let is_better = second.size < best.size - self.least_less();
                let (first, other) = if is_better { (second, best) } else { (best, second) };
                best = self.crossed(first, &other.standing, search, progress)?;
            }
        }
        let plain = self.plainer(best, search, progress)?;
        Ok(Some(self.without_idle(plain, search, progress)?.restore(search)))
    }

    /// Moves the shapes of all but the hypotheses `known` off their grid, if held-out data don't lose by it; whether any was moved.
    ///
    /// # Errors
    /// See [`LawError`].
    fn refine_others(&self, known: &[usize], search: &mut Search<'a, 'b>) -> Result<bool, LawError> {
        let size_of = |trials: &[Trial]| size(trials, None);
        let (standing, before) = (search.standing(), self.tried(search, size_of)?);
        let moved = search.refine_others(known) == Some(true) && search.settle().is_some();
        if moved
            && search.chosen.len() == standing.len()
            && let (Some(before), Some(after)) = (before, self.tried(search, size_of)?)
            && after < before + self.least_less()
        {
            return Ok(true);
        }
        search.go_back(standing);
        Ok(false)
    }

    /// Puts special cases in the place of laws, and one effect in the place of two, where that says as much of the data of the fit and not clearly less of
    /// the held-out data; the proofs of what `search` then has, which were `proofs`. Shapes of all but the hypotheses `known` are moved off their
    /// grid first.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn simplify(
        &self,
        proofs: Vec<Proof>,
        known: &[usize],
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Vec<Proof>>, LawError> {
        let size_of = |trials: &[Trial]| size(trials, None);
        let (mut index, mut has_moved) = (0, self.refine_others(known, search)?);
        while index < search.chosen.len() {
            let (standing, before) = (search.standing(), self.tried(search, size_of)?);
            let mut said = Vec::new();
            let moved = search.simplify_at(index, &mut |words| said.push(words.to_owned()));
            if moved == Some(true)
                && let (Some(before), Some(after)) = (before, self.tried(search, size_of)?)
                && after < before + self.least_less()
            {
                said.iter().for_each(|words| progress(words));
                has_moved = true;
            } else {
                search.go_back(standing);
                index += 1;
            }
        }
        if !has_moved {
            return Ok(Some(proofs));
        }
        self.tried(search, |trials| {
            (0..search.chosen.len()).map(|index| proof(trials, index, self.seed)).collect()
        })
    }

    /// By how much something has to leave less, in the mean of the logarithms over all channels, to take the place of something else.
    pub(super) fn least_less(&self) -> f64 {
        LEAST_LESS / self.held.per_stage().max(1) as f64
    }

    /// Whether the machine follows the law of the effect number `index` of `search` on the held-out data.
    pub(super) fn is_followed(&self, search: &Search<'a, 'b>, index: usize) -> Result<bool, LawError> {
        let trial = Trial::new(search, self.held, &self.system, &self.floor.tuned_there)?;
        Ok(trial.and_then(|trial| trial.is_followed(index)) == Some(true))
    }

    /// Those of `hypotheses` that show where far more than noise is left of the held-out data.
    pub(super) fn where_much_is_left(
        &self,
        search: &Search<'a, 'b>,
        hypotheses: Vec<usize>,
    ) -> Result<Vec<usize>, LawError> {
        self.where_is_left(FAR, search, hypotheses)
    }

    /// Those of `hypotheses` that show where more than `times` the noise is left of the held-out data.
    pub(super) fn where_is_left(
        &self,
        times: f64,
        search: &Search<'a, 'b>,
        hypotheses: Vec<usize>,
    ) -> Result<Vec<usize>, LawError> {
        let Some(trial) = Trial::new(search, self.held, &self.system, &self.floor.tuned_there)? else {
            return Ok(Vec::new());
        };
        let errors = trial.into_errors();
        let left = self.held.rms(&errors.tuned_after);
        let is_left = |c: usize| left[c % left.len()] > times * self.floor.tuned_there[c % left.len()];
        let shows = |&hypothesis: &usize| search.hypotheses[hypothesis].channels().any(is_left);
        Ok(hypotheses.into_iter().filter(shows).collect())
    }

    /// What `ask` says of the trials of what `search` has chosen, that of the fit first.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if the fit is singular, or if `ask` says so.
    pub(super) fn tried<T>(
        &self,
        search: &Search<'a, 'b>,
        ask: impl Fn(&[Trial]) -> Option<T>,
    ) -> Result<Option<T>, LawError> {
        let turned = |(turn, [fitted, _]): &(&'b Turn<'a>, [System; 2])| search.laid_on(&turn.fitted, fitted);
        let others: Vec<Search> = self.turns.iter().map(turned).collect::<Result<_, _>>()?;
        let Some(first) = Trial::new(search, self.held, &self.system, &self.floor.tuned_there)? else {
            return Ok(None);
        };
        let mut trials = vec![first];
        for (search, (turn, [_, held])) in others.iter().zip(&self.turns) {
            trials.extend(Trial::new(search, &turn.held, held, &self.floor.tuned_there)?);
        }
        Ok(ask(&trials))
    }

    /// Gain over all `channels` (numbers within a stage) of `after` against `before`.
    pub fn gain(&self, search: &Search, channels: &[usize], before: &[Vec<f64>], after: &[Vec<f64>]) -> Gain {
        let (channels, weights) = (self.held.all_of(channels), self.held.weights_as(&search.system.weights));
        gain(&[Compared { case: self.held, channels, weights, before, after }], self.seed)
    }

    /// What an unnamed correction takes away of what `fit` leaves after naming, on held-out data: share of the error.
    pub fn unnamed_rest(&self, search: &Search, fit: &Fit, errors: &HeldOut, channels: &[usize]) -> Gain {
        let unnamed = search.case.unnamed_on(self.held, &search.system.residual(fit));
        let after = less(&errors.tuned_after, &unnamed);
        self.gain(search, channels, &errors.tuned_after, &after)
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
        for (index, chosen) in search.chosen.iter().enumerate() {
            let columns = search.hypotheses[chosen.hypothesis].columns_on(self.held)?;
            for (column, eta) in columns.iter().zip(search.coefficients(&fit, index)) {
                subtract(&mut with, column, eta);
            }
        }
        let all: Vec<usize> = (0..self.system.base.len()).collect();
        let tuned = |target: &[Vec<f64>]| {
            let mut system = self.system.with_other_target(target);
            system.weights = self.held.weights_as(&search.system.weights);
            Some(system.residual(&system.fit(&all)?))
        };
        Ok(tuned(&without).zip(tuned(&with)).map(|(without, with)| [without, with]))
    }
}

/// Mean of the sizes of `trials` without the effect number `left_out`.
pub(super) fn size(trials: &[Trial], left_out: Option<usize>) -> Option<f64> {
    let sizes: Vec<f64> = trials.iter().map(|trial| trial.size(left_out)).collect::<Option<_>>()?;
    Some(sizes.iter().sum::<f64>() / sizes.len().max(1) as f64)
}
