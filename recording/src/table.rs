//! Rows of a file on their way to a recording: the checks that every format shares.

use std::path::{Path, PathBuf};

use crate::error::ReadError;
use crate::guess::Guess;
use crate::missing::{self, LeftOut, is_missing};
use crate::names::{Group, Role, Roles, list, shorten};
use crate::overview::Overview;
use crate::place::{Place, Row};
use crate::recording::{Event, Recording};
use crate::sources::Sources;
use crate::time_order;

/// Reason for which a file without its end has no samples.
pub(crate) const ENDS_EARLY: &str = ": it ends before its first complete chunk";

/// Non-numeric content of a column outside the contract.
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
    /// `None` for a recording with all rows.
    overview: Option<Overview>,
    /// Rows without a time or a position.
    pub left_out: LeftOut,
    /// The first place at which time stands still or runs back: the row, its time, the time of the row before.
    disorder: Option<(Row, f64, f64)>,
    pub joint_names: Vec<String>,
    pub guessed: Option<String>,
    pub sources: Option<Sources>,
    pub metadata: Vec<(String, String)>,
    pub events: Vec<Event>,
    pub truncated: bool,
    pub notes: Vec<String>,
}

impl Table {
    /// An empty table with these columns; the header is at `header`. `joints` is the number of joints of the arm, if known.
    pub fn new(
        header: Place,
        names: Vec<String>,
        joints: Option<usize>,
        limit: u64,
    ) -> Result<Self, ReadError> {
        let mut roles = match Roles::new(&names, joints) {
            Ok(roles) => roles,
            Err(source) => return Err(ReadError::Columns { place: header, source }),
        };
        Ok(Table {
            file: header.file,
            columns: vec![Vec::new(); names.len()],
            oddities: vec![Oddities::default(); names.len()],
            names,
            notes: std::mem::take(&mut roles.notes),
            roles,
            limit,
            overview: None,
            left_out: LeftOut::default(),
            disorder: None,
            joint_names: Vec::new(),
            guessed: None,
            sources: None,
            metadata: Vec::new(),
            events: Vec::new(),
            truncated: false,
        })
    }

    /// The same for an overview of at most `rows` rows.
    pub fn with_overview(mut self, rows: Option<usize>) -> Self {
        self.overview = rows.map(Overview::new);
        self
    }

    /// A table from complete columns, with the same checks as rows.
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

    /// True if column `column` is in the contract.
    pub fn is_used(&self, column: usize) -> bool {
        self.roles.roles[column] != Role::Other
    }

    /// Reserves memory for about `rows` rows; refuses them if even half of them are too many.
    pub fn expect_rows(&mut self, rows: u64) -> Result<(), ReadError> {
        if self.overview.is_some() {
            return Ok(());
        }
        if self.check_size(rows / 2).is_err() {
            return self.check_size(rows);
        }
        let most = (rows + rows / 50).min(self.limit / self.names.len() as u64);
        for column in &mut self.columns {
            // If the reservation fails, the column grows row by row.
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

    /// Records the guessed meaning of the columns, with a note.
    pub fn take_guess(&mut self, guess: Guess) {
        self.notes.push(format!(
            "columns by their names: {} (freeplay record import writes this as a mapping file, to be corrected)",
            guess.words
        ));
        self.guessed = Some(guess.toml);
    }

    /// Records that `text` appears instead of a number in a column outside the contract.
    pub fn note_text(&mut self, column: usize, row: Row, text: &str) {
        let place = Place { file: self.file.clone(), row };
        let oddities = &mut self.oddities[column];
        oddities.count += 1;
        oddities.first.get_or_insert_with(|| (place, shorten(text)));
    }

    /// Adds a row, with one value per column; NaN and infinity count as missing. A row without its time or a position is dropped.
    pub fn push(&mut self, row: &[f64], at: Row) -> Result<(), ReadError> {
        debug_assert_eq!(row.len(), self.columns.len());
        self.check_size(self.rows() + 1)?;
        for (column, value) in row.iter().enumerate() {
            let role = self.roles.roles[column];
            if matches!(role, Role::Time | Role::Joint(Group::Position, _)) && !value.is_finite() {
                let what = format!("column {} holds no number", self.names[column]);
                let file = &self.file;
                self.left_out.count(&what, || Place { file: file.clone(), row: at });
                return Ok(());
            }
        }
        let time = self.roles.roles.iter().position(|role| *role == Role::Time).unwrap_or(0);
        if let Some(&previous) = self.columns[time].last().filter(|previous| row[time] <= **previous) {
            self.disorder.get_or_insert((at, row[time], previous));
            if self.overview.is_some() {
                return Ok(());
            }
        }
        if let Some(overview) = &mut self.overview {
            overview.push(row, &mut self.columns, time);
            return Ok(());
        }
        for ((column, value), role) in self.columns.iter_mut().zip(row).zip(&self.roles.roles) {
            column.push(if value.is_finite() || *role == Role::Other { *value } else { f64::NAN });
        }
        Ok(())
    }

    /// Sorts the rows by time.
    fn sort(&mut self) -> Result<(), ReadError> {
        let Some((row, value, previous)) = self.disorder.filter(|_| self.overview.is_none()) else {
            return Ok(());
        };
        let of = |is: fn(&Role) -> bool| {
            self.roles.roles.iter().enumerate().filter(move |(_, role)| is(role)).map(|(column, _)| column)
        };
        let positions: Vec<usize> = of(|role| matches!(role, Role::Joint(Group::Position, _))).collect();
        let time = of(|role| *role == Role::Time).next().unwrap_or(0);
        let sorted =
            time_order::sort(&mut self.columns, time, &positions).filter(|_| self.columns[time].len() > 1);
        let sorted = sorted.ok_or_else(|| ReadError::Time { place: self.place(row), value, previous })?;
        self.notes.extend(sorted.in_words());
        Ok(())
    }

    /// The finished recording.
    pub fn into_recording(mut self) -> Result<Recording, ReadError> {
        if let Some(overview) = &mut self.overview {
            overview.finish(&mut self.columns);
        }
        if self.columns[0].is_empty() {
            if let Some(error) = self.left_out.nothing_left() {
                return Err(error);
            }
            let why = if self.truncated { ENDS_EARLY } else { "" };
            return Err(ReadError::NoSamples { file: self.file, why });
        }
        let all = self.rows() + self.left_out.rows();
        self.notes.extend(self.left_out.in_words(all));
        self.sort()?;
        self.describe_oddities();
        let joints = self.roles.joints;
        let mut recording = Recording {
            origin: self.file,
            joint_names: self.joint_names,
            guessed: self.guessed,
            sources: self.sources,
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
        complete(&mut recording);
        let notes = missing::in_words(&recording);
        recording.notes.extend(notes);
        drop_missing(&mut recording);
        take_names(&mut recording);
        Ok(recording)
    }

    fn describe_oddities(&mut self) {
        let rows = self.columns[0].len() as u64;
        let of_text = self.names.iter().zip(&self.oddities).filter(|(_, oddities)| oddities.count >= rows);
        let of_text: Vec<String> = of_text.map(|(name, _)| name.clone()).collect();
        if of_text.len() > 1 {
            self.notes.push(format!("columns of text are not used: {}", list(&of_text)));
            self.oddities
                .iter_mut()
                .filter(|oddities| oddities.count >= rows)
                .for_each(|oddities| oddities.first = None);
        }
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

/// Adds the missing columns of a group that has others: NaN throughout.
fn complete(recording: &mut Recording) {
    let samples = recording.t.len();
    let groups =
        [&mut recording.qd, &mut recording.tau, &mut recording.q_ref].into_iter().flatten().flatten();
    let axes = recording.tool.iter_mut().flatten().chain(recording.orientation.iter_mut().flatten());
    groups.chain(axes).for_each(|column| column.resize(samples, f64::NAN));
}

/// Removes the groups whose columns are all missing throughout.
fn drop_missing(recording: &mut Recording) {
    for group in [&mut recording.qd, &mut recording.tau, &mut recording.q_ref] {
        group.take_if(|columns| columns.iter().all(|column| is_missing(column)));
    }
    for link in &mut recording.q_link {
        link.take_if(|column| is_missing(column));
    }
    recording.tool.take_if(|axes| axes.iter().all(|axis| is_missing(axis)));
    recording.orientation.take_if(|parts| parts.iter().all(|part| is_missing(part)));
}

/// The key of the joints' names in a recording's metadata.
pub(crate) const JOINTS_KEY: &str = "joints";

/// Reads the joints' names from the metadata, or writes them there.
fn take_names(recording: &mut Recording) {
    let written = recording.metadata.iter().find(|(key, _)| key == JOINTS_KEY).map(|(_, names)| names);
    if let Some(names) = written
        && recording.joint_names.is_empty()
    {
        recording.joint_names = names.split(',').map(str::to_owned).collect();
    } else if written.is_none() && !recording.joint_names.is_empty() {
        recording.metadata.push((JOINTS_KEY.to_owned(), recording.joint_names.join(",")));
        recording.metadata.sort();
    }
    if recording.joint_names.len() != recording.joints() {
        recording.joint_names.clear();
    }
}

/// Assigns one column to its field.
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

impl Recording {
    /// A recording from named columns, with the rules for a file: see [`crate::read`].
    ///
    /// # Errors
    /// As those of [`crate::read`] for a file, with the sample (counted from 1) instead of the line.
    pub fn new(origin: &Path, columns: Vec<(String, Vec<f64>)>) -> Result<Self, ReadError> {
        Table::from_columns(origin, columns)?.into_recording()
    }
}
