//! Common parts of the effects that appear only in commanded against measured positions. They have no effect on torques or poses for the
//! measured motion; the crate `freeplay-servo` integrates the motion itself.

use toml::Table;

use crate::effect::Effect;
use crate::injection::Injection;
use crate::kind::Terms;
use crate::place::Place;

/// They have no columns in torques or poses.
pub const NO_TERMS: Terms = Terms { list: |_, _, _| Vec::new(), compose: |_, shape, _| shape.clone() };

/// The search in torques and poses skips them.
pub fn no_shape(_: &Place) -> Vec<Table> {
    Vec::new()
}

/// An effect without influence on torques and poses for a given motion.
#[derive(Clone, Copy, Debug)]
pub struct Unseen;

impl Effect for Unseen {
    fn inject(&self, _injection: &mut Injection) {}
}
