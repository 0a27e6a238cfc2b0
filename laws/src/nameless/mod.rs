//! Laws that machines of the demonstration conceal and that no diagnosis looks for: neither the catalogue nor what it is compared with has
//! them. They stand for what is without a name. One file each, one line here.

use crate::kind::Kind;

mod cable_drag;
mod detent;
mod thermal_drift;
mod warped_base;

/// Every such kind. [`crate::kinds`] leaves them out, so that they are no candidates.
pub static NAMELESS: &[&Kind] = &[&detent::KIND, &cable_drag::KIND, &warped_base::KIND, &thermal_drift::KIND];
