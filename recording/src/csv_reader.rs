//! Reading a recording from CSV and its relatives: the first lines determine separator, decimal sign, header and the content of the columns.

use std::io::{self, Cursor, Read};

use csv::{ByteRecord, ErrorKind, Reader, ReaderBuilder};

use crate::csv_columns::Columns;
use crate::csv_form::{Form, StatedForm};
use crate::error::ReadError;
use crate::input::Source;
use crate::interpret::interpret;
use crate::line_guard::{LineGuard, LongLine, MAX_LINE};
use crate::mapped::Mapped;
use crate::mapping::Mapping;
use crate::names::shorten;
use crate::place::Row;
use crate::recording::Recording;
use crate::squeeze::Squeeze;
use crate::table::Table;

/// Number of rows after which the total size is estimated.
const ROWS_TO_ESTIMATE: u64 = 1000;
/// Bytes at the beginning that determine the form, and the least number of lines among them if the lines are long.
const HEAD: usize = 1 << 16;
const FEWEST_LINES: usize = 8;
/// Number of rows that determine the content of the columns.
const SAMPLE: usize = 32;

type Lines<R> = Reader<LineGuard<R>>;

/// Reads a text with columns, row by row. The columns have the contract's names, or get them from `mapping` or from a guess by their names.
pub(crate) fn read(
    mut input: impl Read,
    source: &Source,
    mapping: Option<&Mapping>,
) -> Result<Recording, ReadError> {
    let head = head(&mut input, source)?;
    if head.contains(&0) {
        return Err(ReadError::NotText { file: source.file.to_path_buf(), what: "it holds zero bytes" });
    }
    let form = Form::of(whole_lines(&head), mapping.map_or_else(StatedForm::default, Mapping::stated_form));
    let form = form.ok_or_else(|| ReadError::Empty { file: source.file.to_path_buf() })?;
    let (start, line) = form.data;
    let sample = sampled(&whole_lines(&head)[start.min(whole_lines(&head).len())..], &form);
    let mut columns = Columns::of(&form, &sample);
    let (names, sample) = (columns.names.clone(), columns.sample(&sample));
    let rest = Cursor::new(head.get(start..).unwrap_or_default().to_vec()).chain(input);
    let header = source.place(Row::Line(form.header_line));
    let interpreted = interpret(names, columns.numbered, &sample, mapping, Some(&form), &header)?;
    let table = Table::new(header, interpreted.mapped.names.clone(), source.joints, source.limit)?;
    let mut table = table.with_overview(source.overview);
    table.joint_names = interpreted.joints;
    table.sources = interpreted.sources;
    if let Some(guess) = interpreted.guess {
        table.take_guess(guess);
    }
    let rows = Rows { columns, mapped: interpreted.mapped, table, base: None, misfits: None };
    if form.separator == b' ' {
        return rows.read(lines(Squeeze::new(rest), &form, line), source);
    }
    rows.read(lines(rest, &form, line), source)
}

/// A reader of the cells of `input`, which begins with the line number `line`.
fn lines<R: Read>(input: R, form: &Form, line: u64) -> Lines<R> {
    ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(form.separator)
        .buffer_capacity(1 << 16)
        .from_reader(LineGuard::from_line(input, line))
}

/// The first bytes of `input`: more than a few if lines are long.
fn head(input: &mut impl Read, source: &Source) -> Result<Vec<u8>, ReadError> {
    let mut head = Vec::new();
    loop {
        let taken = input.by_ref().take(HEAD as u64).read_to_end(&mut head);
        let taken =
            taken.map_err(|error| ReadError::Io { file: source.file.to_path_buf(), source: error })?;
        let ends = head.iter().filter(|byte| matches!(byte, b'\n' | b'\r')).count();
        if taken < HEAD || ends >= FEWEST_LINES || head.len() > 2 * MAX_LINE {
            return Ok(head);
        }
    }
}

/// `head` without a last incomplete line.
fn whole_lines(head: &[u8]) -> &[u8] {
    if head.len() < HEAD {
        return head;
    }
    let end = head.iter().rposition(|byte| matches!(byte, b'\n' | b'\r'));
    end.map_or(head, |end| &head[..=end])
}

/// The first rows of the data in `text`.
fn sampled(text: &[u8], form: &Form) -> Vec<ByteRecord> {
    let records: Vec<ByteRecord> = if form.separator == b' ' {
        lines(Squeeze::new(text), form, 1).into_byte_records().map_while(Result::ok).take(SAMPLE).collect()
    } else {
        lines(text, form, 1).into_byte_records().map_while(Result::ok).take(SAMPLE).collect()
    };
    records.into_iter().filter(|record| !is_comment(record)).collect()
}

/// True for a comment line among the data, and for an empty line.
fn is_comment(record: &ByteRecord) -> bool {
    let first = record.get(0).unwrap_or_default().trim_ascii_start();
    first.starts_with(b"#")
        || first.starts_with(b"%")
        || record.iter().all(|cell| cell.trim_ascii().is_empty())
}

/// Adds the rows of a file to a table.
struct Rows {
    columns: Columns,
    mapped: Mapped,
    table: Table,
    /// The first whole second of a time in two columns.
    base: Option<f64>,
    /// The first row with another number of cells than the header, and this number.
    misfits: Option<(Row, usize)>,
}

impl Rows {
    fn read<R: Read>(mut self, mut lines: Lines<R>, source: &Source) -> Result<Recording, ReadError> {
        let mut record = ByteRecord::new();
        let mut file = vec![f64::NAN; self.columns.names.len()];
        let mut ours = vec![f64::NAN; self.mapped.names.len()];
        while let Some(at) = next(&mut lines, &mut record, source)? {
            if is_comment(&record) || !self.fits(&record, at) {
                continue;
            }
            let Self { columns, mapped, table, .. } = &mut self;
            columns.read(&record, &mut file, |place, text| odd_cell(mapped, table, place, at, text))?;
            self.mapped.row(&file, &mut self.base, &mut ours);
            self.table.push(&ours, at)?;
            if self.table.rows() == ROWS_TO_ESTIMATE
                && let Some(size) = source.size
            {
                let bytes_per_row = lines.position().byte() / ROWS_TO_ESTIMATE;
                self.table.expect_rows(size / bytes_per_row.max(1))?;
            }
        }
        if self.table.rows() == 0
            && let Some((row, found)) = self.misfits
        {
            let expected = self.columns.cells();
            return Err(ReadError::Ragged { place: self.table.place(row), expected, found });
        }
        self.table.into_recording()
    }

    /// True if a row has as many cells as the header, apart from empty ones at its end; counts the other rows.
    fn fits(&mut self, record: &ByteRecord, at: Row) -> bool {
        let expected = self.columns.cells();
        let more = record.iter().skip(expected).any(|cell| !cell.trim_ascii().is_empty());
        if record.len() >= expected && !more {
            return true;
        }
        self.misfits.get_or_insert((at, record.len()));
        let file = self.table.place(at);
        self.table.left_out.count(&format!("other than {expected} cells"), || file);
        false
    }
}

/// A cell with text in column `place` of the file: an error if the column is used, else a note.
#[cold]
fn odd_cell(mapped: &Mapped, table: &mut Table, place: usize, at: Row, text: &str) -> Result<(), ReadError> {
    let is_from =
        |pick: &crate::mapped::Pick| pick.source == place || pick.rest.is_some_and(|(rest, _)| rest == place);
    let Some(column) = mapped.picks.iter().position(is_from) else { return Ok(()) };
    if table.is_used(column) {
        return Err(ReadError::NotANumber {
            place: table.place(at),
            column: table.names()[column].clone(),
            value: shorten(text),
            remedy: remedy(text),
        });
    }
    table.note_text(column, at, text);
    Ok(())
}

/// The remedy for a cell that is not a number.
fn remedy(text: &str) -> &'static str {
    if text.contains(',') && text.replacen(',', ".", 1).parse::<f64>().is_ok() {
        "write decimals with a point instead of a comma"
    } else {
        "correct the cell, empty it or remove the row"
    }
}

/// Reads the next line that is not blank, with its place; `None` at the end.
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

/// The cause of an error of the CSV parser, which passes on errors of its input and has none of its own here.
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
