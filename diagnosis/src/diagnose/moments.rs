//! What happens at a time: a push, a load that drops. Each recording has a clock of its own, and a repeat need not have the push.

use freeplay_laws::{Kind as EffectKind, kinds};
use toml::{Table, Value};

use super::candidate::{Candidate, Form, at_place, places};
use super::conclude::is_told;
use super::data::{Data, less, sum_of};
use super::nameless;
use super::search::Search;
use super::system::System;
use super::weights::Weights;
use super::whitening::{Wandering, Whitening};
use crate::residual::Kind;

/// The shortest push that is looked for, s, and the factor from one length to the next.
const BRIEFEST: f64 = 0.05;
const LONGER: f64 = 2.0;
/// The longest is this share of a recording: laws list those of a half.
const LONGEST: f64 = 0.25;
/// Most happenings of a recording that are looked for once all else is found.
const MOST: usize = 8;
/// Names of the numbers of a law that begins and ends.
const BEGIN: &str = "start";
const END: &str = "end";

/// The form with this `shape` in the recording number `only`.
pub(crate) fn in_one_recording(data: &Data, shape: Table, only: usize) -> Form {
    Form { only: (data.stages.len() > 1).then_some(only), ..Form::of(shape) }
}

/// From when to when what has this `shape` happens; `None` if it does not end.
pub(crate) fn window(shape: &Table) -> Option<[f64; 2]> {
    let time = |name| shape.get(name).and_then(Value::as_float);
    Some([time(BEGIN)?, time(END)?])
}

/// The shapes of a `kind` at `joint` that begins and ends in which it would act where what is `left` of the torques of the recording number
/// `index` is off most from what is left before and after.
pub(crate) fn struck(
    data: &Data,
    kind: &EffectKind,
    joint: Option<usize>,
    index: usize,
    left: &[Vec<f64>],
) -> Vec<Table> {
    if kind.parameter(END).is_none() {
        return Vec::new();
    }
    let motion = data.stages[index].motion();
    let (Some(stretch), t) = (motion.stretches.first(), &motion.t) else { return Vec::new() };
    let step = motion.step(stretch);
    let torques = torques(data, index, joint, left);
    let most = (LONGEST * t.len() as f64) as usize;
    let lengths = std::iter::successors(Some(BRIEFEST), |length| Some(LONGER * length));
    let rows = lengths.map(|length| ((length / step) as usize).max(1)).take_while(|rows| *rows <= most);
    let mut matched: Vec<(f64, [usize; 2])> = Vec::new();
    for long in rows {
        let mut said = vec![0.0; t.len().saturating_sub(long)];
        for torque in &torques {
            let of_torque = torque.matched(&torque.wandering.push(long));
            said.iter_mut().zip(of_torque).for_each(|(said, x)| *said += x * x);
        }
        matched.extend(said.into_iter().enumerate().map(|(begin, said)| (said, [begin, begin + long])));
    }
    let briefest = ((BRIEFEST / step) as usize).max(1);
    let windows = apart(matched).into_iter().chain(between_edges(&torques, t.len(), briefest));
    let shape = |[begin, end]: [usize; 2]| {
        let times = [(BEGIN, t[begin]), (END, t[end])];
        times.map(|(name, time)| (name.to_owned(), Value::from(time))).into_iter().collect()
    };
    windows.map(shape).collect()
}

/// The windows that explain most, none of which meets a better one.
fn apart(mut windows: Vec<(f64, [usize; 2])>) -> Vec<[usize; 2]> {
    windows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best: Vec<[usize; 2]> = Vec::new();
    for (_, [begin, end]) in windows {
        if best.len() == MOST {
            break;
        }
        if best.iter().all(|[from, to]| end <= *from || *to <= begin) {
            best.push([begin, end]);
        }
    }
    best
}

/// The windows of any length, begun and ended by the edges at which the `torques` of so many `rows` step most, that explain most.
fn between_edges(torques: &[Torque], rows: usize, briefest: usize) -> Vec<[usize; 2]> {
    /// Edges that are paired: both of each of the happenings that are looked for.
    const EDGES: usize = 2 * MOST;
    /// Windows that are laid out.
    const BEST: usize = 4;
    let steps: Vec<Vec<f64>> =
        torques.iter().map(|torque| torque.matched(&torque.wandering.step())).collect();
    let size = |row: usize| steps.iter().map(|of_torque| of_torque[row].powi(2)).sum::<f64>();
    let mut order: Vec<usize> = (0..rows).filter(|&row| size(row) > 0.0).collect();
    order.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    let mut edges: Vec<usize> = Vec::new();
    for row in order {
        if edges.len() < EDGES && edges.iter().all(|edge| edge.abs_diff(row) >= briefest) {
            edges.push(row);
        }
    }
    edges.sort_unstable();
    let mut windows: Vec<(f64, [usize; 2])> = Vec::new();
    for (k, &begin) in edges.iter().enumerate() {
        for &end in &edges[k + 1..] {
            // What sets in and ends by the same amount.
            let said = steps.iter().map(|of_torque| 0.5 * (of_torque[begin] - of_torque[end]).powi(2)).sum();
            windows.push((said, [begin, end]));
        }
    }
    windows.sort_by(|a, b| b.0.total_cmp(&a.0));
    windows.into_iter().take(BEST).map(|(_, window)| window).collect()
}

/// What is left of one torque, white.
struct Torque {
    wandering: Wandering,
    says: Vec<f64>,
    left: Vec<f64>,
}

impl Torque {
    /// By row, by how many deviations of the torque what is left of it goes with a `signal` that begins there: the matched filter (Turin 1960, IRE Trans. Inf. Theory
    /// 6:311), whose square is what such a signal explains.
    fn matched(&self, signal: &[f64]) -> Vec<f64> {
        let deviation = self.wandering.deviation();
        let of_row = |begin: usize| {
            let rows = self.left[begin..].iter().zip(&self.says[begin..]);
            let (product, square) = signal.iter().zip(rows).fold((0.0, 0.0), |sum, (x, (left, says))| {
                (sum.0 + says * x * left, sum.1 + says * x.powi(2))
            });
            if square > 0.0 { product / square.sqrt() / deviation } else { 0.0 }
        };
        if deviation > 0.0 { (0..self.left.len()).map(of_row).collect() } else { vec![0.0; self.left.len()] }
    }
}

/// What is `left` of the torques of the recording number `index`, or of that of `joint`.
fn torques(data: &Data, index: usize, joint: Option<usize>, left: &[Vec<f64>]) -> Vec<Torque> {
    let channels = (0..data.per_stage()).map(|c| index * data.per_stage() + c);
    let is_asked = |&c: &usize| match data.kind(c) {
        Kind::Torque(own) => joint.is_none_or(|joint| joint == own),
        Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => false,
    };
    let of_channel = |c: usize| {
        let sizes = vec![1.0; left[c].len()];
        let wandering = Wandering::of(data, c, &left[c], &sizes);
        Torque { left: wandering.rows(&left[c]), says: wandering.says().collect(), wandering }
    };
    channels.filter(is_asked).map(of_channel).collect()
}

/// What happens in the rows that are heard and is not yet in what is `left` of them, as long as each is more probable than none, and what these leave. Rows are
/// taken as they differ from their past, so that a push is not counted as if it were as slow as what else is left. The evidence is that of the diagnosis. `None` if the system is
/// singular.
pub(crate) fn happenings(
    data: &Data,
    left: Vec<Vec<f64>>,
    sizes: &Weights,
) -> Option<(Vec<Candidate>, Vec<Vec<f64>>)> {
    let whitening = Whitening::of(data, &left, sizes);
    let weights = Weights::white(data, &whitening);
    let system = System::white(data, &left, weights, whitening)?;
    let mut search = Search::new(system, Vec::new());
    let mut now = search.settled(Vec::new())?;
    let mut rest = left.clone();
    // One after the other: what is found says where the next one is.
    while now.members.len() < MOST * data.stages.len() {
        search.laid.clear();
        for kind in kinds().filter(|kind| kind.happens()) {
            for joint in places(kind, data.arm()) {
                let Ok((found, _)) = at_place(data, kind, joint, &rest) else { continue };
                let inside = found.into_iter().filter(|one| is_inside(data, one));
                let taken: Vec<usize> = inside.filter_map(|one| search.system.take(one)).collect();
                search.laid.extend(taken);
            }
        }
        let Some(better) = search.added(&now)? else { break };
        now = better;
        rest = less(&left, &said(&search, &now.members, &left)?);
    }
    let mut members = now.members;
    for place in 0..members.len() {
        // An edge that is a row off leaves what looks like another push.
        let member = members.remove(place);
        let better = search.refined(&members, member)?;
        members.insert(place, better);
    }
    let members = search.improve(members, &mut |_| {})?.members;
    let all = search.system.fit(&members)?.value;
    let odds = |member: usize| {
        let others: Vec<usize> = members.iter().copied().filter(|other| *other != member).collect();
        search.system.fit(&others).map_or(0.0, |without| all - without.value)
    };
    let is_seen = |&member: &usize| is_told(odds(member)) && is_inside(data, search.system.candidate(member));
    let sure: Vec<usize> = members.iter().copied().filter(is_seen).collect();
    let sure = beside_shapes(data, &search, sure, &left)?;
    let found = sure.iter().filter_map(|&member| {
        let candidate = search.system.candidate(member);
        let raw = candidate.reformed(data, candidate.form.clone())?;
        Some(raw.seen_with(odds(member)))
    });
    let found = found.collect();
    Some((found, less(&left, &said(&search, &sure, &left)?)))
}

/// Those of `members` that tell beside shapes of the motion without a name: what goes with the motion does not happen at a time, whether it has a name or not. `None` if the
/// system is singular.
fn beside_shapes(
    data: &Data,
    search: &Search,
    mut members: Vec<usize>,
    left: &[Vec<f64>],
) -> Option<Vec<usize>> {
    let evidence =
        |members: &[usize]| Some(nameless::evidence(data, &less(left, &said(search, members, left)?)));
    let mut all = evidence(&members)?;
    while !members.is_empty() {
        let without = |place: usize| {
            let others = [&members[..place], &members[place + 1..]].concat();
            Some((evidence(&others)?, others))
        };
        let of_others = (0..members.len()).map(without).collect::<Option<Vec<_>>>()?;
        let best = of_others.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((of_others, others)) = best.filter(|best| best.0 >= all) else { break };
        (all, members) = (of_others, others);
    }
    Some(members)
}

/// Whether what happens in the form of `candidate` begins after its recording does, and ends before, if it ends at all: what is there from the first sample on may have been
/// there for ever. What lasts for less than half a period of the low-pass's cutoff is the edge of something else (Shannon 1949).
fn is_inside(data: &Data, candidate: &Candidate) -> bool {
    let stage = &data.stages[candidate.form.only.unwrap_or(0)];
    let t = &stage.motion().t;
    let (Some([begin, end]), Some(first), Some(last)) = (window(&candidate.form.shape), t.first(), t.last())
    else {
        return true;
    };
    let edge = 0.5 / stage.ground.treatment.filter().cutoff_hz();
    begin > first + BRIEFEST && end < last - BRIEFEST && end - begin > edge
}

/// What `members` say of every row, as it is.
fn said(search: &Search, members: &[usize], rows: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let system = &search.system;
    let fit = system.fit(members)?;
    let mut columns = Vec::new();
    for (place, &member) in members.iter().enumerate() {
        let candidate = system.candidate(member);
        let raw = candidate.reformed(system.data, candidate.form.clone())?;
        columns.extend(raw.columns.iter().cloned().zip(system.coefficients(&fit, place).to_vec()));
    }
    Some(sum_of(columns.iter().map(|(column, x)| (column, *x)), rows))
}
