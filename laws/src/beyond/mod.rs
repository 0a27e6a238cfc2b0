//! Laws beyond the catalogue: they occur on machines, too, but the catalogue does not contain them. A diagnosis compares the catalogue with
//! them, so that it does not attribute their effects to a similar kind of the catalogue. One file per law, one line for it here.

use crate::kind::Kind;

mod load_change;
mod mount_compliance;

/// Every kind of effect beyond the catalogue.
pub static BEYOND_CATALOGUE: &[&Kind] = &[&mount_compliance::KIND, &load_change::KIND];
