//! Writing a recording row by row; the code that both formats share.

use std::path::Path;

use crate::csv_writer::CsvWriter;
use crate::error::WriteError;
use crate::interpret::JOINTS_COLUMN;
use crate::layout::{Layout, Summary};
use crate::mcap_writer::McapWriter;
use crate::parquet_writer;
use crate::recording::{Event, Recording};

/// Writes a recording as CSV or MCAP, row by row.
///
/// Complete rows reach the file every 0.25 s of data or 256 KiB, whichever comes first: earlier rows stay readable after a kill of the process. The file
/// belongs to its owner alone (mode 0600); an existing one is replaced. After an error the writer refuses everything else, and never panics. A dropped writer
/// finishes its file as well as it can.
#[derive(Debug)]
pub enum RowWriter {
    /// Writes CSV.
    Csv(CsvWriter),
    /// Writes MCAP.
    Mcap(McapWriter),
}

impl RowWriter {
    /// Begins a recording in the format that the ending of `path` selects (`.csv`, `.mcap`). A CSV file has no `metadata`; the writer drops it.
    ///
    /// # Errors
    /// [`WriteError::Ending`], [`WriteError::Create`], [`WriteError::Stopped`].
    pub fn create(path: &Path, layout: &Layout, metadata: &[(String, String)]) -> Result<Self, WriteError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("csv") => Ok(RowWriter::Csv(CsvWriter::create(path, layout)?)),
            Some("mcap") => Ok(RowWriter::Mcap(McapWriter::create(path, layout, metadata)?)),
            _ => Err(WriteError::Ending { file: path.to_path_buf() }),
        }
    }

    /// Begins a recording that appears under its name only once it is complete and [finished](RowWriter::finish); an existing file stays unchanged until then.
    /// Otherwise as [`RowWriter::create`].
    ///
    /// # Errors
    /// As [`RowWriter::create`].
    pub fn replace(path: &Path, layout: &Layout, metadata: &[(String, String)]) -> Result<Self, WriteError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("csv") => Ok(RowWriter::Csv(CsvWriter::replace(path, layout)?)),
            Some("mcap") => Ok(RowWriter::Mcap(McapWriter::replace(path, layout, metadata)?)),
            _ => Err(WriteError::Ending { file: path.to_path_buf() }),
        }
    }

    /// Writes one row: a value per column of the layout, finite or not.
    ///
    /// # Errors
    /// [`WriteError::Width`] (further rows may follow), [`WriteError::Stopped`], [`WriteError::Closed`].
    pub fn write(&mut self, row: &[f64]) -> Result<(), WriteError> {
        match self {
            RowWriter::Csv(writer) => writer.write(row),
            RowWriter::Mcap(writer) => writer.write(row),
        }
    }

    /// Writes an event; a CSV file has no events, and the writer drops it.
    ///
    /// # Errors
    /// [`WriteError::EventTime`] (further rows may follow), [`WriteError::Stopped`], [`WriteError::Closed`].
    pub fn event(&mut self, event: &Event) -> Result<(), WriteError> {
        match self {
            RowWriter::Csv(_) => Ok(()),
            RowWriter::Mcap(writer) => writer.event(event),
        }
    }

    /// Writes the remaining rows and closes the file.
    ///
    /// # Errors
    /// [`WriteError::Stopped`], [`WriteError::Closed`] after an earlier error.
    pub fn finish(self) -> Result<Summary, WriteError> {
        match self {
            RowWriter::Csv(writer) => writer.finish(),
            RowWriter::Mcap(writer) => writer.finish(),
        }
    }
}

/// Writes `recording` to `path`, as CSV, MCAP or Parquet by the ending, columns in the order of the contract. Reading it again gives the same numbers, bit for
/// bit. Parquet drops events; CSV drops events and metadata, and keeps the joints' names in the name of one more column. The file appears complete or not at
/// all; a complete new one replaces an existing one.
///
/// # Errors
/// As those of [`RowWriter`].
pub fn export(recording: &Recording, path: &Path) -> Result<Summary, WriteError> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet")) {
        return parquet_writer::export(recording, path);
    }
    export_rows(recording, path).map_err(|error| match error {
        // The file appears complete or not at all, so that an error leaves no row.
        WriteError::Stopped { file, source, .. } => WriteError::NotExported { file, source },
        error => error,
    })
}

fn export_rows(recording: &Recording, path: &Path) -> Result<Summary, WriteError> {
    let mut names = recording.columns();
    let is_csv = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    let zeros =
        if is_csv && !recording.joint_names.is_empty() { vec![0.0; recording.len()] } else { Vec::new() };
    let mut columns: Vec<&[f64]> = recording.named().map(|(_, values)| values).collect();
    if !zeros.is_empty() {
        // CSV has no other place for names, and readers accept a further column.
        names.push(format!("{JOINTS_COLUMN}{}", recording.joint_names.join(";")));
        columns.push(&zeros);
    }
    let layout = Layout::new(names)?;
    let mut writer = RowWriter::replace(path, &layout, &recording.metadata)?;
    let mut events = recording.events.iter().peekable();
    let mut row = vec![0.0; columns.len()];
    for sample in 0..recording.len() {
        for (cell, column) in row.iter_mut().zip(&columns) {
            *cell = column[sample];
        }
        while let Some(event) = events.next_if(|e| e.t <= recording.t[sample]) {
            writer.event(event)?;
        }
        writer.write(&row)?;
    }
    for event in events {
        writer.event(event)?;
    }
    writer.finish()
}
