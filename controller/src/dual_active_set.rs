//! Dual active-set solver for a strictly convex programme with few active rows. It starts from the minimiser of the cost alone and adds
//! violated rows one by one.
//!
//! `min ½ xᵀP x + qᵀx  subject to  lᵢ ≤ aᵢᵀx ≤ uᵢ`, where P is positive definite and given by its factor only, and every aᵢ has at most
//! three entries.
//!
//! The method is the dual one of Goldfarb & Idnani (1983), "A numerically stable dual method for solving strictly convex quadratic
//! programs", Mathematical Programming 27. At all times x is the minimiser with the active rows as equations, and their multipliers are ≥
//! 0. Each step adds the most violated row and drops rows whose multiplier would change its sign. Every step raises the cost, so the
//! method terminates. Instead of orthogonal factors, this implementation uses the Cholesky factor of A P⁻¹Aᵀ of the active rows A, since
//! P⁻¹a is one solution with the factor of P. Nothing is allocated after [`DualActiveSet::new`].

/// A row counts as violated if it is exceeded by more than this; in mrad this is a thousandth of a nanoradian.
pub const VIOLATION_TOLERANCE: f64 = 1e-9;
/// A row depends linearly on the active rows if they reduce its curvature below this share.
const DEPENDENT: f64 = 1e-10;
/// Entries of a row.
pub const ENTRIES: usize = 3;

/// A row: `lower ≤ Σ factors · x[places] ≤ upper`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Indices of the variables.
    pub places: [usize; ENTRIES],
    /// Coefficients of the variables; zero for unused entries.
    pub factors: [f64; ENTRIES],
    /// Least value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
}

impl Row {
    /// The value of the row at `x`.
    pub fn of(&self, x: &[f64]) -> f64 {
        self.places.iter().zip(&self.factors).map(|(&place, factor)| factor * x[place]).sum()
    }

    /// Returns the larger violation of the two bounds by `x`, and its side: upper (1) or lower (−1).
    fn violation(&self, x: &[f64]) -> (f64, f64) {
        let value = self.of(x);
        let (above, below) = (value - self.upper, self.lower - value);
        if above >= below { (above, 1.0) } else { (below, -1.0) }
    }
}

/// Reasons why there is no minimiser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActiveSetFault {
    /// No point satisfies all rows.
    Infeasible,
    /// The limit of iterations or of active rows was reached.
    Limit,
    /// A number is not finite.
    NotFinite,
}

/// An active row, kept as an equation: its index, its side (1 upper, −1 lower) and its multiplier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Active {
    /// Index of the row.
    pub row: usize,
    /// 1 if the upper bound is active, −1 if the lower one is.
    pub side: f64,
    /// λ ≥ 0: `P x + q + Σ λ side a = 0`.
    pub multiplier: f64,
}

/// The workspace of the method.
pub struct DualActiveSet {
    variables: usize,
    most_rows: usize,
    most_changes: u32,
    active: Vec<Active>,
    changes: u32,
    /// P⁻¹ (side a) of each active row, one after the other.
    columns: Vec<f64>,
    /// Lower Cholesky factor of A P⁻¹Aᵀ, `most_rows` numbers a row.
    factor: Vec<f64>,
    /// P⁻¹ (side a) of the row that is being added, and its part independent of the active rows.
    column: Vec<f64>,
    step: Vec<f64>,
    /// Decrease of the multipliers with the step.
    fall: Vec<f64>,
}

impl DualActiveSet {
    /// Creates a workspace for `variables` variables, at most `most_rows` active rows and `most_changes` changes of them.
    pub fn new(variables: usize, most_rows: usize, most_changes: u32) -> DualActiveSet {
        DualActiveSet {
            variables,
            most_rows,
            most_changes,
            active: Vec::with_capacity(most_rows),
            changes: 0,
            columns: vec![0.0; most_rows * variables],
            factor: vec![0.0; most_rows * most_rows],
            column: vec![0.0; variables],
            step: vec![0.0; variables],
            fall: vec![0.0; most_rows],
        }
    }

    /// Clears the last minimiser.
    pub fn clear(&mut self) {
        self.active.clear();
        self.changes = 0;
    }

    /// The active rows at the last minimiser.
    pub fn active(&self) -> &[Active] {
        &self.active
    }

    /// Number of rows added or dropped on the way to it; 0 if the minimiser of the cost alone satisfies all rows.
    pub fn changes(&self) -> u32 {
        self.changes
    }

    /// Moves `x` from the minimiser of the cost alone to the minimiser that satisfies `rows`; `solve` replaces v by P⁻¹v.
    ///
    /// # Errors
    /// See [`ActiveSetFault`]; `x` is then invalid.
    pub fn minimise(
        &mut self,
        rows: &[Row],
        mut solve: impl FnMut(&mut [f64]),
        x: &mut [f64],
    ) -> Result<(), ActiveSetFault> {
        self.clear();
        while let Some((row, side)) = self.most_violated(rows, x)? {
            self.column.fill(0.0);
            for (&place, factor) in rows[row].places.iter().zip(&rows[row].factors) {
                self.column[place] += side * factor;
            }
            solve(&mut self.column);
            let mut entering = Active { row, side, multiplier: 0.0 };
            loop {
                if self.changes == self.most_changes {
                    return Err(ActiveSetFault::Limit);
                }
                self.changes += 1;
                if self.step_towards(rows, &mut entering, x)? {
                    break;
                }
            }
        }
        Ok(())
    }

    /// The row that `x` violates most, and its side.
    fn most_violated(&self, rows: &[Row], x: &[f64]) -> Result<Option<(usize, f64)>, ActiveSetFault> {
        let mut most = (VIOLATION_TOLERANCE, None);
        for (index, row) in rows.iter().enumerate() {
            let (by, side) = row.violation(x);
            if by.is_nan() {
                return Err(ActiveSetFault::NotFinite);
            }
            if by > most.0 && self.active.iter().all(|active| active.row != index) {
                most = (by, Some((index, side)));
            }
        }
        Ok(most.1)
    }

    /// Takes one step towards satisfying the row of `entering`. Returns true if the row is active now; otherwise the step has dropped a
    /// row.
    fn step_towards(
        &mut self,
        rows: &[Row],
        entering: &mut Active,
        x: &mut [f64],
    ) -> Result<bool, ActiveSetFault> {
        let row = &rows[entering.row];
        let alone = entering.side * row.of(&self.column);
        let beside = self.project(rows, entering.side, row);
        let bound = if entering.side > 0.0 { row.upper } else { row.lower };
        let by = entering.side * (row.of(x) - bound);
        let full = if beside > DEPENDENT * alone { by.max(0.0) / beside } else { f64::INFINITY };
        let (leaving, partial) = self.first_to_leave();
        let length = full.min(partial);
        if length.is_nan() {
            return Err(ActiveSetFault::NotFinite);
        }
        if length.is_infinite() {
            return Err(ActiveSetFault::Infeasible);
        }
        if full.is_finite() {
            x.iter_mut().zip(&self.step).for_each(|(x, step)| *x -= length * step);
        }
        for (active, fall) in self.active.iter_mut().zip(&self.fall) {
            active.multiplier -= length * fall;
        }
        entering.multiplier += length;
        if full <= partial {
            self.add(*entering)?;
            return Ok(true);
        }
        self.drop_row(rows, leaving);
        Ok(false)
    }

    /// Writes the directions of the step and of the multipliers. Returns the curvature aᵀ step of the row on its `side`.
    fn project(&mut self, rows: &[Row], side: f64, row: &Row) -> f64 {
        let m = self.active.len();
        let mut beside = side * row.of(&self.column);
        for i in 0..m {
            let one = &self.active[i];
            let mut sum = one.side * rows[one.row].of(&self.column);
            for j in 0..i {
                sum -= self.factor[i * self.most_rows + j] * self.fall[j];
            }
            self.fall[i] = sum / self.factor[i * self.most_rows + i];
            beside -= self.fall[i] * self.fall[i];
        }
        // The next row of the factor, in case the row is added.
        if m < self.most_rows {
            self.factor[m * self.most_rows..][..m].copy_from_slice(&self.fall[..m]);
            self.factor[m * self.most_rows + m] = beside.max(0.0).sqrt();
        }
        for i in (0..m).rev() {
            let mut sum = self.fall[i];
            for j in i + 1..m {
                sum -= self.factor[j * self.most_rows + i] * self.fall[j];
            }
            self.fall[i] = sum / self.factor[i * self.most_rows + i];
        }
        self.step.copy_from_slice(&self.column);
        for (fall, column) in self.fall[..m].iter().zip(self.columns.chunks_exact(self.variables)) {
            self.step.iter_mut().zip(column).for_each(|(step, column)| *step -= fall * column);
        }
        beside
    }

    /// The active row whose multiplier reaches zero first, and the step length at which it does.
    fn first_to_leave(&self) -> (usize, f64) {
        let lengths = self.active.iter().zip(&self.fall).enumerate().filter(|(_, (_, fall))| **fall > 0.0);
        let lengths = lengths.map(|(index, (active, fall))| (index, active.multiplier.max(0.0) / fall));
        lengths.fold((0, f64::INFINITY), |first, one| if one.1 < first.1 { one } else { first })
    }

    fn add(&mut self, entering: Active) -> Result<(), ActiveSetFault> {
        let m = self.active.len();
        if m == self.most_rows {
            return Err(ActiveSetFault::Limit);
        }
        self.columns[m * self.variables..][..self.variables].copy_from_slice(&self.column);
        self.active.push(entering);
        Ok(())
    }

    /// Drops the row at `index` of the active ones, and refactorises the part after it.
    fn drop_row(&mut self, rows: &[Row], index: usize) {
        self.active.remove(index);
        let (n, m) = (self.variables, self.active.len());
        self.columns.copy_within((index + 1) * n..(m + 1) * n, index * n);
        for i in index..m {
            let column = &self.columns[i * n..][..n];
            for j in 0..=i {
                let one = &self.active[j];
                let mut sum = one.side * rows[one.row].of(column);
                for k in 0..j {
                    sum -= self.factor[i * self.most_rows + k] * self.factor[j * self.most_rows + k];
                }
                self.factor[i * self.most_rows + j] =
                    if j < i { sum / self.factor[j * self.most_rows + j] } else { sum.max(0.0).sqrt() };
            }
        }
    }
}
