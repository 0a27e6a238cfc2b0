//! What the effects share that show in commanded against measured positions alone: nothing of them is in a torque or a pose for
//! the measured motion, and the motion itself is integrated elsewhere, by the crate `freeplay-servo`.

use toml::Table;

use crate::effect::Effect;
use crate::injection::Injection;
use crate::kind::Terms;
use crate::place::Place;

/// No column of torque or pose is made of them.
pub const NO_TERMS: Terms = Terms { list: |_, _, _| Vec::new(), compose: |_, shape, _| shape.clone() };

/// They are not searched for in torques and poses.
pub fn no_shape(_: &Place) -> Vec<Table> {
    Vec::new()
}

/// An effect of which torques and poses for a given motion know nothing.
#[derive(Clone, Copy, Debug)]
pub struct Unseen;

impl Effect for Unseen {
    fn inject(&self, _injection: &mut Injection) {}
}
