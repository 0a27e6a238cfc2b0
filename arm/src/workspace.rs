//! The intermediate results for one arm, allocated once.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::arm::Arm;
use crate::spatial::{Acceleration, ArticulatedInertia, Symmetric3, Wrench};

/// Intermediate results for one arm: scratch memory, not the space that the arm can reach. Any function of this crate may overwrite all of
/// it. A reading function such as [`Workspace::link_pose`] or [`crate::joint_reaction`] therefore belongs directly after the function whose
/// results it reads.
#[derive(Clone, Debug)]
pub struct Workspace {
    pub(crate) links: Vec<LinkState>,
    /// The algorithm that wrote the links last; it determines where `joint_reaction` finds the wrench.
    pub(crate) wrench_source: WrenchSource,
    /// The step of the inverse kinematics, one value per joint.
    pub(crate) step: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WrenchSource {
    /// `LinkState::wrench` is the whole wrench across the joint (inverse dynamics).
    Transmitted,
    /// The wrench across the joint is articulated inertia × acceleration + `LinkState::wrench` (forward dynamics).
    Articulated,
}

/// State of one link, in world axes; moments are taken about the link origin.
#[derive(Clone, Debug, Default)]
pub(crate) struct LinkState {
    /// Link frame → world.
    pub rotation: Matrix3<f64>,
    /// Link origin in the world, m.
    pub position: Vector3<f64>,
    /// Link origin minus the parent's origin, m.
    pub from_parent: Vector3<f64>,
    /// Joint axis.
    pub axis: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub omega: Vector3<f64>,
    /// Velocity-dependent part of the joint's contribution to the acceleration of the link.
    pub drift: Acceleration,
    /// Acceleration of the link.
    pub acceleration: Acceleration,
    /// First moment m·c, kg·m.
    pub first_moment: Vector3<f64>,
    /// Inertia of the link, or of the link and all links beyond, about the link origin, kg·m².
    pub inertia: Symmetric3,
    /// Mass of the link, or of the link and all links beyond, kg.
    pub mass: f64,
    /// Articulated inertia.
    pub articulated: ArticulatedInertia,
    /// Wrench across the joint, or the bias part of it: see [`WrenchSource`].
    pub wrench: Wrench,
    /// Column of the articulated inertia for the joint's motion.
    pub column: Wrench,
    /// 1/(axis · column), the inverse of the joint's effective inertia.
    pub inverse_effective: f64,
    /// Remaining torque (or force) that accelerates the joint.
    pub residual: f64,
}

impl Workspace {
    /// A workspace for `arm` and for arms with the same number of joints.
    pub fn new(arm: &Arm) -> Workspace {
        Workspace {
            links: vec![LinkState::default(); arm.dof()],
            wrench_source: WrenchSource::Transmitted,
            step: vec![0.0; arm.dof()],
        }
    }

    /// Pose of the link moved by joint number `joint` (from 0) in the base frame, after [`crate::forward_kinematics`] or any other function
    /// with q as input.
    ///
    /// # Panics
    /// If `joint` is not below the number of joints.
    pub fn link_pose(&self, joint: usize) -> Isometry3<f64> {
        let link = &self.links[joint];
        isometry(&link.rotation, link.position)
    }

    /// Panics unless the workspace and every slice fit the arm: mixing up two arms is a bug of the caller.
    #[inline]
    pub(crate) fn check_sizes<const N: usize>(&self, arm: &Arm, lengths: [usize; N]) {
        assert_eq!(
            self.links.len(),
            arm.dof(),
            "the workspace was made for an arm with another number of joints"
        );
        for length in lengths {
            assert_eq!(length, arm.dof(), "a slice of joint values has the wrong length");
        }
    }
}

/// A pose from a rotation matrix that is orthonormal to rounding, and a position.
pub(crate) fn isometry(rotation: &Matrix3<f64>, position: Vector3<f64>) -> Isometry3<f64> {
    let mut quaternion =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation)).into_inner();
    quaternion.normalize_mut();
    Isometry3::from_parts(Translation3::from(position), UnitQuaternion::new_unchecked(quaternion))
}
