//! All kinds of effects, and one by its name.

use crate::beyond::BEYOND_CATALOGUE;
use crate::catalogue::{CATALOGUE, COMMANDED};
use crate::kind::Kind;
use crate::nameless::NAMELESS;

/// Every kind that shows in torques or poses, those of the catalogue first; see [`COMMANDED`] for the others.
pub fn kinds() -> impl Iterator<Item = &'static Kind> {
    CATALOGUE.iter().chain(BEYOND_CATALOGUE).copied()
}

/// The kind called `name`: in the catalogue, beyond it, among those of commanded positions or without a name for a diagnosis.
pub fn kind(name: &str) -> Option<&'static Kind> {
    kinds().chain(COMMANDED.iter().chain(NAMELESS).copied()).find(|kind| kind.name == name)
}

impl Kind {
    /// Whether the catalogue has it; else it is a law that the catalogue is compared with.
    pub fn is_catalogued(&self) -> bool {
        CATALOGUE.iter().any(|kind| kind.name == self.name)
    }
}
