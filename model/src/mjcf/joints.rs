//! `<joint>` of a body: motion, axis, range, friction and armature.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::Model;
use crate::error::ModelError;
use crate::numbers::{direction, parse_number};
use crate::robot::Joint;
use crate::urdf_joint::{Details, Motion};
use freeplay_arm::{JointFriction, JointKind, Limits};

impl<'d, 'i> Model<'_, 'd, 'i> {
    /// Adds the joint `node` between two links.
    pub(super) fn joint(
        &mut self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        [parent, child]: [usize; 2],
        placement: Isometry3<f64>,
    ) -> Result<(), ModelError> {
        let name =
            node.attribute("name").map_or_else(|| format!("joint_{}", self.joints.len() + 1), str::to_owned);
        let owner = format!("joint `{name}`");
        let at = node.range().start;
        if self.joints.iter().any(|other| other.motion != Motion::Fixed && other.name == name) {
            return Err(ModelError::Duplicate { at: self.reader.place(node), what: "joint", name });
        }
        let before = self.reader.notes.len();
        let motion = self.motion(node, childclass, &owner)?;
        let details = match motion.kind() {
            Some(kind) => self.details(node, childclass, kind, &owner),
            None => Ok(Details::none()),
        };
        let placement = match (motion.kind(), &details) {
            (Some(kind), Ok(details)) => {
                let reference = self.one(node, childclass, "ref", &owner)?.unwrap_or(0.0);
                placement * moved(kind, &details.axis, -reference * self.unit(kind))
            }
            _ => placement,
        };
        let notes = self.reader.notes.split_off(before);
        self.joints.push(Joint { name, motion, parent, child, placement: Ok(placement), details, notes, at });
        Ok(())
    }

    fn motion(
        &self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        owner: &str,
    ) -> Result<Motion, ModelError> {
        if node.has_tag_name("freejoint") {
            return Ok(Motion::Free);
        }
        let Some(kind) = self.defaults.attribute(node, childclass, "type") else {
            return Ok(Motion::Moving(JointKind::Revolute));
        };
        match kind.value() {
            "hinge" => Ok(Motion::Moving(JointKind::Revolute)),
            "slide" => Ok(Motion::Moving(JointKind::Prismatic)),
            "ball" | "free" => Ok(Motion::Free),
            _ => {
                let remedy = "write hinge, slide, ball or free".to_owned();
                Err(self.reader.value_error(kind, format!("{owner}: type"), remedy))
            }
        }
    }

    /// One unit of the position of a joint, rad or m.
    pub(super) fn unit(&self, kind: JointKind) -> f64 {
        match kind {
            JointKind::Revolute => self.compiler.angle,
            JointKind::Prismatic => 1.0,
        }
    }

    fn details(
        &mut self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        kind: JointKind,
        owner: &str,
    ) -> Result<Details, ModelError> {
        let axis = self.axis(node, childclass, owner)?;
        let [lower, upper] = self.range(node, childclass, owner)?.map(|bound| bound * self.unit(kind));
        let effort = self.joint_effort(node, childclass, owner)?;
        let viscous = self.first_of(node, childclass, "damping", owner)?;
        let coulomb = self.first_of(node, childclass, "frictionloss", owner)?;
        let rotor_inertia = self.first_of(node, childclass, "armature", owner)?;
        let stiffness = self.first_of(node, childclass, "stiffness", owner)?;
        if stiffness != 0.0 {
            self.reader.notes.push(format!(
                "{owner}: its spring (stiffness {stiffness}) is not used; add an effect for it to an arm file"
            ));
        }
        let limits = Limits { lower, upper, effort, ..Limits::NONE };
        Ok(Details {
            axis,
            limits,
            friction: JointFriction { viscous, coulomb },
            rotor_inertia,
            follows: None,
        })
    }

    fn axis(
        &self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        owner: &str,
    ) -> Result<Unit<Vector3<f64>>, ModelError> {
        let Some(said) = self.defaults.holder(node, childclass, "axis") else { return Ok(Vector3::z_axis()) };
        let xyz: [f64; 3] = self.reader.numbers(said, "axis", owner)?.unwrap_or([0.0, 0.0, 1.0]);
        direction(xyz).ok_or_else(|| ModelError::Value {
            at: self.reader.place(said),
            what: format!("{owner}: axis"),
            value: format!("{xyz:?}"),
            remedy: "an axis needs a direction".to_owned(),
        })
    }

    /// Least and greatest position in the file's unit; infinite without a limit.
    fn range(
        &self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        owner: &str,
    ) -> Result<[f64; 2], ModelError> {
        let none = [f64::NEG_INFINITY, f64::INFINITY];
        let limited =
            self.defaults.attribute(node, childclass, "limited").map_or("auto", |said| said.value());
        let Some(said) = self.defaults.holder(node, childclass, "range") else { return Ok(none) };
        let Some([lower, upper]) = self.reader.numbers(said, "range", owner)? else { return Ok(none) };
        let is_limited = limited == "true" || limited == "auto" && self.compiler.autolimits;
        match is_limited && (lower, upper) != (0.0, 0.0) {
            true if lower > upper => Err(ModelError::Value {
                at: self.reader.place(said),
                what: format!("{owner}: range"),
                value: format!("{lower} {upper}"),
                remedy: "the first must not be above the second".to_owned(),
            }),
            true => Ok([lower, upper]),
            false => Ok(none),
        }
    }

    /// The greatest total torque of all actuators in the joint's own attributes.
    fn joint_effort(
        &self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        owner: &str,
    ) -> Result<f64, ModelError> {
        let Some(said) = self.defaults.holder(node, childclass, "actuatorfrcrange") else {
            return Ok(f64::INFINITY);
        };
        let range: Option<[f64; 2]> = self.reader.numbers(said, "actuatorfrcrange", owner)?;
        let most = range.map_or(f64::INFINITY, |[least, most]| most.min(-least));
        Ok(if most > 0.0 { most } else { f64::INFINITY })
    }

    /// A number from the joint or its class.
    pub(super) fn one(
        &self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        name: &str,
        owner: &str,
    ) -> Result<Option<f64>, ModelError> {
        match self.defaults.holder(node, childclass, name) {
            Some(said) => self.reader.number(said, name, owner),
            None => Ok(None),
        }
    }

    /// The first of the coefficients `name`, by default 0; the others become a note.
    fn first_of(
        &mut self,
        node: Node<'d, 'i>,
        childclass: Option<&'d str>,
        name: &str,
        owner: &str,
    ) -> Result<f64, ModelError> {
        let Some(attribute) = self.defaults.attribute(node, childclass, name) else { return Ok(0.0) };
        let mut words = attribute.value().split_whitespace();
        let value = parse_number(words.next().unwrap_or_default())
            .and_then(|value| if value < 0.0 { Err("it must not be negative".to_owned()) } else { Ok(value) })
            .map_err(|remedy| self.reader.value_error(attribute, format!("{owner}: {name}"), remedy))?;
        if words.next().is_some() {
            self.reader.notes.push(format!("{owner}: the nonlinear part of its {name} is not used"));
        }
        Ok(value)
    }
}

/// The displacement of a joint at the position `q`, rad or m.
fn moved(kind: JointKind, axis: &Unit<Vector3<f64>>, q: f64) -> Isometry3<f64> {
    match kind {
        _ if q == 0.0 => Isometry3::identity(),
        JointKind::Revolute => {
            Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(axis, q))
        }
        JointKind::Prismatic => Isometry3::from(Translation3::from(axis.into_inner() * q)),
    }
}
