//! Symmetric 3×3 matrices and articulated inertias in world axes.

use nalgebra::{Matrix3, Vector3};

/// A symmetric 3×3 matrix by its six distinct elements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Symmetric3 {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    pub xy: f64,
    pub xz: f64,
    pub yz: f64,
}

impl Symmetric3 {
    /// The symmetric tensor with the lower triangle of `m`.
    pub fn from_lower_triangle(m: &Matrix3<f64>) -> Self {
        Self { xx: m.m11, yy: m.m22, zz: m.m33, xy: m.m21, xz: m.m31, yz: m.m32 }
    }

    /// Sum of the diagonal.
    pub fn trace(&self) -> f64 {
        self.xx + self.yy + self.zz
    }

    /// This matrix times `v`.
    #[inline(always)]
    pub fn times(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// R · this · Rᵀ: the same tensor in the target frame of R.
    #[inline(always)]
    pub fn rotated(&self, r: &Matrix3<f64>) -> Self {
        let row1 = self.times(&Vector3::new(r.m11, r.m12, r.m13));
        let row2 = self.times(&Vector3::new(r.m21, r.m22, r.m23));
        let row3 = self.times(&Vector3::new(r.m31, r.m32, r.m33));
        let along = |row: &Vector3<f64>, i: usize| r[(i, 0)] * row.x + r[(i, 1)] * row.y + r[(i, 2)] * row.z;
        Self {
            xx: along(&row1, 0),
            yy: along(&row2, 1),
            zz: along(&row3, 2),
            xy: along(&row1, 1),
            xz: along(&row1, 2),
            yz: along(&row2, 2),
        }
    }

    /// Adds `other`.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        self.xx += other.xx;
        self.yy += other.yy;
        self.zz += other.zz;
        self.xy += other.xy;
        self.xz += other.xz;
        self.yz += other.yz;
    }

    /// Subtracts `scale · v vᵀ`.
    #[inline(always)]
    pub fn subtract_outer(&mut self, scale: f64, v: &Vector3<f64>) {
        let w = v * scale;
        self.xx -= w.x * v.x;
        self.yy -= w.y * v.y;
        self.zz -= w.z * v.z;
        self.xy -= w.x * v.y;
        self.xz -= w.x * v.z;
        self.yz -= w.y * v.z;
    }

    /// The inertia of the body about a new point; the old reference point is at `r` from it. This is the inertia about the old point, with
    /// mass `m` and first moment `h` about the old point: J + m(r² 1 − r rᵀ) + 2(r·h) 1 − r hᵀ − h rᵀ (Steiner 1840).
    #[inline(always)]
    pub fn about_point(&self, r: &Vector3<f64>, m: f64, h: &Vector3<f64>) -> Self {
        let g = h + r * (0.5 * m);
        let d = Vector3::new(r.x * g.x, r.y * g.y, r.z * g.z) * 2.0;
        Self {
            xx: self.xx + d.y + d.z,
            yy: self.yy + d.x + d.z,
            zz: self.zz + d.x + d.y,
            xy: self.xy - r.x * g.y - g.x * r.y,
            xz: self.xz - r.x * g.z - g.x * r.z,
            yz: self.yz - r.y * g.z - g.y * r.z,
        }
    }
}

/// A wrench: moment about the link origin (N·m) and force (N), world axes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wrench {
    pub moment: Vector3<f64>,
    pub force: Vector3<f64>,
}

impl Wrench {
    /// The same wrench with its moment about a new point; the old one is at `r` from it.
    #[inline(always)]
    pub fn about_point(&self, r: &Vector3<f64>) -> Self {
        Self { moment: self.moment + r.cross(&self.force), force: self.force }
    }

    /// Adds `other`.
    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        self.moment += other.moment;
        self.force += other.force;
    }
}

/// Acceleration of a link: angular (rad/s²) and that of its origin (m/s²), world axes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Acceleration {
    pub angular: Vector3<f64>,
    pub linear: Vector3<f64>,
}

/// Articulated inertia about the link origin (Featherstone 2008, §7.1), world axes: the symmetric 6×6 matrix [J H; Hᵀ M] that maps an
/// acceleration (ω̇, a) to the wrench (n, f) that causes it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ArticulatedInertia {
    /// J, kg·m²: the block from ω̇ to the moment.
    pub angular: Symmetric3,
    /// H, kg·m: the block from a to the moment.
    pub cross: Matrix3<f64>,
    /// M, kg: the block from a to the force.
    pub linear: Symmetric3,
}

impl ArticulatedInertia {
    /// Adds a rigid body: inertia `j` about the link origin, mass `m`, first moment `h`; its block H is [h].
    #[inline(always)]
    pub fn add_body(&mut self, j: &Symmetric3, m: f64, h: &Vector3<f64>) {
        self.angular.add(j);
        self.cross.m12 -= h.z;
        self.cross.m13 += h.y;
        self.cross.m21 += h.z;
        self.cross.m23 -= h.x;
        self.cross.m31 -= h.y;
        self.cross.m32 += h.x;
        self.linear.xx += m;
        self.linear.yy += m;
        self.linear.zz += m;
    }

    /// The wrench that causes the acceleration `a`.
    #[inline(always)]
    pub fn times(&self, a: &Acceleration) -> Wrench {
        Wrench {
            moment: self.angular.times(&a.angular) + self.cross * a.linear,
            force: self.cross.tr_mul(&a.angular) + self.linear.times(&a.linear),
        }
    }

    /// The column for rotation about `axis`.
    #[inline(always)]
    pub fn turning_column(&self, axis: &Vector3<f64>) -> Wrench {
        Wrench { moment: self.angular.times(axis), force: self.cross.tr_mul(axis) }
    }

    /// The column for translation along `axis`.
    #[inline(always)]
    pub fn sliding_column(&self, axis: &Vector3<f64>) -> Wrench {
        Wrench { moment: self.cross * axis, force: self.linear.times(axis) }
    }

    /// Subtracts `scale · u uᵀ`, the part of the inertia that a free joint with column `u` does not transmit.
    #[inline(always)]
    pub fn subtract_outer(&mut self, scale: f64, u: &Wrench) {
        self.angular.subtract_outer(scale, &u.moment);
        self.linear.subtract_outer(scale, &u.force);
        self.cross -= (u.moment * scale) * u.force.transpose();
    }

    /// The same inertia about a new point; the old reference point is at `r` from it:
    /// H′ = H + [r]M, J′ = J − H′[r] + [r]Hᵀ, M′ = M, with [r] the cross-product matrix.
    #[inline(always)]
    pub fn about_point(&self, r: &Vector3<f64>) -> Self {
        let m = &self.linear;
        let h = &self.cross;
        let moved = Matrix3::from_columns(&[
            h.column(0) + r.cross(&Vector3::new(m.xx, m.xy, m.xz)),
            h.column(1) + r.cross(&Vector3::new(m.xy, m.yy, m.yz)),
            h.column(2) + r.cross(&Vector3::new(m.xz, m.yz, m.zz)),
        ]);
        // Row i of −H′[r] is r × (row i of H′); column j of [r]Hᵀ is r × (row j of H).
        let left = |i: usize| r.cross(&Vector3::new(moved[(i, 0)], moved[(i, 1)], moved[(i, 2)]));
        let right = |j: usize| r.cross(&Vector3::new(h[(j, 0)], h[(j, 1)], h[(j, 2)]));
        let (l0, l1, l2) = (left(0), left(1), left(2));
        let (r0, r1, r2) = (right(0), right(1), right(2));
        let j = &self.angular;
        Self {
            angular: Symmetric3 {
                xx: j.xx + l0.x + r0.x,
                yy: j.yy + l1.y + r1.y,
                zz: j.zz + l2.z + r2.z,
                xy: j.xy + l1.x + r0.y,
                xz: j.xz + l2.x + r0.z,
                yz: j.yz + l2.y + r1.z,
            },
            cross: moved,
            linear: *m,
        }
    }
}
