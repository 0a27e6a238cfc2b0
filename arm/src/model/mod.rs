//! Model files: URDF and MJCF as found in the field, and the TOML arm file of this project.

mod chain;
mod error;
mod fold;
mod mjcf;
mod names;
mod numbers;
mod plausible;
mod prefixes;
mod robot;
mod toml_read;
mod toml_tables;
mod toml_write;
mod urdf;
mod urdf_inertial;
mod urdf_joint;
mod urdf_tree;
mod urdf_xml;

use std::path::Path;

use freeplay_storage::plain_words;
use serde::de::DeserializeOwned;

use crate::arm::Arm;
use crate::place::Place;

use error::shortened;
pub use error::{MAX_FILE_BYTES, ModelError};
pub use names::match_joints;
pub use toml_read::parse_toml;
pub use toml_write::to_toml;
pub use urdf::{parse_urdf, parse_urdf_selected};

/// An `[[effect]]` of an arm file as read: physics beyond the rigid body; the crate of the effects interprets it.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectTable {
    /// Kind of the effect, such as `coulomb_friction`.
    pub kind: String,
    /// Name of its joint; `None` for an effect of the whole arm.
    pub joint: Option<String>,
    /// The other keys of the table, SI units.
    pub parameters: toml::Table,
    /// Line of the file on which the table begins, from 1.
    pub line: usize,
}

impl EffectTable {
    /// All parameters except the one called `without`, as a table of the effect's own.
    ///
    /// # Errors
    /// The parser's message in plain words: a key that is unknown or missing, a value of another type.
    pub fn read<T: DeserializeOwned>(&self, without: Option<&str>) -> Result<T, String> {
        let mut table = self.parameters.clone();
        without.map(|name| table.remove(name));
        table.try_into().map_err(|error: toml::de::Error| plain_words(error.message()))
    }
}

/// The contents of a model file.
#[derive(Clone, Debug)]
pub struct ArmFile {
    /// The rigid arm.
    pub arm: Arm,
    /// The effects beyond it, in the order of the file.
    pub effects: Vec<EffectTable>,
    /// Unused parts of the file, and notes on its interpretation; one sentence each.
    pub ignored: Vec<String>,
}

/// The choice of the chain of a robot that is the arm.
///
/// The chain to the link `tip`; without one the chain whose joints have the names `joints`, such as those of a recording; else the chain to
/// `tool0`; else the longest one without its fingers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// The link at the end of the arm, whose frame is the tool frame.
    pub tip: Option<String>,
    /// Names of joints; the reader ignores names that no joint of the file has.
    pub joints: Vec<String>,
}

/// Reads a model file with the default choice of the arm: see [`load_selected`].
///
/// # Errors
/// [`ModelError`] with file, line, column, value and remedy.
pub fn load(path: &Path) -> Result<ArmFile, ModelError> {
    load_selected(path, &Selection::default())
}

/// Reads a model file: `.urdf`, `.xml` or `.mjcf` as URDF or MJCF, whichever its root element is; `.toml` as an arm file.
///
/// # Errors
/// [`ModelError`] with file, line, column, value and remedy.
pub fn load_selected(path: &Path, selection: &Selection) -> Result<ArmFile, ModelError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "urdf" | "xml" | "mjcf" => {
            parse_urdf_selected(&read_text(path)?, &path.display().to_string(), selection)
        }
        "toml" => toml_read::parse(&read_text(path)?, path, selection),
        "xacro" => Err(ModelError::Xacro {
            at: Place::start(&path.display().to_string()),
            found: "the file name".to_owned(),
        }),
        _ => Err(ModelError::UnknownExtension { path: shortened(&path.display().to_string()) }),
    }
}

/// The arm of Erkaya (2018), Table 1, with six joints: the file `models/erkaya2018.toml` of this crate.
pub fn paper_arm() -> ArmFile {
    parse_toml(include_str!("../../models/erkaya2018.toml"), Path::new("erkaya2018.toml"))
        .expect("the arm file inside the program is valid")
}

/// The text of a file no longer than [`MAX_FILE_BYTES`].
fn read_text(path: &Path) -> Result<String, ModelError> {
    let origin = path.display().to_string();
    let bytes =
        freeplay_storage::read_bytes(path, MAX_FILE_BYTES).map_err(|error| match error.refusal() {
            Some(freeplay_storage::Refusal::TooLarge { .. }) => {
                ModelError::TooLarge { origin: origin.clone() }
            }
            _ => ModelError::Read { path: origin.clone(), source: error.into() },
        })?;
    String::from_utf8(bytes)
        .map_err(|error| ModelError::NotUtf8 { path: origin, offset: error.utf8_error().valid_up_to() })
}

/// Refuses a text longer than [`MAX_FILE_BYTES`] or without content.
fn check_extent(text: &str, origin: &str) -> Result<(), ModelError> {
    if text.len() as u64 > MAX_FILE_BYTES {
        return Err(ModelError::TooLarge { origin: origin.to_owned() });
    }
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        return Err(ModelError::Empty { origin: origin.to_owned() });
    }
    Ok(())
}
