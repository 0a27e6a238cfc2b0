//! SHA-256 of the frozen objects: files, texts, the catalogue.

use std::io::Read;
use std::path::Path;

use freeplay_laws::kinds;
use freeplay_storage::open_without_links;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::unreadable;
use freeplay_terminal::hex::hex;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::canonical::canonical;

/// SHA-256 of the concatenated `parts`, each with its length before it, as hexadecimal digits.
fn of(parts: &[&[u8]]) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hex(&hash.finalize())
}

/// SHA-256 of the content of the file `path`, which must not be a link; the number that `sha256sum` prints.
///
/// # Errors
/// A file that can't be read.
pub fn of_file(path: &Path) -> Result<String, Failure> {
    let failed = |error| unreadable(path, error);
    let mut file = open_without_links(path)?;
    let (mut hash, mut buffer) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut buffer).map_err(failed)? {
            0 => return Ok(hex(&hash.finalize())),
            read => hash.update(&buffer[..read]),
        }
    }
}

/// SHA-256 of the running program.
///
/// # Errors
/// A program whose file can't be read.
pub fn of_program() -> Result<String, Failure> {
    of_file(&std::env::current_exe().map_err(Failure::internal)?)
}

/// The definition of the effects in the catalogue and beyond it: names, places, parameters with units, laws, sources.
pub fn catalogue() -> Value {
    let kinds = kinds().map(|kind| {
        let parameters: Vec<Value> = kind
            .parameters
            .iter()
            .map(|p| json!({ "name": p.name, "meaning": p.meaning, "range": format!("{:?}", p.range) }))
            .collect();
        json!({
            "kind": kind.name, "site": format!("{:?}", kind.site), "seen": format!("{:?}", kind.seen),
            "parameters": parameters, "equation": kind.equation, "source": kind.source,
        })
    });
    Value::Array(kinds.collect())
}

/// SHA-256 of the catalogue's definition.
pub fn of_catalogue() -> String {
    of_json("catalogue", &catalogue())
}

/// SHA-256 of the word `purpose`, a newline and the canonical text of `value`. The purpose keeps the hash of one object from passing for that of another.
pub fn of_json(purpose: &str, value: &Value) -> String {
    hex(&Sha256::digest(format!("{purpose}\n{}", canonical(value))))
}

/// [`of_json`] of a value whose canonical text comes piece by piece.
#[derive(Debug)]
pub struct Running(Sha256);

impl Running {
    /// A hash for `purpose`.
    pub fn new(purpose: &str) -> Self {
        Self(Sha256::new_with_prefix(format!("{purpose}\n")))
    }

    /// Adds the next piece of the canonical text.
    pub fn add(&mut self, text: &str) {
        self.0.update(text);
    }

    /// The hash, as hexadecimal digits.
    pub fn done(self) -> String {
        hex(&self.0.finalize())
    }
}

/// The commitment to the truth of one case.
pub fn commitment(salt: &str, truth: &Value) -> String {
    of_json("truth", &json!([salt, truth]))
}

/// True if `commitment` commits to `truth`, also by the earlier construction, for folders that were sealed with it: the salt and the truth as compact JSON, in
/// the order of its keys, each with its length before it.
pub fn commits(found: &str, salt: &str, truth: &Value) -> bool {
    found == commitment(salt, truth) || found == of(&[salt.as_bytes(), truth.to_string().as_bytes()])
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    /// The hash of a file equals the example of the standard, FIPS 180-4: "abc".
    #[test]
    fn a_file_has_the_hash_of_the_standard() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").expect("a file");
        let hash = super::of_file(&path).expect("a hash");
        assert_eq!(hash, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    /// Neither another salt, nor another truth, nor a byte moved from one to the other gives the same commitment.
    #[test]
    fn a_commitment_binds() {
        let truth = json!({ "effects": [] });
        let this = super::commitment("00ff", &truth);
        assert_eq!(this, super::commitment("00ff", &truth));
        assert_ne!(this, super::commitment("00fe", &truth));
        assert_ne!(this, super::commitment("00ff", &json!({ "effects": [1] })));
        assert_ne!(super::of(&[b"ab", b"c"]), super::of(&[b"a", b"bc"]));
        assert_ne!(super::of_json("truth", &truth), super::of_json("answers", &truth));
        let earlier = super::of(&[b"00ff", br#"{"effects":[]}"#]);
        assert!(super::commits(&earlier, "00ff", &truth) && !super::commits(&earlier, "00fe", &truth));
    }
}
