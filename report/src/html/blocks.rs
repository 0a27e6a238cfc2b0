//! Blocks without columns of numbers: text, lists, verdicts, tiles, code, details.

use maud::{Markup, html};

use super::{Context, drawing, figure, film, table};
use crate::document::{Block, Figure, Verdict};

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

/// Text with what stands between backticks set as code.
pub(crate) fn inline(text: &str) -> Markup {
    let parts: Vec<&str> = text.split('`').collect();
    // An odd number of backticks leaves the last one as it is.
    let closed = if parts.len().is_multiple_of(2) { parts.len() - 1 } else { parts.len() };
    html! {
        @for (place, part) in parts.iter().enumerate() {
            @if place >= closed { "`" (part) }
            @else if place % 2 == 1 { code { (part) } }
            @else { (part) }
        }
    }
}

/// The sign and the word of a verdict.
pub(crate) fn badge(verdict: Verdict) -> Markup {
    badge_with(verdict, verdict.word())
}

/// The sign of a verdict with a word of its own.
pub(crate) fn badge_with(verdict: Verdict, word: &str) -> Markup {
    let sign = match verdict {
        Verdict::Ok => "✓",
        Verdict::Warn => "!",
        Verdict::Fail => "✕",
        Verdict::Info => "i",
    };
    html! {
        span.badge.(verdict.word()) { span.sign aria-hidden="true" { (sign) } " " (word) }
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
