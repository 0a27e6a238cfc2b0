//! A payload on the last link that the model lacks.
//!
//! Law: a body of mass m \[kg\] with its centre at c \[m\] in the last link's frame joins that link by the parallel axis theorem (Steiner
//! 1840). The tensor about its centre \[kg·m²\] is zero by default. m may be negative if the model has too much mass. Gravity and inertia
//! act on every joint before it.
//! Source: Khalil & Dombre 2002, Modeling, Identification and Control of Robots, §9: the torque is linear in m, m c and the tensor about
//! the link's origin; those are the ten terms. A point mass has four: m at the tool, where loads hang, and m (c − tool). Its tensor is that
//! of m at the tool, plus the change to first order in c − tool.

use freeplay_arm::Inertia;
use freeplay_model::export::Element;
use nalgebra::{Isometry3, Matrix3, Vector3};
use toml::{Table, Value};

use crate::LawError;
use crate::arm_parts::ArmParts;
use crate::basis::{Term, along, vector};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "payload",
    title: "payload",
    words: "a payload of {mass} at {com} from the last joint",
    site: Site::Arm,
    parameters: &[
        Parameter::number("mass", "mass on the last link, extra to the model's", "kg", [-1e4, 1e4]),
        Parameter::vector("com", "its centre of mass in the last link's frame", "m").or_zero(),
        Parameter::vector("moments", "its moments of inertia xx, yy, zz about its centre", "kg*m^2")
            .or_zero(),
        Parameter::vector("products", "its elements xy, xz, yz of the tensor about its centre", "kg*m^2")
            .or_zero(),
    ],
    occurs: Occurrence::Occasional,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "m, m·c and J added to the last link: gravity and inertia on all joints before it",
    source: "Khalil & Dombre 2002, §9",
    signature: "gravity and inertia of one body on all joints, growing towards the base",
    confounders: &[
        ("base_tilt", "rotates gravity for all links alike and does not change inertia"),
        ("link_mass", "does not show on the joints after that link"),
        ("joint_spring", "does not follow the direction of gravity"),
        ("external_force", "does not move with the tool and acts only for a time"),
        ("rotor_inertia", "shows on one joint only and not under gravity"),
    ],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms { list: terms, compose },
    shapes: |place| {
        let tool = place.scene.arm.tool().translation.vector;
        vec![[(TOOL.to_owned(), vector(tool.into()))].into_iter().collect(), Table::new()]
    },
    build: |values| {
        let [xx, yy, zz] = values.vector("moments")?;
        let [xy, xz, yz] = values.vector("products")?;
        let about_com = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let (mass, com) = (values.number("mass")?, values.vector("com")?.into());
        Ok(Box::new(Payload(Inertia { mass, com, about_com })))
    },
};

/// In a shape, the position of the tool in the last link's frame, m: the reference point of a point mass's terms. A shape without it has
/// all ten terms.
const TOOL: &str = "tool";
/// Names of the terms: mass, first moments, tensor about the link's origin.
const NAMES: [&str; 10] = ["mass", "moment_x", "moment_y", "moment_z", "xx", "yy", "zz", "xy", "xz", "yz"];

/// A table of parameters.
fn body(mass: f64, com: [f64; 3], moments: [f64; 3], products: [f64; 3]) -> Table {
    [
        ("mass", Value::Float(mass)),
        ("com", vector(com)),
        ("moments", vector(moments)),
        ("products", vector(products)),
    ]
    .into_iter()
    .map(|(name, value)| (name.to_owned(), value))
    .collect()
}

/// The reference point of a point mass's terms, m; `None` for a shape with all ten terms.
fn about(shape: &Table) -> Option<Vector3<f64>> {
    let place = shape.get(TOOL)?.as_array()?;
    Some(Vector3::from_iterator(place.iter().filter_map(Value::as_float)))
}

fn terms(_: &Kind, place: &Place, shape: &Table) -> Vec<Term> {
    /// Lever of the first moments, m: ±1 kg there; their tensor cancels in the difference.
    const LEVER: f64 = 0.1;
    let none = [0.0; 3];
    let carried = place.scene.arm.joints().last().map_or(0.0, |joint| joint.inertia.mass);
    let (free, tensor) = ([-1e6, 1e6], "kg*m^2");
    let centre = about(shape);
    let near = centre.unwrap_or_default();
    let mut terms = vec![Term::new(NAMES[0], "kg", [-carried, 1e4], body(1.0, near.into(), none, none))];
    for axis in 0..3 {
        let at = |lever| body(1.0, (near + Vector3::from(along(axis, lever))).into(), none, none);
        terms.push(Term::new(NAMES[1 + axis], "kg*m", free, at(LEVER)).less(at(-LEVER)).stepped(2.0 * LEVER));
    }
    if centre.is_none() {
        // Every body of these tables is possible: a product of inertia comes with sufficient moments.
        let round = [1.0; 3];
        for axis in 0..3 {
            terms.push(Term::new(NAMES[4 + axis], tensor, free, body(0.0, none, along(axis, 1.0), none)));
        }
        for pair in 0..3 {
            let with_product = body(0.0, none, round, along(pair, 0.5));
            let without = body(0.0, none, round, none);
            terms.push(Term::new(NAMES[7 + pair], tensor, free, with_product).less(without).stepped(0.5));
        }
    }
    terms
}

fn compose(_: &Kind, shape: &Table, coefficients: &[f64]) -> Table {
    let mass = coefficients[0];
    let centre = about(shape);
    let off =
        if mass == 0.0 { Vector3::zeros() } else { Vector3::from_column_slice(&coefficients[1..4]) / mass };
    let com = centre.unwrap_or_default() + off;
    if centre.is_some() {
        return body(mass, com.into(), [0.0; 3], [0.0; 3]);
    }
    // From the link's origin to the body's centre (Steiner 1840).
    let steiner = (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
    let moments = [0, 1, 2].map(|i| coefficients[4 + i] - steiner[(i, i)]);
    let products = [(0, 1), (0, 2), (1, 2)];
    let products = [0, 1, 2].map(|i| coefficients[7 + i] - steiner[products[i]]);
    if mass < 0.0 {
        return body(mass, com.into(), moments, products);
    }
    let [[xx, yy, zz], [xy, xz, yz]] = [moments, products];
    let about_com = possible(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
    let products = [(0, 1), (0, 2), (1, 2)].map(|place| about_com[place]);
    body(mass, com.into(), about_com.diagonal().into(), products)
}

/// The nearest possible tensor: it sets negative principal moments, which a fit finds if the motion hardly determines them, to 0 (Higham
/// 1988, Linear Algebra Appl. 103:103).
fn possible(tensor: Matrix3<f64>) -> Matrix3<f64> {
    let mut principal = tensor.symmetric_eigen();
    if principal.eigenvalues.min() >= 0.0 {
        return tensor;
    }
    principal.eigenvalues.apply(|moment| *moment = moment.max(0.0));
    principal.recompose()
}

#[derive(Clone, Copy, Debug)]
struct Payload(Inertia);

impl Effect for Payload {
    fn arm(&self, parts: &mut ArmParts) -> Result<(), LawError> {
        if let Some(last) = parts.joints.last_mut() {
            last.inertia = last.inertia.joined_with(&self.0, &Isometry3::identity());
        }
        Ok(())
    }

    fn inject(&self, _injection: &mut Injection) {}

    fn export_elements(&self, _elements: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Whole
    }
}
