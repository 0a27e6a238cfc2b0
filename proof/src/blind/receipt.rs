//! The receipt: a log of the whole protocol in order, with the hashes that bind it.

use std::collections::BTreeMap;
use std::path::Path;

use freeplay_concealed::{Matrix, Quota};
use freeplay_storage::{Refusal, plain_words, read_bytes};
use freeplay_terminal::exit::Failure;
use serde::{Deserialize, Serialize};
use serde_json::error::Category;
use serde_json::{Value, json};

use super::analysis::Sealed;
use super::answer::Answer;
use super::canonical::difference;
use super::judged::Judged;
use super::score::Outcome;
use super::source::Other;
use super::truth::Truth;
use super::{hash, strict};

/// The schema of a [`Receipt`].
pub const SCHEMA: &str = "freeplay.receipt/2";
/// The earlier schema, whose hashes left out fields.
const EARLIER: &str = "freeplay.receipt/1";
/// The file that the user should give as a receipt.
const WANTED: &str = "give a receipt.json that freeplay blind left";

/// Largest receipt that the program reads, bytes: some 100,000 cases of one joint or 10,000 of six. Checking a receipt takes twenty times this in memory.
const LIMIT: u64 = 512 << 20;

/// Log of a blind test, from freeze to score.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Receipt {
    /// [`SCHEMA`].
    pub schema: String,
    /// One protocol each, from freeze to reveal: one, or the shards of a large set.
    pub parts: Vec<Part>,
    /// The cases of all parts, by the name of their folder.
    pub cases: BTreeMap<String, Record>,
    /// The score; null before the reveal.
    pub score: Value,
    /// SHA-256 of all fields above.
    pub sha256: String,
}

/// One protocol.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Part {
    /// The frozen program.
    pub program: Program,
    /// The draw; `None` for a folder that someone else sealed.
    pub draw: Option<Draw>,
    /// SHA-256 of the files of each case.
    pub sealed: Sealed,
    /// The commitment to the truth of each case; a folder that someone else sealed has its own commitments.
    pub commitments: BTreeMap<String, String>,
    /// Drawn cases that could not be made.
    pub not_made: Vec<String>,
    /// Number of analysts by kind of isolation, in words.
    pub isolation: BTreeMap<String, usize>,
    /// SHA-256 of all answers.
    pub answers: String,
    /// Time of the generation and of the analysis, s.
    pub seconds: [f64; 2],
    /// Processor and kernel, as reported by this machine.
    pub machine: String,
    /// The stages with their chain.
    pub stages: Vec<Stage>,
}

/// The program as frozen before the draw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Program {
    /// Version of Freeplay.
    pub version: String,
    /// SHA-256 of the executable.
    pub sha256: String,
    /// SHA-256 of the catalogue's definition.
    pub catalogue: String,
}

impl Program {
    /// The program that runs.
    ///
    /// # Errors
    /// An executable that can't be read.
    pub fn this() -> Result<Self, Failure> {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Self { version, sha256: hash::of_program()?, catalogue: hash::of_catalogue() })
    }
}

/// The draw of the cases.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// The seed.
    pub seed: u64,
    /// Its source: the operating system after the freeze, or the command line.
    pub seed_from: String,
    /// The key from which the names of the folders follow; always from the operating system.
    pub names: String,
    /// Number of cases of each sort, over all shards.
    pub quota: Quota,
    /// Number of the shard, and count of shards.
    pub shard: [usize; 2],
    /// The swept parameters, if kinds and places were not drawn at random.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matrix: Option<Matrix>,
    /// The generator, if it was not this program; hashed at the freeze.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub generator: Option<Other>,
}

/// A case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    /// The salt of its commitment; empty before the reveal.
    pub salt: String,
    /// Its concealed truth; null before the reveal.
    pub truth: Value,
    /// The answer.
    pub answer: Answer,
    /// Its score; `None` before the reveal.
    pub outcome: Option<Outcome>,
}

/// A stage of the protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// Its name.
    pub name: String,
    /// Time of its completion.
    pub at: String,
    /// SHA-256 of its result.
    pub brought: String,
    /// SHA-256 over the previous chain hash, name, time and result.
    pub chain: String,
}

impl Part {
    /// Appends a stage to the chain; returns its hash.
    fn complete(&mut self, name: &str, brought: &Value) -> String {
        let before = self.chain();
        let (at, brought) = (now(), hash::of_json(name, brought));
        let chain = link(before, name, &at, &brought);
        self.stages.push(Stage { name: name.to_owned(), at, brought, chain: chain.clone() });
        chain
    }

    /// The required result of each stage, by name, given the cases of this part.
    pub fn stage_results(&self, cases: &BTreeMap<String, Record>) -> BTreeMap<&'static str, Value> {
        let truths: BTreeMap<_, _> =
            self.records(cases).map(|(name, record)| (name, (&record.salt, &record.truth))).collect();
        BTreeMap::from([
            ("freeze", json!([self.program, self.machine])),
            ("seed", json!(self.draw)),
            ("seal", json!([self.sealed, self.commitments, self.not_made, self.seconds[0]])),
            ("answer", json!([self.answers, self.isolation, self.seconds[1]])),
            ("reveal", json!(truths)),
        ])
    }

    /// Completes the stage `name` with its required result; returns its hash.
    pub fn finish(&mut self, name: &str, cases: &BTreeMap<String, Record>) -> String {
        let brought = self.stage_results(cases).remove(name).unwrap_or_default();
        self.complete(name, &brought)
    }

    /// True if the truth of the cases was revealed.
    pub fn is_open(&self) -> bool {
        self.stages.iter().any(|stage| stage.name == "reveal")
    }

    /// The last hash of the chain.
    pub fn chain(&self) -> &str {
        self.stages.last().map_or("", |stage| stage.chain.as_str())
    }

    /// The chain's hash at the seal. A witness records it to check the receipt later.
    pub fn seal_hash(&self) -> &str {
        let seal = self.stages.iter().find(|stage| stage.name == "seal");
        seal.map_or("", |stage| stage.chain.as_str())
    }

    /// The cases of this part.
    pub fn records<'a>(
        &'a self,
        cases: &'a BTreeMap<String, Record>,
    ) -> impl Iterator<Item = (&'a String, &'a Record)> {
        // The loop walks over the part's own names: a large set has many parts, and none should walk over the cases of the others.
        self.sealed.keys().filter_map(|name| cases.get_key_value(name))
    }

    /// SHA-256 of the answers in this part.
    pub fn hash_of_answers(&self, cases: &BTreeMap<String, Record>) -> String {
        let answers: BTreeMap<_, _> =
            self.records(cases).map(|(name, record)| (name, &record.answer)).collect();
        hash::of_json("answers", &json!(answers))
    }
}

/// A link of the chain.
pub fn link(before: &str, name: &str, at: &str, brought: &str) -> String {
    hash::of_json("chain", &json!([before, name, at, brought]))
}

/// Date and time, UTC.
pub fn now() -> String {
    let now = time::OffsetDateTime::now_utc();
    let (date, (hour, minute, second)) = (now.date(), now.to_hms());
    format!("{date}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Content of a file that should be a receipt.
pub enum Form {
    /// A receipt, with valid or invalid hashes.
    Receipt(Box<Receipt>),
    /// No receipt, and why.
    Wrong(String),
}

/// The text of the receipt `path`.
fn text(path: &Path) -> Result<String, Failure> {
    let bytes = read_bytes(path, LIMIT).map_err(|error| match error.refusal() {
        Some(Refusal::TooLarge { .. }) => Failure::input(format!(
            "{}: longer than {} MiB, the most that is read of a receipt; give the receipts of its parts, which were checked before they were merged",
            path.display(),
            LIMIT >> 20
        )),
        _ => error.into(),
    })?;
    String::from_utf8(bytes).map_err(|error| Failure::input(format!("{}: {error}; {WANTED}", path.display())))
}

impl Form {
    /// The form of the file `path`. Every field must appear exactly once; further fields are errors.
    ///
    /// # Errors
    /// A file that can't be read, is no JSON, or follows the earlier schema.
    pub fn of(path: &Path) -> Result<Self, Failure> {
        let shown = path.display();
        let value = match strict::parse(&text(path)?) {
            Ok(value) => value,
            Err(error) if error.classify() == Category::Data => {
                return Ok(Form::Wrong(plain_words(&error.to_string())));
            }
            Err(error) => {
                return Err(Failure::input(format!(
                    "{shown}: {}; {WANTED}",
                    plain_words(&error.to_string())
                )));
            }
        };
        if value.get("schema").is_none() && value.get("parts").is_none() {
            return Err(Failure::input(format!("{shown}: this is not a receipt; {WANTED}")));
        }
        if value["schema"] == EARLIER {
            let program = value["parts"][0]["program"]["sha256"].as_str().unwrap_or("of its first part");
            return Err(Failure::input(format!(
                "{shown}: schema {EARLIER}, where {SCHEMA} is understood; verify it with the program that made it, whose SHA-256 is \
                 {program}"
            )));
        }
        if value["schema"] != SCHEMA {
            return Ok(Form::Wrong(format!("schema {}, where \"{SCHEMA}\" is understood", value["schema"])));
        }
        let receipt: Receipt = match serde_json::from_value(value.clone()) {
            Ok(receipt) => receipt,
            Err(error) => return Ok(Form::Wrong(plain_words(&error.to_string()))),
        };
        let known = serde_json::to_value(&receipt).map_err(Failure::internal)?;
        Ok(match difference(&value, &known) {
            Some(pointer) => {
                Form::Wrong(format!("{pointer} is not a field of a receipt, or has the wrong type"))
            }
            None => Form::Receipt(Box::new(receipt)),
        })
    }
}

impl Receipt {
    /// Reads the receipt `path`.
    ///
    /// # Errors
    /// As [`Form::of`]; a file that is not a receipt.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        match Form::of(path)? {
            Form::Receipt(receipt) => Ok(*receipt),
            Form::Wrong(why) => Err(Failure::input(format!("{}: {why}; {WANTED}", path.display()))),
        }
    }

    /// SHA-256 of all fields but `sha256`.
    ///
    /// # Errors
    /// A receipt that cannot be written as JSON.
    pub fn hash(&self) -> Result<String, Failure> {
        let mut value = serde_json::to_value(self).map_err(Failure::internal)?;
        if let Some(fields) = value.as_object_mut() {
            fields.shift_remove("sha256");
        }
        Ok(hash::of_json("receipt", &value))
    }

    /// Writes it to `path`, with its hash.
    ///
    /// # Errors
    /// A file that can't be written.
    pub fn write(&mut self, path: &Path) -> Result<(), Failure> {
        self.sha256 = self.hash()?;
        let text = serde_json::to_string(self).map_err(Failure::internal)?;
        freeplay_terminal::files::write(path, &(text + "\n"))
    }

    /// The judged cases.
    ///
    /// # Errors
    /// A truth that does not parse.
    pub fn judged(&self) -> Result<Vec<Judged>, Failure> {
        let judged = self.cases.iter().map(|(name, record)| {
            let truth: Truth = serde_json::from_value(record.truth.clone()).map_err(|error| {
                Failure::input(format!("the truth of {name}: {}", plain_words(&error.to_string())))
            })?;
            Ok(Judged::new(name, truth, record.answer.clone()))
        });
        judged.collect()
    }
}
