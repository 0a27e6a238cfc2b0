//! Coulomb friction of a joint's drive, beyond the nominal.
//!
//! Law: τ = F sign(q̇), with F \[N·m\] in addition to the arm file's friction; it may be negative, down to minus the file's value, if the
//! file has too much. The drive spends τ: positive for a positive velocity.
//! Source: Coulomb 1785; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, Automatica 30:1083, §2.1.
//! In a recording the sign is smoothed over [`crate::DriveFriction::SMOOTHING_SPEED`], as that of the nominal friction is.

use freeplay_model::EffectTable;
use freeplay_model::export::Element;

use crate::basis::with;
use crate::effect::ExportCoverage;
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "coulomb_friction",
    title: "Coulomb friction",
    words: "Coulomb friction of {coulomb}",
    site: Site::Joint,
    parameters: &[Parameter::number(
        "coulomb",
        "friction torque at any speed, extra to the nominal",
        "N*m",
        [-1e6, 1e6],
    )
    .prismatic("N")],
    occurs: Occurrence::Common,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τ = F sign(q̇)",
    source: "Coulomb 1785; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994",
    signature: "the torque steps where the velocity changes sign and depends on nothing else",
    confounders: &[
        ("asymmetric_friction", "has steps that differ between the two directions"),
        ("stribeck_friction", "falls with the speed near standstill"),
        ("load_dependent_friction", "has a step that grows with the load"),
        ("viscous_friction", "grows with the speed: several speeds separate them"),
        ("backlash", "flips with the transmitted torque, not with the velocity"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion, Need::Reversals(1)],
    terms: Terms::EXTRA_COULOMB,
    shapes: one_shape,
    build: |values| {
        let law = Coulomb { coulomb: values.number("coulomb")? };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// The effect that holds the joint called `joint` against a torque of `torque`, N·m (N), in addition to its nominal friction.
pub fn holding(joint: &str, torque: f64) -> EffectTable {
    let parameters = with(&toml::Table::new(), [(KIND.parameters[0].name, torque)]);
    EffectTable { kind: KIND.name.to_owned(), joint: Some(joint.to_owned()), parameters, line: 0 }
}

/// F sign(q̇).
#[derive(Clone, Copy, Debug)]
struct Coulomb {
    coulomb: f64,
}

impl JointLaw for Coulomb {
    fn resisting(&self, at: &Instant) -> f64 {
        self.coulomb * at.sign
    }

    fn export_elements(&self, joint: usize, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::DryFriction { joint, level: self.coulomb });
        ExportCoverage::Whole
    }
}
