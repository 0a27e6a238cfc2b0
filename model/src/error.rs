//! The errors of model files.

use std::io;

use thiserror::Error;

use freeplay_arm::{ArmError, Place};

/// Largest accepted model file, bytes.
pub const MAX_FILE_BYTES: u64 = freeplay_storage::CONFIG_LIMIT;

/// A value as text for an error: at most one line.
pub(crate) fn shortened(value: &str) -> String {
    const LONGEST: usize = 120;
    match value.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &value[..end]),
        None => value.to_owned(),
    }
}

/// Reason why a model file could not be read.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The file could not be opened or read.
    #[error("{path}: {source}; check the path and its permissions")]
    Read {
        /// The file.
        path: String,
        /// The system's error.
        source: io::Error,
    },
    /// The file is not UTF-8.
    #[error("{path}: not UTF-8 text from byte {offset} on; save it as UTF-8")]
    NotUtf8 {
        /// The file.
        path: String,
        /// First byte that is not UTF-8, from 0.
        offset: usize,
    },
    /// The file is longer than allowed.
    #[error("{origin}: longer than the {} MiB allowed for a model file; is it a mesh or a recording?", MAX_FILE_BYTES >> 20)]
    TooLarge {
        /// The file.
        origin: String,
    },
    /// The file is empty.
    #[error("{origin}: the file is empty; it should hold a URDF robot, an MJCF model or a TOML arm")]
    Empty {
        /// The file.
        origin: String,
    },
    /// Neither URDF nor TOML by its name.
    #[error("{path}: unknown kind of model file; its name must end in .urdf, .xml, .mjcf or .toml")]
    UnknownExtension {
        /// The file.
        path: String,
    },
    /// A xacro file that was not expanded.
    #[error(
        "{at}: {found} shows an unexpanded xacro file; run xacro first: `xacro arm.urdf.xacro > arm.urdf`"
    )]
    Xacro {
        /// The place.
        at: Place,
        /// The part that is not expanded.
        found: String,
    },
    /// Not well-formed XML or TOML, or an unknown key.
    #[error("{at}: {message}")]
    Syntax {
        /// The place.
        at: Place,
        /// The parser's message.
        message: String,
    },
    /// A value that cannot be used.
    #[error("{at}: {what} is `{value}`; {remedy}")]
    Value {
        /// The place.
        at: Place,
        /// Name of the value.
        what: String,
        /// The text in the file.
        value: String,
        /// The remedy.
        remedy: String,
    },
    /// A required part is missing.
    #[error("{at}: {what} is missing; {remedy}")]
    Missing {
        /// The place where it belongs.
        at: Place,
        /// The missing part.
        what: String,
        /// The remedy.
        remedy: String,
    },
    /// Two links or joints with one name.
    #[error("{at}: a second {what} called `{name}`; give every {what} a name of its own")]
    Duplicate {
        /// The place of the second one.
        at: Place,
        /// Link or joint.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A link with two parents.
    #[error(
        "{at}: link `{link}` is the child of joint `{first}` and of joint `{second}`; an arm is a tree: remove one of the two joints"
    )]
    TwoParents {
        /// The place of the second joint.
        at: Place,
        /// The link.
        link: String,
        /// The joint found first.
        first: String,
        /// The joint found second.
        second: String,
    },
    /// Links in a closed loop.
    #[error(
        "{at}: joint `{joint}` is part of a closed loop of links; an arm is a tree: remove one joint of the loop"
    )]
    Loop {
        /// The place of a joint of the loop.
        at: Place,
        /// That joint.
        joint: String,
    },
    /// The link that should be the end of the arm is not suitable.
    #[error("{at}: tip `{tip}`: {problem}; links at the ends of chains are {known}")]
    Tip {
        /// The start of the file.
        at: Place,
        /// The requested link.
        tip: String,
        /// The fault, in words.
        problem: &'static str,
        /// Suitable links.
        known: String,
    },
    /// The file describes an impossible arm.
    #[error("{at}: {source}")]
    Arm {
        /// The place of the joint, or the start of the file.
        at: Place,
        /// The fault, in words.
        source: Box<ArmError>,
    },
}
