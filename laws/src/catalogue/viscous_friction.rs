//! Viscous friction of a joint's drive, beyond the nominal.
//!
//! Law: τ = F_v q̇, with F_v \[N·m·s/rad\] in addition to the arm file's friction; it may be negative, down to minus the file's value, if
//! the file has too much. The drive spends τ: positive for a positive velocity.
//! Source: Reynolds 1886; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, Automatica 30:1083, §2.2.

use freeplay_model::export::Element;

use crate::effect::ExportCoverage;
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "viscous_friction",
    title: "viscous friction",
    words: "viscous friction of {viscous}",
    site: Site::Joint,
    parameters: &[Parameter::number(
        "viscous",
        "friction torque per speed, extra to the nominal",
        "N*m*s/rad",
        [-1e6, 1e6],
    )
    .prismatic("N*s/m")],
    occurs: Occurrence::Common,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "τ = F_v q̇",
    source: "Reynolds 1886; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994",
    signature: "the torque grows in proportion to the speed",
    confounders: &[
        ("time_delay", "is proportional to dτ/dt, not to the speed"),
        ("quadratic_drag", "grows with the square of the speed"),
        ("coulomb_friction", "has a step at standstill and no slope"),
        ("friction_drift", "is the same for one speed at all times"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion, Need::Speeds(1.5)],
    terms: Terms::EXTRA_VISCOUS,
    shapes: one_shape,
    build: |values| {
        let law = Viscous { viscous: values.number("viscous")? };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// F_v q̇.
#[derive(Clone, Copy, Debug)]
struct Viscous {
    viscous: f64,
}

impl JointLaw for Viscous {
    fn resisting(&self, at: &Instant) -> f64 {
        self.viscous * at.v
    }

    fn export_elements(&self, joint: usize, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::Damping { joint, linear: self.viscous, quadratic: 0.0 });
        ExportCoverage::Whole
    }
}
