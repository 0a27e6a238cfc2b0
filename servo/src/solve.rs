//! One step with set-valued friction: the speeds at which each joint slides under its friction or rests within it.

/// Most sweeps until the solution is accurate to rounding, for arms with strongly coupled joints; a handful is usual.
const MOST_SWEEPS: usize = 200;
/// Sweeps between two attempts to solve for all sliding joints at once.
const SWEEPS: usize = 4;

/// Solves A w + f = b with the dry friction f: fᵢ = Fᵢ sign(wᵢ) for wᵢ ≠ 0 and |fᵢ| ≤ Fᵢ for wᵢ = 0, where wᵢ stays inside bounds (stops).
/// A is symmetric and positive definite.
///
/// The solution is the unique minimum of ½ wᵀA w − bᵀw + Σ Fᵢ|wᵢ| inside the bounds. From a guess, the solver computes all sliding joints
/// together and holds the others. If the result contradicts no friction and no stop, it is the solution. Otherwise projected Gauss–Seidel
/// descends towards the minimum, one coordinate after the other, each exactly, and gives the next guess.
/// Source: Moreau 1988 (unilateral contact and dry friction in finite freedom dynamics); Tseng 2001, J. Optim. Theory Appl. 109:475 (convergence).
#[derive(Clone, Debug)]
pub struct Sliding {
    /// A, row by row.
    matrix: Vec<f64>,
    /// Cholesky's factor of the rows and columns of A whose joints slide, at their original indices.
    factor: Vec<f64>,
    /// Joints that the factor includes.
    free: Vec<bool>,
    is_factored: bool,
    solution: Vec<f64>,
}

impl Sliding {
    /// For `n` joints.
    pub fn new(n: usize) -> Sliding {
        Sliding {
            matrix: vec![0.0; n * n],
            factor: vec![0.0; n * n],
            free: vec![false; n],
            is_factored: false,
            solution: vec![0.0; n],
        }
    }

    /// A row by row, for writing; the solver keeps it until the next call.
    #[inline]
    pub fn matrix_mut(&mut self) -> &mut [f64] {
        self.is_factored = false;
        &mut self.matrix
    }

    /// Solves for `w`; on entry `w` holds a guess. Each slice has one number per joint. Inlined, so that the compiler knows the number of
    /// joints if the caller does.
    ///
    /// # Panics
    /// If the sizes do not fit.
    #[inline(always)]
    pub fn solve(&mut self, b: &[f64], friction: &[f64], bounds: &[[f64; 2]], w: &mut [f64]) {
        for _ in 0..MOST_SWEEPS / SWEEPS {
            if self.slides_as_guessed(b, friction, bounds, w) {
                return;
            }
            for _ in 0..SWEEPS {
                if self.sweep(b, friction, bounds, w) {
                    return;
                }
            }
        }
    }

    /// One sweep of Gauss–Seidel through `w`; returns true if it changed nothing but rounding.
    fn sweep(&self, b: &[f64], friction: &[f64], bounds: &[[f64; 2]], w: &mut [f64]) -> bool {
        let n = w.len();
        let (mut change, mut size) = (0.0_f64, 0.0_f64);
        for i in 0..n {
            let row = &self.matrix[i * n..(i + 1) * n];
            let coupled: f64 = row.iter().zip(w.iter()).map(|(a, w)| a * w).sum::<f64>() - row[i] * w[i];
            let free = b[i] - coupled;
            // A diverged simulation has non-finite numbers here; unlike `clamp`, `max` and `min` do not panic on NaN bounds.
            let beyond = free - free.max(-friction[i]).min(friction[i]);
            let speed = (beyond / row[i]).max(bounds[i][0]).min(bounds[i][1]);
            change = change.max((speed - w[i]).abs());
            size = size.max(speed.abs());
            w[i] = speed;
        }
        change <= 1e-11 * size
    }

    /// Solves for the joints that slide in the guess `w` and holds the others. Returns true if each sliding joint slides as guessed, inside
    /// its bounds, and friction holds each resting joint; `w` is then the solution.
    #[inline(always)]
    fn slides_as_guessed(&mut self, b: &[f64], friction: &[f64], bounds: &[[f64; 2]], w: &mut [f64]) -> bool {
        let n = w.len();
        let (b, friction, bounds) = (&b[..n], &friction[..n], &bounds[..n]);
        let mut are_all_free = true;
        for (i, free) in self.free[..n].iter_mut().enumerate() {
            let is_free = w[i] != 0.0 && bounds[i][0] < w[i] && w[i] < bounds[i][1];
            self.is_factored &= *free == is_free;
            are_all_free &= is_free;
            *free = is_free;
        }
        if !self.is_factored {
            self.factorise(n);
        }
        if are_all_free {
            self.substitute_all(b, friction, w);
        } else {
            self.substitute(b, friction, w);
        }
        let (free, solution, matrix) = (&self.free[..n], &self.solution[..n], &self.matrix[..n * n]);
        for i in 0..n {
            let x = solution[i];
            let holds = if free[i] {
                x * w[i] > 0.0 && bounds[i][0] <= x && x <= bounds[i][1]
            } else {
                let row = &matrix[i * n..(i + 1) * n];
                let coupled: f64 = row.iter().zip(solution).map(|(a, x)| a * x).sum();
                x == 0.0 && (b[i] - coupled).abs() <= friction[i]
            };
            if !holds {
                return false;
            }
        }
        w.copy_from_slice(solution);
        true
    }

    /// Cholesky's factor of the rows and columns of the joints that slide.
    fn factorise(&mut self, n: usize) {
        for i in (0..n).filter(|&i| self.free[i]) {
            for j in (0..=i).filter(|&j| self.free[j]) {
                let mut sum = self.matrix[i * n + j];
                for k in (0..j).filter(|&k| self.free[k]) {
                    sum -= self.factor[i * n + k] * self.factor[j * n + k];
                }
                self.factor[i * n + j] =
                    if i == j { sum.sqrt().recip() } else { sum * self.factor[j * n + j] };
            }
        }
        self.is_factored = true;
    }

    /// The speeds from the factor if all joints slide as in `w`: the same as [`Sliding::substitute`] without the case distinction.
    #[inline(always)]
    fn substitute_all(&mut self, b: &[f64], friction: &[f64], w: &[f64]) {
        let n = w.len();
        let (factor, solution) = (&self.factor[..n * n], &mut self.solution[..n]);
        for i in 0..n {
            let (row, before) = (&factor[i * n..i * n + i], &solution[..i]);
            let known: f64 = row.iter().zip(before).map(|(factor, x)| factor * x).sum();
            solution[i] = (b[i] - friction[i].copysign(w[i]) - known) * factor[i * n + i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| factor[k * n + i] * solution[k]).sum();
            solution[i] = (solution[i] - known) * factor[i * n + i];
        }
    }

    /// The speeds from the factor; held joints keep their values in `w`. The factor's diagonal holds reciprocals.
    #[inline(always)]
    fn substitute(&mut self, b: &[f64], friction: &[f64], w: &[f64]) {
        let n = w.len();
        let (free, factor, matrix) = (&self.free[..n], &self.factor[..n * n], &self.matrix[..n * n]);
        let solution = &mut self.solution[..n];
        for i in (0..n).filter(|&i| !free[i]) {
            solution[i] = w[i];
        }
        for i in (0..n).filter(|&i| free[i]) {
            let (held, above) = (&matrix[i * n..(i + 1) * n], &factor[i * n..(i + 1) * n]);
            let known = |j: usize| {
                let of_row = if free[j] { if j < i { above[j] } else { 0.0 } } else { held[j] };
                of_row * solution[j]
            };
            let right = b[i] - friction[i].copysign(w[i]) - (0..n).map(known).sum::<f64>();
            solution[i] = right * factor[i * n + i];
        }
        for i in (0..n).rev().filter(|&i| free[i]) {
            let below = (i + 1..n).filter(|&k| free[k]);
            let known: f64 = below.map(|k| factor[k * n + i] * solution[k]).sum();
            solution[i] = (solution[i] - known) * factor[i * n + i];
        }
    }
}
