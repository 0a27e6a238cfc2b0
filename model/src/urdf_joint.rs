//! `<joint>`: the motion of a joint, its limits and its friction.

use nalgebra::{Unit, Vector3};
use roxmltree::Node;

use crate::error::ModelError;
use crate::numbers::direction;
use crate::urdf_xml::{Reader, children};
use freeplay_arm::{JointFriction, JointKind, Limits};

/// The motion that a `<joint>` allows its child.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// Has its own motion.
    Moving(JointKind),
    /// Follows another joint (`<mimic>`).
    Mimic(JointKind),
    /// Does not move.
    Fixed,
    /// Moves freely, like a base on wheels or a body in the air: held in place.
    Free,
    /// An unknown type; the joint's details contain the error.
    Unknown,
}

impl Motion {
    /// Revolute or prismatic, for own motion and for following joints.
    pub fn kind(self) -> Option<JointKind> {
        match self {
            Motion::Moving(kind) | Motion::Mimic(kind) => Some(kind),
            Motion::Fixed | Motion::Free | Motion::Unknown => None,
        }
    }

    /// True if the joint has its own motion: it is neither fixed nor follows another joint.
    pub fn is_own(self) -> bool {
        matches!(self, Motion::Moving(_))
    }
}

/// The data of a joint of the arm: axis, limits, friction, and the joint that it follows.
pub(super) struct Details {
    pub axis: Unit<Vector3<f64>>,
    pub limits: Limits,
    pub friction: JointFriction,
    /// MJCF's `armature`; URDF has none.
    pub rotor_inertia: f64,
    pub follows: Option<Follows>,
}

/// `<mimic>`: position = multiplier · that of the leader + offset.
#[derive(Clone)]
pub(super) struct Follows {
    pub leader: String,
    pub multiplier: f64,
    pub offset: f64,
}

impl Details {
    /// The details of a joint without motion.
    pub fn none() -> Details {
        let (limits, friction) = (Limits::NONE, JointFriction::default());
        Details { axis: Vector3::x_axis(), limits, friction, rotor_inertia: 0.0, follows: None }
    }
}

impl Reader<'_> {
    /// The motion of the joint `node`; `Unknown` for an unknown type.
    pub fn motion(&self, node: Node<'_, '_>, owner: &str) -> Result<Motion, ModelError> {
        let kind = match self.required(node, "type", owner)?.value() {
            "revolute" | "continuous" => JointKind::Revolute,
            "prismatic" => JointKind::Prismatic,
            "fixed" => return Ok(Motion::Fixed),
            "floating" | "planar" => return Ok(Motion::Free),
            _ => return Ok(Motion::Unknown),
        };
        let mimics = children(node, "mimic").next().is_some();
        Ok(if mimics { Motion::Mimic(kind) } else { Motion::Moving(kind) })
    }

    /// Reads the data of the joint `node`, whose motion is `motion`; errors name it as `owner`.
    pub fn details(
        &mut self,
        node: Node<'_, '_>,
        motion: Motion,
        owner: &str,
    ) -> Result<Details, ModelError> {
        if motion == Motion::Unknown {
            let kind = self.required(node, "type", owner)?;
            let remedy = "write revolute, continuous, prismatic or fixed".to_owned();
            return Err(self.value_error(kind, format!("{owner}: type"), remedy));
        }
        if motion.kind().is_none() {
            return Ok(Details::none());
        }
        Ok(Details {
            axis: self.axis(node, owner)?,
            limits: self.limits(node, owner)?,
            friction: self.friction(node, owner)?,
            rotor_inertia: 0.0,
            follows: self.follows(node, owner)?,
        })
    }

    fn axis(&mut self, joint: Node<'_, '_>, owner: &str) -> Result<Unit<Vector3<f64>>, ModelError> {
        let Some(node) = self.first(joint, "axis", owner) else { return Ok(Vector3::x_axis()) };
        let Some(attribute) = node.attribute_node("xyz") else { return Ok(Vector3::x_axis()) };
        let xyz = self.numbers::<3>(node, "xyz", owner)?.unwrap_or([1.0, 0.0, 0.0]);
        direction(xyz).ok_or_else(|| {
            let remedy = "an axis needs a direction".to_owned();
            self.value_error(attribute, format!("{owner}: <axis xyz>"), remedy)
        })
    }

    fn limits(&mut self, joint: Node<'_, '_>, owner: &str) -> Result<Limits, ModelError> {
        let Some(node) = self.first(joint, "limit", owner) else { return Ok(Limits::NONE) };
        let velocity = self.bound(node, "velocity", owner)?;
        let acceleration = self.bound(node, "acceleration", owner)?;
        let effort = self.bound(node, "effort", owner)?;
        let mut lower = self.number(node, "lower", owner)?.unwrap_or(f64::NEG_INFINITY);
        let mut upper = self.number(node, "upper", owner)?.unwrap_or(f64::INFINITY);
        if joint.attribute("type") == Some("continuous") {
            (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        if let Some(attribute) = node.attribute_node("lower").filter(|_| lower > upper) {
            let remedy = format!("it must not be above upper, which is `{upper}`");
            return Err(self.value_error(attribute, format!("{owner}: <limit lower>"), remedy));
        }
        if lower == 0.0 && upper == 0.0 {
            self.notes.push(format!("{owner}: position limits 0 and 0 are read as none"));
            (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        Ok(Limits { lower, upper: upper.max(lower), velocity, acceleration, effort })
    }

    /// A limit on a magnitude. Exporters write 0 or -1 for an unknown limit; the reader takes such a value as no limit.
    fn bound(&mut self, limit: Node<'_, '_>, name: &str, owner: &str) -> Result<f64, ModelError> {
        let value = self.number(limit, name, owner)?;
        if let Some(value) = value.filter(|&value| value <= 0.0) {
            self.notes.push(format!("{owner}: {name} limit {value} is read as none"));
        }
        Ok(value.filter(|&v| v > 0.0).unwrap_or(f64::INFINITY))
    }

    fn friction(&mut self, joint: Node<'_, '_>, owner: &str) -> Result<JointFriction, ModelError> {
        let Some(node) = self.first(joint, "dynamics", owner) else { return Ok(JointFriction::default()) };
        let mut of = |name: &str| {
            let value = self.number(node, name, owner)?.unwrap_or(0.0);
            if value < 0.0 {
                self.notes.push(format!("{owner}: {name} {value} is below zero: read as 0"));
            }
            Ok(value.max(0.0))
        };
        Ok(JointFriction { viscous: of("damping")?, coulomb: of("friction")? })
    }

    fn follows(&mut self, joint: Node<'_, '_>, owner: &str) -> Result<Option<Follows>, ModelError> {
        let Some(node) = children(joint, "mimic").next() else { return Ok(None) };
        let leader = self.required(node, "joint", owner)?.value().to_owned();
        let multiplier = self.number(node, "multiplier", owner)?.unwrap_or(1.0);
        let offset = self.number(node, "offset", owner)?.unwrap_or(0.0);
        Ok(Some(Follows { leader, multiplier, offset }))
    }
}
