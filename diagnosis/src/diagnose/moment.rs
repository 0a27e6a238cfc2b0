//! What happens at a time: a push, a load that drops. Each recording has a clock of its own, and a repeat need not have the push.

use freeplay_laws::{Kind, Place};
use toml::{Table, Value};

use super::case::Case;
use super::hypothesis::{AROUND, hypothesis};
use super::search::Search;
use super::stage::Stage;
use super::upon::UPON;

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
