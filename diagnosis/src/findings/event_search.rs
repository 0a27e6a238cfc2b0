//! The search for events beside the found laws, in whitened rows.

use freeplay_laws::kinds;

use crate::candidates::candidate::{Candidate, Form, at_place, places};
use crate::candidates::transients::{END, MOST, WhiteTorques, between, window};
use crate::data::columns::{add_all, less, sum_of};
use crate::data::stacked::Data;
use crate::data::weights::Weights;
use crate::data::whitening::Whitening;
use crate::evidence::gain::Compared;
use crate::evidence::nameless::{JointRange, NamelessTorques};
use crate::evidence::system::{System, all_but};
use crate::evidence::tails;
use crate::findings::alternatives::instead;
use crate::findings::event::Event;
use crate::findings::interval::{Estimate, estimates};
use crate::report::diagnosis::Alternative;
use crate::search::moves::Search;
use crate::search::tried::LISTED;
use crate::sorting::sort_rising;
use crate::statistics::{STRONG, is_strong_evidence};

/// The events in the active rows. The found laws leave the `residual`. An event must be more probable than none, and no law of `lasting` may
/// explain its rows as well. The search uses whitened rows, so that the slow drift of the other residuals does not hide a push. The evidence is that
/// of the diagnosis. `None` if the system is singular.
pub(crate) fn find_events(
    data: &Data,
    residual: &[Vec<f64>],
    lasting: &[Candidate],
    sizes: &Weights,
    seed: u64,
) -> Option<Vec<Event>> {
    // The found events are no part of the drift: the second pass whitens the rows by the residuals beside these events.
    let (search, members) = found_among(data, residual, &sizes.whitening(data, residual), Vec::new())?;
    if members.is_empty() {
        return Some(Vec::new());
    }
    let known = search.candidates(&members);
    let known = known.into_iter().filter_map(|one| one.reformed(data, one.form.clone())).collect();
    let rest = less(residual, &contribution(&search, &members, residual)?);
    let whitening = sizes.whitening(data, &rest);
    let (mut search, members) = found_among(data, residual, &whitening, known)?;
    let members = unexplained_by_laws(&mut search, members, lasting)?;
    let odds = odds(data, &mut search, &members, &whitening.least())?;
    let rest = less(residual, &contribution(&search, &members, residual)?);
    let fit = search.system.fit(&members)?;
    let estimates = estimates(&mut search.system, &fit, seed);
    let weights = sizes.by_row();
    let log_priors = log_priors(&search, &members)?;
    let mut events = Vec::new();
    for (place, (estimate, (log_odds, alternatives))) in estimates.into_iter().zip(odds).enumerate() {
        let Estimate { parameters, includes_zero } = estimate;
        if includes_zero {
            continue;
        }
        let candidate = search.system.candidate(members[place]);
        let candidate = candidate.reformed(data, candidate.form.clone())?;
        let beta = search.system.coefficients(&fit, place).to_vec();
        let mut before = rest.clone();
        add_all(&mut before, candidate.columns.iter().zip(beta.iter().copied()));
        let compared = Compared { before: &before, after: &rest, weights: &weights };
        events.push(Event {
            gain: compared.gain(data, &candidate.channels, seed)?,
            removed: compared.removed(data, &candidate.channels),
            log_prior: log_priors[place],
            log_odds,
            alternatives,
            candidate,
            beta,
            parameters,
        });
    }
    Some(events)
}

/// The search for events in the `residual`, which `whitening` makes independent, and the numbers of the found events, the `known` ones among
/// them. `None` if the system is singular.
fn found_among<'d, 'a>(
    data: &'d Data<'a>,
    residual: &[Vec<f64>],
    whitening: &Whitening,
    known: Vec<Candidate>,
) -> Option<(Search<'d, 'a>, Vec<usize>)> {
    let mut torques = WhiteTorques::new(data, whitening, residual);
    let system = System::white(data, residual, Weights::white(data, whitening), whitening.clone())?;
    let mut search = Search::new(system, Vec::new());
    let known = known.into_iter().filter_map(|one| search.system.take(one)).collect();
    let least = whitening.least();
    let members = one_by_one(data, &mut search, known, residual, &mut torques, &least)?;
    let members = certain(data, &search, members, &least)?;
    let members = unexplained_by_shapes(data, &search, members, residual)?;
    Some((search, members))
}

/// For each of `members`, the part of its log odds that does not come from the rows: the prior odds, and the volume. `None` if the system is
/// singular.
fn log_priors(search: &Search, members: &[usize]) -> Option<Vec<f64>> {
    let all = search.system.fit(members)?.log_prior;
    let of = |place: usize| Some(all - search.system.fit(&all_but(members, place))?.log_prior);
    (0..members.len()).map(of).collect()
}

/// The log odds of each of `members`, and its alternatives. `None` if the system is singular.
fn odds(
    data: &Data,
    search: &mut Search,
    members: &[usize],
    least: &[f64],
) -> Option<Vec<(f64, Vec<Alternative>)>> {
    let all = probability(data, search, members, least)?;
    let mut odds = Vec::new();
    for place in 0..members.len() {
        let others = all_but(members, place);
        let log_odds = all - probability(data, search, &others, least)?;
        let mut alternatives = Vec::new();
        for other in at_the_same_time(data, search, members[place]) {
            let with = [&others[..], &[other]].concat();
            let against = all - probability(data, search, &with, least)?;
            let [named, other] = [members[place], other].map(|index| search.system.candidate(index));
            alternatives.push(instead(data.arm(), named, other, against));
        }
        sort_rising(&mut alternatives, |other| other.log_odds_against);
        alternatives.truncate(LISTED);
        odds.push((log_odds, alternatives));
    }
    Some(odds)
}

/// Adds events to `members`, as long as each makes the `residual` more probable. The residuals beside the found events give the candidate
/// windows of the next one.
fn one_by_one(
    data: &Data,
    search: &mut Search,
    members: Vec<usize>,
    residual: &[Vec<f64>],
    torques: &mut WhiteTorques,
    least: &[f64],
) -> Option<Vec<usize>> {
    let mut now = search.with_best_shares(members)?;
    let mut probable = probability(data, search, &now.members, least)?;
    while now.members.len() < MOST * data.recordings.len() {
        torques.set(&less(residual, &contribution(search, &now.members, residual)?));
        search.available.clear();
        for kind in kinds().filter(|kind| kind.happens()) {
            for joint in places(kind, data.arm()) {
                let Ok((found, _)) = at_place(data, kind, joint, Some(torques)) else { continue };
                let inside = found.into_iter().filter(|one| is_inside(data, one));
                let taken: Vec<usize> = inside.filter_map(|one| search.system.take(one)).collect();
                search.available.extend(taken);
            }
        }
        let Some(better) = search.added(&now)? else { break };
        let more_probable = probability(data, search, &better.members, least)?;
        if more_probable <= probable {
            break;
        }
        (now, probable) = (better, more_probable);
    }
    let mut members = now.members;
    for place in 0..members.len() {
        // An edge with an error of one row leaves a residual that resembles another push.
        let member = members.remove(place);
        let better = search.refined(&members, member)?;
        let fit = search.system.fit(&members)?;
        let value = |search: &Search, index: usize| {
            let gain = search.system.gains(&fit, &[index]).pop().flatten().filter(|gain| gain.is_inside);
            gain.map_or(f64::NEG_INFINITY, |gain| gain.value)
        };
        let all = at_the_same_time(data, search, better).into_iter().chain([better]);
        let best = all.max_by(|a, b| value(search, *a).total_cmp(&value(search, *b)))?;
        let best = if best == better { best } else { search.refined(&members, best)? };
        members.insert(place, best);
    }
    // Several torques at the same time may be one force on the tool, and pieces of an event one event.
    search.available = between_edges(data, search, &members);
    for &member in &members {
        let others = at_the_same_time(data, search, member);
        search.available.extend(others);
    }
    Some(search.improve(members, &mut |_| {})?.members)
}

/// For each of `members`, the same event up to each edge of those events of its kind and place that overlap it: one event may have been found as two, the
/// second of which takes back what the first has too much.
fn between_edges(data: &Data, search: &mut Search, members: &[usize]) -> Vec<usize> {
    let mut all = Vec::new();
    for &member in members {
        let own = search.system.candidate(member).clone();
        let Some([begin, _]) = window(&own.form.shape) else { continue };
        let is_like = |other: &Candidate| other.same_effect(&own) && other.form.only == own.form.only;
        let like = members.iter().map(|&other| search.system.candidate(other)).filter(|other| is_like(other));
        let edges: Vec<f64> = like.filter_map(|other| window(&other.form.shape)).flatten().collect();
        for end in edges.into_iter().filter(|end| *end > begin) {
            let form = Form { shape: between(begin, end), ..own.form.clone() };
            let other = own.reformed(data, form).map(|other| other.with_form_count(own.forms));
            all.extend(other.and_then(|other| search.system.take(other)));
        }
    }
    all
}

/// The candidates with the same start and end as `member`.
fn at_the_same_time(data: &Data, search: &mut Search, member: usize) -> Vec<usize> {
    let own = search.system.candidate(member).clone();
    if window(&own.form.shape).is_none() {
        return Vec::new();
    }
    let mut all = Vec::new();
    for kind in kinds().filter(|kind| kind.happens() && kind.parameter(END).is_some()) {
        for joint in places(kind, data.arm()) {
            let other = Candidate::new(data, kind, joint, own.form.clone()).ok().flatten();
            let other =
                other.filter(|other| !other.same_effect(&own)).map(|other| other.with_form_count(own.forms));
            all.extend(other.and_then(|other| search.system.take(other)));
        }
    }
    all
}

/// The certain ones of `members`: without any of them the rows are less probable, even with heavier tails. A law that is wrong at some places is
/// wrong at more places than events occur.
fn certain(data: &Data, search: &Search, mut members: Vec<usize>, least: &[f64]) -> Option<Vec<usize>> {
    loop {
        let all = probability(data, search, &members, least)?;
        let mut odds = Vec::new();
        for place in 0..members.len() {
            let others = all_but(&members, place);
            let is_inside = is_inside(data, search.system.candidate(members[place]));
            let of_one =
                if is_inside { all - probability(data, search, &others, least)? } else { f64::NEG_INFINITY };
            odds.push((members[place], of_one));
        }
        let unsure =
            odds.iter().min_by(|a, b| a.1.total_cmp(&b.1)).filter(|unsure| !is_strong_evidence(unsure.1));
        let Some(&(unsure, _)) = unsure else { return Some(members) };
        members.retain(|member| *member != unsure);
    }
}

/// Log-likelihood of the white rows beside `members`, with the most probable degrees of freedom of Student's t. The instruments leave the standard
/// deviation `least` in each channel.
fn probability(data: &Data, search: &Search, members: &[usize], least: &[f64]) -> Option<f64> {
    let fit = search.system.fit(members)?;
    let residual = search.system.residual(&fit);
    let of_channel = |c: usize| {
        let weights = search.system.weights.rows[c].weights();
        let used = residual[c].iter().zip(weights).filter(|(_, weight)| *weight > 0.0);
        let used: Vec<f64> = used.map(|(x, _)| *x).collect();
        tails::log_likelihood(&used, least[c])
    };
    Some((0..data.channels()).map(of_channel).sum::<f64>() + fit.log_prior)
}

/// Those of `members` that remain probable beside shapes of the motion without a name: a torque that follows the motion is no event, whether a law
/// explains it or not. `None` if the system is singular.
fn unexplained_by_shapes(
    data: &Data,
    search: &Search,
    members: Vec<usize>,
    residual: &[Vec<f64>],
) -> Option<Vec<usize>> {
    let places: Vec<Option<JointRange>> =
        members.iter().map(|&member| joint_range(data, search.system.candidate(member))).collect();
    let shapes = NamelessTorques::new(data, &places);
    let evidence = |events: &[usize], places: &[usize]| {
        let named: Vec<usize> = events.iter().map(|&event| members[event]).collect();
        Some(shapes.evidence(&less(residual, &contribution(search, &named, residual)?), places))
    };
    let mut events: Vec<usize> = (0..members.len()).collect();
    let mut all = evidence(&events, &[])?;
    // Several events may be pieces of one shape, so that the shapes must first exceed all of them together.
    if evidence(&[], &[])? >= all {
        return Some(Vec::new());
    }
    while !events.is_empty() {
        let without = |place: usize| {
            let others = all_but(&events, place);
            Some((evidence(&others, &[])?, others))
        };
        let of_others = (0..events.len()).map(without).collect::<Option<Vec<_>>>()?;
        let best = of_others.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((of_others, others)) = best.filter(|best| best.0 >= all) else { break };
        (all, events) = (of_others, others);
    }
    let priors = log_priors(search, &members)?;
    let value = |events: &[usize], places: &[usize]| {
        let priors: f64 = events.iter().chain(places).map(|&one| priors[one]).sum();
        Some(evidence(events, places)? + priors)
    };
    let events = unexplained_by_places(events, &places, value)?;
    Some(events.into_iter().map(|event| members[event]).collect())
}

/// Those of `events` that no position-dependent torque of a joint explains: if a joint meets the same torque at each passage of a position, there is
/// no event, whether a law explains it or not. The number of an event is that of its place among `places`. `value` is the log of the probability of
/// events and places; each place has the prior of the event at it. If a joint passes a position only once, the data don't distinguish the two: the
/// event stays unless the place is better by the odds of a name. `None` if `value` is.
fn unexplained_by_places(
    mut events: Vec<usize>,
    places: &[Option<JointRange>],
    value: impl Fn(&[usize], &[usize]) -> Option<f64>,
) -> Option<Vec<usize>> {
    let mut taken: Vec<usize> = Vec::new();
    let mut now = value(&events, &taken)?;
    loop {
        let mut best: Option<(f64, Vec<usize>, Vec<usize>)> = None;
        for &place in &events {
            let Some(range) = places[place] else { continue };
            let is_elsewhere = |event: &usize| !places[*event].is_some_and(|other| range.meets(&other));
            let others: Vec<usize> = events.iter().copied().filter(is_elsewhere).collect();
            let with = [&taken[..], &[place]].concat();
            let there = value(&others, &with)?;
            if there > best.as_ref().map_or(now + STRONG, |best| best.0) {
                best = Some((there, others, with));
            }
        }
        let Some(better) = best else { return Some(events) };
        (now, events, taken) = better;
    }
}

/// Range of the joint's position while `candidate` acts on it; `None` if the candidate acts on no single joint or does not end.
fn joint_range(data: &Data, candidate: &Candidate) -> Option<JointRange> {
    let (joint, [begin, end]) = (candidate.joint?, window(&candidate.form.shape)?);
    let motion = data.recordings[candidate.form.only.unwrap_or(0)].motion();
    let during = motion.t.iter().zip(&motion.q[joint]).filter(|(t, _)| (begin..=end).contains(*t));
    let range = during
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], (_, q)| [least.min(*q), most.max(*q)]);
    (range[0] <= range[1]).then_some(JointRange { joint, range })
}

/// Those of `members` that no law of `lasting` replaces: pieces of a law resemble pushes, and whitened rows are sensitive to laws that are too small
/// to be named. `None` if the system is singular.
fn unexplained_by_laws(
    search: &mut Search,
    members: Vec<usize>,
    lasting: &[Candidate],
) -> Option<Vec<usize>> {
    if members.is_empty() {
        return Some(members);
    }
    search.available = lasting.iter().filter_map(|law| search.system.take(law.clone())).collect();
    let mut now = search.with_best_shares(members)?;
    while let Some(better) = search.exchanged_whole(&now)? {
        now = better;
    }
    now.members.retain(|&member| search.system.candidate(member).kind.happens());
    Some(now.members)
}

/// Returns true if the event in the form of `candidate` begins after the start of its recording, and ends before its end, if it ends at all: an
/// effect from the first sample on may have existed for any time. An event shorter than half a period of the low-pass's cutoff is the edge of another
/// effect (Shannon 1949).
fn is_inside(data: &Data, candidate: &Candidate) -> bool {
    let recording = &data.recordings[candidate.form.only.unwrap_or(0)];
    let t = &recording.motion().t;
    let (Some([begin, end]), Some(first), Some(last)) = (window(&candidate.form.shape), t.first(), t.last())
    else {
        return true;
    };
    let edge = 0.5 / recording.prepared.treatment.filter().cutoff_hz();
    begin > first + edge && end < last - edge && end - begin > edge
}

/// The contribution of `members` to every row, before whitening.
fn contribution(search: &Search, members: &[usize], rows: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
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
