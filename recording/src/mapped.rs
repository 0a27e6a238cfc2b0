//! The columns of a recording: the source of each in the file, and its factor to SI.

use std::collections::HashMap;

use crate::names::Group;

/// The columns of a recording, with their sources in the file.
#[derive(Debug)]
pub(crate) struct Mapped {
    /// Names in the contract.
    pub names: Vec<String>,
    /// The source of each.
    pub picks: Vec<Pick>,
    /// Index of the time among them.
    pub time: usize,
}

/// The source of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pick {
    /// The column of the file.
    pub source: usize,
    /// Its factor to SI.
    pub factor: f64,
    /// For a time in two columns, the other one and its factor to s.
    pub rest: Option<(usize, f64)>,
}

impl Mapped {
    /// Columns `names` that have the contract's names already.
    pub fn own(names: Vec<String>) -> Self {
        let picks = (0..names.len()).map(|source| Pick { source, factor: 1.0, rest: None }).collect();
        let time = names.iter().position(|name| name == "t").unwrap_or(0);
        Self { names, picks, time }
    }

    /// The columns of the file with the joints' positions, joint by joint.
    pub fn positions(&self) -> Vec<usize> {
        let place = |joint: usize| self.names.iter().position(|name| *name == Group::Position.column(joint));
        (0..).map_while(place).map(|ours| self.picks[ours].source).collect()
    }

    /// Removes column `place`.
    pub fn remove(&mut self, place: usize) {
        self.names.remove(place);
        self.picks.remove(place);
        self.time -= usize::from(self.time > place);
    }

    /// Converts the row `file` of the file to the row `ours` of the recording; a time in two columns counts from its first whole second, `base`.
    pub fn row(&self, file: &[f64], base: &mut Option<f64>, ours: &mut [f64]) {
        for (value, pick) in ours.iter_mut().zip(&self.picks) {
            let source = file[pick.source];
            *value = match pick.rest {
                Some((rest, factor)) if source.is_finite() => {
                    let base = *base.get_or_insert(source);
                    (source - base) * pick.factor + file[rest] * factor
                }
                _ => source * pick.factor,
            };
        }
    }
}

/// Indices of a file's columns by name, with and without a comment mark before the name.
pub(crate) struct Places<'a>(HashMap<&'a str, usize>);

impl<'a> Places<'a> {
    /// The indices of the columns `names`.
    pub fn of(names: &'a [String]) -> Self {
        let mut places: HashMap<&str, usize> =
            names.iter().enumerate().map(|(place, name)| (name.as_str(), place)).collect();
        for (place, name) in names.iter().enumerate() {
            places.entry(bare(name)).or_insert(place);
        }
        Self(places)
    }

    /// The index of the column `name`.
    pub fn get(&self, name: &str) -> Option<usize> {
        self.0.get(name).or_else(|| self.0.get(bare(name))).copied()
    }
}

/// A name without a comment mark before it.
fn bare(name: &str) -> &str {
    name.trim_start_matches(['#', '%']).trim()
}
