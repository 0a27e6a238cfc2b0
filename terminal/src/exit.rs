//! Exit codes, and the conversion of failures to them.

use std::process::ExitCode;

/// Exit code of a process of this program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Done.
    Done = 0,
    /// A verdict failed.
    Verdict = 1,
    /// An invalid command line.
    Usage = 2,
    /// Bad input or configuration.
    Input = 3,
    /// The machine is not fit (`--require-rt`).
    Unfit = 4,
    /// The other process is missing.
    Peer = 5,
    /// An internal fault.
    Internal = 70,
    /// Interrupted; the recording was closed properly.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit as u8)
    }
}

/// A failure: the message and the exit code.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// The fault and the remedy, for a person.
    pub message: String,
}

impl Failure {
    /// Bad input or configuration.
    pub fn input(error: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Input, message: error.to_string() }
    }

    /// The other process is missing.
    pub fn peer(error: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Peer, message: error.to_string() }
    }

    /// A fault of this program or of the machine.
    pub fn internal(error: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Internal, message: error.to_string() }
    }

    /// The system cannot start a thread.
    pub fn no_thread(error: impl std::fmt::Display) -> Self {
        Self::internal(format!(
            "the system starts no thread: {error}; allow more memory or more processes (ulimit -v, ulimit -u)"
        ))
    }

    /// An invalid command line.
    pub fn usage(error: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Usage, message: error.to_string() }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}
