//! The calls to the operating system.

use std::path::Path;

/// A call to the operating system. `handle` numbers the files that a process has created, from 1.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(
    not(debug_assertions),
    allow(dead_code, reason = "only the fault injection of debug builds reads the fields")
)]
pub(crate) enum Call<'a> {
    /// Opens a file for reading.
    Open(&'a Path),
    /// Reads from an open file.
    Read(&'a Path),
    /// Lists a folder.
    List(&'a Path),
    /// Creates a file that does not exist.
    Create { path: &'a Path, handle: u64 },
    /// Opens a file for appending, and creates it if it is missing.
    Append { path: &'a Path, handle: u64 },
    /// Writes at an offset, bytes.
    Write { handle: u64, offset: u64, bytes: &'a [u8] },
    /// Truncates a file to a length, bytes.
    Truncate { handle: u64, length: u64 },
    /// Makes the data of a file durable.
    SyncFile { handle: u64 },
    /// Makes the names in a folder durable.
    SyncFolder(&'a Path),
    /// Renames a file, replacing an existing one.
    Rename { from: &'a Path, to: &'a Path },
    /// Creates one folder.
    MakeFolder(&'a Path),
    /// Locks an open file or folder.
    Lock(&'a Path),
    /// Sets the times of a file.
    SetTimes(&'a Path),
    /// Removes a file.
    Remove(&'a Path),
    /// Removes an empty folder.
    RemoveFolder(&'a Path),
}
