//! What blocks of columns explain beyond a fit, many at once: a search asks it of thousands, again and again.
//!
//! With the base's normal matrix N = LLᵀ and the block's inner products C with the base, S with itself and b with the target, its coefficients
//! solve (S − HᵀH) β = b − Cᵀη, where H = L⁻¹C. H is worked out for [`LANES`] columns side by side, whatever blocks they belong to.

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView};

use super::bounded::bounded;
use super::system::{Block, Fit, Score, System};

/// Columns that are eliminated together.
const LANES: usize = 16;
/// Blocks that are taken together: what is worked out for them stays in the processor's cache.
const AT_ONCE: usize = 64;
/// Least share of a column's square that the base does not say.
const LEAST_OWN: f64 = 1e-9;

/// A block, and its inner products with a target by channel.
pub(crate) type Asked<'b> = (&'b Block, &'b [DVector<f64>]);

/// [`LANES`] columns, row by row.
type Panel = Vec<[f64; LANES]>;

impl System {
    /// What each of `blocks` explains beyond `fit`; `None` if it is nothing of its own.
    pub fn scores(&self, fit: &Fit, blocks: &[&Block]) -> Vec<Option<Score>> {
        let asked: Vec<Asked> = blocks.iter().map(|block| (*block, block.with_target.as_slice())).collect();
        self.scores_of(fit, &asked)
    }

    /// The same for targets other than this system's.
    pub fn scores_of(&self, fit: &Fit, asked: &[Asked]) -> Vec<Option<Score>> {
        asked.chunks(AT_ONCE).flat_map(|few| self.scores_of_few(fit, few)).collect()
    }

    fn scores_of_few(&self, fit: &Fit, asked: &[Asked]) -> Vec<Option<Score>> {
        let (n, columns) = (fit.active.len(), asked.iter().map(|(block, _)| block.columns.len()).sum());
        let mut cross = DMatrix::zeros(n, columns);
        let mut begin = 0;
        let mut places = Vec::with_capacity(asked.len());
        for (block, _) in asked {
            let end = begin + block.columns.len();
            self.add_cross(fit, block, &mut cross.as_mut_slice()[n * begin..n * end]);
            places.push(begin);
            begin = end;
        }
        let said = cross.tr_mul(&fit.eta);
        let eliminated = Eliminated::new(fit, &cross);
        let one = |(&(block, with_target), begin): (&Asked, usize)| {
            let said = said.rows(begin, block.columns.len());
            self.score_by(block, with_target, &said, |i, j| eliminated.product(begin + i, begin + j))
        };
        asked.iter().zip(places).map(one).collect()
    }

    /// What `block` explains, of whose right side the base has `said` a part, and `product` of two of whose columns.
    fn score_by(
        &self,
        block: &Block,
        with_target: &[DVector<f64>],
        said: &DVectorView<f64>,
        product: impl Fn(usize, usize) -> f64,
    ) -> Option<Score> {
        let p = block.columns.len();
        let (mut own, mut right) = (DMatrix::<f64>::zeros(p, p), DVector::zeros(p));
        for &c in &block.shows {
            let weight = self.weights[c];
            own.zip_apply(&block.with_itself[c], |own, more| *own += weight * more);
            right.axpy(weight, &with_target[c], 1.0);
        }
        right -= said;
        let mut share = 1.0_f64;
        for i in 0..p {
            let whole = own[(i, i)];
            for j in 0..=i {
                own[(i, j)] -= product(i, j);
                own[(j, i)] = own[(i, j)];
            }
            if whole <= 0.0 || whole.is_nan() {
                return None;
            }
            share = share.min(own[(i, i)] / whole.max(f64::MIN_POSITIVE));
        }
        if share < LEAST_OWN {
            return None;
        }
        let mut beta = Cholesky::new(own.clone())?.solve(&right);
        if beta.iter().zip(&block.limits).any(|(beta, [least, most])| beta < least || beta > most) {
            beta = bounded(&own, &right, &block.limits)?.eta;
        }
        let gain = 2.0 * right.dot(&beta) - beta.dot(&(own * &beta));
        gain.is_finite().then_some(Score { gain, beta, shift: None })
    }
}

/// H = L⁻¹C.
struct Eliminated {
    panels: Vec<Panel>,
}

impl Eliminated {
    /// H for the L of `fit` and C = `cross`, whose rows are the active columns of `fit`.
    fn new(fit: &Fit, cross: &DMatrix<f64>) -> Self {
        let columns: Vec<usize> = (0..cross.ncols()).collect();
        let panel = |few: &[usize]| -> Panel {
            let mut panel = vec![[0.0; LANES]; fit.free.len()];
            for (lane, &column) in few.iter().enumerate() {
                let column = cross.column(column);
                panel.iter_mut().zip(&fit.free).for_each(|(row, &k)| row[lane] = column[k]);
            }
            panel
        };
        let mut panels: Vec<Panel> = columns.chunks(LANES).map(panel).collect();
        // Row by row, as they are gone through.
        let lower = fit.factor().l_dirty().transpose();
        let arch = pulp::Arch::new();
        panels.iter_mut().for_each(|panel| {
            arch.dispatch(
                #[inline(always)]
                || eliminate(&lower, panel),
            );
        });
        Self { panels }
    }

    /// The inner product of two columns.
    fn product(&self, i: usize, j: usize) -> f64 {
        let [left, right] = [i, j].map(|column| &self.panels[column / LANES]);
        let (i, j) = (i % LANES, j % LANES);
        left.iter().zip(right).map(|(left, right)| left[i] * right[j]).sum()
    }
}

/// Solves L h = c for each column c of `panel`; `upper` is Lᵀ.
#[inline(always)]
fn eliminate(upper: &DMatrix<f64>, panel: &mut [[f64; LANES]]) {
    for k in 0..panel.len() {
        let (known, rest) = panel.split_at_mut(k);
        let column = upper.column(k);
        let mut row = rest[0];
        for (factor, known) in column.iter().zip(known.iter()) {
            for lane in 0..LANES {
                row[lane] -= factor * known[lane];
            }
        }
        let diagonal = column[k];
        rest[0] = row.map(|x| x / diagonal);
    }
}
