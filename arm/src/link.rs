//! Constants of each link for the recursions, computed once.

use nalgebra::{Matrix3, Unit, Vector3};

use crate::joint::{Inertia, Joint, JointKind};
use crate::spatial::Symmetric3;

/// Constants of a joint and its link for the recursions, computed once.
///
/// The link frame is rotated against the parent's by P Rot(axis, q) with P the rotation of the placement; the link origin in the parent's
/// frame is `offset` + q `slide`.
#[derive(Clone, Debug)]
pub(crate) struct LinkConstants {
    pub kind: JointKind,
    /// P; `None` for the identity, as in most hand-written arm files.
    pub placed: Option<Matrix3<f64>>,
    pub turn: Turn,
    pub offset: Vector3<f64>,
    pub slide: Vector3<f64>,
    /// Axis in the parent's link frame.
    pub axis: Vector3<f64>,
    /// True if the link has neither mass nor inertia, so that it adds nothing to the articulated inertia.
    pub massless: bool,
    pub mass: f64,
    /// Inertia of the rotor on the joint's side of the gear, kg·m² or kg.
    pub rotor_inertia: f64,
    /// m·c in the link frame, kg·m.
    pub first_moment: Vector3<f64>,
    /// Inertia about the link origin in the link frame, kg·m².
    pub inertia: Symmetric3,
}

impl LinkConstants {
    pub fn of(joint: &Joint) -> LinkConstants {
        let placed = joint.placement.rotation.to_rotation_matrix().into_inner();
        let axis = placed * joint.axis.into_inner();
        let slide = match joint.kind {
            JointKind::Revolute => Vector3::zeros(),
            JointKind::Prismatic => axis,
        };
        let zero = Matrix3::zeros();
        let Inertia { mass, com, about_com } = joint.inertia;
        let about_origin =
            about_com + (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        LinkConstants {
            kind: joint.kind,
            placed: (placed != Matrix3::identity()).then_some(placed),
            turn: Turn::about(&joint.axis),
            offset: joint.placement.translation.vector,
            slide,
            axis,
            massless: mass == 0.0 && about_com == zero,
            mass,
            rotor_inertia: joint.rotor_inertia,
            first_moment: com * mass,
            inertia: Symmetric3::from_lower_triangle(&about_origin),
        }
    }
}

/// A rotation about a fixed axis, as a right factor of a frame's rotation.
#[derive(Clone, Debug)]
pub(crate) enum Turn {
    /// About the coordinate axis `number` (0, 1, 2 for x, y, z), in the positive sense where `sign` is 1, else −1.
    Coordinate { number: usize, sign: f64 },
    /// About any axis u: 1 + sin q [u] + (1 − cos q) [u]² (Rodrigues 1840).
    Skew { cross: Matrix3<f64>, squared: Matrix3<f64> },
}

impl Turn {
    fn about(axis: &Unit<Vector3<f64>>) -> Turn {
        // An axis close to a coordinate axis can also have a component of 1 to rounding.
        let alone = axis.iter().filter(|&&x| x != 0.0).count() == 1;
        match axis.iter().position(|x| x.abs() == 1.0) {
            Some(number) if alone => Turn::Coordinate { number, sign: axis[number] },
            _ => {
                let cross = axis.cross_matrix();
                Turn::Skew { cross, squared: cross * cross }
            }
        }
    }

    /// `rotation` · Rot(axis, q).
    #[inline(always)]
    pub fn applied(&self, rotation: &Matrix3<f64>, q: f64) -> Matrix3<f64> {
        let (sin, cos) = q.sin_cos();
        match self {
            Turn::Coordinate { number, sign } => {
                let sin = sin * sign;
                let r = rotation;
                let x = Vector3::new(r.m11, r.m21, r.m31);
                let y = Vector3::new(r.m12, r.m22, r.m32);
                let z = Vector3::new(r.m13, r.m23, r.m33);
                // The rotation mixes two columns; the third is the axis.
                let turned = |a: Vector3<f64>, b: Vector3<f64>| (a * cos + b * sin, b * cos - a * sin);
                let (x, y, z) = match number {
                    0 => {
                        let (y, z) = turned(y, z);
                        (x, y, z)
                    }
                    1 => {
                        let (z, x) = turned(z, x);
                        (x, y, z)
                    }
                    _ => {
                        let (x, y) = turned(x, y);
                        (x, y, z)
                    }
                };
                Matrix3::from_columns(&[x, y, z])
            }
            Turn::Skew { cross, squared } => {
                rotation * (Matrix3::identity() + cross * sin + squared * (1.0 - cos))
            }
        }
    }
}
