//! Writing a whole recording as Parquet: one column of `double` per column, compressed with Snappy.
//!
//! Parquet has its table of contents at the end, so that an unfinished file cannot be read: the format suits exchange, not recording.

use std::io::{self, Seek, Write};
use std::path::Path;
use std::sync::Arc;

use freeplay_storage::AtomicFile;

use parquet::basic::{Compression, Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};

use crate::error::WriteError;
use crate::layout::Summary;
use crate::recording::Recording;

/// Rows of one row group: a reader loads one group at a time.
const GROUP: usize = 1 << 17;

/// Writes `recording` to `path`, readable by its owner alone; the file appears complete or not at all.
///
/// # Errors
/// [`WriteError::Create`], [`WriteError::NotExported`].
pub(crate) fn export(recording: &Recording, path: &Path) -> Result<Summary, WriteError> {
    let columns: Vec<(String, &[f64])> = recording.named().collect();
    let metadata = recording.metadata.iter().map(|(key, value)| KeyValue::new(key.clone(), value.clone()));
    export_table(&columns, metadata.collect(), path)
}

/// Writes `columns`, all of one length, to the Parquet file `path`, readable by its owner alone; the file appears complete or not at all.
///
/// # Errors
/// [`WriteError::Create`], [`WriteError::NotExported`].
pub fn export_columns(columns: &[(String, &[f64])], path: &Path) -> Result<Summary, WriteError> {
    export_table(columns, Vec::new(), path)
}

fn export_table(
    columns: &[(String, &[f64])],
    metadata: Vec<KeyValue>,
    path: &Path,
) -> Result<Summary, WriteError> {
    let rows = columns.iter().map(|(_, values)| values.len()).min().unwrap_or(0);
    let mut file = AtomicFile::create(path)
        .map_err(|error| WriteError::Create { file: path.to_path_buf(), source: error.into() })?;
    let stopped = |source| WriteError::NotExported { file: path.to_path_buf(), source };
    write(columns, metadata, rows, &mut file).map_err(|error| {
        stopped(match error {
            ParquetError::External(source) => io::Error::other(source),
            error => io::Error::other(error.to_string()),
        })
    })?;
    let bytes = file.stream_position().map_err(stopped)?;
    file.commit().map_err(|error| stopped(error.into()))?;
    Ok(Summary { file: path.to_path_buf(), rows: rows as u64, events: 0, bytes })
}

/// Writes the whole content.
fn write(
    columns: &[(String, &[f64])],
    metadata: Vec<KeyValue>,
    rows: usize,
    file: impl Write + Send,
) -> Result<(), ParquetError> {
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_dictionary_enabled(false)
        .set_created_by(crate::parquet_reader::CREATED_BY.to_owned())
        .set_key_value_metadata(Some(metadata));
    let mut writer = SerializedFileWriter::new(file, schema(columns)?, Arc::new(properties.build()))?;
    for begin in (0..rows).step_by(GROUP) {
        let end = (begin + GROUP).min(rows);
        let mut group = writer.next_row_group()?;
        for (_, values) in columns {
            let Some(mut column) = group.next_column()? else { break };
            column.typed::<DoubleType>().write_batch(&values[begin..end], None, None)?;
            column.close()?;
        }
        group.close()?;
    }
    writer.close()?;
    Ok(())
}

fn schema(columns: &[(String, &[f64])]) -> Result<TypePtr, ParquetError> {
    let field = |(name, _): &(String, &[f64])| {
        let column =
            Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::REQUIRED);
        Ok(Arc::new(column.build()?))
    };
    let fields = columns.iter().map(field).collect::<Result<Vec<_>, ParquetError>>()?;
    Ok(Arc::new(Type::group_type_builder("recording").with_fields(fields).build()?))
}
