//! The order for a generator of blind cases.

use std::collections::BTreeSet;
use std::path::PathBuf;

use freeplay_concealed::{Case, GenerateError, Made, Matrix, Quota, draw_set, make_case, make_here};
use serde::{Deserialize, Serialize};

use super::truth::at;

/// The cases for a generator, and their folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Order {
    /// Seed of all random draws.
    pub seed: u64,
    /// Number of cases of each sort, over all shards.
    pub quota: Quota,
    /// The sweep that replaces random draws.
    pub matrix: Option<Matrix>,
    /// Key from which the folder names of the cases follow.
    pub names: String,
    /// Shard of the cases: every `shard[1]`-th, from the `shard[0]`-th on, counted from 1.
    pub shard: [usize; 2],
    /// Folder for the cases.
    pub folder: PathBuf,
    /// Number of cases that the generator makes at a time.
    pub jobs: usize,
    /// Cases to skip, by their place in the draw: an earlier generator made them, or died over them.
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

    /// The places in the draw of `count` cases that this shard still has to make.
    pub fn open(&self, count: usize) -> Vec<usize> {
        let [shard, shards] = self.shard;
        (0..count).filter(|index| index % shards == shard - 1 && !self.done.contains(index)).collect()
    }

    /// Generates `case`. A case of a matrix stays on its machine and joint; any other case may move to another machine.
    pub fn generate(&self, case: &Case) -> Result<Made, GenerateError> {
        if self.matrix.is_some() && !case.hollow { make_here(case) } else { make_case(case) }
    }

    /// Describes `case` in words: its kinds of effects, or its [`place`] in a matrix.
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
