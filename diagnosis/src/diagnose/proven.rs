//! Which effects prove themselves: what takes nothing away of data that it was not fitted to is no finding.

use freeplay_laws::LawError;

use super::judge::{FAR, Judge, Sifted, size};
use super::search::Search;
use super::trial::{Proof, Trial, channels_of, proof};
use super::validate::Validation;

/// Least share of the error that an effect takes away beside the others, which the cross-validation has passed.
const LEAST_HELD_OUT: f64 = 0.08;

/// The same where far more than noise is left, if the interval of that share is above zero.
const LEAST_OF_MUCH: f64 = 0.03;

/// Share of the error of the data of the fit, each part foretold from the others, that an effect takes away which held-out data may leave open.
const LEAST_FORETOLD: f64 = 0.3;

/// The same of an effect that held-out data can't show, as a push: any leavings can be had a little smaller by one at the right moment.
const LEAST_ON_FIT: f64 = 0.25;

/// Which of several effects that don't prove themselves goes first.
#[derive(Clone, Copy)]
enum Order {
    /// The one that brings least where it shows.
    WeakestFirst,
    /// The one without which the errors of all channels are least: what brings least itself may only suffer from that one.
    LeastMissedFirst,
}

impl<'a, 'b> Judge<'a, 'b> {
    /// `proofs`, those of what `search` has; none, and nothing taken in, if all of it together does not surely leave less of the held-out data: what
    /// proved itself in some parting of the recordings may still be a likeness.
    ///
    /// # Errors
    /// See [`LawError`]; `None` if a fit is singular.
    pub fn surely(
        &self,
        proofs: Vec<Proof>,
        search: &mut Search<'a, 'b>,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Option<Vec<Proof>>, LawError> {
        if proofs.is_empty() || proofs.iter().any(|proof| !proof.held_out) {
            return Ok(Some(proofs));
        }
        let Some(fit) = search.system.fit(&search.active(None)) else { return Ok(None) };
        let Some(errors) = self.errors(search, &fit)? else { return Ok(None) };
        let gain = self.gain(search, &channels_of(&proofs), &errors.retuned, &errors.tuned_after);
        if gain.ci95[0] > 0.0 {
            return Ok(Some(proofs));
        }
        let [low, high] = gain.ci95.map(|share| 100.0 * share);
        progress(&format!(
            "all of it takes nothing away for sure: {low:.0} to {high:.0} % of the held-out error"
        ));
        search.chosen.clear();
        Ok(search.settle().map(|()| Vec::new()))
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
