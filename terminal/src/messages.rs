//! Messages in addition to the results: progress, notes, details.
//!
//! Results go to standard output (see `output`), errors end the program (see `exit`); these messages go to standard error.

use std::fmt::Display;
use std::time::{Duration, Instant};

use freeplay_report::one_line;
use freeplay_storage::without_error_number;

use crate::flags::{OUTPUT_SETTINGS, is_quiet};
pub use crate::layout::width;
use crate::output::tell;
use crate::progress;

/// Without a terminal, a command that takes longer than this reports its present work.
const PATIENCE: Duration = Duration::from_secs(2);

/// Prints a note on the results, unless --quiet.
pub fn note(words: impl Display) {
    if !is_quiet() {
        tell(&one_line(&without_error_number(&words.to_string())));
    }
}

/// Prints a fault on standard error, also with --quiet.
pub fn fault(words: impl Display) {
    tell(&format!("freeplay: {}", without_error_number(&words.to_string())));
}

/// Prints a finished step, with --verbose, after the seconds since the start.
pub fn detail(words: impl Display) {
    if let Some(settings) =
        OUTPUT_SETTINGS.get().filter(|settings| settings.asked.verbose && !settings.asked.quiet)
    {
        tell_after(settings.started, words);
    }
}

/// Prints the present work of a long command, or with --verbose; not with --quiet.
pub fn announce(words: impl Display) {
    let Some(settings) = OUTPUT_SETTINGS.get().filter(|settings| !settings.asked.quiet) else { return };
    if !settings.asked.verbose && progress::step(&one_line(&words.to_string())) {
        return;
    }
    if settings.asked.verbose || settings.started.elapsed() > PATIENCE {
        tell_after(settings.started, words);
    }
}

fn tell_after(started: Instant, words: impl Display) {
    let line = format!("{:5.1} s  {words}", started.elapsed().as_secs_f64());
    tell(&one_line(&line));
}
