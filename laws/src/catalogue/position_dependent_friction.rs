//! Friction that changes with the position: an axis that runs out, a gear that jams once a turn.
//!
//! Law: τ = a sin(Nq + φ) sign(q̇), with a \[N·m\] ≥ 0 extra to the Coulomb friction, N \[periods per turn of the joint\] and φ \[rad\] the
//! phase at q = 0. τ is what the drive spends.
//! Source: Popovic & Goldenberg 1998, IEEE Trans. Robot. Autom. 14:114.
//! In the plant the sign is smoothed over [`crate::DriveFriction::SMOOTHING`].

use crate::harmonic::{TERMS, orders, wave};
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Seen, Site};
use crate::needs::Need;
use crate::parameter::Parameter;

/// The entry.
pub static KIND: Kind = Kind {
    name: "position_dependent_friction",
    title: "friction that depends on the position",
    site: Site::Joint,
    parameters: &[
        Parameter::number("amplitude", "greatest torque of the wave", "N*m", [0.0, 1e6]).prismatic("N"),
        Parameter::number("periods", "periods N of the wave in one turn", "1/rev", [1e-3, 1e5])
            .prismatic("rad/m")
            .shape(),
        Parameter::number("phase", "phase φ of the wave at q = 0", "rad", [-7.0, 7.0]).or(0.0),
    ],
    seen: Seen::TORQUE,
    rough: true,
    equation: "τ = a sin(Nq + φ) sign(q̇)",
    source: "Popovic & Goldenberg 1998",
    signature: "residual × sign(q̇) repeats with the position",
    confounders: &[
        ("torque_ripple", "does not change its sign with the direction"),
        ("coulomb_friction", "is the same at all positions"),
        ("load_dependent_friction", "follows the load"),
    ],
    contains: &[("coulomb_friction", "periods → 0")],
    needs: &[Need::Torque, Need::Motion, Need::Reversals(2), Need::Travel(0.05)],
    terms: TERMS,
    shapes: orders,
    build: |values| {
        let [amplitude, periods, phase] =
            [values.number("amplitude")?, values.number("periods")?, values.number("phase")?];
        Ok(Box::new(AtJoint { joint: values.joint()?, law: Wave { amplitude, periods, phase } }))
    },
};

/// The wave.
#[derive(Clone, Copy, Debug)]
struct Wave {
    amplitude: f64,
    periods: f64,
    phase: f64,
}

impl JointLaw for Wave {
    fn resisting(&self, at: &Instant) -> f64 {
        wave(self.amplitude, self.periods, self.phase, at.q) * at.sign
    }
}
