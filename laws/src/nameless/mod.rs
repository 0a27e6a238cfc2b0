//! Laws of the demonstration's concealed machines that no diagnosis searches for: they are neither in the catalogue nor among the laws it
//! is compared with. They represent unknown physics. One file per law, one line for it here.

use crate::kind::Kind;

mod cable_drag;
mod detent;
mod thermal_drift;
mod warped_base;

/// Every such kind. [`crate::kinds`] omits them, so that they are no candidates.
pub static NAMELESS: &[&Kind] = &[&detent::KIND, &cable_drag::KIND, &warped_base::KIND, &thermal_drift::KIND];
