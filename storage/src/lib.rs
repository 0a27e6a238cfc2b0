//! Access to the user's files and folders. Every crate of the project opens, reads, writes, renames and removes them through this crate.
//!
//! The items, in the order in which data passes through them:
//!
//! - an [`InputFile`] is a regular file open for reading; [`read_bytes`] and [`read_text`] read a whole file up to a limit;
//! - [`list`] returns the entries of a folder, without following links;
//! - an [`OutputFolder`] is a folder for the exclusive use of one command, locked until the command ends, and removed again if it stays empty;
//! - [`make_folder`] creates a folder private to its owner;
//! - an [`AtomicFile`] appears under its name complete or not at all; [`write()`] does the same for bytes in memory;
//! - a [`LiveFile`] is the exception: a recording that is readable while it grows;
//! - an [`Exposure`] reports a folder whose contents other users can change;
//! - a [`StorageError`] contains the operation, the path, the cause and the remedy; a [`Refusal`] is a cause detected by this crate;
//! - [`plain_words`] rewrites the message of a parser in the terms of the person who wrote the text.
//!
//! One function of the module `call` makes every call to the operating system. In a debug build it reads the variables
//! `FREEPLAY_STORAGE_FAULT` and `FREEPLAY_STORAGE_LOG`, makes the n-th call fail, and logs the calls; a release build has neither.

mod atomic;
mod call;
mod error;
mod exposure;
mod folder;
mod handle;
#[cfg(debug_assertions)]
mod injection;
mod input;
mod live;
mod output_folder;
mod path;
mod perform;
mod plain_words;

pub use atomic::{AtomicFile, TEMPORARY_SUFFIX, write};
pub use error::{Operation, PATH_LIMIT, Refusal, StorageError};
pub use exposure::Exposure;
pub use folder::{
    Entry, EntryKind, FileIdentity, check_target, list, make_folder, remove_file, remove_folder, same_file,
    set_times,
};
pub use input::{
    CONFIG_LIMIT, DOCUMENT_LIMIT, InputFile, open_without_links, read_bytes, read_config, read_text,
};
pub use live::LiveFile;
pub use output_folder::{Claim, OutputFolder};
pub use path::check_path;
pub use plain_words::{plain_words, without_error_number};
