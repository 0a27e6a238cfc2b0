//! Rows on their way to a recording: the checks that every format shares.

use std::path::{Path, PathBuf};

use crate::error::{Place, ReadError, Row};
use crate::names::{Group, Role, Roles, shorten};
use crate::overview::Overview;
use crate::recording::{Event, Recording};

/// The most numbers (rows times columns) that one recording may hold: 2 GiB of them. While the columns
/// grow, up to twice that may be in use for a moment.
pub const MAX_NUMBERS: u64 = 1 << 28;

/// Why a file without its end has no samples.
pub(crate) const ENDS_EARLY: &str = ": it ends before its first complete chunk";

/// What a column outside the contract holds besides finite numbers.
#[derive(Debug, Clone, Default)]
struct Oddities {
    count: u64,
    first: Option<(Place, String)>,
}

/// Columns that grow row by row, in the order of the file.
#[derive(Debug)]
pub(crate) struct Table {
    file: PathBuf,
    names: Vec<String>,
    roles: Roles,
    columns: Vec<Vec<f64>>,
    oddities: Vec<Oddities>,
    limit: u64,
    /// Where but an overview is wanted.
    overview: Option<Overview>,
    pub metadata: Vec<(String, String)>,
    pub events: Vec<Event>,
    pub truncated: bool,
    pub notes: Vec<String>,
}

impl Table {
    /// An empty table with these columns, which stand at `header`; `joints` is the number of joints of the
    /// arm, where known.
    pub fn new(
        header: Place,
        names: Vec<String>,
        joints: Option<usize>,
        limit: u64,
    ) -> Result<Self, ReadError> {
        let roles = match Roles::new(&names, joints) {
            Ok(roles) => roles,
            Err(source) => return Err(ReadError::Columns { place: header, source }),
        };
        Ok(Table {
            file: header.file,
            columns: vec![Vec::new(); names.len()],
            oddities: vec![Oddities::default(); names.len()],
            names,
            roles,
            limit,
            overview: None,
            metadata: Vec::new(),
            events: Vec::new(),
            truncated: false,
            notes: Vec::new(),
        })
    }

    /// The same, of which an overview of at most `rows` rows is wanted.
    pub fn with_overview(mut self, rows: Option<usize>) -> Self {
        self.overview = rows.map(Overview::new);
        self
    }

    /// A table from whole columns, checked like rows.
    pub fn from_columns(file: &Path, columns: Vec<(String, Vec<f64>)>) -> Result<Self, ReadError> {
        let (names, values): (Vec<String>, Vec<Vec<f64>>) = columns.into_iter().unzip();
        let whole = Place { file: file.to_path_buf(), row: Row::Whole };
        let mut table = Table::new(whole, names, None, u64::MAX)?;
        let samples = values.first().map_or(0, Vec::len);
        if let Some(i) = values.iter().position(|v| v.len() != samples) {
            return Err(ReadError::Lengths {
                file: file.to_path_buf(),
                column: table.names[i].clone(),
                found: values[i].len(),
                expected: samples,
            });
        }
        let mut row = vec![0.0; values.len()];
        for sample in 0..samples {
            for (cell, column) in row.iter_mut().zip(&values) {
                *cell = column[sample];
            }
            table.push(&row, Row::Sample(sample as u64 + 1))?;
        }
        Ok(table)
    }

    /// The columns' names, in the order of the file.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The rows so far.
    pub fn rows(&self) -> u64 {
        self.columns[0].len() as u64
    }

    /// A place in this file.
    pub fn place(&self, row: Row) -> Place {
        Place { file: self.file.clone(), row }
    }

    /// Column `column` is in the contract.
    pub fn is_used(&self, column: usize) -> bool {
        self.roles.roles[column] != Role::Other
    }

    /// Makes room for about `rows` rows; refuses them if even half of them are too many.
    pub fn expect_rows(&mut self, rows: u64) -> Result<(), ReadError> {
        if self.overview.is_some() {
            return Ok(());
        }
        if self.check_size(rows / 2).is_err() {
            return self.check_size(rows);
        }
        let most = (rows + rows / 50).min(self.limit / self.names.len() as u64);
        for column in &mut self.columns {
            // Without the room the column grows as it goes.
            let _ = column.try_reserve_exact((most as usize).saturating_sub(column.len()));
        }
        Ok(())
    }

    /// Refuses `rows` rows if they are too many.
    pub fn check_size(&self, rows: u64) -> Result<(), ReadError> {
        let columns = self.names.len();
        if rows.saturating_mul(columns as u64) <= self.limit {
            return Ok(());
        }
        let every = (rows.saturating_mul(columns as u64)).div_ceil(self.limit).max(2);
        let name = self.file.file_name().unwrap_or_default().to_string_lossy();
        let remedy = if name.ends_with(".mcap") {
            "cut it into shorter pieces: `mcap filter`, or record fewer columns".into()
        } else {
            format!("keep every {every}th row: awk 'NR == 1 || NR % {every} == 0' {name} > thin.csv")
        };
        Err(ReadError::TooLarge { file: self.file.clone(), columns, rows, limit: self.limit, remedy })
    }

    /// Remembers that `text` stands in a column outside the contract where a number should.
    pub fn note_text(&mut self, column: usize, row: Row, text: &str) {
        let place = Place { file: self.file.clone(), row };
        let oddities = &mut self.oddities[column];
        oddities.count += 1;
        oddities.first.get_or_insert_with(|| (place, shorten(text)));
    }

    /// Adds a row, which has one value per column.
    pub fn push(&mut self, row: &[f64], at: Row) -> Result<(), ReadError> {
        debug_assert_eq!(row.len(), self.columns.len());
        self.check_size(self.rows() + 1)?;
        for (column, value) in row.iter().enumerate() {
            match self.roles.roles[column] {
                Role::Other => {}
                _ if !value.is_finite() => return Err(self.not_finite(column, at, format!("{value}"))),
                Role::Time => self.check_time(column, *value, at)?,
                _ => {}
            }
        }
        if let Some(overview) = &mut self.overview {
            let time = self.roles.roles.iter().position(|role| *role == Role::Time);
            overview.push(row, &mut self.columns, time.unwrap_or(usize::MAX));
            return Ok(());
        }
        for (column, value) in self.columns.iter_mut().zip(row) {
            column.push(*value);
        }
        Ok(())
    }

    /// The error for a value that is not finite.
    pub fn not_finite(&self, column: usize, at: Row, value: String) -> ReadError {
        ReadError::NotFinite { place: self.place(at), column: self.names[column].clone(), value }
    }

    fn check_time(&self, column: usize, value: f64, at: Row) -> Result<(), ReadError> {
        match self.columns[column].last() {
            Some(&previous) if value <= previous => {
                Err(ReadError::Time { place: self.place(at), value, previous })
            }
            _ => Ok(()),
        }
    }

    /// The finished recording.
    pub fn into_recording(mut self) -> Result<Recording, ReadError> {
        if let Some(overview) = &mut self.overview {
            overview.finish(&mut self.columns);
        }
        if self.columns[0].is_empty() {
            let why = if self.truncated { ENDS_EARLY } else { "" };
            return Err(ReadError::NoSamples { file: self.file, why });
        }
        self.describe_oddities();
        let joints = self.roles.joints;
        let mut recording = Recording {
            origin: self.file,
            q: vec![Vec::new(); joints],
            q_link: vec![None; joints],
            metadata: self.metadata,
            events: self.events,
            truncated: self.truncated,
            notes: self.notes,
            ..Recording::default()
        };
        let named = self.names.into_iter().zip(self.roles.roles).zip(self.columns);
        for ((name, role), values) in named {
            place_column(&mut recording, name, role, values);
        }
        Ok(recording)
    }

    fn describe_oddities(&mut self) {
        for (name, oddities) in self.names.iter().zip(&self.oddities) {
            if let Some((place, text)) = &oddities.first {
                self.notes.push(format!(
                    "column {name} is not used: {} of its {} cells are no numbers (first {place}: {text:?}), kept as NaN",
                    oddities.count,
                    self.columns[0].len(),
                ));
            }
        }
    }
}

/// Puts one column where it belongs.
fn place_column(recording: &mut Recording, name: String, role: Role, values: Vec<f64>) {
    let joints = recording.q.len();
    let whole = || vec![Vec::new(); joints];
    match role {
        Role::Time => recording.t = values,
        Role::Joint(Group::Position, j) => recording.q[j] = values,
        Role::Joint(Group::Velocity, j) => recording.qd.get_or_insert_with(whole)[j] = values,
        Role::Joint(Group::Torque, j) => recording.tau.get_or_insert_with(whole)[j] = values,
        Role::Joint(Group::Reference, j) => recording.q_ref.get_or_insert_with(whole)[j] = values,
        Role::Joint(Group::Link, j) => recording.q_link[j] = Some(values),
        Role::Tool(i) => recording.tool.get_or_insert_with(Default::default)[i] = values,
        Role::Orientation(i) => recording.orientation.get_or_insert_with(Default::default)[i] = values,
        Role::Other => recording.others.push((name, values)),
    }
}
