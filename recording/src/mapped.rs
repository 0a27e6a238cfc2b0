//! The columns of a file as ours: where each comes from, and its factor to SI.

use std::collections::HashMap;

use crate::names::Group;

/// The columns of a file as ours.
#[derive(Debug)]
pub(crate) struct Mapped {
    /// Our names.
    pub names: Vec<String>,
    /// Where each comes from.
    pub picks: Vec<Pick>,
    /// Which of ours is the time.
    pub time: usize,
}

/// Where a column of ours comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pick {
    /// The column of the file.
    pub source: usize,
    /// Its factor to SI.
    pub factor: f64,
    /// Of a time in two columns, the other one and its factor to s.
    pub rest: Option<(usize, f64)>,
}

impl Mapped {
    /// The columns `names`, which are ours already.
    pub fn own(names: Vec<String>) -> Self {
        let picks = (0..names.len()).map(|source| Pick { source, factor: 1.0, rest: None }).collect();
        let time = names.iter().position(|name| name == "t").unwrap_or(0);
        Self { names, picks, time }
    }

    /// The columns of the file that are the joints' positions, joint by joint.
    pub fn positions(&self) -> Vec<usize> {
        let place = |joint: usize| self.names.iter().position(|name| *name == Group::Position.column(joint));
        (0..).map_while(place).map(|ours| self.picks[ours].source).collect()
    }

    /// Leaves out column `place`.
    pub fn remove(&mut self, place: usize) {
        self.names.remove(place);
        self.picks.remove(place);
        self.time -= usize::from(self.time > place);
    }

    /// Our row of the row `file` of the file; a time in two columns counts from its first whole second, `base`.
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

/// The names of a file's columns and where they stand, with and without a mark of comment before them.
pub(crate) struct Places<'a>(HashMap<&'a str, usize>);

impl<'a> Places<'a> {
    /// Of the columns `names`.
    pub fn of(names: &'a [String]) -> Self {
        let mut places: HashMap<&str, usize> =
            names.iter().enumerate().map(|(place, name)| (name.as_str(), place)).collect();
        for (place, name) in names.iter().enumerate() {
            places.entry(bare(name)).or_insert(place);
        }
        Self(places)
    }

    /// Where the column `name` stands.
    pub fn get(&self, name: &str) -> Option<usize> {
        self.0.get(name).or_else(|| self.0.get(bare(name))).copied()
    }
}

/// A name without a mark of comment before it.
fn bare(name: &str) -> &str {
    name.trim_start_matches(['#', '%']).trim()
}
