//! What else could stand in the place of what was named: by the data of the fit, and where these leave it open by held-out data.

use std::collections::BTreeMap;

use freeplay_laws::LawError;

use super::case::{Case, Weighing};
use super::conclude::Conclusion;
use super::hypothesis::Hypothesis;
use super::judge::Judge;
use super::report::Alternative;
use super::search::{Search, TOLD_APART};
use super::show::{Compared, stability};
use super::system::{Fit, Score};
use super::trial::errors_by;
use super::words;

/// Most alternatives that are listed.
const ALTERNATIVES: usize = 6;
/// Rivals that explain less than this share of what an effect does are not asked for in bootstraps.
const ASKED: f64 = 0.5;
/// Share of bootstraps in which an effect has to leave less than another to be told from it.
const STABLE: f64 = 0.8;
/// Twice the log of the odds up to which held-out data have a say.
const CLOSE: f64 = 3.0 * TOLD_APART;

/// What could stand in the place of an effect.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rival {
    /// Which hypothesis.
    pub hypothesis: usize,
    /// How far its merit is behind, as a share of the effect's.
    pub less: f64,
    /// Twice the log of the odds against it, by all data.
    pub behind: f64,
    /// The same by the data of the fit alone.
    pub by_fit: f64,
}

/// The effects of `search` with one of them to be replaced.
struct Contest<'s, 'a, 'b> {
    search: &'s Search<'a, 'b>,
    index: usize,
    /// Without it.
    without: Fit,
    /// With all.
    all: Fit,
    /// How the channels weigh with all.
    weighing: Weighing,
}

impl<'s, 'a, 'b> Contest<'s, 'a, 'b> {
    fn new(search: &'s Search<'a, 'b>, index: usize) -> Option<Self> {
        let fit = |but| search.system.fit(&search.active(but));
        let (without, all) = (fit(Some(index))?, fit(None)?);
        let weighing = search.case.weigh(&search.system.residual(&all));
        Some(Self { search, index, without, all, weighing })
    }

    /// Whether the hypothesis may stand there at all.
    fn admits(&self, other: &Hypothesis) -> bool {
        let (search, named) = (self.search, self.search.named(self.index));
        let refuted = search.vetoed.contains(&(other.kind.name, other.joint));
        // What has a name keeps it beside what has none, unless that explains more.
        let nameless = !other.kind.is_catalogued();
        !(search.is_taken(other, None)
            || refuted
            || nameless
            || !other.meets(named)
            || named.contains(other)
            || other.contains(named))
    }

    /// The strongest shape of each kind at each place, with what it explains there. What it explains beside the effect is no reason to
    /// put it in that one's place.
    fn strongest(&self) -> Vec<(usize, f64)> {
        let (search, system) = (self.search, &self.search.system);
        let mut best: BTreeMap<(&str, Option<usize>), (f64, usize)> = BTreeMap::new();
        let admitted: Vec<usize> =
            (0..search.hypotheses.len()).filter(|&at| self.admits(&search.hypotheses[at])).collect();
        let blocks: Vec<_> = admitted.iter().map(|&at| &search.hypotheses[at].block).collect();
        let [scores, beside] = [&self.without, &self.all].map(|fit| system.scores(fit, &blocks));
        for ((at, score), beside) in admitted.into_iter().zip(scores).zip(beside) {
            let other = &search.hypotheses[at];
            let Some(score) = score.filter(|score| other.is_physical(score)) else { continue };
            let beside = beside.map_or(0.0, |score| score.gain);
            let merit = search.merit(other, score.gain - beside, &self.weighing);
            let entry = best.entry((other.kind.name, other.joint)).or_insert((merit, at));
            if merit > entry.0 {
                *entry = (merit, at);
            }
        }
        let exact = |at: usize| {
            let other = &search.hypotheses[at];
            let beside = system.exact_score(&self.all, &other.block).map_or(0.0, |score| score.gain);
            let score = system.exact_score(&self.without, &other.block);
            let gain =
                score.filter(|score| other.is_physical(score)).map_or(0.0, |score| score.gain - beside);
            search.merit(other, gain, &self.weighing)
        };
        best.into_values().map(|(_, at)| (at, exact(at))).collect()
    }

    /// What is left of the data of the fit with `one` in the place of the effect; `None` if a fit is singular.
    fn left_with(&self, one: &Hypothesis) -> Option<Vec<Vec<f64>>> {
        let system = &self.search.system;
        let score = system.exact_score(&self.without, &one.block)?;
        Some(system.residual_with(&self.without, &one.block, &score))
    }

    /// In which share of bootstraps the effect leaves less of the data of the fit than `hypothesis` in its place, further numbers counted.
    fn stability(&self, hypothesis: usize, seed: u64) -> Option<f64> {
        let search = self.search;
        let pair = [search.named(self.index), &search.hypotheses[hypothesis]];
        let [after, before] = pair.map(|one| self.left_with(one));
        let [price, others] = pair.map(|one| search.cost(one, &self.weighing));
        let mut channels: Vec<usize> = pair.iter().flat_map(|one| one.channels()).collect();
        channels.sort_unstable();
        channels.dedup();
        let weights = search.system.weights.clone();
        let compared = Compared { case: search.case, channels, weights, before: &before?, after: &after? };
        Some(stability(&compared, price - others, seed))
    }

    /// What the effect in dispute is worth.
    fn merit(&self) -> f64 {
        let search = self.search;
        search.merit(search.named(self.index), search.chosen[self.index].gain, &self.weighing)
    }
}

impl Judge<'_, '_> {
    /// What could stand in the place of the effect number `index` of `search`, the closest first.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn rivals(&self, search: &Search, index: usize) -> Result<Vec<Rival>, LawError> {
        let Some(contest) = Contest::new(search, index) else { return Ok(Vec::new()) };
        let merit = contest.merit();
        let mut rivals = Vec::new();
        for (hypothesis, others) in contest.strongest() {
            let by_fit = merit - others;
            let held_out = if by_fit < CLOSE { self.against(&contest, hypothesis)? } else { 0.0 };
            let less = by_fit / merit.max(f64::MIN_POSITIVE);
            rivals.push(Rival { hypothesis, less, behind: by_fit + held_out, by_fit });
        }
        rivals.sort_by(|a, b| a.behind.total_cmp(&b.behind));
        Ok(rivals)
    }

    /// Twice the log of the odds of held-out data against `hypothesis` in the place of the effect: by how much more it leaves of the
    /// channels in which either shows, over how much more is left there than where both were fitted.
    fn against(&self, contest: &Contest, hypothesis: usize) -> Result<f64, LawError> {
        let Contest { search, index, without, .. } = contest;
        let pair = [search.named(*index), &search.hypotheses[hypothesis]];
        let shows = |c: usize| pair.iter().any(|one| one.channels().any(|other| other == c));
        let weighed = |rows: &[Vec<f64>], weights: &[f64], shows: &dyn Fn(usize) -> bool| -> f64 {
            let square = |c: usize| weights[c] * rows[c].iter().map(|x| x * x).sum::<f64>();
            (0..rows.len()).filter(|&c| shows(c)).map(square).sum()
        };
        let weights = self.held.weights_as(&search.system.weights);
        let shows_held = |c: usize| shows(c % self.held.per_stage());
        let (mut fitted, mut held) = (Vec::new(), Vec::new());
        for one in pair {
            let Some(score) = search.system.exact_score(without, &one.block) else { return Ok(0.0) };
            let rows = search.system.residual_with(without, &one.block, &score);
            fitted.push(weighed(&rows, &search.system.weights, &shows));
            held.push(weighed(&self.left_with(contest, one, &score)?, &weights, &shows_held));
        }
        let count = |case: &Case, shows: &dyn Fn(usize) -> bool| -> f64 {
            case.rows().iter().enumerate().filter(|(c, _)| shows(*c)).map(|(_, rows)| rows).sum()
        };
        let fitted = fitted[0].min(fitted[1]) / count(search.case, &shows).max(1.0);
        let there = held[0].min(held[1]) / count(self.held, &shows_held).max(1.0);
        Ok((held[1] - held[0]) / (there / fitted.max(f64::MIN_POSITIVE)).max(1.0))
    }

    /// What `one` leaves of the held-out data in the place of the effect, with the coefficients that `score` gives all.
    fn left_with(
        &self,
        contest: &Contest,
        one: &Hypothesis,
        score: &Score,
    ) -> Result<Vec<Vec<f64>>, LawError> {
        let Contest { search, index, without, .. } = contest;
        let eta = score.shift.as_ref().map_or_else(|| without.eta.clone(), |shift| &without.eta + shift);
        let (nuisances, others) = eta.as_slice().split_at(search.nuisances().len());
        let beside = (0..search.chosen.len()).filter(|other| other != index).map(|other| search.named(other));
        let laid = beside.chain([one]).map(|effect| effect.columns_on(self.held));
        let laid = laid.collect::<Result<Vec<_>, _>>()?;
        let columns = laid.iter().flat_map(|columns| columns.iter());
        let effects: Vec<_> = columns.zip(others.iter().chain(&score.beta).copied()).collect();
        Ok(errors_by(&search.system, [nuisances; 2], &effects, self.held, &self.system).tuned_after)
    }
}

impl Conclusion<'_, '_, '_> {
    /// What else could stand in the place of each named effect, the closest first; and in which share of bootstraps each effect leaves less than
    /// any of that.
    ///
    /// # Errors
    /// See [`LawError`].
    pub(super) fn alternatives(&self) -> Result<(Vec<Alternative>, Vec<f64>), LawError> {
        let search = self.search;
        let (mut all, mut stabilities) = (Vec::new(), Vec::new());
        for index in 0..search.chosen.len() {
            let named = search.named(index);
            let contest = Contest::new(search, index);
            let mut least = 1.0_f64;
            let instead_of =
                format!("{} {}", named.kind.name, words::site(self.joint_name(named.joint).as_deref()));
            for rival in self.judge.rivals(search, index)? {
                let other = &search.hypotheses[rival.hypothesis];
                let asked = contest.as_ref().filter(|_| rival.less < ASKED);
                let stable =
                    asked.and_then(|contest| contest.stability(rival.hypothesis, self.settings.seed));
                least = least.min(stable.unwrap_or(1.0));
                let is_unstable = stable.is_some_and(|stable| stable < STABLE) && rival.behind < CLOSE;
                let indistinguishable = rival.behind < TOLD_APART || is_unstable;
                let why_not = if indistinguishable {
                    "says it as well in this motion".to_owned()
                } else if rival.by_fit < TOLD_APART {
                    "says it as well where it was fitted, and less well of held-out data".to_owned()
                } else {
                    format!("explains {:.0} % less", (100.0 * rival.less).clamp(0.0, 100.0))
                };
                all.push(Alternative {
                    kind: other.kind.name,
                    joint: self.joint_name(other.joint),
                    instead_of: instead_of.clone(),
                    why_not,
                    indistinguishable,
                    what_would_separate: separates(named, other),
                    log_odds_against: 0.5 * rival.behind,
                });
            }
            stabilities.push(least);
        }
        all.sort_by(|a, b| a.log_odds_against.total_cmp(&b.log_odds_against));
        let sure = all.iter().filter(|alternative| alternative.indistinguishable).count();
        all.truncate(sure.max(ALTERNATIVES));
        Ok((all, stabilities))
    }
}

/// What separates two kinds, by the catalogue.
fn separates(named: &Hypothesis, other: &Hypothesis) -> String {
    if named.kind.name == other.kind.name {
        return "a motion in which the two joints do not move alike".to_owned();
    }
    let of = |a: &Hypothesis, b: &Hypothesis| {
        a.kind
            .confounders
            .iter()
            .find(|(kind, _)| *kind == b.kind.name)
            .map(|(_, how)| format!("{} {how}", b.kind.title))
    };
    of(named, other)
        .or_else(|| of(other, named))
        .unwrap_or_else(|| "a motion that varies speed, load and position independently".to_owned())
}
