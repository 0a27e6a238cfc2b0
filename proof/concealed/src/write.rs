//! Writes a case as files, which reveal nothing beyond their content.

use std::path::Path;

use freeplay_recording::{ColumnError, Layout, RowWriter, WriteError};
use freeplay_storage::{StorageError, make_folder};
use thiserror::Error;

use crate::case::Made;
use crate::sensors::Samples;

/// Reason why a case was not written.
#[derive(Debug, Error)]
pub enum WriteCaseError {
    /// A folder or file can't be written.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A recording can't be written.
    #[error(transparent)]
    Recording(#[from] WriteError),
    /// The columns form no recording.
    #[error(transparent)]
    Columns(#[from] ColumnError),
    /// The truth can't be written as JSON.
    #[error("the truth of case {number} is no JSON: {source}")]
    Truth {
        /// Number of the case.
        number: usize,
        /// The error.
        source: serde_json::Error,
    },
}

/// Writes case `number`: `NNN/model.toml`, `NNN/recording.csv` and `NNN/second.csv` in `folder`, and the truth, apart from them, in
/// `folder/truth/NNN.json`.
///
/// # Errors
/// [`WriteCaseError`] names the file.
pub fn write_case(folder: &Path, number: usize, made: &Made) -> Result<(), WriteCaseError> {
    let name = format!("{number:04}");
    let truths = folder.join("truth");
    write_sealed(&folder.join(&name), made)?;
    make_folder(&truths)?;
    let truth = serde_json::to_string_pretty(&made.truth);
    let truth = truth.map_err(|source| WriteCaseError::Truth { number, source })?;
    write_text(&truths.join(format!("{name}.json")), &(truth + "\n"))
}

/// Writes `model.toml`, `recording.csv` and `second.csv` into `folder`, without the truth.
///
/// # Errors
/// [`WriteCaseError`] names the file.
pub fn write_sealed(folder: &Path, made: &Made) -> Result<(), WriteCaseError> {
    make_folder(folder)?;
    write_text(&folder.join("model.toml"), &made.model)?;
    write_samples(&folder.join("recording.csv"), &made.recording)?;
    write_samples(&folder.join("second.csv"), &made.second)
}

fn write_text(path: &Path, text: &str) -> Result<(), WriteCaseError> {
    Ok(freeplay_storage::write(path, text)?)
}

fn write_samples(path: &Path, samples: &Samples) -> Result<(), WriteCaseError> {
    let names = std::iter::once("t").chain(samples.names.iter().map(String::as_str));
    let layout = Layout::new(names)?;
    let mut writer = RowWriter::replace(path, &layout, &[])?;
    let mut row = vec![0.0; samples.names.len() + 1];
    for (k, t) in samples.t.iter().enumerate() {
        row[0] = *t;
        row[1..].iter_mut().zip(&samples.columns).for_each(|(cell, column)| *cell = column[k]);
        writer.write(&row)?;
    }
    writer.finish()?;
    Ok(())
}
