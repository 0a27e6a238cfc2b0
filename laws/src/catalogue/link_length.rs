//! A link whose length differs from the model.
//!
//! Law: the vector from the joint to the next one (from the last joint: to the tool) is longer by the offset Δ \[m\] in the direction
//! `along`: along the vector itself, or along x, y or z of the link's frame. Masses keep their positions in their own links.
//! Source: Denavit & Hartenberg 1955; Mooring, Roth & Driels 1991, Fundamentals of Manipulator Calibration, §3.

use freeplay_model::export::Element;
use nalgebra::{Isometry3, Vector3};
use toml::{Table, Value};

use crate::LawError;
use crate::arm_parts::ArmParts;
use crate::basis::{Term, with};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::Site;

/// Directions, in arm files.
const DIRECTIONS: &[&str] = &["way", "x", "y", "z"];
/// Greatest offset, m.
const MOST: f64 = 10.0;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "link_length",
    title: "length of the link",
    words: "a link length error of {offset}",
    site: Site::Joint,
    parameters: &[
        Parameter::number("offset", "true minus modelled length", "m", [-MOST, MOST]),
        Parameter {
            name: "along",
            meaning: "direction: towards the next joint, or along an axis of the link's frame",
            range: Range::Word(DIRECTIONS),
        },
    ],
    occurs: Occurrence::Rare,
    tolerance: Some(Tolerance::Length),
    seen: Seen::BOTH,
    rough: false,
    shakes: false,
    equation: "r = r₀ + Δ e, r the way to the next joint or to the tool",
    source: "Denavit & Hartenberg 1955; Mooring, Roth & Driels 1991, §3",
    signature: "the tool deviates by the same amount in every pose and under every load, in a direction that turns with the link",
    confounders: &[
        ("joint_elasticity", "is proportional to the load"),
        ("link_flexure", "is proportional to the load"),
        ("encoder_offset", "grows with the distance from the joint"),
        ("joint_clearance", "turns with the force, not with the link"),
    ],
    contains: &[],
    needs: &[Need::Tool],
    terms: Terms {
        list: |_, _, shape| {
            const STEP: f64 = 1e-4;
            let (plus, minus) = (with(shape, [("offset", STEP)]), with(shape, [("offset", -STEP)]));
            vec![Term::new("offset", "m", [-MOST, MOST], plus).less(minus).stepped(2.0 * STEP)]
        },
        compose: |_, shape, coefficients| with(shape, [("offset", coefficients[0])]),
    },
    shapes: |_| {
        let shape =
            |along: &&str| -> Table { [("along".to_owned(), Value::from(*along))].into_iter().collect() };
        DIRECTIONS.iter().map(shape).collect()
    },
    build: |values| {
        let along = match values.word("along")? {
            "x" => Some(Vector3::x()),
            "y" => Some(Vector3::y()),
            "z" => Some(Vector3::z()),
            _ => None,
        };
        Ok(Box::new(LinkLength { joint: values.joint()?, offset: values.number("offset")?, along }))
    },
};

#[derive(Clone, Copy, Debug)]
struct LinkLength {
    joint: usize,
    offset: f64,
    along: Option<Vector3<f64>>,
}

impl Effect for LinkLength {
    fn arm(&self, parts: &mut ArmParts) -> Result<(), LawError> {
        let way: &mut Isometry3<f64> = match parts.joints.get_mut(self.joint + 1) {
            Some(next) => &mut next.placement,
            None => &mut parts.tool,
        };
        // Two joints at one point move apart along the z of the link, like the d of Denavit and Hartenberg.
        let way = &mut way.translation.vector;
        let along = self.along.or_else(|| way.try_normalize(1e-9)).unwrap_or_else(Vector3::z);
        *way += along * self.offset;
        Ok(())
    }

    fn inject(&self, _injection: &mut Injection) {}

    fn export_elements(&self, _elements: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Whole
    }
}
