//! The choice between the best few answers by evidence: the likelihood of the choice part decides.

use crate::data::parts::Part;
use crate::search::moves::{EffectSet, Search};
use crate::statistics::STRONG;

/// Among the answers whose log evidence is within [`STRONG`] of the best, the one under which the choice part is most probable; the function leaves the system
/// with that answer's discrepancies. `None` if the system is singular.
pub(crate) fn choose(search: &mut Search) -> Option<EffectSet> {
    let best = search.visited.first()?.evidence;
    let as_good: Vec<EffectSet> =
        search.visited.iter().filter(|answer| answer.evidence > best - STRONG).cloned().collect();
    let mut chosen: Option<(f64, EffectSet)> = None;
    for answer in as_good {
        search.restore(&answer)?;
        let score = score(search, &answer)?;
        if chosen.as_ref().is_none_or(|(known, _)| score > *known) {
            chosen = Some((score, answer));
        }
    }
    let (_, answer) = chosen?;
    search.restore(&answer)?;
    Some(answer)
}

/// Log of the likelihood of the choice part under `answer`, plus the log of its evidence.
fn score(search: &Search, answer: &EffectSet) -> Option<f64> {
    let fit = search.system.fit(&answer.members)?;
    let residual = search.system.residual(&fit);
    let choice = search.system.weights.on(search.system.data, &[Part::Choice]);
    Some(choice.score(&residual) + answer.evidence)
}
