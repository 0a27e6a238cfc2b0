//! The parts of a line: text with code in it, the sign of a verdict.

use maud::{Markup, html};

use crate::verdict::Verdict;

/// Text in which words between backticks are set as code.
pub(crate) fn inline(text: &str) -> Markup {
    let parts: Vec<&str> = text.split('`').collect();
    // With an odd number of backticks the last one stays.
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
