//! The recordings row by row, for pictures.

use std::ops::Range;

use freeplay_laws::Trajectory;
use freeplay_recording::Group;

use super::compare::unit;
use super::conclude::Conclusion;
use super::scores::Deviations;
use crate::report::diagnosis::{Passage, Trace, Variable};

impl Conclusion<'_> {
    /// All recordings, those of the fit first.
    pub(super) fn passages(&self) -> Vec<Passage> {
        let all = [(&self.parts.fit, false), (&self.parts.choice, false), (&self.parts.test, true)];
        let parts =
            all.into_iter().flat_map(|(parts, held_out)| parts.iter().map(move |part| (part, held_out)));
        parts.map(|((index, rows), held_out)| self.passage(*index, rows.clone(), held_out)).collect()
    }

    fn passage(&self, index: usize, rows: Range<usize>, held_out: bool) -> Passage {
        let track = &self.tracks[index];
        let t = track.stamps[rows.clone()].to_vec();
        let cut = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            columns.iter().map(|column| column[rows.clone()].to_vec()).collect()
        };
        let zeros = vec![vec![0.0; rows.len()]; self.moves.len()];
        let stretches = std::iter::once(0..rows.len()).collect();
        let trace = |joint: usize| {
            let of = |deviations: &Deviations| deviations[index][joint][rows.clone()].to_vec();
            Trace {
                channel: Group::Position.column(joint),
                unit: unit(self.numbers.file.arm.joints()[joint].kind),
                measured: track.measured[joint][rows.clone()].to_vec(),
                before: of(&self.before),
                retuned: of(&self.lagged),
                after: of(&self.after),
                unnamed: of(&self.filtered),
                laws: Vec::new(),
            }
        };
        let time =
            Variable { name: "time".to_owned(), unit: "s", quantity: "time", joint: None, values: t.clone() };
        Passage {
            recording: self.name_of(index),
            held_out,
            motion: Trajectory { t, q: cut(&track.measured), v: zeros.clone(), a: zeros, stretches },
            variables: vec![time],
            traces: self.joints().into_iter().map(trace).collect(),
        }
    }
}
