//! The best windows of a recording for an event with a start and an end: the search tries every pair of rows.
//!
//! A push from row b to row e is a step at b minus the same step at e. With W the whitening filter, y the residual and s a step, a push of the best
//! size explains ½ (r_b − r_e)² / (G_bb − 2 G_be + G_ee) of the log-likelihood, r_b = s_bᵀWᵀWy and G_be = s_bᵀWᵀWs_e: the matched filter (Turin 1960,
//! IRE Trans. Inf. Theory 6:311) for all windows at once.

use crate::data::whitening::DriftModel;
use crate::sorting::sort_falling;

/// Share of a step below which the whitened step has decayed: its square, a millionth, adds nothing to the evidence.
const OVER: f64 = 1e-3;

/// The response of a low-pass to a step, by row around the step.
#[derive(Clone, Debug)]
pub(crate) struct Step(Vec<f64>);

impl Step {
    /// The step with the response `seen`: as many rows before the step as after it, with the step between them.
    pub fn new(seen: Vec<f64>) -> Self {
        Self(seen)
    }

    /// Rows on either side of the step in which the response is neither zero nor one.
    fn reach(&self) -> usize {
        self.0.len() / 2
    }

    /// The response at `row` to a step at `at`.
    fn value(&self, row: usize, at: usize) -> f64 {
        match (row + self.reach()).checked_sub(at) {
            None => 0.0,
            Some(place) => self.0.get(place).copied().unwrap_or(1.0),
        }
    }
}

/// One torque, with the rows that its drift model uses.
pub(crate) struct Torque {
    /// The numbers of these rows.
    rows: Vec<usize>,
    drift: DriftModel,
    step: Step,
    /// The rows at which an event may start or end.
    edges: Vec<usize>,
    /// r_b.
    right: Vec<f64>,
    /// G_be of the edges b up to each edge e: the first near edge, the values from there on, and the common value of all edges before it.
    cross: Vec<(usize, Vec<f64>, f64)>,
}

impl Torque {
    /// The torque with the drift model `drift` and the `residual`; a `step` has this response, and events may start or end at these
    /// `edges`.
    pub fn new(drift: &DriftModel, residual: &[f64], step: &Step, edges: &[usize]) -> Self {
        let (rows, drift) = drift.condensed();
        let mut torque = Self {
            rows,
            drift,
            step: step.clone(),
            edges: edges.to_vec(),
            right: Vec::new(),
            cross: Vec::new(),
        };
        let steps = torque.drift.kalman_steps();
        torque.cross = (0..edges.len()).map(|edge| torque.cross(&steps, edge)).collect();
        torque.set(residual);
        torque
    }

    /// Number of rows that the drift model uses.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// Sets the `residual` of the torque.
    pub fn set(&mut self, residual: &[f64]) {
        let residual: Vec<f64> = self.rows.iter().map(|row| residual[*row]).collect();
        let mut sums = self.drift.transposed(&self.drift.rows(&residual));
        let mut sum = 0.0;
        for x in sums.iter_mut().rev() {
            sum += *x;
            *x = sum;
        }
        self.right = self.edges.iter().map(|&edge| self.along(edge, 0, &sums)).collect();
    }

    /// The product of a step at the row `edge` with rows. `sums` are the sums of these rows from each row to the end, beginning with the row number
    /// `begin`.
    fn along(&self, edge: usize, begin: usize, sums: &[f64]) -> f64 {
        let sum = |at: usize| sums.get(at.saturating_sub(begin)).copied().unwrap_or(0.0);
        let first = self.rows.partition_point(|&row| row + self.step.reach() < edge);
        let mut along = 0.0;
        let mut at = first;
        while let Some(&row) = self.rows.get(at).filter(|row| **row <= edge + self.step.reach()) {
            along += self.step.value(row, edge) * (sum(at) - sum(at + 1));
            at += 1;
        }
        along + sum(at)
    }

    /// The products of a step at the edge number `edge` with steps at the edges up to it.
    fn cross(&self, steps: &[(f64, f64)], edge: usize) -> (usize, Vec<f64>, f64) {
        let at = self.edges[edge];
        let reach = self.step.reach();
        let first = self.rows.partition_point(|&row| row + reach < at);
        let last = self.rows.partition_point(|&row| row <= at + reach);
        let value = |row: usize| self.step.value(self.rows[row], at);
        let (begin, sums) = self.drift.normal_product_of_step(steps, [first, last], value, OVER);
        let far = sums.first().copied().unwrap_or(0.0);
        let near = self.edges[..=edge]
            .partition_point(|&b| self.rows.get(begin).is_some_and(|&row| b + reach < row));
        let crosses = (near..=edge).map(|b| self.along(self.edges[b], begin, &sums)).collect();
        (near, crosses, far)
    }

    /// G of the edges number `begin` and `end`, in this order.
    fn product(&self, begin: usize, end: usize) -> f64 {
        let (near, crosses, far) = &self.cross[end];
        begin.checked_sub(*near).map_or(*far, |at| crosses[at])
    }

    /// Log-likelihood that a push between the edges number `begin` and `end` explains.
    fn explained(&self, begin: usize, end: usize) -> f64 {
        let own = self.product(begin, begin) + self.product(end, end);
        let square = own - 2.0 * self.product(begin, end);
        let variance = self.drift.deviation().powi(2);
        let is_seen = square > OVER * own && variance > 0.0;
        if is_seen { 0.5 * (self.right[begin] - self.right[end]).powi(2) / square / variance } else { 0.0 }
    }
}

/// The `most` best windows, first and last row, for an event in all `torques` with its own size in each. No window overlaps a better one, and none is
/// longer than half of the rows.
pub(crate) fn windows(torques: &[&Torque], most: usize) -> Vec<[usize; 2]> {
    let Some(edges) = torques.first().map(|torque| &torque.edges) else { return Vec::new() };
    let longest = edges.len() / 2;
    let mut best: Vec<(f64, [usize; 2])> = Vec::new();
    for end in 1..edges.len() {
        let said = |begin: usize| torques.iter().map(|torque| torque.explained(begin, end)).sum::<f64>();
        let begins =
            (end.saturating_sub(longest)..end).map(|begin| (said(begin), [edges[begin], edges[end]]));
        best.extend(begins.max_by(|a, b| a.0.total_cmp(&b.0)));
    }
    without_overlap(best, most)
}

/// The `most` windows that explain most, none of which overlaps a better one.
fn without_overlap(mut windows: Vec<(f64, [usize; 2])>, most: usize) -> Vec<[usize; 2]> {
    sort_falling(&mut windows, |(gain, _)| *gain);
    let mut best: Vec<[usize; 2]> = Vec::new();
    for (_, [begin, end]) in windows {
        if best.len() == most {
            break;
        }
        if best.iter().all(|[from, to]| end <= *from || *to <= begin) {
            best.push([begin, end]);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Step, Torque, windows};
    use crate::data::whitening::DriftModel;
    use crate::random::normals;

    /// The explained log-likelihood is that of least squares on white rows, and the search finds the window of a push to the row.
    #[test]
    fn the_window_of_a_push_is_found() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let sizes = (0..400).map(|row| 1.0 + 0.001 * f64::from(row)).collect();
        let used = (0..400).map(|row| row % 50 > 8).collect();
        let one = DriftModel::with(vec![0.97; 400], sizes, used, 25.0, 0.1);
        let step = Step::new(vec![0.0, 0.1, 0.5, 0.9, 1.0]);
        let column = |at: usize| -> Vec<f64> { (0..400).map(|row| step.value(row, at)).collect() };
        let push = |begin: usize, end: usize| -> Vec<f64> {
            column(begin).iter().zip(column(end)).map(|(begin, end)| begin - end).collect()
        };
        let mut residual = normals(&mut rng, 400, 0.1);
        residual.iter_mut().zip(push(215, 236)).for_each(|(x, push)| *x += push);
        let edges: Vec<usize> = (0..400).collect();
        let torque = Torque::new(&one, &residual, &step, &edges);
        for [begin, end] in [[215, 236], [20, 380], [60, 61]] {
            let (column, rows) = (one.rows(&push(begin, end)), one.rows(&residual));
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let exact = 0.5 * dot(&column, &rows).powi(2) / dot(&column, &column) / 0.01;
            let said = torque.explained(begin, end);
            println!("{begin} to {end}: {said:.4}, least squares {exact:.4}");
            assert!((said - exact).abs() < 1e-2 * exact + 1e-6);
        }
        assert_eq!(windows(&[&torque], 1), [[215, 236]]);
    }
}
