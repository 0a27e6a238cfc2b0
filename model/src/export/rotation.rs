//! Rotations in the conventions of the formats.

use nalgebra::UnitQuaternion;

/// Roll, pitch and yaw about fixed x, y and z, rad: R = R_z(yaw) R_y(pitch) R_x(roll).
///
/// The pitch comes from two elements by the arc tangent, and the roll from the rotation without yaw and pitch, so that the three reproduce
/// the rotation to rounding even if roll and yaw turn about one axis (Shoemake 1994, Graphics Gems IV, III.5).
pub(super) fn roll_pitch_yaw(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let matrix = rotation.to_rotation_matrix();
    let r = matrix.matrix();
    let cosine = r.m11.hypot(r.m21);
    let pitch = (-r.m31).atan2(cosine);
    let yaw = if cosine > f64::EPSILON { r.m21.atan2(r.m11) } else { 0.0 };
    let (sin, cos) = yaw.sin_cos();
    let roll = (sin * r.m13 - cos * r.m23).atan2(cos * r.m22 - sin * r.m12);
    [roll, pitch, yaw]
}

/// w, x, y and z.
pub(super) fn quaternion(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    [rotation.w, rotation.i, rotation.j, rotation.k]
}

#[cfg(test)]
mod tests {
    use super::roll_pitch_yaw;
    use nalgebra::UnitQuaternion;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn angles_give_back_the_rotation_where_roll_and_yaw_are_one() {
        let mut worst = 0.0_f64;
        for off in [0.0, 1e-17, 1e-12, 1e-9, 1e-8, 1e-5, 0.3, 1.5] {
            for (roll, yaw) in [(0.0, 0.0), (1.2, -2.0), (-3.0, 0.4), (FRAC_PI_2, FRAC_PI_2)] {
                for sign in [-1.0, 1.0] {
                    let rotation = UnitQuaternion::from_euler_angles(roll, sign * (FRAC_PI_2 - off), yaw);
                    let [roll, pitch, yaw] = roll_pitch_yaw(&rotation);
                    let back = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                    let error =
                        (back.to_rotation_matrix().matrix() - rotation.to_rotation_matrix().matrix()).amax();
                    worst = worst.max(error);
                }
            }
        }
        assert!(worst < 2e-15, "{worst:e}");
    }
}
