//! Tables.

use maud::{Markup, html};

use super::Context;
use super::inline::{badge, badge_with, inline};
use crate::table::{Best, Cell, Column, Content, Table};
use crate::text::{number, uncertain};

/// Properties shared by the cells of a column.
struct Drawn {
    numeric: bool,
    best: Option<f64>,
    longest: f64,
}

/// A table in a box of its own, which scrolls horizontally if the window is too narrow.
pub(crate) fn table(table: &Table, context: &Context<'_>) -> Markup {
    let drawn: Vec<Drawn> =
        table.columns.iter().enumerate().map(|(place, c)| Drawn::new(table, place, c)).collect();
    html! {
        figure.table {
            @if !table.caption.is_empty() { figcaption { (inline(&table.caption)) } }
            div.scroll tabindex="0" role="region" aria-label=(table.caption) {
                table {
                    thead { (group_headings(&table.columns)) (headings(&table.columns, &drawn)) }
                    tbody { @for row in &table.rows { (body_row(table, &drawn, row, context)) } }
                }
            }
            @if !table.note.is_empty() { p.note { (inline(&table.note)) } }
        }
    }
}

impl Drawn {
    fn new(table: &Table, place: usize, column: &Column) -> Self {
        let cells = || table.rows.iter().filter_map(|row| row.get(place));
        let values: Vec<f64> = cells().filter_map(Cell::value).collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let best = match column.best {
            Best::Lowest if low < high => Some(low),
            Best::Highest if low < high => Some(high),
            _ => None,
        };
        let numeric = cells().any(|cell| is_number(&cell.content));
        Self { numeric, best, longest: values.iter().fold(0.0, |most, value| value.abs().max(most)) }
    }
}

fn is_number(content: &Content) -> bool {
    matches!(content, Content::Number(_) | Content::Uncertain(..) | Content::Count(_))
}

/// The row of headings over several columns; empty if no column has one.
fn group_headings(columns: &[Column]) -> Markup {
    let runs = columns.chunk_by(|a, b| a.group == b.group);
    html! {
        @if columns.iter().any(|column| !column.group.is_empty()) {
            tr.groups {
                @for run in runs {
                    @if run[0].group.is_empty() { td colspan=(run.len()) {} }
                    @else { th scope="colgroup" colspan=(run.len()) { (run[0].group) } }
                }
            }
        }
    }
}

fn headings(columns: &[Column], drawn: &[Drawn]) -> Markup {
    html! {
        tr {
            @for (column, drawn) in columns.iter().zip(drawn) {
                th scope="col" .number[drawn.numeric] {
                    (column.title) @if !column.unit.is_empty() { " " span.unit { "[" (column.unit) "]" } }
                }
            }
        }
    }
}

fn body_row(table: &Table, drawn: &[Drawn], row: &[Cell], context: &Context<'_>) -> Markup {
    let missing = table.columns.len().saturating_sub(row.len());
    html! {
        tr {
            @for (place, cell) in row.iter().enumerate() {
                @let column = table.columns.get(place).zip(drawn.get(place));
                @if place == 0 { th scope="row" .wraps[column.is_some_and(|(column, _)| column.wraps)] { (content(cell, column, context)) } }
                @else { (body_cell(cell, column, context)) }
            }
            @for _ in 0..missing { td {} }
        }
    }
}

fn body_cell(cell: &Cell, column: Option<(&Column, &Drawn)>, context: &Context<'_>) -> Markup {
    let number = column.map_or_else(|| is_number(&cell.content), |(_, drawn)| drawn.numeric);
    let wraps = column.is_some_and(|(column, _)| column.wraps);
    let bar = column.filter(|(column, drawn)| column.bars && drawn.longest > 0.0).zip(cell.value());
    let bar = bar.map(|((_, drawn), value)| format!("--part: {:.1}%", 100.0 * value.abs() / drawn.longest));
    html! {
        td .number[number] .bar[bar.is_some()] .wraps[wraps] style=[bar] { (content(cell, column, context)) }
    }
}

fn content(cell: &Cell, column: Option<(&Column, &Drawn)>, context: &Context<'_>) -> Markup {
    let digits = column.map_or(crate::text::Digits::Significant(3), |(column, _)| column.digits);
    let best = column.and_then(|(_, drawn)| drawn.best);
    let is_best = best.is_some() && cell.value() == best;
    let written = match &cell.content {
        Content::Empty => html! {},
        Content::Text(text) => inline(text),
        Content::Judged(verdict, word) => badge_with(*verdict, word),
        Content::Series(name) => html! { (swatch(name, context)) (name) },
        Content::Number(value) => html! { (number(*value, digits)) },
        Content::Uncertain(value, half_width) => html! { (uncertain(*value, *half_width)) },
        Content::Count(count) => html! { (count) },
    };
    html! {
        @if let Some(verdict) = cell.verdict { (badge(verdict)) " " }
        @if is_best { strong.best { (written) span.unseen { " (best)" } } } @else { (written) }
    }
}

/// The colour of a name in the charts; empty for a name that no chart has.
fn swatch(name: &str, context: &Context<'_>) -> Markup {
    html! {
        @if let Some(place) = context.colours.index(name) {
            span.swatch.{ "series-" (place % crate::colours::PALETTE) } {}
        }
    }
}
