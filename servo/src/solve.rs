//! One step with set-valued friction: the speeds at which each joint slides under its friction or rests within it.

/// Sweeps until the solution stands to rounding, for arms whose joints are strongly coupled; a handful is usual.
const MOST_SWEEPS: usize = 200;

/// Solves A w + f = b, where f is dry friction: fᵢ = Fᵢ sign(wᵢ) for wᵢ ≠ 0 and |fᵢ| ≤ Fᵢ for wᵢ = 0, and where wᵢ stays between
/// `least` and `most` (stops). `w` holds a guess and receives the solution. A is symmetric and positive definite, row by row in `a`.
///
/// The solution is the minimum of ½ wᵀA w − bᵀw + Σ Fᵢ|wᵢ| inside the bounds, which is unique; projected Gauss–Seidel descends to it
/// one coordinate after the other, each exactly.
/// Source: Moreau 1988 (unilateral contact and dry friction in finite freedom dynamics); Tseng 2001, J. Optim. Theory Appl. 109:475 (convergence).
#[inline]
pub fn solve(a: &[f64], b: &[f64], friction: &[f64], bounds: &[[f64; 2]], w: &mut [f64]) {
    let n = w.len();
    for _ in 0..MOST_SWEEPS {
        let (mut change, mut size) = (0.0_f64, 0.0_f64);
        for i in 0..n {
            let row = &a[i * n..(i + 1) * n];
            let coupled: f64 = row.iter().zip(w.iter()).map(|(a, w)| a * w).sum::<f64>() - row[i] * w[i];
            let free = b[i] - coupled;
            let beyond = free - free.clamp(-friction[i], friction[i]);
            let speed = (beyond / row[i]).max(bounds[i][0]).min(bounds[i][1]);
            change = change.max((speed - w[i]).abs());
            size = size.max(speed.abs());
            w[i] = speed;
        }
        if change <= 1e-11 * size {
            return;
        }
    }
}
