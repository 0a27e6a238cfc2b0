//! What happens at a time: a push, a load that drops. Each recording has a clock of its own, and a repeat need not have the push.

use freeplay_laws::{Kind as EffectKind, kinds};
use toml::{Table, Value};

use super::candidate::{Candidate, Form, at_place, places};
use super::conclude::is_told;
use super::data::Data;
use super::search::Search;
use super::system::System;
use super::weights::Weights;
use crate::residual::Kind;

/// The shortest push that is looked for, s, and the factor from one length to the next.
const BRIEFEST: f64 = 0.05;
const LONGER: f64 = 2.0;
/// The longest is this share of a recording: laws list windows down to it.
const LONGEST: f64 = 1.0 / 16.0;
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

/// The shapes of a `kind` at `joint` that begins and ends in which it would act where, for so long, what is `left` of the torques of the recording number
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
    let sums = running_sums(data, index, joint, left);
    let most = (LONGEST * t.len() as f64) as usize;
    let lengths = std::iter::successors(Some(BRIEFEST), |length| Some(LONGER * length));
    let rows = lengths.map(|length| ((length / step) as usize).max(1)).take_while(|rows| *rows <= most);
    let of_length = |long: usize| {
        let begin = (long..t.len().saturating_sub(2 * long)).max_by(|a, b| {
            let off = |k: usize| sums.iter().map(|sums| sums.off(k, long)).sum::<f64>();
            off(*a).total_cmp(&off(*b))
        })?;
        let times = [(BEGIN, t[begin]), (END, t[begin + long])];
        Some(times.map(|(name, time)| (name.to_owned(), Value::from(time))).into_iter().collect())
    };
    rows.filter_map(of_length).collect()
}

/// Sums, up to each point, of what is left of one torque in units of its own size, and of the rows that count.
struct Sums {
    left: Vec<f64>,
    rows: Vec<f64>,
}

impl Sums {
    fn mean(&self, from: usize, to: usize) -> Option<f64> {
        let rows = self.rows[to] - self.rows[from];
        (rows > 0.5 * (to - from) as f64).then(|| (self.left[to] - self.left[from]) / rows)
    }

    /// Square of what the `long` rows from `k` on are off from those before and after, in all of these rows.
    fn off(&self, k: usize, long: usize) -> f64 {
        let around = [self.mean(k - long, k), self.mean(k + long, k + 2 * long)];
        let (Some(here), [Some(before), Some(after)]) = (self.mean(k, k + long), around) else { return 0.0 };
        // A step that lasts is no push: what is off on both sides the same way counts.
        let (rise, fall) = (here - before, here - after);
        if rise * fall > 0.0 { long as f64 * rise.abs().min(fall.abs()).powi(2) } else { 0.0 }
    }
}

/// The [`Sums`] of the torques of the recording number `index`, or of that of `joint`.
fn running_sums(data: &Data, index: usize, joint: Option<usize>, left: &[Vec<f64>]) -> Vec<Sums> {
    let channels = (0..data.per_stage()).map(|c| index * data.per_stage() + c);
    let is_asked = |&c: &usize| match data.kind(c) {
        Kind::Torque(own) => joint.is_none_or(|joint| joint == own),
        Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => false,
    };
    let summed = |values: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
        std::iter::once(0.0)
            .chain(values.scan(0.0, |sum, x| {
                *sum += x;
                Some(*sum)
            }))
            .collect()
    };
    let of_channel = |c: usize| {
        let heard = data.heard(c);
        let square: f64 = left[c].iter().zip(&heard).map(|(x, heard)| heard * x * x).sum();
        let size = (square / heard.iter().sum::<f64>().max(1.0)).sqrt().max(f64::MIN_POSITIVE);
        Sums {
            left: summed(&mut left[c].iter().zip(&heard).map(|(x, heard)| heard * x / size)),
            rows: summed(&mut heard.iter().copied()),
        }
    };
    channels.filter(is_asked).map(of_channel).collect()
}

/// What happens in the rows that are heard and is not yet in what is `left` of them, as long as each is more probable than none, and what these leave. The
/// evidence is that of the diagnosis. `None` if the system is singular.
pub(crate) fn happenings(
    data: &Data,
    mut left: Vec<Vec<f64>>,
    weights: Weights,
) -> Option<(Vec<Candidate>, Vec<Vec<f64>>)> {
    let system = System::new(data, left.clone(), weights)?;
    let mut search = Search::new(system, Vec::new());
    let mut members = Vec::new();
    while members.len() < MOST {
        for kind in kinds().filter(|kind| kind.happens()) {
            for joint in places(kind, data.arm()) {
                let Ok((found, _)) = at_place(data, kind, joint, &left) else { continue };
                let taken: Vec<usize> = found.into_iter().filter_map(|one| search.system.take(one)).collect();
                search.laid.extend(taken);
            }
        }
        let better = search.improve(members.clone(), &mut |_| {})?;
        if better.members.len() <= members.len() {
            break;
        }
        members = better.members;
        left = search.system.left(&search.system.fit(&members)?);
    }
    let all = search.system.fit(&members)?.value;
    let is_sure = |&&member: &&usize| {
        let others: Vec<usize> = members.iter().copied().filter(|other| *other != member).collect();
        search.system.fit(&others).is_some_and(|without| is_told(all - without.value))
    };
    let sure = members.iter().filter(is_sure);
    let found = sure.map(|&member| search.system.candidate(member).clone()).collect();
    Some((found, left))
}
