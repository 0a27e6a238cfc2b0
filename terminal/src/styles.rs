//! The styles of words of verdict.

use std::fmt::Display;

use clap::builder::styling::{AnsiColor, Style};

/// A good result.
pub const GOOD: Style = AnsiColor::Green.on_default().bold();
/// An undecided or unknown result.
pub const UNDECIDED: Style = AnsiColor::Yellow.on_default().bold();
/// A bad result.
pub const BAD: Style = AnsiColor::Red.on_default().bold();

/// The styles of [`styled`] words, the only escape sequences sent to the terminal.
pub const STYLES: [Style; 3] = [GOOD, UNDECIDED, BAD];

/// `words` in `style`, for [`show`](crate::output::show).
pub fn styled(style: Style, words: impl Display) -> String {
    format!("{style}{words}{style:#}")
}

/// The word of a verdict on a run, padded.
pub fn judgement(holds: bool) -> String {
    if holds { styled(GOOD, "holds  ") } else { styled(BAD, "FAILS  ") }
}
