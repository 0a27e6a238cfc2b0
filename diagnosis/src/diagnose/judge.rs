//! What the search found, judged on held-out data: an effect that does not make the model better there is no finding.
//!
//! Of an only recording each part is held out in turn (Stone 1974): a joint that hardly turns in the last of them is judged by the others.

use freeplay_laws::{LawError, Placed};

use super::case::Case;
use super::engine::DiagnoseSettings;
use super::floor::HeldFloor;
use super::search::{Search, Standing, TOLD_APART};
use super::show::{Compared, Gain, HeldOut, gain};
use super::system::{Fit, System, less, subtract};
use super::trial::{Proof, Trial, proof};
use super::validate::{Validation, is_plain};

/// How often the search goes on after effects did not prove themselves.
const RENEWALS: usize = 4;
/// Least share of the error that an effect takes away beside the others, which the cross-validation has passed.
const LEAST_HELD_OUT: f64 = 0.08;

/// The same where far more than noise is left, if the interval of that share is above zero.
const LEAST_OF_MUCH: f64 = 0.03;

/// Share of the error of the data of the fit, each part foretold from the others, that an effect takes away which held-out data may leave open.
const LEAST_FORETOLD: f64 = 0.3;

/// The same of an effect that held-out data can't show, as a push: any leavings can be had a little smaller by one at the right moment.
const LEAST_ON_FIT: f64 = 0.25;

/// By which share of the error of one channel something else has to leave less to take the place of an effect.
const LEAST_LESS: f64 = 0.05;

/// By which share of the error of one channel the data of the fit may be foretold worse with that.
const MOST_LOST: f64 = 0.1;

/// From how many times the noise on what is left of a channel shows that the model is wrong there.
const FAR: f64 = 3.0;

/// Another parting of the only recording.
pub(crate) struct Turn<'a> {
    /// What is fitted.
    pub fitted: Case<'a>,
    /// What is held out.
    pub held: Case<'a>,
}

/// Which of several effects that don't prove themselves goes first.
#[derive(Clone, Copy)]
enum Order {
    /// The one that brings least where it shows.
    WeakestFirst,
    /// The one without which the errors of all channels are least: what brings least itself may only suffer from that one.
    LeastMissedFirst,
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

    /// Drops effects that don't prove themselves and searches for others in their place, a few times, then for what leaves less.
    fn sift_one(
        &self,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Sifted>, LawError> {
        let mut best: Option<Sifted> = None;
        for renewal in 0..=RENEWALS {
            let before = search.chosen.len();
            self.confine(search)?;
            let Some(sifted) = self.drop_unproven(search, progress)? else { return Ok(None) };
            let is_last = sifted.proofs.len() == before || renewal == RENEWALS;
            best = Some(sifted.or_smaller(best));
            if is_last {
                break;
            }
            if search.improve_validated(progress).is_none() {
                return Ok(None);
            }
        }
        let Some(mut best) = best else { return Ok(None) };
        let (mut place, mut in_vain) = (0, 0);
        while !best.proofs.is_empty() && in_vain <= best.proofs.len() {
            search.go_back(best.standing.clone());
            let better = self.better(&best, place, search, progress)?;
            in_vain = if better.is_some() { 0 } else { in_vain + 1 };
            best = better.unwrap_or(best);
            place = (place + 1) % (best.proofs.len() + 1);
        }
        search.go_back(best.standing.clone());
        best = self.decided(best, search, progress)?;
        self.together(best, search, progress)
    }

    /// Confines what happens at a time to one recording where it is plain there and leaves less of the held-out data so.
    fn confine(&self, search: &mut Search<'a, 'b>) -> Result<(), LawError> {
        for index in 0..search.chosen.len() {
            let (standing, size_of) = (search.standing(), |trials: &[Trial]| size(trials, None));
            let everywhere = self.tried(search, size_of)?;
            if search.confine(index)
                && !(is_plain(search, index) == Some(true) && self.tried(search, size_of)? < everywhere)
            {
                search.go_back(standing);
            }
        }
        Ok(())
    }

    /// `best`, where `search` stands, without what makes the model worse as soon as all laws act at once, as in an arm file: a limit of a drive that was
    /// fitted to what the model alone asks for clips what the other laws say, too.
    fn together(
        &self,
        mut best: Sifted,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Sifted>, LawError> {
        while let Some(index) = self.in_the_way(search)? {
            progress(&format!("{} makes the whole model worse", search.in_words(index)));
            search.veto(index);
            if search.settle().is_none() {
                return Ok(None);
            }
            let Some(sifted) = self.drop_unproven(search, progress)? else { return Ok(None) };
            best = sifted;
        }
        Ok(Some(best))
    }

    /// The effect on a measurement without which all laws at once leave less of the held-out channels in which it shows.
    fn in_the_way(&self, search: &Search<'a, 'b>) -> Result<Option<usize>, LawError> {
        let arm = self.held.stages[0].arm();
        let Some(fit) = search.system.fit(&search.active(None)) else { return Ok(None) };
        let chosen = 0..search.chosen.len();
        let placed: Option<Vec<Placed>> =
            chosen.map(|index| search.named(index).placed(arm, &search.coefficients(&fit, index))).collect();
        let Some(placed) = placed else { return Ok(None) };
        if placed.len() < 2 || !placed.iter().any(|placed| placed.effect.measures()) {
            return Ok(None);
        }
        let all: Vec<&Placed> = placed.iter().collect();
        let with = self.held.left_with(&all)?;
        let weights = self.held.weights_as(&search.system.weights);
        for index in (0..placed.len()).filter(|&index| placed[index].effect.measures()) {
            let mut others = all.clone();
            others.remove(index);
            let without = self.held.left_with(&others)?;
            let here: Vec<usize> =
                search.named(index).channels().map(|c| c % self.held.per_stage()).collect();
            let left = |rows: &[Vec<f64>]| -> f64 {
                let counted = |c: usize| self.held.kept[c].iter().zip(&rows[c]).map(|(kept, x)| kept * x * x);
                self.held.all_of(&here).into_iter().map(|c| weights[c] * counted(c).sum::<f64>()).sum()
            };
            if left(&with) > left(&without) {
                return Ok(Some(index));
            }
        }
        Ok(None)
    }

    /// `best`, where `search` stands, with what says as much where it was fitted, and surely more of held-out data, in the place of each effect.
    fn decided(
        &self,
        mut best: Sifted,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Sifted, LawError> {
        for index in 0..best.proofs.len() {
            let rivals = self.rivals(search, index)?;
            let Some(rival) = rivals.first().filter(|rival| rival.behind < -TOLD_APART) else { continue };
            let is_richer = search.hypotheses[rival.hypothesis].contains(search.named(index));
            if is_richer && self.is_followed(search, index)? {
                continue;
            }
            let was = search.in_words(index);
            if search.put(index, &[rival.hypothesis]).is_some()
                && let Some(sifted) = self.drop_unproven(search, progress)?
                && sifted.proofs.len() == best.proofs.len()
            {
                progress(&format!("held-out data decide for {} against {was}", search.in_words(index)));
                best = sifted;
            }
            search.go_back(best.standing.clone());
        }
        Ok(best)
    }

    /// What leaves less of the held-out data than `best`, where `search` stands: with something that explains nearly as much in the place of
    /// the effect number `place`; behind the last, with friction or an offset that sits on every joint of a real machine, or all of these that one
    /// joint lacks, beside the others, if the data of the fit say something of it, too. What these foretell clearly worse does not come in.
    fn better(
        &self,
        best: &Sifted,
        place: usize,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Sifted>, LawError> {
        let is_further = place == best.proofs.len();
        let candidates = if is_further { search.usual_left() } else { search.rivals_of(place) };
        let mut candidates = self.where_much_is_left(search, candidates)?;
        if !is_further && self.is_followed(search, place)? {
            candidates.retain(|&one| !search.hypotheses[one].contains(search.named(place)));
        }
        let together = if is_further { search.by_joint(&candidates) } else { Vec::new() };
        let most = best.size - self.least_less();
        let before = foretold(search);
        let mut smallest: Option<(f64, Vec<usize>)> = None;
        for hypotheses in candidates.into_iter().map(|one| vec![one]).chain(together) {
            search.go_back(best.standing.clone());
            let is_idle = |search: &Search| search.chosen.get(place).is_none_or(|it| it.gain < TOLD_APART);
            if search.put(place, &hypotheses).is_none() || is_further && is_idle(search) {
                continue;
            }
            let Some(size) = self.tried(search, |trials| size(trials, None))? else { continue };
            let lost = before.zip(foretold(search)).map_or(0.0, |(before, now)| now - before);
            let is_borne_out = lost < MOST_LOST / self.held.per_stage().max(1) as f64;
            if is_borne_out && size < most && smallest.as_ref().is_none_or(|(least, _)| size < *least) {
                smallest = Some((size, hypotheses));
            }
        }
        let Some((_, hypotheses)) = smallest else { return Ok(None) };
        search.go_back(best.standing.clone());
        let was = (!is_further).then(|| search.in_words(place));
        if search.put(place, &hypotheses).is_none() {
            return Ok(None);
        }
        let sifted = self.drop_unproven(search, progress)?.filter(|sifted| sifted.size < most);
        if sifted.is_some() {
            let words: Vec<String> = hypotheses.iter().map(|one| search.hypothesis_in_words(*one)).collect();
            let of_whom = was.map_or_else(|| "without".to_owned(), |was| format!("with {was} in its place"));
            progress(&format!(
                "{} leaves less of the held-out data than is left {of_whom}",
                words.join(", ")
            ));
        }
        Ok(sifted)
    }

    /// Whether the machine follows the law of the effect number `index` of `search` on the held-out data.
    fn is_followed(&self, search: &Search<'a, 'b>, index: usize) -> Result<bool, LawError> {
        let trial = Trial::new(search, self.held, &self.system, &self.floor.tuned_there)?;
        Ok(trial.and_then(|trial| trial.is_followed(index)) == Some(true))
    }

    /// Those of `hypotheses` that show where far more than noise is left of the held-out data.
    fn where_much_is_left(
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

    /// Drops effects that don't prove themselves, in that of two orders which leaves the smaller errors.
    pub(super) fn drop_unproven(
        &self,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Sifted>, LawError> {
        let all = search.standing();
        let Some((weakest_first, has_choice)) = self.drop_in(Order::WeakestFirst, search, progress)? else {
            return Ok(None);
        };
        if !has_choice {
            return Ok(Some(weakest_first));
        }
        search.go_back(all);
        let least_missed_first = self.drop_in(Order::LeastMissedFirst, search, progress)?;
        let Some((least_missed_first, _)) = least_missed_first else { return Ok(None) };
        let smaller = least_missed_first.or_smaller(Some(weakest_first));
        search.go_back(smaller.standing.clone());
        Ok(Some(smaller))
    }

    /// Drops effects that don't prove themselves, one after another: without it the others may. Whether there ever was one more than that
    /// which was dropped.
    fn drop_in(
        &self,
        order: Order,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<(Sifted, bool)>, LawError> {
        let mut has_choice = false;
        loop {
            let judged = self.tried(search, |trials| {
                let chosen = 0..search.chosen.len();
                let proofs: Vec<Proof> =
                    chosen.map(|index| proof(trials, index, self.seed)).collect::<Option<_>>()?;
                let mut dropped: Option<(f64, usize)> = None;
                let validation = Validation::of(search)?;
                let stands = |index: usize| {
                    is_proven(&proofs[index], trials) || is_borne_out(&proofs[index], validation.gain(index))
                };
                let unproven: Vec<usize> = (0..proofs.len()).filter(|&index| !stands(index)).collect();
                for &index in &unproven {
                    let worth = match order {
                        Order::WeakestFirst => proofs[index].gain.value,
                        Order::LeastMissedFirst => size(trials, Some(index))?,
                    };
                    if dropped.is_none_or(|(least, _)| worth < least) {
                        dropped = Some((worth, index));
                    }
                }
                Some((proofs, dropped, size(trials, None)?, unproven.len() > 1))
            })?;
            let Some((proofs, dropped, size, are_more)) = judged else { return Ok(None) };
            let Some((_, index)) = dropped else {
                return Ok(Some((Sifted { size, standing: search.standing(), proofs }, has_choice)));
            };
            has_choice |= are_more;
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

/// Whether an effect proves itself with that: it takes away enough of the error, or surely some of a large one.
fn is_proven(proof: &Proof, trials: &[Trial]) -> bool {
    if !proof.held_out {
        return proof.gain.value >= LEAST_ON_FIT;
    }
    let is_far = || trials.iter().any(|trial| trial.is_left(&proof.channels, FAR));
    let surely = proof.gain.value >= LEAST_OF_MUCH && proof.gain.ci95[0] > 0.0;
    proof.gain.value >= LEAST_HELD_OUT || surely && is_far()
}

/// Whether held-out data leave an effect open that the data of the fit bear out, part by part foretold from the others: a stretch in which a joint
/// turns one way only can't tell friction from an offset, and is no case against either.
fn is_borne_out(proof: &Proof, foretold: Option<f64>) -> bool {
    proof.held_out
        && proof.gain.ci95[1] > LEAST_HELD_OUT
        && foretold.is_some_and(|gain| gain > LEAST_FORETOLD)
}

/// How large the errors of the data of the fit are where each part is foretold from the others: the mean logarithm over the channels.
fn foretold(search: &Search) -> Option<f64> {
    let channels = search.case.kept.len().max(1) as f64;
    Validation::of(search).map(|validation| validation.size() / channels)
}

/// Mean of the sizes of `trials` without the effect number `left_out`.
pub(super) fn size(trials: &[Trial], left_out: Option<usize>) -> Option<f64> {
    let sizes: Vec<f64> = trials.iter().map(|trial| trial.size(left_out)).collect::<Option<_>>()?;
    Some(sizes.iter().sum::<f64>() / sizes.len().max(1) as f64)
}
