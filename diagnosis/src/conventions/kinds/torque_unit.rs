//! `torque_unit`
/// Round factors near `scale` that are no accident.
pub(crate) fn rounded(scale: f64) -> Vec<f64> {
    let mut near = Vec::new();
    if scale >= 1.5 {
        near.push(scale.round());
    }
    if scale < 0.67 && scale > 0.0 {
        near.push(1.0 / (1.0 / scale).round());
    }
    near
}
