//! Shared code of the tests of this crate: random arms, tolerances with printed margins.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits};
use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};

/// A small deterministic generator (SplitMix64, Steele, Lea & Flood 2014), so that every run has the same arms.
pub struct Random(pub u64);

impl Random {
    /// Uniform in [-1, 1).
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// `n` values in [-scale, scale).
    pub fn values(&mut self, n: usize, scale: f64) -> Vec<f64> {
        (0..n).map(|_| scale * self.next()).collect()
    }

    /// A vector with components in [-1, 1).
    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next())
    }

    /// A rotation about a random axis by a random angle.
    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Unit::new_normalize(self.vector()), 3.0 * self.next())
    }

    /// A possible body: three point pairs on random axes.
    pub fn inertia(&mut self) -> Inertia {
        let mass = 3.0 + 2.9 * self.next();
        let r = self.rotation().to_rotation_matrix();
        let gyration = Vector3::from_fn(|_, _| 0.02 + 0.015 * self.next());
        let sum = gyration.sum();
        let about_com =
            r.matrix() * Matrix3::from_diagonal(&gyration.map(|g| (sum - g) * mass)) * r.matrix().transpose();
        Inertia { mass, com: self.vector() * 0.3, about_com: (about_com + about_com.transpose()) * 0.5 }
    }

    /// A coordinate axis in either sense, as for most joints of real arms, or any axis.
    pub fn axis(&mut self) -> Unit<Vector3<f64>> {
        let any = self.vector();
        let coordinate = any.map(|x| if x.abs() == any.amax() { x.signum() } else { 0.0 });
        Unit::new_normalize(if self.next() < 0.0 { coordinate } else { any })
    }

    /// A joint with a random axis, placement and link; some placements have no rotation.
    pub fn joint(&mut self, number: usize) -> Joint {
        let turn = if self.next() < -0.4 { UnitQuaternion::identity() } else { self.rotation() };
        Joint {
            name: format!("joint_{number}"),
            kind: if self.next() < -0.4 { JointKind::Prismatic } else { JointKind::Revolute },
            axis: self.axis(),
            placement: Isometry3::from_parts(Translation3::from(self.vector() * 0.5), turn),
            limits: Limits::NONE,
            friction: JointFriction::default(),
            rotor_inertia: if self.next() < 0.0 { 0.0 } else { 0.1 + 0.1 * self.next() },
            inertia: self.inertia(),
        }
    }

    /// A random arm with `dof` joints.
    pub fn arm(&mut self, dof: usize) -> Arm {
        let joints = (1..=dof).map(|number| self.joint(number)).collect();
        let tool = Isometry3::from_parts(Translation3::from(self.vector() * 0.2), self.rotation());
        Arm::new("random", joints, tool, Vector3::new(0.3, -0.2, -9.81)).expect("a random arm is an arm")
    }
}

/// Largest difference of two lists.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |worst, d| if d.is_nan() { f64::NAN } else { d.max(worst) })
}

/// Largest magnitude in a list.
pub fn size(a: &[f64]) -> f64 {
    a.iter().fold(0.0_f64, |worst, x| worst.max(x.abs()))
}

/// Asserts `error <= tolerance` and prints the margin. `FREEPLAY_TOLERANCE_SCALE` scales every tolerance.
pub fn close(what: &str, error: f64, tolerance: f64) {
    let scale = std::env::var("FREEPLAY_TOLERANCE_SCALE").ok().and_then(|s| s.parse().ok()).unwrap_or(1.0);
    println!("{what}: error {error:.3e}, tolerance {tolerance:.1e}, margin ×{:.1}", tolerance / error);
    assert!(error <= tolerance * scale, "{what}: error {error:e} exceeds {tolerance:e}");
}
