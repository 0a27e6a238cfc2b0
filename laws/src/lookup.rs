//! All kinds of effects, and one by its name.

use crate::beyond::BEYOND_CATALOGUE;
use crate::catalogue::{CATALOGUE, COMMANDED};
use crate::kind::Kind;
use crate::nameless::NAMELESS;

/// Every kind that appears in torques or poses, those of the catalogue first; see [`COMMANDED`] for the others.
pub fn kinds() -> impl Iterator<Item = &'static Kind> {
    CATALOGUE.iter().chain(BEYOND_CATALOGUE).copied()
}

/// The kind called `name`: from the catalogue, beyond it, from those of commanded positions, or from those that no diagnosis searches for.
pub fn kind(name: &str) -> Option<&'static Kind> {
    kinds().chain(COMMANDED.iter().chain(NAMELESS).copied()).find(|kind| kind.name == name)
}

impl Kind {
    /// True for a kind of the catalogue; the others are laws against which a diagnosis compares the catalogue.
    pub fn is_catalogued(&self) -> bool {
        CATALOGUE.iter().any(|kind| kind.name == self.name)
    }
}
