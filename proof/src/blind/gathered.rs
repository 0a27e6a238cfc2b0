//! Collects the cases of many receipts for one receipt, on disk, so that memory does not grow with the answers.

use std::collections::BTreeMap;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use freeplay_storage::{AtomicFile, LiveFile, read_bytes, remove_folder};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::make_folder;
use serde_json::{Value, json};

use super::canonical::canonical;
use super::hash::Running;
use super::receipt::{Part, Record, SCHEMA};

/// Bytes of a bucket in memory before they go to its file.
const HELD: usize = 64 << 10;
/// Leading bytes of a name that select the bucket: 256 buckets of names in hexadecimal digits.
const PREFIX: usize = 2;

/// Cases by the beginning of their names, each bucket in a file of its own. The order of buckets and of names within each is that of a receipt.
#[derive(Debug)]
pub struct Gathered {
    folder: PathBuf,
    buckets: BTreeMap<Vec<u8>, Vec<u8>>,
}

impl Gathered {
    /// Collects in `folder`, which is created and removed with this value.
    ///
    /// # Errors
    /// A folder that can't be created.
    pub fn new(folder: PathBuf) -> Result<Self, Failure> {
        remove_folder(&folder)?;
        make_folder(&folder)?;
        Ok(Self { folder, buckets: BTreeMap::new() })
    }

    /// Adds a case.
    ///
    /// # Errors
    /// A file that can't be written.
    pub fn add(&mut self, name: &str, record: &Record) -> Result<(), Failure> {
        let key = name.as_bytes().iter().take(PREFIX).copied().collect::<Vec<u8>>();
        let bucket = self.buckets.entry(key.clone()).or_default();
        serde_json::to_writer(&mut *bucket, &(name, record)).map_err(Failure::internal)?;
        bucket.push(b'\n');
        if bucket.len() < HELD {
            return Ok(());
        }
        let held = std::mem::take(bucket);
        let path = self.file(&key);
        LiveFile::open_to_append(&path)?.write_all(&held).map_err(|error| unwritten(&path, &error))
    }

    fn file(&self, key: &[u8]) -> PathBuf {
        self.folder.join(freeplay_terminal::hex::hex(key))
    }

    /// The cases of a bucket, by their names.
    fn bucket(&self, key: &[u8], held: &[u8]) -> Result<BTreeMap<String, Value>, Failure> {
        let path = self.file(key);
        let mut lines = if path.exists() { read_bytes(&path, u64::MAX - 1)? } else { Vec::new() };
        lines.extend_from_slice(held);
        let cases = lines.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
        cases.map(|line| serde_json::from_slice(line).map_err(Failure::internal)).collect()
    }

    /// Writes the receipt of all cases with their `parts` and their `score` to `path`; returns its hash.
    ///
    /// # Errors
    /// A file that can't be written or read back.
    pub fn write(&self, path: &Path, parts: &[Part], score: &Value) -> Result<String, Failure> {
        let file = AtomicFile::create(path)?;
        let mut receipt = Output { text: BufWriter::new(file), path, hash: Running::new("receipt") };
        // The text has the fields of a receipt in their order, the hash has them sorted: there, the parts come after the cases.
        receipt.text(&format!("{{\"schema\":{},\"parts\":[", json!(SCHEMA)))?;
        for (index, part) in parts.iter().enumerate() {
            receipt.text(if index > 0 { "," } else { "" })?;
            receipt.text(&serde_json::to_string(part).map_err(Failure::internal)?)?;
        }
        receipt.text("],")?;
        receipt.hash.add("{");
        receipt.both("\"cases\":{")?;
        let mut comma = "";
        for (key, held) in &self.buckets {
            for (name, record) in self.bucket(key, held)? {
                let name = Value::from(name);
                receipt.both(&format!("{comma}{name}:"))?;
                receipt.text(&record.to_string())?;
                receipt.hash.add(&canonical(&record));
                comma = ",";
            }
        }
        receipt.both("},")?;
        receipt.hash.add("\"parts\":[");
        for (index, part) in parts.iter().enumerate() {
            receipt.hash.add(if index > 0 { "," } else { "" });
            receipt.hash.add(&canonical(&json!(part)));
        }
        receipt.hash.add(&format!("],\"schema\":{},\"score\":{}}}", json!(SCHEMA), canonical(score)));
        receipt.text(&format!("\"score\":{score}"))?;
        receipt.commit()
    }
}

impl Drop for Gathered {
    fn drop(&mut self) {
        // The caller already knows whether the receipt was written; remaining files can be removed by hand.
        let _ = remove_folder(&self.folder);
    }
}

/// Writes and hashes a receipt at once.
struct Output<'a> {
    text: BufWriter<AtomicFile>,
    path: &'a Path,
    hash: Running,
}

impl Output<'_> {
    fn text(&mut self, text: &str) -> Result<(), Failure> {
        self.text.write_all(text.as_bytes()).map_err(|error| unwritten(self.path, &error))
    }

    fn both(&mut self, text: &str) -> Result<(), Failure> {
        self.hash.add(text);
        self.text(text)
    }

    /// Ends the file with the hash.
    fn commit(mut self) -> Result<String, Failure> {
        let hash = std::mem::replace(&mut self.hash, Running::new("")).done();
        self.text(&format!(",\"sha256\":\"{hash}\"}}\n"))?;
        let path = self.path;
        let file = self.text.into_inner().map_err(|error| unwritten(path, error.error()))?;
        file.commit()?;
        Ok(hash)
    }
}

fn unwritten(path: &Path, error: &std::io::Error) -> Failure {
    Failure::input(format!("{}: {error}; make room, or choose another --out", path.display()))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde_json::{Value, json};

    use super::Gathered;
    use crate::blind::answer::Answer;
    use crate::blind::receipt::{Receipt, Record, SCHEMA};

    /// The receipt collected on disk equals a receipt in memory byte for byte, for names of all kinds and more cases than a bucket holds.
    #[test]
    fn a_gathered_receipt_is_that_of_memory() {
        let folder = tempfile::tempdir().expect("a folder");
        let record = |index: usize| Record {
            salt: format!("{index:04x}"),
            truth: json!({ "effects": [], "seed": index, "length": 0.1 * index as f64, "words": "a \"line\"\nand ä\ttab" }),
            answer: Answer {
                statement: "x".repeat(700),
                cpu_seconds: 1.5 / (index + 1) as f64,
                ..Answer::default()
            },
            outcome: None,
        };
        let names = (0_u64..400).map(|index| format!("{:016x}", index * 7_919 % 400 + ((index % 2) << 60)));
        let names: Vec<String> = names.chain(["a", "ö", "b\"c", "zz\n1"].map(str::to_owned)).collect();
        let mut gathered = Gathered::new(folder.path().join("cases")).expect("a folder");
        let mut cases = BTreeMap::new();
        for (index, name) in names.iter().enumerate() {
            gathered.add(name, &record(index)).expect("it is added");
            cases.insert(name.clone(), record(index));
        }
        assert!(folder.path().join("cases").read_dir().expect("a folder").count() > 0, "some are on disk");
        let score = json!({ "goals": [1.5, Value::Null] });
        let hash = gathered.write(&folder.path().join("one.json"), &[], &score).expect("it is written");
        let mut whole =
            Receipt { schema: SCHEMA.to_owned(), parts: Vec::new(), cases, score, sha256: String::new() };
        whole.write(&folder.path().join("two.json")).expect("it is written");
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("a file");
        assert_eq!(read("one.json"), read("two.json"));
        assert_eq!(hash, whole.sha256);
        drop(gathered);
        assert!(!folder.path().join("cases").exists());
    }
}
