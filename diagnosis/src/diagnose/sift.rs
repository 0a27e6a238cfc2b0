//! What is held against what was found, one effect after another: rivals, what sits on every joint, all laws at once.

use freeplay_laws::{LawError, Placed};

use super::judge::{Judge, Sifted, size};
use super::search::{Search, TOLD_APART};
use super::trial::Trial;
use super::validate::{Validation, is_plain};

/// How often the search goes on after effects did not prove themselves.
const RENEWALS: usize = 4;

/// By which share of the error of one channel the data of the fit may be foretold worse with that.
const MOST_LOST: f64 = 0.1;

impl<'a, 'b> Judge<'a, 'b> {
    /// Drops effects that don't prove themselves and searches for others in their place, a few times, then for what leaves less.
    pub(super) fn sift_one(
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
}

/// How large the errors of the data of the fit are where each part is foretold from the others: the mean logarithm over the channels.
fn foretold(search: &Search) -> Option<f64> {
    let channels = search.case.kept.len().max(1) as f64;
    Validation::of(search).map(|validation| validation.size() / channels)
}
