//! The contents of a model file, and the choice of the chain that is the arm.

use freeplay_arm::Arm;
use freeplay_storage::plain_words;
use serde::de::DeserializeOwned;

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
