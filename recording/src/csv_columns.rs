//! The columns of a text file; the first rows determine the content of each.

use csv::ByteRecord;

use crate::cells::{Cell, cell, number, unquote};
use crate::csv_form::{Form, text};
use crate::guess::Sample;
use crate::interpret::tidy;

/// Content of a column of a file.
#[derive(Debug, Clone, PartialEq)]
enum Held {
    Numbers,
    /// Time stamps, read as seconds since the first one.
    TimeStamps,
    /// So many numbers in each cell.
    Lists(usize),
    Text,
}

/// The columns of a file, each as one or several of numbers.
#[derive(Debug)]
pub(crate) struct Columns {
    held: Vec<Held>,
    /// The first time stamp, ns.
    begin: Option<i128>,
    /// Names of the numbers of a row.
    pub names: Vec<String>,
    /// The file has no header; names are numbers.
    pub numbered: bool,
    decimal: u8,
}

impl Columns {
    /// The columns of a file of the form `form` with these first `rows`.
    pub fn of(form: &Form, rows: &[ByteRecord]) -> Self {
        let cells = rows.iter().map(ByteRecord::len).max().unwrap_or(0);
        let (names, numbered) = match &form.header {
            Some(names) => (tidy(&fitted(names.clone(), cells, rows)), false),
            None => ((1..=cells).map(|number| number.to_string()).collect(), true),
        };
        let held: Vec<Held> = (0..names.len()).map(|column| held(rows, column, form.decimal)).collect();
        let mut flat = Vec::new();
        for (name, held) in names.iter().zip(&held) {
            match held {
                Held::Lists(width) => flat.extend((0..*width).map(|k| format!("{name}[{k}]"))),
                _ => flat.push(name.clone()),
            }
        }
        Self { held, begin: None, names: flat, numbered, decimal: form.decimal }
    }

    /// Cells of a row.
    pub fn cells(&self) -> usize {
        self.held.len()
    }

    /// Reads the numbers of `record` into `row`. Passes a cell that is not a number to `odd`, with the index of the number in the row, and sets NaN.
    ///
    /// # Errors
    /// Those of `odd`.
    pub fn read<E>(
        &mut self,
        record: &ByteRecord,
        row: &mut [f64],
        mut odd: impl FnMut(usize, &str) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut place = 0;
        for (column, held) in self.held.iter().enumerate() {
            let bytes = record.get(column).unwrap_or_default();
            match (held, cell(bytes, self.decimal)) {
                (Held::Lists(width), Cell::List(values)) => {
                    let values = values.into_iter().chain(std::iter::repeat(f64::NAN));
                    row[place..place + width].iter_mut().zip(values).for_each(|(to, value)| *to = value);
                    place += width;
                }
                (Held::Lists(width), _) => {
                    row[place..place + width].fill(f64::NAN);
                    place += width;
                }
                (Held::TimeStamps, Cell::TimeStamp(ns)) => {
                    let begin = *self.begin.get_or_insert(ns);
                    row[place] = (ns - begin) as f64 * 1e-9;
                    place += 1;
                }
                (Held::TimeStamps, Cell::Number(value)) if !value.is_nan() => {
                    odd(place, &text(bytes))?;
                    row[place] = f64::NAN;
                    place += 1;
                }
                (_, Cell::Number(value)) => {
                    row[place] = value;
                    place += 1;
                }
                _ => {
                    row[place] = f64::NAN;
                    odd(place, unquote(&text(bytes)))?;
                    place += 1;
                }
            }
        }
        Ok(())
    }

    /// The first `rows` in the form for guessing the columns.
    pub fn sample(&mut self, rows: &[ByteRecord]) -> Sample {
        let mut sample = Sample::default();
        for record in rows {
            let mut row = vec![f64::NAN; self.names.len()];
            let Ok(()) = self.read(record, &mut row, |_, _| Ok::<(), std::convert::Infallible>(()));
            sample.rows.push(row);
        }
        let mut place = 0;
        for (column, held) in self.held.iter().enumerate() {
            let first = rows.first().and_then(|row| row.get(column)).unwrap_or_default();
            match held {
                Held::TimeStamps => {
                    sample.time_stamps.insert(place);
                }
                Held::Text => {
                    let words = match cell(first, self.decimal) {
                        Cell::Words(words) => words,
                        _ => vec![unquote(&text(first)).to_owned()],
                    };
                    sample.texts.insert(place, words);
                }
                Held::Numbers | Held::Lists(_) => {}
            }
            place += if let Held::Lists(width) = held { *width } else { 1 };
        }
        self.begin = None;
        sample
    }
}

/// `names` for rows of `cells` cells: without the empty one behind a separator at the end, with an empty one for an index column without a name.
fn fitted(mut names: Vec<String>, cells: usize, rows: &[ByteRecord]) -> Vec<String> {
    let is_empty = |record: &ByteRecord, column: usize| {
        record.get(column).is_none_or(|cell| cell.trim_ascii().is_empty())
    };
    let last_is_empty = |column: usize| rows.iter().all(|row| is_empty(row, column));
    if names.last().is_some_and(String::is_empty) && last_is_empty(names.len() - 1) {
        names.pop();
    } else if names.len() + 1 == cells && rows.iter().all(|row| row.len() == cells) && are_names(rows) {
        // R writes such tables: the rows have names, their column has none.
        names.insert(0, String::new());
    }
    names
}

/// True if the first cells of `rows` are names of rows: texts, or consecutive numbers.
fn are_names(rows: &[ByteRecord]) -> bool {
    let first = |row: &ByteRecord| number(row.get(0).unwrap_or_default(), b'.');
    let counts =
        rows.windows(2).all(|pair| first(&pair[0]).zip(first(&pair[1])).is_some_and(|(a, b)| b - a == 1.0));
    (rows.len() > 1 && counts) || rows.iter().all(|row| first(row).is_none())
}

/// The content of column number `column`, from its first non-empty cells.
fn held(rows: &[ByteRecord], column: usize, decimal: u8) -> Held {
    let mut cells = rows.iter().filter_map(|row| row.get(column)).map(|bytes| cell(bytes, decimal));
    let is_nothing = |cell: &Cell| matches!(cell, Cell::Number(value) if value.is_nan());
    match cells.find(|cell| !is_nothing(cell)) {
        None | Some(Cell::Number(_)) => Held::Numbers,
        Some(Cell::TimeStamp(_)) => Held::TimeStamps,
        Some(Cell::List(values)) => Held::Lists(values.len().max(1)),
        Some(Cell::Words(_) | Cell::Text) => Held::Text,
    }
}
