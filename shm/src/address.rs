//! [`Address`]: the information with which a process finds a run.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::error::LinkError;
use crate::limits::MAX_ROOT;

/// Environment variable that carries an [`Address`] to another process.
pub const RUN_ENV: &str = "FREEPLAY_RUN";

/// Longest run id, bytes.
const MAX_ID: usize = 32;

/// Location of a run: its folder on tmpfs. The run's id is the folder's name, and all other names derive from it.
///
/// As text, an address is the folder's absolute path, e.g. `/dev/shm/freeplay-1000/4711-9f3c21aa`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    root: PathBuf,
    id: String,
}

impl Address {
    /// Parses the text of an address as written by [`Display`](fmt::Display). The function does not check that the run lives.
    ///
    /// # Errors
    /// [`LinkError::BadAddress`] unless `text` is an absolute path of at most 112 bytes whose last part is a run id: at most 32
    /// letters, digits and hyphens.
    pub fn parse(text: &str) -> Result<Self, LinkError> {
        let bad = || LinkError::BadAddress { text: text.to_owned() };
        let root = Path::new(text);
        let id = root.file_name().and_then(|name| name.to_str()).ok_or_else(bad)?;
        let is_id = id.len() <= MAX_ID && id.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
        if !root.is_absolute() || !is_id || text.len() > MAX_ROOT {
            return Err(bad());
        }
        Ok(Self { root: root.to_owned(), id: id.to_owned() })
    }

    /// The address in the environment variable [`RUN_ENV`].
    ///
    /// # Errors
    /// [`LinkError::NoAddress`] if it is not set, [`LinkError::BadAddress`] if its text is not an address.
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

    /// Hash of the run's id as used in messages: FNV-1a, 64 bit (Fowler, Noll, Vo 1991).
    #[must_use]
    pub fn run(&self) -> u64 {
        self.id.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }

    /// Prefix of the names of all the run's shared memory objects; no run's prefix begins with another's.
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn an_address_survives_being_written_and_read() {
        let address = Address::parse("/dev/shm/freeplay-1000/4711-9f3c21aa").unwrap();
        assert_eq!(address.to_string().parse::<Address>().unwrap(), address);
        assert_eq!((address.id(), address.prefix().as_str()), ("4711-9f3c21aa", "freeplay-4711-9f3c21aa_"));
    }

    #[test]
    fn the_run_is_the_published_hash_of_its_id() {
        // Test vectors of the FNV reference code: "a" and "foobar".
        assert_eq!(Address::parse("/a").unwrap().run(), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(Address::parse("/foobar").unwrap().run(), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn what_is_no_address_is_told() {
        let long_path = format!("/{}/run", "x".repeat(MAX_ROOT));
        let long_id = format!("/{}", "x".repeat(MAX_ID + 1));
        for text in ["", "run", "tmp/run", "/", "/tmp/..", "/tmp/a_b", "/tmp/a b", &long_path, &long_id] {
            let error = Address::parse(text).unwrap_err();
            assert!(error.to_string().contains("is no address of a run"), "'{text}': {error}");
        }
    }
}
