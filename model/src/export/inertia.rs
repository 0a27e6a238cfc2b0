//! The inertia of a body in MJCF: principal moments of a possible body.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use freeplay_arm::Inertia;

/// Least moment of a moving body, kg·m²: ten times MuJoCo's threshold for zero.
pub(super) const LEAST_MOMENT: f64 = 1e-14;

/// Least mass of a moving body, kg: with [`LEAST_MOMENT`] a body of 0.1 m.
pub(super) const LEAST_MASS: f64 = 1e-12;

/// Permitted relative change of a moment by rounding, against the largest moment.
const ROUNDING: f64 = 1e-9;

/// Mass, principal moments and their axes.
pub(super) struct Principal {
    /// kg.
    pub mass: f64,
    /// kg·m², about the centre of mass.
    pub moments: Vector3<f64>,
    /// The principal axes in the link's frame.
    pub axes: UnitQuaternion<f64>,
    /// Greatest change of a moment against the model's, kg·m², if it exceeds rounding.
    pub changed: Option<f64>,
}

impl Principal {
    /// The moments of `inertia`, or the nearest positive ones that satisfy A + B ≥ C.
    pub fn of(inertia: &Inertia) -> Principal {
        let tensor = inertia.about_com;
        let is_diagonal = tensor.iter().enumerate().all(|(i, x)| i % 4 == 0 || *x == 0.0);
        let (values, axes) = if is_diagonal {
            (tensor.diagonal(), UnitQuaternion::identity())
        } else {
            let eigen = tensor.symmetric_eigen();
            let axes = right_handed(eigen.eigenvectors);
            (eigen.eigenvalues, UnitQuaternion::from_rotation_matrix(&axes))
        };
        let moments = possible(values);
        let changed = (moments - values).amax();
        let changed = (changed > ROUNDING * values.amax().max(LEAST_MOMENT)).then_some(changed);
        Principal {
            mass: inertia.mass.max(LEAST_MASS),
            moments,
            axes,
            changed: changed.filter(|x| *x > LEAST_MOMENT),
        }
    }

    /// Names the axes in another order. If the principal axes and the centre of a body are those of its frame, MuJoCo assumes a diagonal
    /// mass matrix, even if two of its slides are parallel, as those of motor and gear are. Any order but the frame's own prevents this.
    pub fn turn(&mut self) {
        let order =
            Rotation3::from_matrix_unchecked(Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0));
        self.axes *= UnitQuaternion::from_rotation_matrix(&order);
        let [x, y, z] = self.moments.into();
        self.moments = Vector3::new(y, z, x);
    }
}

/// Axes with the third as the cross product of the others.
fn right_handed(mut axes: Matrix3<f64>) -> Rotation3<f64> {
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    Rotation3::from_matrix_unchecked(axes)
}

/// The nearest positive moments that satisfy A + B ≥ C.
fn possible(values: Vector3<f64>) -> Vector3<f64> {
    let mut moments = values.map(|moment| moment.max(LEAST_MOMENT));
    let excess = 2.0 * moments.max() - moments.sum();
    if excess > 0.0 {
        let largest = moments.imax();
        // The orthogonal projection on A + B = C, by a rounding error inside of it.
        let share = excess / 3.0 + 1e-15 * moments.max();
        moments.add_scalar_mut(share);
        moments[largest] -= 2.0 * share;
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::Principal;
    use freeplay_arm::Inertia;
    use nalgebra::{Matrix3, Vector3};

    fn body(tensor: Matrix3<f64>) -> Inertia {
        Inertia { mass: 2.0, com: Vector3::zeros(), about_com: tensor }
    }

    #[test]
    fn a_tensor_comes_back_from_its_principal_moments() {
        let tensor = Matrix3::new(0.3, 0.02, -0.01, 0.02, 0.25, 0.03, -0.01, 0.03, 0.4);
        let principal = Principal::of(&body(tensor));
        let axes = principal.axes.to_rotation_matrix();
        let back = axes.matrix() * Matrix3::from_diagonal(&principal.moments) * axes.matrix().transpose();
        assert!((back - tensor).amax() < 1e-15);
        assert!(principal.changed.is_none());
    }

    #[test]
    fn a_turned_body_is_the_same_with_other_axes() {
        let mut principal = Principal::of(&body(Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.25))));
        principal.turn();
        let axes = principal.axes.to_rotation_matrix();
        let back = axes.matrix() * Matrix3::from_diagonal(&principal.moments) * axes.matrix().transpose();
        assert!((back - Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.25))).amax() < 1e-15);
        assert!(principal.axes.angle() > 1.0);
    }

    #[test]
    fn points_plates_and_impossible_bodies_become_the_nearest_that_exist() {
        let point = Principal::of(&body(Matrix3::zeros()));
        assert!(point.moments.min() > 1e-15 && point.changed.is_none());
        let plate = Principal::of(&body(Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.3 + 1e-16))));
        assert!(plate.moments.x + plate.moments.y >= plate.moments.z && plate.changed.is_none());
        let broken = Principal::of(&body(Matrix3::from_diagonal(&Vector3::new(0.1, 0.1, 0.5))));
        assert!((broken.changed.expect("told") - 0.1).abs() < 1e-12);
        assert!((broken.moments - Vector3::new(0.2, 0.2, 0.4)).amax() < 1e-12);
    }
}
