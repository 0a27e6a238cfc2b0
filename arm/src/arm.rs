//! The checked, immutable arm.

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use thiserror::Error;

use crate::dynamics::forward::felt_inertia;
use crate::dynamics::mass_matrix::compose_inertias;
use crate::spatial::Symmetric3;
use crate::workspace::Workspace;

/// Most joints an arm may have. It bounds what a broken or hostile file can ask for.
pub const MAX_DOF: usize = 64;

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turns about its axis; q in rad, tau in N·m. A URDF `continuous` joint is one without position limits.
    Revolute,
    /// Slides along its axis; q in m, tau in N.
    Prismatic,
}

/// What the joint may do; infinite where the file is silent. Units: rad or m, per s, per s²; N·m or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least position, rad or m; −∞ if none.
    pub lower: f64,
    /// Greatest position, rad or m; +∞ if none.
    pub upper: f64,
    /// Greatest speed, rad/s or m/s.
    pub velocity: f64,
    /// Greatest acceleration, rad/s² or m/s².
    pub acceleration: f64,
    /// Greatest torque or force, N·m or N.
    pub effort: f64,
}

impl Limits {
    /// No limits at all.
    pub const NONE: Limits = Limits {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: f64::INFINITY,
        acceleration: f64::INFINITY,
        effort: f64::INFINITY,
    };
}

/// Nominal friction of a joint (URDF `<dynamics damping friction>`). The dynamics of this crate leave it out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointFriction {
    /// Torque per speed, N·m·s/rad or N·s/m; not negative.
    pub viscous: f64,
    /// Torque that opposes motion at any speed, N·m or N; not negative.
    pub coulomb: f64,
}

/// Mass distribution of a link, in the link frame (which moves with the joint).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass, m.
    pub com: Vector3<f64>,
    /// Inertia tensor about the centre of mass, kg·m²; off-diagonal elements are −∫xy dm.
    pub about_com: Matrix3<f64>,
}

impl Inertia {
    /// No mass and no inertia.
    pub fn zero() -> Inertia {
        Inertia { mass: 0.0, com: Vector3::zeros(), about_com: Matrix3::zeros() }
    }

    /// The inertia of this body and `other` moved by `pose` (the frame of `other` in the frame of this body), by the parallel
    /// axis theorem (Steiner 1840).
    pub fn joined_with(&self, other: &Inertia, pose: &Isometry3<f64>) -> Inertia {
        let rotation = pose.rotation.to_rotation_matrix();
        let other_com = (pose * nalgebra::Point3::from(other.com)).coords;
        let other_about_com = rotation.matrix() * other.about_com * rotation.matrix().transpose();
        let mass = self.mass + other.mass;
        let com = if mass > 0.0 { (self.com * self.mass + other_com * other.mass) / mass } else { self.com };
        let offset = |c: &Vector3<f64>, m: f64| {
            let d = c - com;
            (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * m
        };
        let sum =
            self.about_com + other_about_com + offset(&self.com, self.mass) + offset(&other_com, other.mass);
        Inertia { mass, com, about_com: (sum + sum.transpose()) * 0.5 }
    }

    /// What makes the tensor impossible, in words: it is not finite, not symmetric or not positive semi-definite. Rounding of a
    /// file that writes three digits passes.
    pub fn tensor_problem(&self) -> Option<String> {
        let size = self.about_com.amax();
        if !self.about_com.iter().all(|x| x.is_finite()) {
            return Some("not finite".to_owned());
        }
        if (self.about_com - self.about_com.transpose()).amax() > 1e-9 * size {
            return Some("not symmetric".to_owned());
        }
        let least = size * self.principal_ratios().min();
        if least < -1e-3 * size {
            return Some(format!(
                "not positive semi-definite: it has the principal moment {least:.3e}; check its signs"
            ));
        }
        None
    }

    /// Principal moments over the largest element, so that no size of the tensor can over- or underflow.
    fn principal_ratios(&self) -> Vector3<f64> {
        let size = self.about_com.amax();
        if size > 0.0 && size.is_finite() {
            (self.about_com / size).symmetric_eigenvalues()
        } else {
            Vector3::zeros()
        }
    }

    /// How far the principal moments break the triangle inequality that every real body obeys: the largest minus the sum of
    /// the other two, over the trace; zero or below for a body that can exist.
    pub fn triangle_excess(&self) -> f64 {
        let moments = self.principal_ratios();
        if moments.sum() > 0.0 { 2.0 * moments.max() / moments.sum() - 1.0 } else { 0.0 }
    }
}

/// One joint and the link that it moves. The link frame is the joint frame after the joint's motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique in the arm.
    pub name: String,
    /// Turning or sliding.
    pub kind: JointKind,
    /// Axis of the motion in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Joint frame in the parent's link frame at q = 0, m.
    pub placement: Isometry3<f64>,
    /// Limits.
    pub limits: Limits,
    /// Nominal friction, not part of the dynamics here.
    pub friction: JointFriction,
    /// Inertia of the link, everything rigidly fixed to it included, in the link frame.
    pub inertia: Inertia,
}

/// Why a chain of joints is not an arm.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ArmError {
    /// No joint at all.
    #[error("the arm has no moving joint; it needs at least one revolute or prismatic joint")]
    NoJoints,
    /// More joints than [`MAX_DOF`].
    #[error(
        "the arm has {count} moving joints, more than the {MAX_DOF} allowed; lock or leave out the joints not needed"
    )]
    TooManyJoints {
        /// How many there are.
        count: usize,
    },
    /// Two joints share a name.
    #[error("two joints are called `{name}`; every joint needs a name of its own")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// A joint without a name.
    #[error("joint number {number} has an empty name; give it one")]
    EmptyName {
        /// Position in the chain, from 1.
        number: usize,
    },
    /// A value outside its range, NaN or infinite.
    #[error("{}: {quantity} is {value}, but must be {must}", joint.as_ref().map_or("the arm".to_owned(), |name| format!("joint `{name}`")))]
    Value {
        /// The joint whose value it is; `None` for the arm as a whole.
        joint: Option<String>,
        /// Which quantity, with its unit.
        quantity: String,
        /// The value found.
        value: String,
        /// What is allowed.
        must: &'static str,
    },
    /// A joint whose motion no inertia resists.
    #[error(
        "joint `{name}` moves no inertia (felt inertia {felt:e}): no mass beyond it resists its motion, so its acceleration would be \
         infinite; give its link or one beyond it a mass away from the axis or an inertia about it, or lock the joint"
    )]
    MovesNoInertia {
        /// The joint.
        name: String,
        /// Inertia felt at the joint, kg·m² or kg.
        felt: f64,
    },
    /// An index that names no joint.
    #[error("there is no joint number {index} (from 0) in an arm of {dof} joints")]
    NoSuchJoint {
        /// The index asked for.
        index: usize,
        /// Number of joints.
        dof: usize,
    },
}

impl ArmError {
    /// The joint that the error is about, if it is about one.
    pub fn joint(&self) -> Option<&str> {
        match self {
            ArmError::Value { joint, .. } => joint.as_deref(),
            ArmError::MovesNoInertia { name, .. } | ArmError::DuplicateName { name } => Some(name),
            ArmError::NoJoints
            | ArmError::TooManyJoints { .. }
            | ArmError::EmptyName { .. }
            | ArmError::NoSuchJoint { .. } => None,
        }
    }
}

/// A serial chain of joints on a fixed base, checked and immutable.
#[derive(Clone, Debug)]
pub struct Arm {
    name: String,
    joints: Vec<Joint>,
    tool: Isometry3<f64>,
    gravity: Vector3<f64>,
    constants: Vec<LinkConstants>,
}

/// What the recursions need of a joint and its link, worked out once.
///
/// The rotation from the link frame to the parent's is P Rot(axis, q) = `fixed` + cos q `cosine` + sin q `sine` by Rodrigues'
/// formula (1840), with P the rotation of the placement; the link origin in the parent's frame is `offset` + q `slide`.
#[derive(Clone, Debug)]
pub(crate) struct LinkConstants {
    pub kind: JointKind,
    pub fixed: Matrix3<f64>,
    pub cosine: Matrix3<f64>,
    pub sine: Matrix3<f64>,
    pub offset: Vector3<f64>,
    pub slide: Vector3<f64>,
    /// Axis in the parent's link frame.
    pub axis: Vector3<f64>,
    /// Neither mass nor inertia: nothing to add to the articulated inertia.
    pub massless: bool,
    pub mass: f64,
    /// m·c in the link frame, kg·m.
    pub first_moment: Vector3<f64>,
    /// Inertia about the link origin in the link frame, kg·m².
    pub inertia: Symmetric3,
}

impl Arm {
    /// An arm of `joints` from the base outwards, with the pose of the tool frame `tool0` in the last link's frame and the
    /// acceleration of gravity in the base frame, m/s².
    ///
    /// # Errors
    /// [`ArmError`] names the joint, the value and what is allowed: see its variants.
    pub fn new(
        name: &str,
        mut joints: Vec<Joint>,
        tool: Isometry3<f64>,
        gravity: Vector3<f64>,
    ) -> Result<Arm, ArmError> {
        check::chain(&joints)?;
        check::pose(None, "tool pose", &tool)?;
        check::finite(None, "gravity (m/s²)", gravity.as_slice())?;
        for joint in &mut joints {
            check::joint(joint)?;
            let tensor = joint.inertia.about_com;
            joint.inertia.about_com = (tensor + tensor.transpose()) * 0.5;
        }
        let constants = joints.iter().map(LinkConstants::of).collect();
        let arm = Arm { name: name.to_owned(), joints, tool, gravity, constants };
        check::every_joint_moves_inertia(&arm)?;
        Ok(arm)
    }

    /// Number of joints.
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// Name of the arm.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The joints from the base outwards.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Position in the chain, from 0, of the joint called `name`.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Pose of the tool frame `tool0` in the last link's frame, m.
    pub fn tool(&self) -> &Isometry3<f64> {
        &self.tool
    }

    /// Acceleration of gravity in the base frame, m/s².
    pub fn gravity(&self) -> &Vector3<f64> {
        &self.gravity
    }

    /// The same arm under the gravity `g`, m/s² in the base frame.
    pub fn with_gravity(&self, g: Vector3<f64>) -> Arm {
        Arm { gravity: g, ..self.clone() }
    }

    /// The same arm with `joint` inserted before joint number `index` (from 0). The inserted joint takes over the placement of
    /// joint `index`, which gets the identity placement; the placement given in `joint` is not used.
    ///
    /// # Errors
    /// [`ArmError::NoSuchJoint`] for an index beyond the last joint, and whatever [`Arm::new`] finds.
    pub fn with_joint_inserted_before(&self, index: usize, joint: Joint) -> Result<Arm, ArmError> {
        let mut joints = self.joints.clone();
        let next = joints.get_mut(index).ok_or(ArmError::NoSuchJoint { index, dof: self.joints.len() })?;
        let placement = std::mem::replace(&mut next.placement, Isometry3::identity());
        joints.insert(index, Joint { placement, ..joint });
        Arm::new(&self.name, joints, self.tool, self.gravity)
    }

    pub(crate) fn constants(&self) -> &[LinkConstants] {
        &self.constants
    }
}

impl LinkConstants {
    fn of(joint: &Joint) -> LinkConstants {
        let placed = joint.placement.rotation.to_rotation_matrix().into_inner();
        let axis = joint.axis.into_inner();
        let along = axis * axis.transpose();
        let zero = Matrix3::zeros();
        let (fixed, cosine, sine, slide) = match joint.kind {
            JointKind::Revolute => (
                placed * along,
                placed * (Matrix3::identity() - along),
                placed * axis.cross_matrix(),
                Vector3::zeros(),
            ),
            JointKind::Prismatic => (placed, zero, zero, placed * axis),
        };
        let Inertia { mass, com, about_com } = joint.inertia;
        let about_origin =
            about_com + (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        LinkConstants {
            kind: joint.kind,
            fixed,
            cosine,
            sine,
            offset: joint.placement.translation.vector,
            slide,
            axis: placed * axis,
            massless: mass == 0.0 && about_com == zero,
            mass,
            first_moment: com * mass,
            inertia: Symmetric3::from_matrix(&about_origin),
        }
    }
}

/// The checks of [`Arm::new`].
mod check {
    use super::{
        Arm, ArmError, Isometry3, Joint, JointKind, MAX_DOF, Matrix3, Workspace, compose_inertias,
        felt_inertia,
    };

    pub fn chain(joints: &[Joint]) -> Result<(), ArmError> {
        if joints.is_empty() {
            return Err(ArmError::NoJoints);
        }
        if joints.len() > MAX_DOF {
            return Err(ArmError::TooManyJoints { count: joints.len() });
        }
        for (i, joint) in joints.iter().enumerate() {
            if joint.name.is_empty() {
                return Err(ArmError::EmptyName { number: i + 1 });
            }
            if joints[..i].iter().any(|other| other.name == joint.name) {
                return Err(ArmError::DuplicateName { name: joint.name.clone() });
            }
        }
        Ok(())
    }

    /// The joint that a value belongs to; `None` for the arm.
    type Of<'a> = Option<&'a str>;

    fn value(of: Of<'_>, quantity: &str, value: impl ToString, must: &'static str) -> ArmError {
        ArmError::Value {
            joint: of.map(str::to_owned),
            quantity: quantity.to_owned(),
            value: value.to_string(),
            must,
        }
    }

    pub fn finite(of: Of<'_>, quantity: &str, values: &[f64]) -> Result<(), ArmError> {
        match values.iter().find(|v| !v.is_finite()) {
            Some(v) => Err(value(of, quantity, v, "finite")),
            None => Ok(()),
        }
    }

    pub fn pose(of: Of<'_>, quantity: &str, pose: &Isometry3<f64>) -> Result<(), ArmError> {
        finite(of, quantity, pose.translation.vector.as_slice())?;
        finite(of, quantity, pose.rotation.coords.as_slice())?;
        let norm = pose.rotation.coords.norm();
        if (norm - 1.0).abs() > 1e-9 {
            return Err(value(of, quantity, format!("a quaternion of length {norm}"), "a unit quaternion"));
        }
        Ok(())
    }

    pub fn joint(joint: &Joint) -> Result<(), ArmError> {
        let of = Some(joint.name.as_str());
        pose(of, "placement", &joint.placement)?;
        finite(of, "axis", joint.axis.as_slice())?;
        if (joint.axis.norm() - 1.0).abs() > 1e-9 {
            return Err(value(of, "length of the axis", joint.axis.norm(), "1"));
        }
        limits(of, joint)?;
        for (quantity, v) in
            [("viscous friction", joint.friction.viscous), ("Coulomb friction", joint.friction.coulomb)]
        {
            if !(v >= 0.0 && v.is_finite()) {
                return Err(value(of, quantity, v, "finite and not negative"));
            }
        }
        inertia(of, joint)
    }

    fn limits(of: Of<'_>, joint: &Joint) -> Result<(), ArmError> {
        let l = &joint.limits;
        if l.lower.is_nan() || l.upper.is_nan() || l.lower > l.upper {
            let range = format!("{} … {}", l.lower, l.upper);
            return Err(value(of, "position limit", range, "two numbers, lower ≤ upper"));
        }
        for (quantity, v) in [
            ("velocity limit", l.velocity),
            ("acceleration limit", l.acceleration),
            ("effort limit", l.effort),
        ] {
            if v.is_nan() || v <= 0.0 {
                return Err(value(of, quantity, v, "positive, or infinite for none"));
            }
        }
        Ok(())
    }

    fn inertia(of: Of<'_>, joint: &Joint) -> Result<(), ArmError> {
        let inertia = &joint.inertia;
        if !(inertia.mass >= 0.0 && inertia.mass.is_finite()) {
            return Err(value(of, "mass (kg)", inertia.mass, "finite and not negative"));
        }
        finite(of, "centre of mass (m)", inertia.com.as_slice())?;
        let tensor: &Matrix3<f64> = &inertia.about_com;
        finite(of, "inertia (kg·m²)", tensor.as_slice())?;
        match inertia.tensor_problem() {
            Some(problem) => {
                Err(value(of, "inertia (kg·m²)", problem, "symmetric and positive semi-definite"))
            }
            None => Ok(()),
        }
    }

    /// An inertia felt by a joint that is zero in general position is zero everywhere (it is an analytic function of q), so a
    /// few positions decide.
    pub fn every_joint_moves_inertia(arm: &Arm) -> Result<(), ArmError> {
        let mut ws = Workspace::new(arm);
        let mut felt = vec![0.0_f64; arm.dof()];
        for sample in 1..=3_u8 {
            let q: Vec<f64> = (1..=arm.dof()).map(|i| (1.3 * i as f64 * f64::from(sample)).sin()).collect();
            felt_inertia(arm, &mut ws, &q, |i, value| felt[i] = felt[i].max(value));
        }
        compose_inertias(arm, &mut ws);
        for ((joint, &felt), link) in arm.joints.iter().zip(&felt).zip(&ws.links).rev() {
            // Against the same load as one rigid body: below this ratio only rounding is left.
            let rigid = match joint.kind {
                JointKind::Revolute => link.inertia.trace(),
                JointKind::Prismatic => link.mass,
            };
            if felt.is_nan() || felt <= 1e-13 * rigid {
                return Err(ArmError::MovesNoInertia { name: joint.name.clone(), felt });
            }
        }
        Ok(())
    }
}
