//! The flags of every command, and the messages that they control: progress, notes, details, colour.
//!
//! Results go to standard output (see `output`), errors end the program (see `exit`); these messages go to standard error.

use std::ffi::OsString;
use std::fmt::Display;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use clap::builder::styling::{AnsiColor, Style};
use clap::{Args, ColorChoice, ValueEnum};
use freeplay_report::one_line;
use freeplay_storage::without_error_number;

pub use crate::layout::width;
use crate::output::tell;
use crate::progress;

/// Where there is no terminal, a command that takes longer tells what it is doing.
const PATIENCE: Duration = Duration::from_secs(2);

/// A good result.
pub const GOOD: Style = AnsiColor::Green.on_default().bold();
/// An undecided or unknown result.
pub const UNDECIDED: Style = AnsiColor::Yellow.on_default().bold();
/// A bad result.
pub const BAD: Style = AnsiColor::Red.on_default().bold();

/// The styles of [`styled`] words, which alone may speak to the terminal.
pub const STYLES: [Style; 3] = [GOOD, UNDECIDED, BAD];

/// What every command understands.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Print results and errors alone: no progress, no notes.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Print each step on standard error.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// When to print in colour; auto: on a terminal, unless NO_COLOR is set.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    color: ColorChoice,
}

/// What was asked for, once it is known.
static VOICE: OnceLock<Voice> = OnceLock::new();

struct Voice {
    asked: Common,
    begun: Instant,
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

/// Says something worth knowing beside the results, unless --quiet.
pub fn note(words: impl Display) {
    if !is_quiet() {
        tell(&one_line(&without_error_number(&words.to_string())));
    }
}

/// Says on standard error what went wrong, also with --quiet.
pub fn fault(words: impl Display) {
    tell(&format!("freeplay: {}", without_error_number(&words.to_string())));
}

/// Says what was done, with --verbose, after the seconds since the start.
pub fn detail(words: impl Display) {
    if let Some(voice) = VOICE.get().filter(|voice| voice.asked.verbose && !voice.asked.quiet) {
        voice.tell(words);
    }
}

/// Says what is being done: of a command that takes long, or with --verbose; not with --quiet.
pub fn announce(words: impl Display) {
    let Some(voice) = VOICE.get().filter(|voice| !voice.asked.quiet) else { return };
    if !voice.asked.verbose && progress::step(&one_line(&words.to_string())) {
        return;
    }
    if voice.asked.verbose || voice.begun.elapsed() > PATIENCE {
        voice.tell(words);
    }
}

impl Voice {
    fn tell(&self, words: impl Display) {
        let line = format!("{:5.1} s  {words}", self.begun.elapsed().as_secs_f64());
        tell(&one_line(&line));
    }
}

/// `words` in `style`, for [`show`](crate::output::show).
pub fn styled(style: Style, words: impl Display) -> String {
    format!("{style}{words}{style:#}")
}

/// The word before what was asked of a run, padded: whether it holds.
pub fn judgement(holds: bool) -> String {
    if holds { styled(GOOD, "holds  ") } else { styled(BAD, "FAILS  ") }
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
