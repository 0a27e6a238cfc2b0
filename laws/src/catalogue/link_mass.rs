//! A link whose mass, or whose centre of mass, differs from the model.
//!
//! Law: mass and inertia of the link that the joint moves are `scale` times the model's, m = s m₀ and J = s J₀ about the centre of mass,
//! which is displaced by d \[m\] from the model's in the link's frame (zero by default). Gravity and inertia act on that joint and on all
//! before it.
//! Source: Khalil & Dombre 2002, Modeling, Identification and Control of Robots, §9.2: the torque is linear in mass and first moments.
//! Terms: s − 1 and, with the centre of mass in the search, s d. The columns of s d neglect the tensor's part in d² until the diagnosis
//! linearises about the finding. The last link has no such shape: a payload on it has the same effect.

use freeplay_model::export::Element;
use nalgebra::Vector3;
use toml::{Table, Value};

use crate::LawError;
use crate::arm_parts::ArmParts;
use crate::basis::{Term, along, vector, with};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "link_mass",
    title: "mass of the link",
    words: "a link {scale} times as heavy[, its centre of mass off by {com_shift}]",
    site: Site::Joint,
    parameters: &[
        Parameter::number("scale", "true over modelled mass and inertia", "1", [0.0, 1e3]),
        Parameter::vector(SHIFT, "its centre of mass minus the model's, in the link's frame", "m").or_zero(),
    ],
    occurs: Occurrence::Rare,
    tolerance: Some(Tolerance::Mass),
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "m = s m₀, J = s J₀, c = c₀ + d of one link",
    source: "Khalil & Dombre 2002, §9.2",
    signature: "gravity and inertia of one link deviate by one factor, on its joint and all before it",
    confounders: &[
        ("payload", "shows on the joints after that link too"),
        ("base_tilt", "rotates gravity for all links alike and does not change inertia"),
        ("torque_gain", "shows on one joint alone, friction included"),
        ("joint_spring", "does not follow the direction of gravity"),
    ],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms {
        list: terms,
        compose: |_, shape, coefficients| {
            let scale = 1.0 + coefficients[0];
            let mut table = with(&Table::new(), [("scale", scale)]);
            if shape.contains_key(SHIFT) {
                table.insert(SHIFT.to_owned(), vector([1, 2, 3].map(|i| coefficients[i] / scale)));
            }
            table
        },
    },
    shapes,
    build: |values| {
        let shift = values.vector(SHIFT)?.into();
        Ok(Box::new(LinkMass { joint: values.joint()?, scale: values.number("scale")?, shift }))
    },
};

/// The parameter with the displacement of the centre of mass; in a shape, it includes the displacement in the search.
const SHIFT: &str = "com_shift";

/// Greatest displacement of a centre of mass in the search, m.
const FARTHEST: f64 = 1.0;

/// The mass alone; and with the centre of mass, if the link carries others.
fn shapes(place: &Place) -> Vec<Table> {
    let mut shapes = vec![Table::new()];
    let is_last = place.joint.is_none_or(|joint| joint + 1 == place.scene.arm.dof());
    if !is_last && place.joint().is_some_and(|joint| joint.inertia.mass > 0.0) {
        shapes.push([(SHIFT.to_owned(), Value::Boolean(true))].into_iter().collect());
    }
    shapes
}

fn terms(_: &Kind, _: &Place, shape: &Table) -> Vec<Term> {
    /// Displacement of the centre of mass, m: its quadratic part is the same on both sides and cancels in the difference.
    const LEVER: f64 = 0.1;
    // A link with more than three times its mass, or less than a third, is a different link.
    let heavier = with(&Table::new(), [("scale", 1.5)]);
    let mut terms = vec![Term::new("excess", "1", [-2.0 / 3.0, 2.0], heavier).stepped(0.5)];
    if shape.contains_key(SHIFT) {
        for (axis, name) in ["shift_x", "shift_y", "shift_z"].into_iter().enumerate() {
            let at = |way: f64| {
                let mut table = with(&Table::new(), [("scale", 1.0)]);
                table.insert(SHIFT.to_owned(), vector(along(axis, way)));
                table
            };
            let off = Term::new(name, "m", [-FARTHEST, FARTHEST], at(LEVER));
            terms.push(off.less(at(-LEVER)).stepped(2.0 * LEVER));
        }
    }
    terms
}

#[derive(Clone, Copy, Debug)]
struct LinkMass {
    joint: usize,
    scale: f64,
    shift: Vector3<f64>,
}

impl Effect for LinkMass {
    fn arm(&self, parts: &mut ArmParts) -> Result<(), LawError> {
        let inertia = &mut parts.joints[self.joint].inertia;
        inertia.mass *= self.scale;
        inertia.about_com *= self.scale;
        inertia.com += self.shift;
        Ok(())
    }

    fn inject(&self, _injection: &mut Injection) {}

    fn export_elements(&self, _elements: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Whole
    }
}
