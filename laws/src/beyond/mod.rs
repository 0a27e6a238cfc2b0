//! Laws beyond the catalogue: machines do these things, too, but the catalogue has no name for them. A diagnosis compares the catalogue
//! with them, so that it does not call them by the name of what they look like. One file each, one line here.

use crate::kind::Kind;

mod load_change;
mod mount_compliance;

/// Every kind of effect beyond the catalogue.
pub static BEYOND_CATALOGUE: &[&Kind] = &[&mount_compliance::KIND, &load_change::KIND];
