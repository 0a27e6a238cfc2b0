//! Standard output, which may be a pipe that nobody reads to its end.

use std::io::{ErrorKind, Write};

use crate::exit::Failure;

/// Writes `text` to standard output; a reader that has left is no fault.
///
/// # Errors
/// Standard output can't be written otherwise.
pub fn say(text: &str) -> Result<(), Failure> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::internal(format!("standard output: {error}")))
        }
        _ => Ok(()),
    }
}
