//! The joints of one body in MJCF: the slides of its play, the motor's, and the gear's.

use nalgebra::{Unit, Vector3};

use super::mjcf_writer::{Marks, Writer};
use super::parts::{Gear, JointParts};
use super::xml::{number, numbers};
use freeplay_arm::JointKind;

/// Bound of a range without a bound on one side, rad or m.
const OPEN: f64 = 1e9;

/// Impedance of elastic flanks: the share of MuJoCo's additional term against their spring and damper.
const SOFT: f64 = 0.01;

/// Writes the joints of the body that joint number `index` moves.
pub(super) fn write(writer: &mut Writer, index: usize, parts: &JointParts, marks: &mut Marks) {
    let joint = &parts.joint;
    let axis = joint.axis;
    if parts.play.is_some() {
        for (number, slide) in across(&axis).into_iter().enumerate() {
            let name = writer.names.take(&format!("{}_play_{}", joint.name, number + 1));
            let axis = ("axis", numbers(slide.as_slice()));
            writer.xml.empty("joint", &[("name", name), ("type", "slide".to_owned()), axis]);
        }
    }
    writer.xml.empty("joint", &motor(parts));
    if let Some(gear) = parts.gear {
        let name = writer.names.take(&format!("{}_gear", joint.name));
        let mut attributes = vec![("name", name.clone()), kind(parts), ("axis", numbers(axis.as_slice()))];
        attributes.extend(flanks(&gear));
        writer.xml.empty("joint", &attributes);
        marks.gears.insert(index, name);
    }
}

/// Two directions across `axis`.
fn across(axis: &Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    let mut along = Vector3::zeros();
    along[axis.iamin()] = 1.0;
    let first = axis.cross(&along).normalize();
    [first, axis.cross(&first)]
}

fn kind(parts: &JointParts) -> (&'static str, String) {
    let kind = match parts.joint.kind {
        JointKind::Revolute => "hinge",
        JointKind::Prismatic => "slide",
    };
    ("type", kind.to_owned())
}

/// The joint of the motor, with all effects on the motor's side.
fn motor(parts: &JointParts) -> Vec<(&'static str, String)> {
    let joint = &parts.joint;
    let mut attributes =
        vec![("name", joint.name.clone()), kind(parts), ("axis", numbers(joint.axis.as_slice()))];
    let (lower, upper) = (joint.limits.lower, joint.limits.upper);
    if lower.is_finite() || upper.is_finite() {
        attributes.push(("range", numbers(&[lower.max(-OPEN), upper.min(OPEN)])));
    }
    let [linear, quadratic] = parts.damping;
    if quadratic > 0.0 {
        attributes.push(("damping", numbers(&[linear.max(0.0), quadratic])));
    } else if linear > 0.0 {
        attributes.push(("damping", number(linear)));
    }
    for (name, value) in [("frictionloss", parts.friction), ("armature", parts.armature)] {
        if value > 0.0 {
            attributes.push((name, number(value)));
        }
    }
    if let Some(spring) = parts.spring.filter(|spring| spring.stiffness > 0.0) {
        attributes.extend([("stiffness", number(spring.stiffness)), ("springref", number(spring.rest))]);
    }
    attributes
}

/// The attributes of a joint that represents a gear.
///
/// Flanks are limits. In MuJoCo a limit at the depth r and the speed v gives the force f = (−b v − k r − a₀)/(R + A), a₀ being the
/// acceleration without it, A the mobility and R = A (1 − d)/d for the impedance d. With d small the part of a₀ is small, and f = K r + D v
/// for k = K A/d and b = D A/d, which `solref` expresses as −K A and −D A (MuJoCo documentation, "Solver parameters", direct format).
fn flanks(gear: &Gear) -> Vec<(&'static str, String)> {
    let half = 0.5 * gear.gap;
    let range = ("range", numbers(&[-half, half]));
    if gear.compliance == 0.0 {
        return vec![range];
    }
    let stiffness = 1.0 / gear.compliance;
    if gear.gap > 0.0 {
        let reference = [-stiffness * gear.mobility, -gear.damping * gear.mobility];
        let impedance = [SOFT, SOFT, 1e-3, 0.5, 2.0];
        return vec![range, ("solreflimit", numbers(&reference)), ("solimplimit", numbers(&impedance))];
    }
    let mut attributes = vec![("stiffness", number(stiffness))];
    if gear.damping > 0.0 {
        attributes.push(("damping", number(gear.damping)));
    }
    attributes
}
