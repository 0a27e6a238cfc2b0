//! The page: frame, table of contents, sections.

mod blocks;
mod drawing;
mod figure;
mod film;
mod inline;
mod table;

use std::path::{Path, PathBuf};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::colours::Colours;
use crate::document::{Block, Document};
use crate::thin::{LEAST_IN_SERIES, MOST_IN_DOCUMENT, MOST_IN_SERIES};

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("glue.js");
const FILM_SCRIPT: &str = include_str!("film.js");
const UPLOT_STYLE: &str = include_str!("../vendor/uplot/uPlot.min.css");
const UPLOT_SCRIPT: &str = include_str!("../vendor/uplot/uPlot.iife.min.js");
const UPLOT_LICENCE: &str = include_str!("../vendor/uplot/LICENSE");

/// Security policy: the page may use its own content and contact no server.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";

/// Why a report could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// An error of the file system.
    #[error("cannot write the report {}: {source}; free some space or choose another folder", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// The file system's error.
        source: std::io::Error,
    },
}

impl Document {
    /// The whole page, with style, charts and data in it.
    #[must_use]
    pub fn to_html(&self) -> String {
        page(self)
    }

    /// Writes the page to `path`, whose folder must exist. An existing file is replaced only once the new one is complete.
    ///
    /// # Errors
    /// [`ReportError::Write`] when the file cannot be written; then no new file remains.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let written = freeplay_storage::write(path, self.to_html());
        written.map_err(|error| ReportError::Write { path: path.to_owned(), source: error.into() })
    }
}

/// Properties of the document that its blocks need.
pub(crate) struct Context<'a> {
    pub(crate) colours: Colours<'a>,
    pub(crate) most_points: usize,
}

/// The whole page.
fn page(document: &Document) -> String {
    let context = Context { colours: Colours::of(document), most_points: points_per_series(document) };
    let contents = document.sections.len() > 1;
    let whole = html! {
        (DOCTYPE)
        html lang="en" {
            (head(document))
            body {
                div.page.with-contents[contents] {
                    (header(document))
                    main {
                        div.overview { (blocks::blocks(&document.overview, &context)) }
                        @if contents { (table_of_contents(document)) }
                        div.sections { (sections(document, &context)) }
                    }
                    (footer(document))
                }
            }
        }
    }
    .into_string();
    // The last step, so that no block of a page can omit it; in the JSON for the scripts the escapes do not change the values.
    crate::visible(&whole).into_owned()
}

fn head(document: &Document) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta http-equiv="Content-Security-Policy" content=(POLICY);
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="generator" content=(program());
            title { (document.title) }
            style { (PreEscaped(UPLOT_STYLE)) (PreEscaped(STYLE)) }
            script { "/*\n" (PreEscaped(UPLOT_LICENCE)) "*/\n" (PreEscaped(UPLOT_SCRIPT)) }
            script { (PreEscaped(SCRIPT)) }
            script { (PreEscaped(FILM_SCRIPT)) }
        }
    }
}

fn header(document: &Document) -> Markup {
    html! {
        header {
            button #theme type="button" hidden { "Dark / light" }
            h1 { (document.title) }
            @if !document.subtitle.is_empty() { p.subtitle { (document.subtitle) } }
        }
    }
}

fn table_of_contents(document: &Document) -> Markup {
    html! {
        nav aria-label="Contents" {
            ol {
                @for (place, section) in document.sections.iter().enumerate() {
                    li { a href={ "#section-" (place + 1) } { (section.title) } }
                }
            }
            p.hint { "Charts: drag across to zoom, double-click to reset, click a name to hide it." }
        }
    }
}

fn sections(document: &Document, context: &Context<'_>) -> Markup {
    html! {
        @for (place, section) in document.sections.iter().enumerate() {
            section #{ "section-" (place + 1) } {
                h2 { (section.title) }
                (blocks::blocks(&section.blocks, context))
            }
        }
    }
}

fn footer(document: &Document) -> Markup {
    html! {
        footer {
            @for line in &document.footer { p { (inline::inline(line)) } }
            p { (program()) " · charts: uPlot, © Leon Sorokin, MIT licence" }
            noscript { p { "The charts need JavaScript; the text below each chart says the same in words." } }
        }
    }
}

fn program() -> String {
    format!("Freeplay {}", env!("CARGO_PKG_VERSION"))
}

/// Points per series, limited so that the file stays small with any number of series.
fn points_per_series(document: &Document) -> usize {
    let sections = document.sections.iter().map(|section| count_series(&section.blocks)).sum::<usize>();
    let series = count_series(&document.overview) + sections;
    (MOST_IN_DOCUMENT / series.max(1)).clamp(LEAST_IN_SERIES, MOST_IN_SERIES)
}

fn count_series(blocks: &[Block]) -> usize {
    let of_block = |block: &Block| match block {
        Block::Chart(chart) => chart.series.len(),
        Block::Columns(blocks) | Block::Details { blocks, .. } => count_series(blocks),
        _ => 0,
    };
    blocks.iter().map(of_block).sum()
}
