//! Documents, sections and their blocks.

use crate::chart::Chart;
use crate::drawing::Drawing;
use crate::film::Film;
use crate::table::Table;
use crate::verdict::Verdict;

/// A report: the content of one HTML file.
///
/// The page has this order: title and subtitle, the overview, a table of contents, the sections, the footer. All texts are plain text; the writer escapes them.
#[derive(Debug, Clone, Default)]
pub struct Document {
    /// The heading of the page and the title of its window.
    pub title: String,
    /// One line below the title: the run, its time and its subject; may be empty.
    pub subtitle: String,
    /// The first blocks of the page: verdict, key figures, the table that answers the question.
    pub overview: Vec<Block>,
    /// The chapters, in the order of the table of contents.
    pub sections: Vec<Section>,
    /// Lines at the end: hashes, seeds, the command that made the report. The writer adds the version.
    pub footer: Vec<String>,
}

/// A chapter of a document, listed in the table of contents.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// Its content.
    pub blocks: Vec<Block>,
}

/// An element of a document.
#[derive(Debug, Clone)]
pub enum Block {
    /// Paragraphs, separated by blank lines; text between backticks is set as code.
    Text(String),
    /// A heading within a section; not in the table of contents.
    Heading(String),
    /// One line per entry, with bullets; backticks as in [`Block::Text`].
    List(Vec<String>),
    /// A verdict with a sentence that explains it.
    Verdict(Verdict, String),
    /// A verdict in words of its own, such as "does not hold", with a sentence that explains it.
    Judged {
        /// The verdict.
        verdict: Verdict,
        /// The word in place of [`Verdict::word`].
        word: String,
        /// The sentence.
        text: String,
    },
    /// Key numbers as tiles.
    Figures(Vec<Figure>),
    /// A table.
    Table(Table),
    /// A chart.
    Chart(Box<Chart>),
    /// A figure drawn once, as SVG.
    Drawing(Box<Drawing>),
    /// A figure whose parts move.
    Film(Box<Film>),
    /// Blocks side by side if the window is wide enough, else one below the other.
    Columns(Vec<Block>),
    /// Text as typed: commands, files, messages.
    Code(String),
    /// Blocks that stay folded until the reader opens them.
    Details {
        /// The visible line.
        summary: String,
        /// The folded blocks.
        blocks: Vec<Block>,
    },
}

/// A key number, drawn as a tile.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// Name of the number.
    pub label: String,
    /// The number as text; see [`crate::text`].
    pub value: String,
    /// Its unit; may be empty.
    pub unit: String,
    /// A remark below it: a limit, a comparison; may be empty.
    pub note: String,
    /// Its verdict, if any.
    pub verdict: Option<Verdict>,
}

impl Document {
    /// A document with a title alone.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Sets the line below the title.
    #[must_use]
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = subtitle.into();
        self
    }

    /// Adds a block to the overview.
    #[must_use]
    pub fn overview(mut self, block: impl Into<Block>) -> Self {
        self.overview.push(block.into());
        self
    }

    /// Adds a section.
    #[must_use]
    pub fn section(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// Adds a line to the footer.
    #[must_use]
    pub fn footer(mut self, line: impl Into<String>) -> Self {
        self.footer.push(line.into());
        self
    }
}

impl Section {
    /// A section with a heading alone.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new() }
    }

    /// Adds a block.
    #[must_use]
    pub fn with(mut self, block: impl Into<Block>) -> Self {
        self.blocks.push(block.into());
        self
    }
}

impl Figure {
    /// A figure without remark and verdict.
    #[must_use]
    pub fn new(label: impl Into<String>, value: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), value: value.into(), unit: unit.into(), ..Self::default() }
    }

    /// Sets the remark below the number.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Sets the verdict.
    #[must_use]
    pub fn verdict(mut self, verdict: Verdict) -> Self {
        self.verdict = Some(verdict);
        self
    }
}

impl From<&str> for Block {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Block {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl<T: Into<String>> From<(Verdict, T)> for Block {
    fn from((verdict, text): (Verdict, T)) -> Self {
        Self::Verdict(verdict, text.into())
    }
}

impl From<Vec<Figure>> for Block {
    fn from(figures: Vec<Figure>) -> Self {
        Self::Figures(figures)
    }
}

impl From<Table> for Block {
    fn from(table: Table) -> Self {
        Self::Table(table)
    }
}

impl From<Chart> for Block {
    fn from(chart: Chart) -> Self {
        Self::Chart(Box::new(chart))
    }
}

impl From<Film> for Block {
    fn from(film: Film) -> Self {
        Self::Film(Box::new(film))
    }
}

impl From<Drawing> for Block {
    fn from(drawing: Drawing) -> Self {
        Self::Drawing(Box::new(drawing))
    }
}
