//! One joint and the link that it moves.

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

/// The kind of motion of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turns about its axis; q in rad, tau in N·m. A URDF `continuous` joint is one without position limits.
    Revolute,
    /// Slides along its axis; q in m, tau in N.
    Prismatic,
}

/// The limits of a joint; infinite where the file gives none. Units: rad or m, per s, per s²; N·m or N.
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

/// Nominal friction of a joint (URDF `<dynamics damping friction>`). The dynamics of this crate ignore it.
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
        // A body without mass leaves the centre of the other one unchanged, to the last digit.
        let com = if other.mass == 0.0 {
            self.com
        } else if self.mass == 0.0 {
            other_com
        } else {
            (self.com * self.mass + other_com * other.mass) / mass
        };
        let offset = |c: &Vector3<f64>, m: f64| {
            let d = c - com;
            (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * m
        };
        let sum =
            self.about_com + other_about_com + offset(&self.com, self.mass) + offset(&other_com, other.mass);
        Inertia { mass, com, about_com: (sum + sum.transpose()) * 0.5 }
    }

    /// Describes why the tensor is impossible, in words: it is not finite, not symmetric or not positive semi-definite. Rounding of a file
    /// with three digits passes.
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

    /// Principal moments over the largest element; this scaling avoids overflow and underflow.
    fn principal_ratios(&self) -> Vector3<f64> {
        let size = self.about_com.amax();
        // The eigenvalue iteration does not terminate on NaN.
        if size > 0.0 && self.about_com.iter().all(|x| x.is_finite()) {
            (self.about_com / size).symmetric_eigenvalues()
        } else {
            Vector3::zeros()
        }
    }

    /// Violation of the triangle inequality that the principal moments of every real body obey: the largest minus the sum of the other two,
    /// over the trace; zero or negative for a possible body.
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
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Axis of the motion in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Joint frame in the parent's link frame at q = 0, m.
    pub placement: Isometry3<f64>,
    /// Limits.
    pub limits: Limits,
    /// Nominal friction, not part of the dynamics here.
    pub friction: JointFriction,
    /// Inertia of the motor's rotor, reflected through its gear to the joint's side, kg·m² (kg); on this joint's own row of the mass matrix
    /// alone (Spong 1987, J. Dyn. Syst. Meas. Control 109:310, assumption A2; Featherstone 2008, §9.6). Negative only if another element
    /// has taken inertia out of the link.
    pub rotor_inertia: f64,
    /// Inertia of the link, everything rigidly fixed to it included, in the link frame.
    pub inertia: Inertia,
}
