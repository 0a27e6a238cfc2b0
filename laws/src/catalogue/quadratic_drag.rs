//! Drag that grows with the square of a joint's speed: air, churning oil.
//!
//! Law: τ = c q̇|q̇|, with c \[N·m·s²/rad²\] ≥ 0. The drive spends τ: positive for a positive velocity.
//! Source: Newton 1687, Principia II; for gear churning Changenet & Velex 2007, J. Mech. Des. 129:128.

use freeplay_model::export::Element;

use crate::effect::ExportCoverage;
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "quadratic_drag",
    title: "quadratic drag",
    words: "drag of {coefficient}",
    site: Site::Joint,
    parameters: &[Parameter::number(
        "coefficient",
        "torque per square of the speed",
        "N*m*s^2/rad^2",
        [0.0, 1e6],
    )
    .prismatic("N*s^2/m^2")],
    occurs: Occurrence::Rare,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "τ = c q̇|q̇|",
    source: "Newton 1687; Changenet & Velex 2007",
    signature: "the torque grows with the square of the speed",
    confounders: &[("viscous_friction", "grows in proportion to the speed: needs fast and slow samples")],
    contains: &[],
    needs: &[Need::Torque, Need::Motion, Need::Speeds(3.0)],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| {
        let law = Drag { coefficient: values.number("coefficient")? };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// c q̇|q̇|.
#[derive(Clone, Copy, Debug)]
struct Drag {
    coefficient: f64,
}

impl JointLaw for Drag {
    fn resisting(&self, at: &Instant) -> f64 {
        self.coefficient * at.v * at.v.abs()
    }

    fn export_elements(&self, joint: usize, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::Damping { joint, linear: 0.0, quadratic: self.coefficient });
        ExportCoverage::Whole
    }
}
