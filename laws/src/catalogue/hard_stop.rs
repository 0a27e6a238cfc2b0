//! A stop that a joint can't pass.
//!
//! Law: lower ≤ q ≤ upper; at the stop the joint rests against any torque of the servo. No bounce.
//! Source: Moreau 1988, Unilateral contact and dry friction in finite freedom dynamics, §3.

use freeplay_model::export::Element;

use super::commanded::{NO_TERMS, no_shape};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "hard_stop",
    title: "hard stop",
    words: "a hard stop",
    site: Site::Joint,
    parameters: &[
        Parameter::number("lower", "least position that the joint reaches", "rad", [-1e6, 1e6])
            .prismatic("m")
            .or_else("no stop below"),
        Parameter::number("upper", "greatest position that the joint reaches", "rad", [-1e6, 1e6])
            .prismatic("m")
            .or_else("no stop above"),
    ],
    occurs: Occurrence::Common,
    tolerance: None,
    seen: Seen { torque: false, pose: false },
    rough: true,
    shakes: false,
    equation: "lower ≤ q ≤ upper",
    source: "Moreau 1988, §3",
    signature: "the joint rests at one position, the end of its range of motion, while its command continues",
    confounders: &[
        ("contact", "stops the joint at another position in another posture, and stops other joints, too"),
        ("servo", "with a torque limit lets the joint move on where the load is smaller"),
    ],
    contains: &[],
    needs: &[Need::Motion],
    terms: NO_TERMS,
    shapes: no_shape,
    build: |values| {
        let lower = values.optional("lower")?.unwrap_or(f64::NEG_INFINITY);
        let upper = values.optional("upper")?.unwrap_or(f64::INFINITY);
        Ok(Box::new(HardStop { joint: values.joint()?, lower, upper }))
    },
};

/// It has no influence on torques and poses for a given motion.
#[derive(Clone, Copy, Debug)]
struct HardStop {
    joint: usize,
    lower: f64,
    upper: f64,
}

impl Effect for HardStop {
    fn inject(&self, _injection: &mut Injection) {}

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::Stop { joint: self.joint, lower: self.lower, upper: self.upper });
        ExportCoverage::Whole
    }
}
