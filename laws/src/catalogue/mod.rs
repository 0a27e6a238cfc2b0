//! The catalogue of effects: one file each, one line here.

use crate::effect::Kind;

mod coulomb_friction;
mod encoder_offset;
mod joint_clearance;
mod payload;

/// Every kind of effect there is.
pub static CATALOGUE: &[&Kind] =
    &[&joint_clearance::KIND, &coulomb_friction::KIND, &payload::KIND, &encoder_offset::KIND];

/// The kind called `name`.
pub fn kind(name: &str) -> Option<&'static Kind> {
    CATALOGUE.iter().copied().find(|kind| kind.name == name)
}
