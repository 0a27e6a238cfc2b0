//! The linear system behind every question: y = N η + Z β + ε with η ~ N(0, Λ), in inner products.
//!
//! Rows are the points of all channels of all recordings. Each channel c weighs w_c = n_eff/(n σ²): its rows count as the
//! effective number of samples that its residual's autocorrelation leaves, so that a likelihood ratio is one. Inner products are
//! kept channel by channel, so that other weights cost nothing.

use std::rc::Rc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::bounded::{Bounded, bounded};
use super::columns::{Column, against, gram, gram_of, subtract};

/// Inner products of blocks of columns, one matrix a channel.
type ByChannel = Vec<DMatrix<f64>>;

/// A block of columns that come and go together.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Its columns.
    pub columns: Vec<Column>,
    /// BᵀZ by channel, rows as the system's columns; kept up in the channels in which the block shows.
    with_base: ByChannel,
    /// ZᵀZ by channel.
    pub(super) with_itself: ByChannel,
    /// Zᵀy by channel.
    pub(super) with_target: Vec<DVector<f64>>,
    /// Channels in which it is not zero.
    pub shows: Vec<usize>,
    /// Within which its coefficients are held.
    pub(super) limits: Vec<[f64; 2]>,
}

/// What is not held.
const FREE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl Block {
    /// The same with its coefficients held within `limits`.
    #[must_use]
    pub fn held(self, limits: Vec<[f64; 2]>) -> Self {
        Self { limits, ..self }
    }

    /// Which of its columns say something that those before them don't: more than `share` of their squares.
    pub fn independent(&self, share: f64) -> Vec<usize> {
        let n = self.columns.len();
        let gram = self.with_itself.iter().fold(DMatrix::zeros(n, n), |sum, of_channel| sum + of_channel);
        let mut found: Vec<usize> = Vec::new();
        for place in 0..n {
            let known = gram.select_rows(&found).select_columns(&found);
            let cross = DVector::from_iterator(found.len(), found.iter().map(|&k| gram[(k, place)]));
            let said = Cholesky::new(known).map_or(0.0, |factor| cross.dot(&factor.solve(&cross)));
            let whole = gram[(place, place)];
            if whole > 0.0 && whole - said > share * whole {
                found.push(place);
            }
        }
        found
    }
}

/// What a block explains beyond the base.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    /// Fall of the weighted sum of squares: twice the log of the likelihood ratio.
    pub gain: f64,
    /// Coefficients β of the block.
    pub beta: DVector<f64>,
    /// By how much the base's coefficients change when the block comes in, where that was worked out.
    pub shift: Option<DVector<f64>>,
}

/// The system: base columns with their priors, and the target.
#[derive(Clone, Debug)]
pub(crate) struct System {
    /// Base columns, nuisances first.
    pub base: Rc<Vec<Column>>,
    /// Precision 1/sd² of the prior of each; 0 is flat.
    pub precision: Vec<f64>,
    /// The target y by channel.
    pub target: Vec<Vec<f64>>,
    /// Weight of each channel.
    pub weights: Vec<f64>,
    /// Within which the coefficient of each base column is held.
    limits: Vec<[f64; 2]>,
    /// Base columns of effects, each with a nuisance that says the same: it stays at zero while the effect takes part.
    replaces: Vec<(usize, usize)>,
    products: Rc<ByChannel>,
    with_target: Vec<DVector<f64>>,
}

/// A nuisance with a prior goes no farther than this many of its standard deviations: 1.7 are the tolerance, the rest is for
/// tolerances that are not meant to the last digit.
const BOUND: f64 = 2.0;

/// What is smaller than this share of what the tolerances may make in a channel is nothing that anybody would look for.
const MATERIAL: f64 = 0.1;

/// Least share of an effect's square that the effects taken in don't say already: large effects that cancel are no finding.
const LEAST_APART: f64 = 0.05;

/// The same for any sum of its columns.
const LEAST_TOGETHER: f64 = 0.01;

/// Share of a nuisance's square that an effect has to say to be the same.
const SAME: f64 = 0.99;
/// Precision of a nuisance that has gone over into an effect.
const NONE: f64 = 1e15;

/// The base fitted under the present weights, for some of its columns.
pub(crate) struct Fit {
    /// Indices of the base columns that take part.
    pub active: Vec<usize>,
    /// Positions in `active` of those that are not held at their bound.
    pub free: Vec<usize>,
    factor: Cholesky<f64, Dyn>,
    /// Coefficients of the active columns.
    pub eta: DVector<f64>,
    /// What is left: the weighted sum of squares and what the priors pay.
    pub left: f64,
    /// Where they show.
    shown: Shown,
    /// Normal matrix and right side of the active columns.
    normal: (DMatrix<f64>, DVector<f64>),
    /// Weighted square of the target.
    whole: f64,
}

impl Fit {
    /// The factor of the normal matrix of what is free.
    pub(super) fn factor(&self) -> &Cholesky<f64, Dyn> {
        &self.factor
    }

    /// The rows of `all` that belong to coefficients that are not held.
    fn of_free(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        if self.free.len() == self.active.len() { all.clone() } else { all.select_rows(&self.free) }
    }
}

impl System {
    /// A system of the nuisances `base` for `target`.
    pub fn new(base: Vec<Column>, precision: Vec<f64>, target: Vec<Vec<f64>>) -> Self {
        let channels = target.len();
        let products: ByChannel = (0..channels).map(|c| gram_of(&base, c)).collect();
        let with_target = (0..channels).map(|c| against(&base, &target, c)).collect();
        let limit = |precision: &f64| if *precision == 1.0 { [-BOUND, BOUND] } else { FREE };
        Self {
            replaces: Vec::new(),
            limits: precision.iter().map(limit).collect(),
            base: Rc::new(base),
            precision,
            weights: vec![1.0; channels],
            products: Rc::new(products),
            with_target,
            target,
        }
    }

    /// The same base for another target.
    pub fn with_other_target(&self, target: &[Vec<f64>]) -> Self {
        let with_target = (0..target.len()).map(|c| against(&self.base, target, c)).collect();
        Self { target: target.to_vec(), with_target, ..self.clone() }
    }

    /// The base columns `active` and the target with each row times its factor in `rows`, by channel; the other columns say nothing.
    pub fn with_rows(&self, active: &[usize], rows: &[Vec<f64>]) -> Self {
        let times = |part: &[f64], rows: &[f64]| part.iter().zip(rows).map(|(x, row)| x * row).collect();
        let mut base = vec![vec![None; rows.len()]; self.base.len()];
        for &a in active {
            let parts = self.base[a].iter().zip(rows);
            base[a] = parts.map(|(part, rows)| part.as_ref().map(|part| times(part, rows))).collect();
        }
        let target = self.target.iter().zip(rows).map(|(y, rows)| times(y, rows)).collect();
        let (weights, replaces, limits) = (self.weights.clone(), self.replaces.clone(), self.limits.clone());
        Self { weights, replaces, limits, ..Self::new(base, self.precision.clone(), target) }
    }

    /// A block of `columns` with its inner products.
    pub fn block(&self, columns: Vec<Column>) -> Block {
        let channels = 0..self.target.len();
        Block {
            with_base: channels.clone().map(|c| gram(&self.base, &columns, c)).collect(),
            with_itself: channels.clone().map(|c| gram_of(&columns, c)).collect(),
            with_target: channels.clone().map(|c| against(&columns, &self.target, c)).collect(),
            shows: channels.filter(|&c| columns.iter().any(|column| column[c].is_some())).collect(),
            limits: vec![FREE; columns.len()],
            columns,
        }
    }

    /// The same block against the target of this system, whose base is the same.
    pub fn retargeted(&self, block: &Block) -> Vec<DVector<f64>> {
        (0..self.target.len()).map(|c| against(&block.columns, &self.target, c)).collect()
    }

    /// Adds the columns of `block` to the base under a flat prior; the indices of the new columns.
    pub fn admit(&mut self, block: &Block) -> Vec<usize> {
        let (old, new) = (self.base.len(), block.columns.len());
        let products = Rc::make_mut(&mut self.products);
        for (c, product) in products.iter_mut().enumerate() {
            let mut grown = product.clone().resize(old + new, old + new, 0.0);
            if block.shows.contains(&c) {
                grown.view_mut((0, old), (old, new)).copy_from(&block.with_base[c].rows(0, old));
                grown.view_mut((old, 0), (new, old)).copy_from(&block.with_base[c].rows(0, old).transpose());
                grown.view_mut((old, old), (new, new)).copy_from(&block.with_itself[c]);
            }
            *product = grown;
            let mut target = self.with_target[c].clone().resize_vertically(old + new, 0.0);
            target.rows_mut(old, new).copy_from(&block.with_target[c]);
            self.with_target[c] = target;
        }
        Rc::make_mut(&mut self.base).extend(block.columns.iter().cloned());
        self.precision.extend(std::iter::repeat_n(0.0, new));
        self.limits.extend_from_slice(&block.limits);
        let columns: Vec<usize> = (old..old + new).collect();
        if let &[column] = columns.as_slice() {
            self.replaces.extend(self.said_by(column).into_iter().map(|nuisance| (column, nuisance)));
        }
        columns
    }

    /// Lets the base columns `ours` replace the nuisances that their like `theirs` replace in `other`, and no others.
    pub fn replace_as(&mut self, other: &System, theirs: &[usize], ours: &[usize]) {
        self.replaces.retain(|(column, _)| !ours.contains(column));
        for (column, like) in ours.iter().zip(theirs) {
            let same = other.replaces.iter().filter(|(column, _)| column == like);
            self.replaces.extend(same.map(|(_, nuisance)| (*column, *nuisance)));
        }
    }

    /// Lets the base columns `new` replace what their like `old` replace, too.
    pub fn inherit(&mut self, old: &[usize], new: &[usize]) {
        for (old, new) in old.iter().zip(new) {
            let same = self.replaces.iter().filter(|(column, _)| column == old);
            let more: Vec<(usize, usize)> = same.map(|(_, nuisance)| (*new, *nuisance)).collect();
            self.replaces.extend(more);
        }
    }

    /// The nuisances of which the base column `column` says nearly all: what has a name is no tolerance any more, and the prior of the
    /// one must not keep a part of the other.
    fn said_by(&self, column: usize) -> Vec<usize> {
        let product = |i: usize, j: usize| -> f64 {
            self.weights
                .iter()
                .zip(self.products.iter())
                .map(|(weight, product)| weight * product[(i, j)])
                .sum()
        };
        let own = product(column, column);
        let is_said =
            |&nuisance: &usize| product(column, nuisance).powi(2) > SAME * own * product(nuisance, nuisance);
        (0..column).filter(|&k| self.precision[k] == 1.0).filter(is_said).collect()
    }

    /// Precision of each of the base columns `active` while these take part.
    pub fn precisions(&self, active: &[usize]) -> Vec<f64> {
        let replaced = |a: &usize| {
            self.replaces.iter().any(|(column, nuisance)| nuisance == a && active.contains(column))
        };
        active.iter().map(|a| if replaced(a) { NONE } else { self.precision[*a] }).collect()
    }

    /// Brings the inner products of `block` up to the columns admitted since.
    pub fn catch_up(&self, block: &mut Block) {
        let all = self.base.len();
        for &c in &block.shows {
            let known = block.with_base[c].nrows();
            if known == all {
                continue;
            }
            let mut grown = std::mem::take(&mut block.with_base[c]).resize_vertically(all, 0.0);
            grown.rows_mut(known, all - known).copy_from(&gram(&self.base[known..], &block.columns, c));
            block.with_base[c] = grown;
        }
    }

    /// Fits the base columns `active`, nuisances inside their bounds; `None` if they are not independent.
    pub fn fit(&self, active: &[usize]) -> Option<Fit> {
        let shown = self.shown(active);
        let (normal, right) = self.normal(active, &shown);
        let Bounded { free, factor, eta, fall } = bounded(&normal, &right, &self.limits(active))?;
        let whole = self.weighted_square(&self.target);
        Some(Fit {
            active: active.to_vec(),
            free,
            factor,
            eta,
            left: whole - fall,
            shown,
            normal: (normal, right),
            whole,
        })
    }

    /// As [`System::scores`], with the nuisances that `fit` holds at their bounds free to come back: what the block would really gain.
    pub fn exact_score(&self, fit: &Fit, block: &Block) -> Option<Score> {
        let (n, p) = (fit.active.len(), block.columns.len());
        let (base, base_right) = &fit.normal;
        let mut normal = base.clone().resize(n + p, n + p, 0.0);
        let mut right = base_right.clone().resize_vertically(n + p, 0.0);
        let cross = self.cross(fit, block);
        normal.view_mut((0, n), (n, p)).copy_from(&cross);
        normal.view_mut((n, 0), (p, n)).copy_from(&cross.transpose());
        for &c in &block.shows {
            let weight = self.weights[c];
            right.rows_mut(n, p).axpy(weight, &block.with_target[c], 1.0);
            for j in 0..p {
                for k in 0..p {
                    normal[(n + j, n + k)] += weight * block.with_itself[c][(j, k)];
                }
            }
        }
        let mut limits = self.limits(&fit.active);
        limits.extend_from_slice(&block.limits);
        let solved = bounded(&normal, &right, &limits)?;
        let gain = fit.left - (fit.whole - solved.fall);
        let beta = solved.eta.rows(n, p).into_owned();
        let shift = solved.eta.rows(0, n) - &fit.eta;
        gain.is_finite().then_some(Score { gain, beta, shift: Some(shift) })
    }

    /// Within which the coefficients of the base columns `active` are held.
    pub fn limits(&self, active: &[usize]) -> Vec<[f64; 2]> {
        active.iter().map(|&a| self.limits[a]).collect()
    }

    /// Where the base columns `active` show.
    fn shown(&self, active: &[usize]) -> Shown {
        let in_order = active.iter().enumerate().take_while(|(i, a)| i == *a).count();
        let others = active.iter().copied().enumerate().skip(in_order);
        let of_channel = |c: usize| others.clone().filter(|(_, a)| self.base[*a][c].is_some()).collect();
        Shown { in_order, others: (0..self.target.len()).map(of_channel).collect() }
    }

    /// Normal matrix and right side of the base columns `active`, priors included.
    fn normal(&self, active: &[usize], shown: &Shown) -> (DMatrix<f64>, DVector<f64>) {
        let n = active.len();
        let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (c, weight) in self.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            shown.add(c, *weight, self.with_target[c].as_slice(), right.as_mut_slice());
            for (i, &a) in active.iter().enumerate().filter(|(_, a)| self.base[**a][c].is_some()) {
                let products = self.products[c].column(a);
                shown.add(c, *weight, products.as_slice(), &mut normal.as_mut_slice()[i * n..(i + 1) * n]);
            }
        }
        for (i, precision) in self.precisions(active).into_iter().enumerate() {
            normal[(i, i)] = normal[(i, i)] * (1.0 + 1e-11) + precision + f64::MIN_POSITIVE;
        }
        (normal, right)
    }

    /// Adds the weighed inner products of the active columns of `fit` with those of `block` to `cross`, column by column.
    pub(super) fn add_cross(&self, fit: &Fit, block: &Block, cross: &mut [f64]) {
        let n = fit.active.len();
        for &c in &block.shows {
            let products = &block.with_base[c];
            let all = products.as_slice().chunks_exact(products.nrows().max(1));
            for (cross, products) in cross.chunks_exact_mut(n.max(1)).zip(all) {
                fit.shown.add(c, self.weights[c], products, cross);
            }
        }
    }

    /// Weighed inner products of the active columns of `fit` with those of `block`.
    fn cross(&self, fit: &Fit, block: &Block) -> DMatrix<f64> {
        let mut cross = DMatrix::zeros(fit.active.len(), block.columns.len());
        self.add_cross(fit, block, cross.as_mut_slice());
        cross
    }

    /// By how much the coefficients of `fit` change when `block` comes in with the coefficients `beta`.
    fn shift(&self, fit: &Fit, block: &Block, beta: &DVector<f64>) -> DVector<f64> {
        let moved = fit.factor.solve(&(fit.of_free(&self.cross(fit, block)) * beta));
        let mut shift = DVector::zeros(fit.active.len());
        fit.free.iter().zip(moved.iter()).for_each(|(&k, moved)| shift[k] = -moved);
        shift
    }

    /// Whether the base columns `others` can't say nearly all of any column of `block`, nor all of any sum of these: what differs by direction is an
    /// offset beside friction, and beside a spring, whose rest is free, no data tell how much of it there is.
    pub fn is_apart(&self, others: &[usize], block: &Block) -> bool {
        let near: Vec<usize> = others
            .iter()
            .copied()
            .filter(|&a| block.shows.iter().any(|&c| self.base[a][c].is_some()))
            .collect();
        let n = near.len();
        if n == 0 {
            return true;
        }
        let size = block.columns.len();
        let mut gram = DMatrix::<f64>::zeros(n, n);
        let mut cross = DMatrix::<f64>::zeros(n, size);
        let mut own = DMatrix::<f64>::zeros(size, size);
        for &c in &block.shows {
            let weight = self.weights[c];
            own += weight * &block.with_itself[c];
            for (i, &a) in near.iter().enumerate() {
                for (j, &b) in near.iter().enumerate() {
                    gram[(i, j)] += weight * self.products[c][(a, b)];
                }
                for j in 0..size {
                    cross[(i, j)] += weight * block.with_base[c][(a, j)];
                }
            }
        }
        (0..n).for_each(|i| gram[(i, i)] = gram[(i, i)] * (1.0 + 1e-9) + f64::MIN_POSITIVE);
        let Some(factor) = Cholesky::new(gram) else { return false };
        let left = &own - cross.transpose() * factor.solve(&cross);
        let is_said = |j: usize| left[(j, j)] < LEAST_APART * own[(j, j)].max(f64::MIN_POSITIVE);
        if (0..size).any(is_said) {
            return false;
        }
        // Of all sums of the columns, the one that keeps the least share of its square.
        let Some(factor) = Cholesky::new(own).filter(|_| size > 1) else { return true };
        let half = factor.l().solve_lower_triangular(&left).unwrap_or(left);
        let shares = factor.l().solve_lower_triangular(&half.transpose()).unwrap_or(half);
        shares.symmetric_eigenvalues().min() >= LEAST_TOGETHER
    }

    /// Whether `block` with the coefficients `beta` says enough in some channel to be a finding, beside what tolerances may say there.
    pub fn is_material(&self, block: &Block, beta: &DVector<f64>) -> bool {
        block.shows.iter().any(|&c| {
            let said = beta.dot(&(&block.with_itself[c] * beta));
            let tolerated = self.precision.iter().enumerate().filter(|(_, precision)| **precision == 1.0);
            said >= MATERIAL.powi(2) * tolerated.map(|(k, _)| self.products[c][(k, k)]).sum::<f64>()
        })
    }

    /// Covariance of the active coefficients; zero where one is held at its bound.
    pub fn covariance(&self, fit: &Fit) -> DMatrix<f64> {
        let (inverse, n) = (fit.factor.inverse(), fit.active.len());
        let mut whole = DMatrix::zeros(n, n);
        for (i, &a) in fit.free.iter().enumerate() {
            for (j, &b) in fit.free.iter().enumerate() {
                whole[(a, b)] = inverse[(i, j)];
            }
        }
        whole
    }

    /// Standard deviations of the active coefficients; infinite where one is held at its bound.
    pub fn deviations(&self, fit: &Fit) -> DVector<f64> {
        let variances = self.covariance(fit).diagonal();
        variances.map(|variance| if variance > 0.0 { variance.sqrt() } else { f64::INFINITY })
    }

    /// Target minus the fitted base, by channel.
    pub fn residual(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let mut residual = self.target.clone();
        for (&a, eta) in fit.active.iter().zip(fit.eta.iter()) {
            subtract(&mut residual, &self.base[a], *eta);
        }
        residual
    }

    /// The same with `block` in, by its `score`.
    pub fn residual_with(&self, fit: &Fit, block: &Block, score: &Score) -> Vec<Vec<f64>> {
        let mut residual = self.target.clone();
        let shift = score.shift.clone().unwrap_or_else(|| self.shift(fit, block, &score.beta));
        for (&a, eta) in fit.active.iter().zip((&fit.eta + shift).iter()) {
            subtract(&mut residual, &self.base[a], *eta);
        }
        for (column, beta) in block.columns.iter().zip(score.beta.iter()) {
            subtract(&mut residual, column, *beta);
        }
        residual
    }

    /// Weighted sum of squares of `residual`.
    pub fn weighted_square(&self, residual: &[Vec<f64>]) -> f64 {
        let squares = residual.iter().map(|r| r.iter().map(|x| x * x).sum::<f64>());
        squares.zip(&self.weights).map(|(square, weight)| square * weight).sum()
    }
}

/// Where the columns that take part show: what is not in a channel has no inner product there, and need not be looked for.
struct Shown {
    /// So many are at the same place among all columns: the nuisances come first and all take part.
    in_order: usize,
    /// The others that show in each channel, by their places among those that take part and among all.
    others: Vec<Vec<(usize, usize)>>,
}

impl Shown {
    /// Adds to `sums`, one for each column that takes part, `weight` times its number among those of all columns in the channel `c`.
    fn add(&self, c: usize, weight: f64, numbers: &[f64], sums: &mut [f64]) {
        let in_order = sums[..self.in_order].iter_mut().zip(numbers);
        in_order.for_each(|(sum, number)| *sum += weight * number);
        self.others[c].iter().for_each(|&(place, among_all)| sums[place] += weight * numbers[among_all]);
    }
}
