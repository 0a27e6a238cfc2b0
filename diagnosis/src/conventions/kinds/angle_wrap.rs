//! `angle_wrap`
/// A jump counts as whole turns within this share of one.
const NEAR: f64 = 0.1;

/// `column` without its jumps by whole turns.
pub(crate) fn unwrapped(column: &[f64], turn: f64) -> Vec<f64> {
    let mut turns = 0.0;
    let mut before = column.first().copied().unwrap_or(0.0);
    let one = |x: &f64| {
        let jump = (x - before) / turn;
        if jump.round() != 0.0 && (jump - jump.round()).abs() < NEAR {
            turns -= jump.round();
        }
        before = *x;
        x + turns * turn
    };
    column.iter().map(one).collect()
}
