//! Parsing of numbers, directions, poses and rotations, for both file formats.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

/// Least excess over the triangle inequality of an inertia tensor for a note; a smaller excess is rounding.
pub(crate) const IMPOSSIBLE: f64 = 1e-2;

/// The note on such a tensor.
pub(crate) const NO_REAL_BODY: &str =
    "no real body has this inertia (triangle inequality); used as it stands";

/// Parses a number; the error is the remedy to print after the value.
pub(crate) fn parse_number(token: &str) -> Result<f64, String> {
    match token.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err("write a finite number".to_owned()),
        Err(_) if token.contains(',') => Err("write a number with a decimal point, not a comma".to_owned()),
        Err(_) => Err("write a number such as 0.25 or 1e-3".to_owned()),
    }
}

/// `N` finite numbers separated by white space.
pub(crate) fn parse_numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let mut values = [0.0; N];
    let mut tokens = text.split_whitespace();
    for value in &mut values {
        let token = tokens.next().ok_or_else(|| count_remedy(N))?;
        *value = parse_number(token)?;
    }
    if tokens.next().is_some() { Err(count_remedy(N)) } else { Ok(values) }
}

fn count_remedy(count: usize) -> String {
    match count {
        1 => "write one number".to_owned(),
        _ => format!("write {count} numbers separated by spaces"),
    }
}

/// The direction of `axis`; an axis that already has length 1 to rounding keeps its digits, so that a written file reads back
/// bit by bit. `None` for a zero axis.
pub(crate) fn direction(axis: [f64; 3]) -> Option<Unit<Vector3<f64>>> {
    let vector = Vector3::from(axis);
    if (vector.norm_squared() - 1.0).abs() < 4.0 * f64::EPSILON {
        return Some(Unit::new_unchecked(vector));
    }
    // Scaling by the largest component first avoids underflow and overflow for tiny and huge axes.
    let scaled = vector / vector.amax();
    let unit = scaled / scaled.norm();
    if unit.iter().all(|x| x.is_finite()) { Some(Unit::new_unchecked(unit)) } else { None }
}

/// A pose from a position (m) and roll, pitch, yaw about fixed x, y, z (rad), as in URDF.
pub(crate) fn pose(xyz: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(xyz[0], xyz[1], xyz[2]), rotation(rpy))
}

/// The rotation of roll, pitch, yaw.
pub(crate) fn rotation(rpy: [f64; 3]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2])
}
