//! Tables: columns with units, cells with content and verdict.

use crate::text::Digits;
use crate::verdict::Verdict;

/// A table. The first cell of a row names the row.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// Title above the table.
    pub caption: String,
    /// The columns, from left to right.
    pub columns: Vec<Column>,
    /// The rows; missing cells are empty, surplus cells have no heading.
    pub rows: Vec<Vec<Cell>>,
    /// A remark below the table; may be empty.
    pub note: String,
}

/// A column of a table. Columns of numbers are aligned to the right.
#[derive(Debug, Clone)]
pub struct Column {
    /// The heading.
    pub title: String,
    /// The unit, shown in brackets; may be empty.
    pub unit: String,
    /// A heading shared with the neighbouring columns of the same group; may be empty.
    pub group: String,
    /// Format of its numbers.
    pub digits: Digits,
    /// Selects the number that is marked as the best.
    pub best: Best,
    /// True if each number has a bar; the largest number of the column has the longest bar.
    pub bars: bool,
    /// True if long texts are broken into lines.
    pub wraps: bool,
}

/// Selects the marked number of a column. A best number requires two different ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Best {
    /// None.
    Unmarked,
    /// The lowest.
    Lowest,
    /// The highest.
    Highest,
}

/// A cell: its content and its verdict, if any.
#[derive(Debug, Clone, Default)]
pub struct Cell {
    /// The content.
    pub content: Content,
    /// The verdict, if any.
    pub verdict: Option<Verdict>,
}

/// Content of a cell.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Content {
    /// Empty.
    #[default]
    Empty,
    /// Plain text.
    Text(String),
    /// A verdict in words of its own, such as "does not hold".
    Judged(Verdict, String),
    /// The name of a series: shown with the colour that this name has in the charts.
    Series(String),
    /// A number in the format of its column; NaN appears as a dash.
    Number(f64),
    /// A number and the half width of its interval, both in the unit of the column.
    Uncertain(f64, f64),
    /// A whole number, written in full.
    Count(u64),
}

impl Table {
    /// An empty table.
    #[must_use]
    pub fn new(caption: impl Into<String>) -> Self {
        Self { caption: caption.into(), ..Self::default() }
    }

    /// Adds a column.
    #[must_use]
    pub fn column(mut self, column: Column) -> Self {
        self.columns.push(column);
        self
    }

    /// Adds a row.
    #[must_use]
    pub fn row(mut self, cells: impl IntoIterator<Item = Cell>) -> Self {
        self.rows.push(cells.into_iter().collect());
        self
    }

    /// Sets the remark below the table.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }
}

impl Column {
    /// A column of words.
    #[must_use]
    pub fn text(title: impl Into<String>) -> Self {
        Self::number(title, "")
    }

    /// A column of numbers in `unit` with three significant digits.
    #[must_use]
    pub fn number(title: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            unit: unit.into(),
            group: String::new(),
            digits: Digits::Significant(3),
            best: Best::Unmarked,
            bars: false,
            wraps: false,
        }
    }

    /// Writes the numbers with that many decimals.
    #[must_use]
    pub fn fixed(mut self, decimals: usize) -> Self {
        self.digits = Digits::Fixed(decimals);
        self
    }

    /// Writes the numbers with that many significant digits.
    #[must_use]
    pub fn significant(mut self, count: usize) -> Self {
        self.digits = Digits::Significant(count);
        self
    }

    /// Gives this column and its neighbours of the same group a shared heading.
    #[must_use]
    pub fn group(mut self, group: impl Into<String>) -> Self {
        self.group = group.into();
        self
    }

    /// Marks the lowest number.
    #[must_use]
    pub fn lowest(mut self) -> Self {
        self.best = Best::Lowest;
        self
    }

    /// Marks the highest number.
    #[must_use]
    pub fn highest(mut self) -> Self {
        self.best = Best::Highest;
        self
    }

    /// Breaks long texts into lines.
    #[must_use]
    pub fn wrapping(mut self) -> Self {
        self.wraps = true;
        self
    }

    /// Draws a bar behind each number.
    #[must_use]
    pub fn bars(mut self) -> Self {
        self.bars = true;
        self
    }
}

impl Cell {
    /// The name of a series, with its colour.
    #[must_use]
    pub fn series(name: impl Into<String>) -> Self {
        Content::Series(name.into()).into()
    }

    /// A number and the half width of its interval.
    #[must_use]
    pub fn uncertain(value: f64, half_width: f64) -> Self {
        Content::Uncertain(value, half_width).into()
    }

    /// A verdict on its own, shown as its word.
    #[must_use]
    pub fn verdict(verdict: Verdict) -> Self {
        Self { content: Content::Empty, verdict: Some(verdict) }
    }

    /// A verdict in words of its own.
    #[must_use]
    pub fn verdict_in_words(verdict: Verdict, word: impl Into<String>) -> Self {
        Content::Judged(verdict, word.into()).into()
    }

    /// Sets the verdict.
    #[must_use]
    pub fn judged(mut self, verdict: Verdict) -> Self {
        self.verdict = Some(verdict);
        self
    }

    /// The finite number in the cell, if there is one.
    pub(crate) fn value(&self) -> Option<f64> {
        let value = match self.content {
            Content::Number(value) | Content::Uncertain(value, _) => value,
            Content::Count(count) => count as f64,
            Content::Empty | Content::Text(_) | Content::Judged(..) | Content::Series(_) => return None,
        };
        value.is_finite().then_some(value)
    }
}

impl From<Content> for Cell {
    fn from(content: Content) -> Self {
        Self { content, verdict: None }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Content::Text(text.to_owned()).into()
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Content::Text(text).into()
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Content::Number(value).into()
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Self {
        Content::Count(count).into()
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or_else(Self::default, Into::into)
    }
}
