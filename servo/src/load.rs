//! The load of one joint.

/// Inertia and torque that an arm puts on one of its joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Inertia that the joint moves, kg·m² (kg).
    pub inertia: f64,
    /// Torque that the joint needs where it does not accelerate, N·m (N): gravity, and what the motion of the other joints asks for.
    pub torque: f64,
}

impl Load {
    /// Between `self` and `other` at `share` of the way.
    pub(crate) fn between(self, other: Load, share: f64) -> Load {
        let mix = |a: f64, b: f64| a + share * (b - a);
        Load { inertia: mix(self.inertia, other.inertia), torque: mix(self.torque, other.torque) }
    }
}
