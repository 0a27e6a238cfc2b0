//! Friction of a transmission that grows with its load.
//!
//! Law: τ = μ |τ_L| sign(q̇), with μ \[1\] ≥ 0 and τ_L \[N·m\] the torque of the *model's* rigid arm on the transmission; the measured
//! torque contains the friction itself and must not be used. The drive spends τ: positive for a positive velocity.
//! Source: Bittencourt & Gunnarsson 2012, J. Dyn. Sys. Meas. Control 134:051013, Eq. 9.

use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "load_dependent_friction",
    title: "friction that grows with the load",
    words: "friction of {coefficient} times the load carried",
    site: Site::Joint,
    parameters: &[Parameter::number("coefficient", "friction torque per torque carried", "1", [0.0, 2.0])],
    occurs: Occurrence::Rare,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τ = μ |τ_L| sign(q̇), τ_L the load by the model",
    source: "Bittencourt & Gunnarsson 2012",
    signature: "torque over load forms a butterfly: the step at a change of direction grows with the load",
    confounders: &[
        ("coulomb_friction", "does not depend on the load"),
        ("torque_gain", "is proportional to the load without regard to the direction"),
        ("joint_coupling", "depends on another joint"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion, Need::Reversals(1), Need::LoadRange(0.3)],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| {
        let law = LoadFriction { coefficient: values.number("coefficient")? };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// μ |τ_L| sign(q̇).
#[derive(Clone, Copy, Debug)]
struct LoadFriction {
    coefficient: f64,
}

impl JointLaw for LoadFriction {
    fn resisting(&self, at: &Instant) -> f64 {
        self.coefficient * at.load.abs() * at.sign
    }
}
