//! What happens at a time: a push, a load that drops. Each recording has a clock of its own, and a repeat need not have the push.

use freeplay_laws::{Kind, Place};
use toml::{Table, Value};

use super::case::Case;
use super::hypothesis::{AROUND, hypothesis};
use super::search::Search;
use super::stage::Stage;
use super::upon::UPON;
use crate::residual::Kind as ChannelKind;

/// Name of the entry in a shape that says in which recording alone it happens.
const ONLY: &str = "only";

/// `shape` as an arm file can say it.
pub(crate) fn plain(shape: &Table) -> Table {
    let mut plain = shape.clone();
    plain.remove(ONLY);
    plain.remove(UPON);
    plain.remove(AROUND);
    plain
}

/// Whether what has `shape` happens in `stage`.
pub(crate) fn happens_in(shape: &Table, stage: &Stage) -> bool {
    shape.get(ONLY).is_none_or(|only| only.as_str() == Some(&name(stage)))
}

/// The shapes of `kind` at `joint` that happen in one of several recordings of `case` alone.
pub(crate) fn in_each(case: &Case, kind: &Kind, joint: Option<usize>) -> Vec<Table> {
    if case.stages.len() < 2 || !kind.happens() {
        return Vec::new();
    }
    let of_stage = |stage: &Stage| -> Vec<Table> {
        let shapes = (kind.shapes)(&Place { scene: stage.baseline(kind).scene(), joint });
        shapes.into_iter().map(|shape| only(shape, stage)).collect()
    };
    case.stages.iter().flat_map(of_stage).collect()
}

/// Shares of a recording that what strikes may last, shorter than a list of windows goes.
const BRIEF: [f64; 3] = [1.0 / 24.0, 1.0 / 48.0, 1.0 / 96.0];
/// Names of the numbers of a law that begins and ends.
const BEGIN: &str = "start";
const END: &str = "end";

/// The shapes of a `kind` that begins and ends in which it would act where, for so long, most more is left of the torques of a recording than before and after.
pub(crate) fn struck(case: &Case, kind: &Kind) -> Vec<Table> {
    if !kind.happens() || kind.parameter(END).is_none() {
        return Vec::new();
    }
    let of_stage = |stage: &Stage| -> Vec<Table> {
        let t = &stage.motion().t;
        let sums = running_sums(stage);
        let within = |from: usize, to: usize| sums[to.min(t.len())] - sums[from.min(t.len())];
        let of_share = |share: f64| {
            let long = (share * t.len() as f64) as usize;
            let more = |k: &usize| {
                within(*k, k + long)
                    - 0.5 * (within(k.saturating_sub(long), *k) + within(k + long, k + 2 * long))
            };
            let begin = (0..t.len().saturating_sub(long + 1)).max_by(|a, b| more(a).total_cmp(&more(b)))?;
            let times = [(BEGIN, t[begin]), (END, t[begin + long])];
            let shape = times.map(|(name, time)| (name.to_owned(), Value::from(time))).into_iter().collect();
            (long > 1).then(|| if case.stages.len() > 1 { only(shape, stage) } else { shape })
        };
        BRIEF.into_iter().filter_map(of_share).collect()
    };
    case.stages.iter().flat_map(of_stage).collect()
}

/// Sums, up to each point, of the squares that the model leaves of the torques of `stage`, each by its own mean.
fn running_sums(stage: &Stage) -> Vec<f64> {
    let mut squares = vec![0.0; stage.motion().len()];
    for channel in &stage.channels {
        let left = channel.residual();
        let mean = left.iter().map(|x| x * x).sum::<f64>() / left.len().max(1) as f64;
        if matches!(channel.kind, ChannelKind::Torque(_)) && mean > 0.0 {
            squares.iter_mut().zip(left).for_each(|(square, x)| *square += x * x / mean);
        }
    }
    let summed = squares.into_iter().scan(0.0, |sum, square| {
        *sum += square;
        Some(*sum)
    });
    std::iter::once(0.0).chain(summed).collect()
}

fn only(mut shape: Table, stage: &Stage) -> Table {
    shape.insert(ONLY.to_owned(), Value::String(name(stage)));
    shape
}

fn name(stage: &Stage) -> String {
    stage.ground.recording.origin.display().to_string()
}

impl Search<'_, '_> {
    /// Confines the effect number `index`, if it happens at a time in whatever recording, to that one of the fit in which it says most; whether
    /// there was anything to confine.
    pub fn confine(&mut self, index: usize) -> bool {
        let now = self.named(index);
        if !now.kind.happens() || now.shape.contains_key(ONLY) {
            return false;
        }
        let said = |stage: usize| -> f64 {
            let channels = stage * self.case.per_stage()..(stage + 1) * self.case.per_stage();
            let parts = now.block.columns.iter().flat_map(|column| column[channels.clone()].iter().flatten());
            parts.flatten().map(|x| x * x).sum()
        };
        let stages = 0..self.case.stages.len();
        let Some(most) = stages.max_by(|&a, &b| said(a).total_cmp(&said(b))) else { return false };
        let shape = only(now.shape.clone(), &self.case.stages[most]);
        let Ok(Some(confined)) = hypothesis(self.case, &self.system, now.kind, now.joint, shape) else {
            return false;
        };
        let at = self.chosen[index].hypothesis;
        self.hypotheses[at] = confined;
        self.take_shape(index);
        self.update_gains().is_some()
    }
}
