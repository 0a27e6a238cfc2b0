//! Friction that changes with the position: an axis with runout, a gear that jams once per turn.
//!
//! Law: τ = a sin(Nq + φ) sign(q̇), with a \[N·m\] ≥ 0 in addition to the Coulomb friction, N \[periods per turn of the joint\] and φ
//! \[rad\] the phase at q = 0. The drive spends τ.
//! Source: Popovic & Goldenberg 1998, IEEE Trans. Robot. Autom. 14:114.
//! In a recording the sign is smoothed over [`crate::DriveFriction::SMOOTHING_SPEED`].

use crate::harmonic::{TERMS, TORQUE_PARAMETERS, Wave, orders};
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Tolerance};
use crate::needs::Need;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "position_dependent_friction",
    title: "friction that depends on the position",
    words: "friction that varies by {amplitude} with the position, {periods}",
    site: Site::Joint,
    parameters: TORQUE_PARAMETERS,
    occurs: Occurrence::Rare,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
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
    build: |values| Ok(Box::new(AtJoint { joint: values.joint()?, law: Jamming(Wave::of(values)?) })),
};

/// The law.
#[derive(Clone, Copy, Debug)]
struct Jamming(Wave);

impl JointLaw for Jamming {
    fn resisting(&self, at: &Instant) -> f64 {
        self.0.at(at.q) * at.sign
    }
}
