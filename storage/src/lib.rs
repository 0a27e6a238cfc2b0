//! Files and folders that a person sees. Every crate of the project opens, reads, writes, renames and removes them here.
//!
//! In the order in which data passes through them:
//!
//! - an [`InputFile`] is a regular file open for reading; [`read_bytes`] and [`read_text`] read a whole one up to a limit;
//! - [`list`] names what a folder holds, and follows no link out of it;
//! - an [`OutputFolder`] is a folder that one command has to itself, locked until the command ends, and gone again if nothing was put into it;
//! - [`make_folder`] makes a folder for its owner alone;
//! - an [`AtomicFile`] appears under its name whole or not at all; [`write()`] does the same for bytes in memory;
//! - a [`LiveFile`] is the exception: a recording that is readable while it grows;
//! - an [`Exposure`] tells that other users can change what is in a folder;
//! - a [`StorageError`] names the operation, the path, the cause and the remedy; a [`Refusal`] is a cause of this crate;
//! - [`plain_words`] says what a parser finds wrong with a text in words of the person who wrote it.
//!
//! Every call to the operating system passes through one function of the module `call`. A debug build reads the variables
//! `FREEPLAY_STORAGE_FAULT` and `FREEPLAY_STORAGE_LOG` there, lets the n-th call fail, and logs what a disk is told; a release build has
//! neither.

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
