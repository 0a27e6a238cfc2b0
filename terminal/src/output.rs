//! Standard output, which may be a pipe that nobody reads to its end.

use std::io::{Error, ErrorKind, Write};

use crate::exit::Failure;

/// Writes `text` to standard output as it is; a reader that has left is no fault.
///
/// # Errors
/// Standard output can't be written otherwise.
pub fn say(text: &str) -> Result<(), Failure> {
    written(std::io::stdout().lock().write_all(text.as_bytes()))
}

/// Writes `text` for a person, which may have styles: they are left out where --color, `NO_COLOR` or the lack of a terminal says so.
///
/// # Errors
/// As [`say`].
pub fn show(text: &str) -> Result<(), Failure> {
    written(anstream::stdout().lock().write_all(text.as_bytes()))
}

fn written(done: Result<(), Error>) -> Result<(), Failure> {
    match done {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::internal(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}
