//! The load of one joint.

/// Inertia and torque of an arm on one of its joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Inertia that the joint moves, kg·m² (kg).
    pub inertia: f64,
    /// Torque of the joint without its own acceleration, N·m (N): gravity, and the coupling torques of the other joints' motion.
    pub torque: f64,
}

impl Load {
    /// Linear interpolation between `self` and `other` by `share`.
    pub(crate) fn between(self, other: Load, share: f64) -> Load {
        let mix = |a: f64, b: f64| a + share * (b - a);
        Load { inertia: mix(self.inertia, other.inertia), torque: mix(self.torque, other.torque) }
    }
}
