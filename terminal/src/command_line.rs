//! Errors of a command line, as reported by its parser.

use std::error::Error;
use std::io::Write;

use anstream::{AutoStream, ColorChoice};
use freeplay_storage::plain_words;

use crate::flags::color_among;

/// Prints help, the version, or the error of the command line; a refused value in plain words.
pub fn print(error: &clap::Error) {
    // If neither output can be written, nobody can read the message.
    let _ = match in_plain_words(error) {
        Some(message) => {
            let choice = match color_among(std::env::args_os()) {
                clap::ColorChoice::Auto => AutoStream::choice(&std::io::stderr()),
                clap::ColorChoice::Always => ColorChoice::Always,
                clap::ColorChoice::Never => ColorChoice::Never,
            };
            AutoStream::new(std::io::stderr(), choice).lock().write_all(message.as_bytes())
        }
        None => error.print(),
    };
}

/// The message of `error` if it refuses a value in words of the program; `None` if the message can be shown unchanged.
#[must_use]
pub fn in_plain_words(error: &clap::Error) -> Option<String> {
    let cause = error.source()?.to_string();
    let (said, words) = (format!(": {cause}"), format!(": {}", plain_words(&cause)));
    let message = error.render().ansi().to_string();
    // The cause ends the message; the value before it may hold any words.
    (said != words)
        .then(|| {
            message.rfind(&said).map(|at| message[..at].to_owned() + &words + &message[at + said.len()..])
        })
        .flatten()
}
