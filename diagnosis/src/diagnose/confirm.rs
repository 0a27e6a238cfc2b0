//! The confirmation: with more of the data the findings are refined together, others are tried in the place of each, and the search goes on from the best.

use super::alternatives::tried;
use super::search::{Answer, Search, WORTH};
use crate::statistics::MOST_ROUNDS;

/// `members` with their numbers in agreement, once nothing that is tried in the place of one of them is more probable; `None` if the system is singular.
pub(crate) fn confirmed(
    search: &mut Search,
    members: Vec<usize>,
    progress: &mut dyn FnMut(&str),
) -> Option<Answer> {
    let members = search.improve(members, progress)?.members;
    let mut now = grown(search, members, progress)?;
    while let Some(better) = with_another(search, &now, progress)? {
        now = better;
    }
    Some(now)
}

/// `now` with another in the place of one of its members, if that makes it more probable; else the search is back at `now`.
fn with_another(search: &mut Search, now: &Answer, progress: &mut dyn FnMut(&str)) -> Option<Option<Answer>> {
    let fit = search.system.held_fit(&now.members)?;
    let mut others = tried(search, &fit);
    others.retain(|other| other.against < -WORTH);
    others.sort_by(|a, b| a.against.total_cmp(&b.against));
    for other in others {
        progress("trying others in the place of each finding");
        let rest = now.members.iter().copied().filter(|member| *member != other.member);
        let there = grown(search, rest.chain([other.index]).collect(), progress)?;
        // What seemed more probable beside the others need not be, once these have followed it.
        if there.evidence > now.evidence + WORTH && !search.same_effects(&there.members, &now.members) {
            return Some(Some(there));
        }
        search.agreed(now)?;
    }
    Some(None)
}

/// `members` in their best forms, or what the search finds from there, whichever is the most probable once its numbers agree; `None` if the system is singular.
///
/// Rows count otherwise beside what was found, and other effects may be found then: the search goes on until effects come back.
fn grown(search: &mut Search, members: Vec<usize>, progress: &mut dyn FnMut(&str)) -> Option<Answer> {
    let mut last = search.polished(members)?;
    let mut met = vec![last.clone()];
    for _ in 0..MOST_ROUNDS {
        let better = search.improve(last.members, progress)?;
        last = search.agreed(&better)?;
        let comes_back = met.iter().any(|known| search.same_effects(&known.members, &last.members));
        met.push(last.clone());
        if comes_back {
            break;
        }
    }
    let best = met.into_iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence))?;
    if search.same_effects(&best.members, &last.members) { Some(last) } else { search.agreed(&best) }
}

/// The better one of `answer` and what the search finds with the fit and the choice part together, by its evidence; `None` if the system is singular.
pub(crate) fn searched_again(
    search: &mut Search,
    answer: &Answer,
    progress: &mut dyn FnMut(&str),
) -> Option<Answer> {
    search.system.trust_all()?;
    search.met.clear();
    let again = search.run(&[], progress)?;
    let again = confirmed(search, again.members, progress)?;
    search.system.trust_all()?;
    let known = search.settled(answer.members.clone())?;
    let there = search.settled(again.members.clone())?;
    let best = if there.evidence > known.evidence + WORTH { again } else { known };
    search.agreed(&best)
}
