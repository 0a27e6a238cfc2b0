//! The flags of every command: how much it says, and in which colours.

use std::ffi::OsString;
use std::sync::OnceLock;
use std::time::Instant;

use clap::{Args, ColorChoice, ValueEnum};

/// What every command understands.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Print results and errors alone: no progress, no notes.
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Print each step on standard error.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// When to print in colour; auto: on a terminal, unless NO_COLOR is set.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    color: ColorChoice,
}

/// What was asked for, once it is known.
pub(crate) static VOICE: OnceLock<Voice> = OnceLock::new();

pub(crate) struct Voice {
    pub asked: Common,
    pub begun: Instant,
}

impl Common {
    /// Lets all that is said from now on be said as asked for.
    pub fn apply(self) {
        match self.color {
            ColorChoice::Auto => anstream::ColorChoice::Auto,
            ColorChoice::Always => anstream::ColorChoice::Always,
            ColorChoice::Never => anstream::ColorChoice::Never,
        }
        .write_global();
        // What was said first holds: the command line is read once.
        let _ = VOICE.set(Voice { asked: self, begun: Instant::now() });
    }
}

/// The --color among `words`, for what is printed of them before they are understood: help, and what is wrong with them.
pub fn color_among(words: impl Iterator<Item = OsString>) -> ColorChoice {
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let after = words.iter().position(|word| word == "--color").and_then(|place| words.get(place + 1));
    let value = words.iter().find_map(|word| word.strip_prefix("--color=")).or(after.map(String::as_str));
    value.and_then(|value| ColorChoice::from_str(value, false).ok()).unwrap_or_default()
}

/// Whether results and errors are all that is wanted.
pub fn is_quiet() -> bool {
    VOICE.get().is_some_and(|voice| voice.asked.quiet)
}

/// Whether what goes to standard output has colour.
pub fn is_coloured() -> bool {
    anstream::AutoStream::choice(&std::io::stdout()) != anstream::ColorChoice::Never
}

#[cfg(test)]
mod tests {
    use clap::ColorChoice;

    use super::color_among;

    #[test]
    fn the_colour_is_known_before_the_command_line_is() {
        let of = |line: &str| color_among(line.split(' ').map(Into::into));
        assert_eq!(of("freeplay run --color never --help"), ColorChoice::Never);
        assert_eq!(of("freeplay --color=always"), ColorChoice::Always);
        for line in ["freeplay run", "freeplay --color", "freeplay --color red"] {
            assert_eq!(of(line), ColorChoice::Auto, "{line}");
        }
    }
}
