//! Reading a recording from CSV.

use std::io::{self, Read};

use csv::{ByteRecord, ErrorKind, Reader, ReaderBuilder};

use crate::error::{Place, ReadError, Row};
use crate::line_guard::{LineGuard, LongLine, MAX_LINE};
use crate::mapping::{Mapped, Mapping};
use crate::names::shorten;
use crate::read::Source;
use crate::recording::Recording;
use crate::table::Table;

/// After how many rows the size of the whole is estimated.
const ROWS_TO_ESTIMATE: u64 = 1000;

type Lines<R> = Reader<LineGuard<R>>;

/// Reads a CSV with our columns, row by row.
pub(crate) fn read(input: impl Read, source: &Source) -> Result<Recording, ReadError> {
    read_mapped(input, source, None)
}

/// Reads a CSV, row by row, with our columns or with those that `mapping` makes ours.
pub(crate) fn read_mapped(
    input: impl Read,
    source: &Source,
    mapping: Option<&Mapping>,
) -> Result<Recording, ReadError> {
    let mut lines = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(mapping.map_or(b',', Mapping::separator))
        .buffer_capacity(1 << 16)
        .from_reader(LineGuard::new(input));
    let mut record = ByteRecord::new();
    for _ in 0..mapping.map_or(0, Mapping::skip) {
        next(&mut lines, &mut record, source)?;
    }
    let Some(at) = next(&mut lines, &mut record, source)? else {
        return Err(ReadError::Empty { file: source.file.to_path_buf() });
    };
    let names = header(&record, source.place(at))?;
    let Mapped { names, factors } = match mapping {
        None => Mapped { factors: vec![1.0; names.len()], names },
        Some(mapping) => mapping
            .apply(names)
            .map_err(|error| ReadError::Mapping { place: source.place(at), source: error })?,
    };
    let decimal = mapping.map_or(b'.', Mapping::decimal);
    let table = Table::new(source.place(at), names, source.joints, source.limit)?;
    let mut table = table.with_overview(source.overview);
    let mut row = vec![0.0; table.names().len()];
    while let Some(at) = next(&mut lines, &mut record, source)? {
        read_row(&record, at, decimal, &mut row, &mut table)?;
        row.iter_mut().zip(&factors).for_each(|(value, factor)| *value *= factor);
        table.push(&row, at)?;
        if table.rows() == ROWS_TO_ESTIMATE
            && let Some(size) = source.size
        {
            let bytes_per_row = lines.position().byte() / ROWS_TO_ESTIMATE;
            table.expect_rows(size / bytes_per_row.max(1))?;
        }
    }
    table.into_recording()
}

/// Reads the next line that is not blank and says where it is; none at the end.
fn next<R: Read>(
    lines: &mut Lines<R>,
    record: &mut ByteRecord,
    source: &Source,
) -> Result<Option<Row>, ReadError> {
    let offset = lines.position().byte();
    match lines.read_byte_record(record) {
        Ok(true) => Ok(Some(Row::Line(lines.get_mut().line_from(offset)))),
        Ok(false) => Ok(None),
        Err(error) => Err(not_read(error, source)),
    }
}

/// The error behind an error of the CSV parser, which passes on those of its input and has none of its own here.
fn not_read(error: csv::Error, source: &Source) -> ReadError {
    let error = match error.into_kind() {
        ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    };
    match error.get_ref().and_then(|inner| inner.downcast_ref::<LongLine>()) {
        Some(LongLine { line }) => {
            ReadError::LongLine { place: source.place(Row::Line(*line)), limit: MAX_LINE }
        }
        None => ReadError::Io { file: source.file.to_path_buf(), source: error },
    }
}

/// The column names of the first line.
fn header(record: &ByteRecord, place: Place) -> Result<Vec<String>, ReadError> {
    let not_text = |what| ReadError::NotText { file: place.file.clone(), what };
    if record.as_slice().contains(&0) {
        return Err(not_text("its first line holds zero bytes"));
    }
    let cells = record.iter().map(std::str::from_utf8).collect::<Result<Vec<_>, _>>();
    let cells = cells.map_err(|_| not_text("its first line is no UTF-8 text"))?;
    let names: Vec<String> = cells.iter().map(|cell| unquote(cell).to_string()).collect();
    if let Some(first) = names.first().filter(|first| first.starts_with(['#', '%'])) {
        return Err(ReadError::Comment { place, value: shorten(first) });
    }
    if let [only] = names.as_slice()
        && let Some(separator) = only.chars().find(|c| matches!(c, ';' | '\t' | ' '))
    {
        return Err(wrong_separator(place, separator));
    }
    if names.first().is_some_and(|name| number(name.as_bytes()).is_some()) {
        return Err(ReadError::NoHeader { place, value: shorten(&names[0]) });
    }
    Ok(names)
}

fn wrong_separator(place: Place, separator: char) -> ReadError {
    let name = place.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let remedy = match separator {
        ';' => format!("sed 's/,/./g; s/;/,/g' {name} > comma.csv"),
        '\t' => format!("tr ',\\t' '.,' < {name} > comma.csv"),
        _ => format!("sed 's/,/./g; s/  */,/g' {name} > comma.csv"),
    };
    ReadError::Separator { place, separator, remedy }
}

/// Reads one line into `row`.
fn read_row(
    record: &ByteRecord,
    at: Row,
    decimal: u8,
    row: &mut [f64],
    table: &mut Table,
) -> Result<(), ReadError> {
    if record.len() != row.len() {
        let (place, expected, found) = (table.place(at), row.len(), record.len());
        return Err(ReadError::Ragged { place, expected, found });
    }
    for (column, cell) in record.iter().enumerate() {
        let value = if decimal == b'.' { number(cell) } else { number_with(decimal, cell) };
        row[column] = match value {
            Some(value) if value.is_finite() => value,
            value => odd_cell(column, cell, value, at, table)?,
        };
    }
    Ok(())
}

/// The number in a cell that has `decimal` before its decimals.
fn number_with(decimal: u8, cell: &[u8]) -> Option<f64> {
    let pointed: Vec<u8> = cell.iter().map(|&byte| if byte == decimal { b'.' } else { byte }).collect();
    number(&pointed)
}

/// A cell that is no finite number: an error in a column that is used, else kept (text as NaN).
#[cold]
fn odd_cell(
    column: usize,
    cell: &[u8],
    value: Option<f64>,
    at: Row,
    table: &mut Table,
) -> Result<f64, ReadError> {
    let text = String::from_utf8_lossy(cell);
    let text = unquote(&text);
    match (table.is_used(column), value) {
        (true, Some(_)) => Err(table.not_finite(column, at, shorten(text))),
        (true, None) => Err(ReadError::NotANumber {
            place: table.place(at),
            column: table.names()[column].clone(),
            value: shorten(text),
            remedy: remedy(text),
        }),
        (false, Some(value)) => Ok(value),
        (false, None) => {
            table.note_text(column, at, text);
            Ok(f64::NAN)
        }
    }
}

/// What to do about a cell that is no number.
fn remedy(text: &str) -> &'static str {
    if text.is_empty() {
        "the cell is empty: remove the row or interpolate it"
    } else if text.contains(',') && number(text.replacen(',', ".", 1).as_bytes()).is_some() {
        "write decimals with a point instead of a comma"
    } else {
        "correct the cell or remove the row"
    }
}

/// The number in a cell, which may have spaces around it and quotes around that.
fn number(cell: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(cell.trim_ascii()).ok()?;
    text.parse().ok().or_else(|| unquote(text).parse().ok())
}

/// A cell without the spaces around it, nor quotes that the CSV parser left because of them.
fn unquote(cell: &str) -> &str {
    let cell = cell.trim_start_matches('\u{feff}').trim();
    cell.strip_prefix('"').and_then(|c| c.strip_suffix('"')).unwrap_or(cell).trim()
}
