//! One step with set-valued friction: the speeds at which each joint slides under its friction or rests within it.

/// Sweeps until the solution stands to rounding, for arms whose joints are strongly coupled; a handful is usual.
const MOST_SWEEPS: usize = 200;
/// Sweeps between two tries to solve for all sliding joints at once.
const SWEEPS: usize = 4;

/// A w + f = b, where f is dry friction: fᵢ = Fᵢ sign(wᵢ) for wᵢ ≠ 0 and |fᵢ| ≤ Fᵢ for wᵢ = 0, and where wᵢ stays inside bounds (stops). A is symmetric and
/// positive definite.
///
/// The solution is the minimum of ½ wᵀA w − bᵀw + Σ Fᵢ|wᵢ| inside the bounds, which is unique. The joints that slide in a guess are solved for together, the others held
/// where they are: where that contradicts no friction and no stop, it is the solution. Else projected Gauss–Seidel descends to it, one coordinate after the
/// other, each exactly, and gives the next guess.
/// Source: Moreau 1988 (unilateral contact and dry friction in finite freedom dynamics); Tseng 2001, J. Optim. Theory Appl. 109:475 (convergence).
#[derive(Clone, Debug)]
pub struct Sliding {
    /// A, row by row.
    matrix: Vec<f64>,
    /// Cholesky's factor of the rows and columns of A whose joints slide, in their places.
    factor: Vec<f64>,
    /// Joints that the factor is of.
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

    /// A row by row, to be written; it stays as it is until then.
    #[inline]
    pub fn matrix_mut(&mut self) -> &mut [f64] {
        self.is_factored = false;
        &mut self.matrix
    }

    /// Solves for `w`, which holds a guess. All have one number a joint. Inlined, so that loops know the number of joints of a caller that does.
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

    /// One sweep of Gauss–Seidel through `w`; whether it changed nothing but rounding.
    fn sweep(&self, b: &[f64], friction: &[f64], bounds: &[[f64; 2]], w: &mut [f64]) -> bool {
        let n = w.len();
        let (mut change, mut size) = (0.0_f64, 0.0_f64);
        for i in 0..n {
            let row = &self.matrix[i * n..(i + 1) * n];
            let coupled: f64 = row.iter().zip(w.iter()).map(|(a, w)| a * w).sum::<f64>() - row[i] * w[i];
            let free = b[i] - coupled;
            // Speeds that have left all numbers come out as such, and end no process.
            let beyond = free - free.max(-friction[i]).min(friction[i]);
            let speed = (beyond / row[i]).max(bounds[i][0]).min(bounds[i][1]);
            change = change.max((speed - w[i]).abs());
            size = size.max(speed.abs());
            w[i] = speed;
        }
        change <= 1e-11 * size
    }

    /// Solves for the joints that slide in the guess `w`, the others held where they are; whether each slides as guessed, inside its bounds, and each that rests is
    /// held by its friction. Then `w` is the solution.
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

    /// The speeds with the factor where all joints slide as in `w`: the same as [`Sliding::substitute`], without looking who does.
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

    /// The speeds with the factor: those of joints that are held as they are in `w`. The factor's diagonal holds reciprocals.
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
