//! Reports: one HTML file that needs no network.
//!
//! This crate draws documents and knows nothing of their subject. uPlot draws the charts; its code is part of the file (`vendor/uplot`). The page contacts no
//! server, and its own policy forbids it to.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Document`]: title, overview (the first blocks of the page), [`Section`]s, footer; written with [`Document::write`].
//! - [`Block`]: an element of an overview or a section: text, list, verdict, figures, table, chart, drawing, film, columns, code, details.
//! - [`Verdict`]: ok, warn, fail or info; shown as a word and a sign, never as a colour alone.
//! - [`Figure`]: a key number with its name, unit and remark, drawn as a tile.
//! - [`Table`] of [`Column`]s and [`Cell`]s: units in the heading, decimals aligned, the [`Best`] marked.
//! - [`Chart`] of [`Series`] over two [`Axis`]es, with [`Mark`]s; [`Scale`] and [`Style`] define how they are drawn.
//! - [`Drawing`]: a figure of panels drawn once, as SVG, with a caption; each panel is a [`Chart`].
//! - [`Film`] of [`Scene`]s with [`Moving`] parts: a figure that is played over time, and a still on paper.
//! - [`thin`]: fewer points, every peak kept; applied automatically so that a report stays below about 5 MB.
//! - [`text`]: number formats for every table of the project, in pages and in the terminal.
//! - [`units`]: values in convenient units for people.
//! - [`paste`]: paths quoted for a shell.
//! - [`visible`] and [`one_line`]: text without invisible characters, for pages, figures and the terminal.
//! - [`ReportError`]: reason why a report could not be written.
//!
//! ```
//! use freeplay_report::{Axis, Cell, Chart, Column, Document, Section, Series, Table, Verdict};
//!
//! let t = [0.0, 1.0, 2.0];
//! let page = Document::new("Two controllers")
//!     .overview((Verdict::Ok, "both stay within 0.7 mm"))
//!     .section(
//!         Section::new("Deviation")
//!             .with(
//!                 Table::new("Tool deviation after the first 0.5 s")
//!                     .column(Column::text("controller"))
//!                     .column(Column::number("rms", "mm").fixed(3).lowest())
//!                     .row([Cell::series("plain"), 0.599.into()])
//!                     .row([Cell::series("compensated"), 0.011.into()]),
//!             )
//!             .with(
//!                 Chart::trace("Deviation", Axis::new("time", "s"), Axis::new("deviation", "mm"))
//!                     .series(Series::line("plain", &t, &[0.0, 0.6, 0.6]))
//!                     .series(Series::line("compensated", &t, &[0.0, 0.1, 0.01])),
//!             ),
//!     )
//!     .to_html();
//! assert!(page.starts_with("<!DOCTYPE html>"));
//! ```

mod chart;
mod chart_data;
mod colours;
mod document;
mod drawing;
mod film;
mod html;
pub mod paste;
mod standalone;
mod svg;
mod table;
pub mod text;
mod thin;
pub mod units;
mod verdict;
mod visible;

pub use chart::{Axis, Chart, Mark, Scale, Series, Style};
pub use document::{Block, Document, Figure, Section};
pub use drawing::Drawing;
pub use film::{Film, Moving, Scene};
pub use html::ReportError;
pub use table::{Best, Cell, Column, Content, Table};
pub use thin::thin;
pub use verdict::Verdict;
pub use visible::{is_visible, one_line, visible};
