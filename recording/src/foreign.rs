//! A table in memory from a file with whole columns (Parquet, NumPy, MATLAB), or from a recording whose columns get new names.

use std::collections::{BTreeMap, HashSet};

use crate::error::ReadError;
use crate::guess::Sample;
use crate::input::Source;
use crate::interpret::{interpret, tidy};
use crate::mapping::Mapping;
use crate::place::Row;
use crate::recording::{Event, Recording};
use crate::table::{JOINTS_KEY, Table};

/// Number of rows that determine the content of the columns.
const SAMPLE: usize = 32;
/// Gap between one episode and the next, in steps, if both count from zero: far above the threshold of a gap.
const APART: f64 = 50.0;

/// Columns of numbers with their names, all of one length.
#[derive(Debug, Default)]
pub(crate) struct Foreign {
    pub names: Vec<String>,
    pub columns: Vec<Vec<f64>>,
    /// Columns in seconds since the first time stamp.
    pub time_stamps: HashSet<usize>,
    /// Numbers name the columns.
    pub numbered: bool,
    /// The joints' names, if the file has such a list.
    pub joints: Vec<String>,
    pub metadata: Vec<(String, String)>,
    pub events: Vec<Event>,
    pub truncated: bool,
    pub notes: Vec<String>,
}

impl Foreign {
    /// The columns of `recording`.
    pub fn of(recording: Recording) -> Self {
        let (names, columns) = recording.named().map(|(name, values)| (name, values.to_vec())).unzip();
        Self {
            names,
            columns,
            joints: recording.joint_names,
            metadata: recording.metadata,
            events: recording.events,
            truncated: recording.truncated,
            notes: recording.notes,
            ..Self::default()
        }
    }

    /// Adds a column.
    pub fn add(&mut self, name: String, values: Vec<f64>) {
        self.names.push(name);
        self.columns.push(values);
    }

    /// Number of values in each column.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Adds the rows of `other`, which has the same columns; a missing column gives NaN there.
    pub fn append(&mut self, other: &Self) {
        let rows = other.rows();
        for (name, column) in self.names.iter().zip(&mut self.columns) {
            match other.names.iter().position(|theirs| theirs == name) {
                Some(place) => column.extend_from_slice(&other.columns[place]),
                None => column.resize(column.len() + rows, f64::NAN),
            }
        }
    }

    /// Concatenates episodes, each of which counts its time from zero.
    pub fn lay_episodes_out(&mut self) {
        let place = |name: &str| self.names.iter().position(|known| known == name);
        let (Some(time), Some(episode)) = (place("timestamp"), place("episode_index")) else { return };
        let (times, episodes) = (self.columns[time].clone(), &self.columns[episode]);
        let mut steps: Vec<f64> =
            times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
        if steps.is_empty() {
            return;
        }
        let middle = steps.len() / 2;
        let apart = APART * *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        let (mut offset, mut count) = (0.0, 1_u64);
        let mut laid = times.clone();
        for row in 1..times.len() {
            if episodes[row] != episodes[row - 1] && times[row] <= times[row - 1] {
                offset = laid[row - 1] + apart - times[row];
                count += 1;
            }
            laid[row] = times[row] + offset;
        }
        self.columns[time] = laid;
        if count > 1 {
            self.notes.push(format!("{count} episodes, laid one after the other, {apart:.2} s apart"));
        }
    }

    /// The recording of these columns: by `mapping`, by their own names, or guessed.
    ///
    /// # Errors
    /// See [`ReadError`].
    pub fn into_recording(self, source: &Source, mapping: Option<&Mapping>) -> Result<Recording, ReadError> {
        let rows = self.rows();
        let row = |k: usize| self.columns.iter().map(|column| column[k]).collect::<Vec<f64>>();
        let sample = Sample {
            rows: (0..rows.min(SAMPLE)).map(row).collect(),
            texts: BTreeMap::new(),
            time_stamps: self.time_stamps.clone(),
        };
        let whole = source.place(Row::Whole);
        let interpreted = interpret(tidy(&self.names), self.numbered, &sample, mapping, None, &whole)?;
        let mapped = interpreted.mapped;
        let table = Table::new(whole, mapped.names.clone(), source.joints, source.limit)?;
        let mut table = table.with_overview(source.overview);
        table.check_size(rows as u64)?;
        table.joint_names = if interpreted.joints.is_empty() { self.joints } else { interpreted.joints };
        table.sources = interpreted.sources;
        let mut metadata = self.metadata;
        if table.sources.is_some() && !table.joint_names.is_empty() {
            // A mapping may give the joints other names.
            metadata.retain(|(key, _)| key != JOINTS_KEY);
        }
        table.metadata = metadata;
        table.events = self.events;
        table.truncated = self.truncated;
        table.notes.extend(self.notes);
        if let Some(guess) = interpreted.guess {
            table.take_guess(guess);
        }
        let (mut file, mut ours, mut base) =
            (vec![0.0; self.names.len()], vec![0.0; mapped.names.len()], None);
        for k in 0..rows {
            file.iter_mut().zip(&self.columns).for_each(|(cell, column)| *cell = column[k]);
            mapped.row(&file, &mut base, &mut ours);
            table.push(&ours, Row::Sample(k as u64 + 1))?;
        }
        table.into_recording()
    }
}
