//! [`Address`]: what a process needs to find a run.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::error::LinkError;

/// Environment variable that carries an [`Address`] to another process.
pub const RUN_ENV: &str = "FREEPLAY_RUN";

/// Longest path of a run's folder, bytes: iceoryx2 takes paths of up to 255 bytes, and its longest name within the folder
/// needs the rest.
pub(crate) const MAX_ROOT: usize = 96;

/// Where a run lives: its folder on tmpfs. The run's id is the folder's name; everything else follows from it.
///
/// As text, an address is the folder's absolute path, e.g. `/dev/shm/freeplay-1000/4711-9f3c21aa`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    root: PathBuf,
    id: String,
}

impl Address {
    /// Reads an address as [`Display`](fmt::Display) writes it. Does not look whether the run lives.
    ///
    /// # Errors
    /// [`LinkError::BadAddress`] unless `text` is an absolute path whose last part is a run id: letters, digits and
    /// hyphens; of at most 96 bytes.
    pub fn parse(text: &str) -> Result<Self, LinkError> {
        let bad = || LinkError::BadAddress { text: text.to_owned() };
        let root = Path::new(text);
        let id = root.file_name().and_then(|name| name.to_str()).ok_or_else(bad)?;
        let is_id = id.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
        if !root.is_absolute() || !is_id || text.len() > MAX_ROOT {
            return Err(bad());
        }
        Ok(Self { root: root.to_owned(), id: id.to_owned() })
    }

    /// The address in the environment variable [`RUN_ENV`].
    ///
    /// # Errors
    /// [`LinkError::NoAddress`] if it is not set, [`LinkError::BadAddress`] if it is no address.
    pub fn from_env() -> Result<Self, LinkError> {
        let text = std::env::var(RUN_ENV).map_err(|_| LinkError::NoAddress)?;
        Self::parse(&text)
    }

    /// The run's folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The run's id.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Hash of the run's id as it stands in messages: FNV-1a, 64 bit (Fowler, Noll, Vo 1991).
    #[must_use]
    pub fn run(&self) -> u64 {
        self.id.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }

    /// First part of the names of all the run's shared memory objects; no run's prefix begins with another's.
    #[must_use]
    pub fn prefix(&self) -> String {
        format!("freeplay-{}_", self.id)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.root.display().fmt(f)
    }
}

impl FromStr for Address {
    type Err = LinkError;

    fn from_str(text: &str) -> Result<Self, LinkError> {
        Self::parse(text)
    }
}
