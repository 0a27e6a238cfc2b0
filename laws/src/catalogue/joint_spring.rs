//! A spring across a joint: a hose pack, a cable loop, a balancing spring or gas cylinder about its operating point.
//!
//! Law: τ = k (q − q₀), with k \[N·m/rad\] ≥ 0 and the rest position q₀ \[rad\]. The drive spends τ: positive beyond the rest position.
//! Source: Hooke 1678; as a model of hose packs and counterbalances in identification: Swevers, Verdonck & De Schutter 2007, §3.
//! The terms are k and the moment m = −k q₀; the effect is linear in both.

use freeplay_model::export::Element;

use crate::basis::{Term, with};
use crate::effect::ExportCoverage;
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "joint_spring",
    title: "spring",
    words: "a spring of {stiffness} that rests at {rest}",
    site: Site::Joint,
    parameters: &[
        Parameter::number("stiffness", "torque per angle", "N*m/rad", [0.0, 1e9]).prismatic("N/m"),
        Parameter::number("rest", "position without torque", "rad", [-1e3, 1e3]).prismatic("m").or(0.0),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "τ = k (q − q₀)",
    source: "Hooke 1678; Swevers, Verdonck & De Schutter 2007, §3",
    signature: "the torque of one joint grows with its own position, independently of the other joints and of the direction of gravity",
    confounders: &[
        ("torque_offset", "does not change with the position"),
        ("payload", "follows the direction of gravity and shows on the joints before it"),
        ("link_mass", "follows the direction of gravity and shows on the joints before it"),
        ("torque_ripple", "repeats within the range of motion"),
    ],
    contains: &[("torque_offset", "stiffness → 0 with the rest far away")],
    needs: &[Need::Torque, Need::Travel(0.1)],
    terms: Terms {
        list: |kind, place, shape| {
            let at = |rest: f64| with(shape, [("stiffness", 1.0), ("rest", rest)]);
            let stiffness = kind.unit("stiffness", place.joint());
            let moment = if stiffness == "N/m" { "N" } else { "N*m" };
            vec![
                Term::new("stiffness", stiffness, [0.0, 1e9], at(0.0)),
                Term::new("moment", moment, [-1e9, 1e9], at(-1.0)).less(at(0.0)),
            ]
        },
        compose: |_, shape, coefficients| {
            let (stiffness, moment) = (coefficients[0], coefficients[1]);
            let rest = if stiffness > 0.0 { (-moment / stiffness).clamp(-1e3, 1e3) } else { 0.0 };
            with(shape, [("stiffness", stiffness), ("rest", rest)])
        },
    },
    shapes: one_shape,
    build: |values| {
        let law = Spring { stiffness: values.number("stiffness")?, rest: values.number("rest")? };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// k (q − q₀).
#[derive(Clone, Copy, Debug)]
struct Spring {
    stiffness: f64,
    rest: f64,
}

impl JointLaw for Spring {
    fn resisting(&self, at: &Instant) -> f64 {
        self.stiffness * (at.q - self.rest)
    }

    fn export_elements(&self, joint: usize, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::Spring { joint, stiffness: self.stiffness, rest: self.rest });
        ExportCoverage::Whole
    }
}
