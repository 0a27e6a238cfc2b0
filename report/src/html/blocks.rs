//! Blocks without columns of numbers: text, lists, verdicts, tiles, code, details.

use maud::{Markup, html};

use super::inline::{badge, badge_with, inline};
use super::{Context, drawing, figure, film, table};
use crate::document::{Block, Figure};
use crate::verdict::Verdict;

/// Blocks, one below the other.
pub(crate) fn blocks(blocks: &[Block], context: &Context<'_>) -> Markup {
    html! { @for block in blocks { (one(block, context)) } }
}

fn one(block: &Block, context: &Context<'_>) -> Markup {
    match block {
        Block::Text(text) => paragraphs(text),
        Block::Heading(text) => html! { h3 { (text) } },
        Block::List(lines) => html! { ul { @for line in lines { li { (inline(line)) } } } },
        Block::Verdict(verdict, text) => banner(*verdict, verdict.word(), text),
        Block::Judged { verdict, word, text } => banner(*verdict, word, text),
        Block::Figures(figures) => tiles(figures),
        Block::Table(content) => table::table(content, context),
        Block::Chart(chart) => figure::chart(chart, context),
        Block::Drawing(content) => drawing::drawing(content, context),
        Block::Film(content) => film::film(content, context),
        Block::Columns(columns) => html! {
            div.columns { @for column in columns { div { (one(column, context)) } } }
        },
        Block::Code(text) => html! { pre tabindex="0" { code { (text) } } },
        Block::Details { summary, blocks: hidden } => html! {
            details { summary { (summary) } (blocks(hidden, context)) }
        },
    }
}

fn paragraphs(text: &str) -> Markup {
    let paragraphs = text.split("\n\n").map(str::trim).filter(|paragraph| !paragraph.is_empty());
    html! { @for paragraph in paragraphs { p { (inline(paragraph)) } } }
}

fn banner(verdict: Verdict, word: &str, text: &str) -> Markup {
    html! { p.verdict.(verdict.word()) { (badge_with(verdict, word)) span { (inline(text)) } } }
}

fn tiles(figures: &[Figure]) -> Markup {
    html! {
        dl.figures {
            @for figure in figures {
                div {
                    dt { (inline(&figure.label)) @if let Some(verdict) = figure.verdict { " " (badge(verdict)) } }
                    dd.value { (figure.value) @if !figure.unit.is_empty() { " " span.unit { (figure.unit) } } }
                    @if !figure.note.is_empty() { dd.note { (inline(&figure.note)) } }
                }
            }
        }
    }
}
