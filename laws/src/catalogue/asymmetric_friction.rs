//! Coulomb friction that differs between the two directions of a joint.
//!
//! Law: τ = F₊ for q̇ > 0 and −F₋ for q̇ < 0, with F₊ and F₋ \[N·m\] both against the motion and in addition to the arm file's friction.
//! This equals Coulomb friction (F₊ + F₋)/2 with the offset (F₊ − F₋)/2: no motion distinguishes the two. A joint at rest has any torque
//! from −F₋ to F₊; the law passes through the middle, as the sum of the two does.
//! Source: Armstrong-Hélouvry 1991, Control of Machines with Friction, §2.

use freeplay_model::export::Element;

use crate::effect::ExportCoverage;
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "asymmetric_friction",
    title: "friction that depends on the direction",
    words: "friction of {positive} forwards and {negative} backwards",
    site: Site::Joint,
    parameters: &[
        Parameter::number(
            "positive",
            "friction torque for positive velocity, extra to the nominal",
            "N*m",
            [-1e6, 1e6],
        )
        .prismatic("N"),
        Parameter::number(
            "negative",
            "friction torque for negative velocity, extra to the nominal",
            "N*m",
            [-1e6, 1e6],
        )
        .prismatic("N"),
    ],
    occurs: Occurrence::Occasional,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τ = F₊ for q̇ > 0, −F₋ for q̇ < 0",
    source: "Armstrong-Hélouvry 1991",
    signature: "the torque steps where the velocity changes sign, by different amounts to the two sides",
    confounders: &[
        ("torque_offset", "is the same together with Coulomb friction: report the class"),
        ("coulomb_friction", "is the same in both directions"),
        ("joint_spring", "changes with the position"),
    ],
    contains: &[("coulomb_friction", "positive = negative"), ("torque_offset", "positive = −negative")],
    needs: &[Need::Torque, Need::Motion, Need::Reversals(1)],
    terms: Terms::EXTRA_COULOMB,
    shapes: one_shape,
    build: |values| {
        let law = Asymmetric { positive: values.number("positive")?, negative: values.number("negative")? };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// F₊ or F₋ against the motion.
#[derive(Clone, Copy, Debug)]
struct Asymmetric {
    positive: f64,
    negative: f64,
}

impl JointLaw for Asymmetric {
    fn resisting(&self, at: &Instant) -> f64 {
        0.5 * (at.sign * (self.positive + self.negative) + self.positive - self.negative)
    }

    fn export_elements(&self, joint: usize, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.extend([
            Element::DryFriction { joint, level: 0.5 * (self.positive + self.negative) },
            Element::ConstantTorque { joint, torque: 0.5 * (self.positive - self.negative) },
        ]);
        ExportCoverage::Whole
    }
}
