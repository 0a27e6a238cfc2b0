//! The columns for writing a recording row by row.

use std::path::PathBuf;

use crate::names::{ColumnError, Group, ORIENTATION, Roles, TOOL};

/// The columns of a recording to be written, checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    columns: Vec<String>,
}

impl Layout {
    /// A layout of these columns; rows are given in the same order. The customary order is the one of
    /// [`Layout::of`].
    ///
    /// # Errors
    /// The names form no recording: see [`ColumnError`].
    pub fn new(columns: impl IntoIterator<Item = impl Into<String>>) -> Result<Self, ColumnError> {
        let columns: Vec<String> = columns.into_iter().map(Into::into).collect();
        Roles::new(&columns, None)?;
        Ok(Layout { columns })
    }

    /// The layout in the order of the contract: `t`, the groups for every one of `joints` joints in the
    /// order of [`Group::ALL`], the tool's position and orientation if `tool`, then `others`.
    /// Positions are always included.
    ///
    /// # Errors
    /// One of `others` is a name of the contract, a repetition or unprintable; or there are no joints.
    pub fn of(joints: usize, groups: &[Group], tool: bool, others: &[&str]) -> Result<Self, ColumnError> {
        let mut columns = vec!["t".to_string()];
        for group in Group::ALL {
            if group == Group::Position || groups.contains(&group) {
                columns.extend((0..joints).map(|joint| group.column(joint)));
            }
        }
        if tool {
            columns.extend(TOOL.iter().chain(&ORIENTATION).map(ToString::to_string));
        }
        columns.extend(others.iter().map(ToString::to_string));
        Layout::new(columns)
    }

    /// The names, in the order of a row.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Index of `t` in a row.
    pub(crate) fn time(&self) -> usize {
        self.columns.iter().position(|name| name == "t").expect("Roles::new refuses names without t")
    }
}

/// The size of a file that a writer has closed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Summary {
    /// The file.
    pub file: PathBuf,
    /// Rows in it.
    pub rows: u64,
    /// Events in it; a CSV file has none.
    pub events: u64,
    /// Its size, bytes.
    pub bytes: u64,
}

/// Decides when to hand over the collected rows: after [`Pace::SECONDS`] of data or [`Pace::BYTES`], so that a killed recorder loses no more than that.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    since: Option<f64>,
    bytes: usize,
}

impl Pace {
    const SECONDS: f64 = 0.25;
    const BYTES: usize = 256 * 1024;

    /// Counts `bytes` written at time `t`, s; true if the rows are due.
    pub fn due(&mut self, t: f64, bytes: usize) -> bool {
        self.bytes += bytes;
        let since = *self.since.get_or_insert(t);
        let due = t - since >= Self::SECONDS || self.bytes >= Self::BYTES;
        if due {
            *self = Pace::default();
        }
        due
    }
}
