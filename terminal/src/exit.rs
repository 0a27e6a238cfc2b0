//! Exit codes, and how a failure becomes one.

use std::process::ExitCode;

/// What a process of this program ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Done.
    Done = 0,
    /// A verdict failed.
    Verdict = 1,
    /// The command line is not understood.
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

/// A failure: what to say and which code to end with.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// What went wrong and what to do, for a person.
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

    /// A thread that the system does not start.
    pub fn no_thread(error: impl std::fmt::Display) -> Self {
        Self::internal(format!(
            "the system starts no thread: {error}; allow more memory or more processes (ulimit -v, ulimit -u)"
        ))
    }

    /// The command line is not understood.
    pub fn usage(error: impl std::fmt::Display) -> Self {
        Self { exit: Exit::Usage, message: error.to_string() }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}
