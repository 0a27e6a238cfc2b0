//! The order that a generator is given.

use std::collections::BTreeSet;
use std::path::PathBuf;

use freeplay_concealed::{Case, GenerateError, Made, Matrix, Quota, draw_set, make_case, make_here};
use serde::{Deserialize, Serialize};

use super::truth::at;

/// What is to be made.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Order {
    /// Everything that is drawn comes from it.
    pub seed: u64,
    /// How many cases of which sort, over all shards.
    pub quota: Quota,
    /// What is swept instead of drawn at random.
    pub matrix: Option<Matrix>,
    /// The key that the names of their folders follow from.
    pub names: String,
    /// Which part of the cases: every `shard[1]`-th, from the `shard[0]`-th on, counted from 1.
    pub shard: [usize; 2],
    /// Where the cases are written.
    pub folder: PathBuf,
    /// Cases made at a time.
    pub jobs: usize,
    /// Cases that are not to be made any more, by their place in the draw: an earlier generator made them, or died over them.
    pub done: BTreeSet<usize>,
}

impl Order {
    /// The cases of all shards.
    pub fn cases(&self) -> Result<Vec<Case>, GenerateError> {
        match &self.matrix {
            Some(matrix) => matrix.draw(self.seed),
            None => draw_set(&self.quota, self.seed),
        }
    }

    /// The places in the draw of `count` cases that are still to be made in this shard.
    pub fn open(&self, count: usize) -> Vec<usize> {
        let [shard, shards] = self.shard;
        (0..count).filter(|index| index % shards == shard - 1 && !self.done.contains(index)).collect()
    }

    /// Makes `case`: a place of a matrix is that place, anything else may go to another machine.
    pub fn make(&self, case: &Case) -> Result<Made, GenerateError> {
        if self.matrix.is_some() && !case.hollow { make_here(case) } else { make_case(case) }
    }

    /// What `case` asks for, in words: its kinds, or the [`place`] of a matrix.
    pub fn asked(&self, case: &Case) -> String {
        let words = case.effects.iter().map(|effect| {
            if self.matrix.is_none() || case.hollow {
                return effect.kind.clone();
            }
            let arm = case.machine.data_sheet().ok();
            let joint = effect.joint.and_then(|joint| Some(arm?.joints().get(joint)?.name.clone()));
            place(&effect.kind, joint.as_deref(), case.machine.name(), effect.severity.name())
        });
        words.collect::<Vec<_>>().join(" + ")
    }
}

/// A place of a matrix in words.
pub fn place(kind: &str, joint: Option<&str>, machine: &str, severity: &str) -> String {
    format!("{} on {machine}, {severity}", at(kind, joint))
}
