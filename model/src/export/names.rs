//! Unique names for elements of a file that the model does not name.

use std::collections::HashSet;

/// The names in use.
#[derive(Debug, Default)]
pub(super) struct Names(HashSet<String>);

impl Names {
    /// The names of an arm's joints, which a file keeps.
    pub fn of<'a>(kept: impl IntoIterator<Item = &'a str>) -> Names {
        Names(kept.into_iter().map(str::to_owned).collect())
    }

    /// Returns `wanted`, with as many `_` appended as make it unused.
    pub fn take(&mut self, wanted: &str) -> String {
        let mut name = wanted.to_owned();
        while !self.0.insert(name.clone()) {
            name.push('_');
        }
        name
    }
}
