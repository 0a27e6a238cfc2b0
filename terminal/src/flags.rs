//! The flags of every command: amount of output, and colours.

use std::ffi::OsString;
use std::sync::OnceLock;
use std::time::Instant;

use clap::{Args, ColorChoice, ValueEnum};

/// Options of every command.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Print only results and errors, without progress and notes.
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Print each step on standard error.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    /// When to print in colour. The value auto prints in colour on a terminal unless NO_COLOR is set.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    color: ColorChoice,
}

/// The output settings of this command, once the command line is read.
pub(crate) static OUTPUT_SETTINGS: OnceLock<OutputSettings> = OnceLock::new();

/// Output settings of this command, and its start time.
pub(crate) struct OutputSettings {
    pub asked: Common,
    pub started: Instant,
}

impl Common {
    /// Applies these flags to all later output of the process.
    pub fn apply(self) {
        match self.color {
            ColorChoice::Auto => anstream::ColorChoice::Auto,
            ColorChoice::Always => anstream::ColorChoice::Always,
            ColorChoice::Never => anstream::ColorChoice::Never,
        }
        .write_global();
        // The first call decides: the process reads its command line once.
        let _ = OUTPUT_SETTINGS.set(OutputSettings { asked: self, started: Instant::now() });
    }
}

/// The --color among `words`, for output before the command line is parsed: help and usage errors.
pub fn color_among(words: impl Iterator<Item = OsString>) -> ColorChoice {
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let after = words.iter().position(|word| word == "--color").and_then(|place| words.get(place + 1));
    let value = words.iter().find_map(|word| word.strip_prefix("--color=")).or(after.map(String::as_str));
    value.and_then(|value| ColorChoice::from_str(value, false).ok()).unwrap_or_default()
}

/// True if the user wants only results and errors.
pub fn is_quiet() -> bool {
    OUTPUT_SETTINGS.get().is_some_and(|settings| settings.asked.quiet)
}

/// True if standard output has colour.
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
