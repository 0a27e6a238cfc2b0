//! The linear model under the weights of its rows: y = Nη + Σ Zβ + ε, with η ~ N(0, Λ) eliminated.
//!
//! With W the weights and K = NᵀWN + Λ⁻¹, two products describe a block Z of columns after the elimination of the tolerances: G = ZᵀWZ − ZᵀWN K⁻¹
//! NᵀWZ and h = ZᵀWy − ZᵀWN K⁻¹ NᵀWy. These matrices are small for any number of rows. The evidence of a set of blocks has a closed form in them.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use freeplay_arm::Arm;
use freeplay_laws::Placed;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::candidates::candidate::Candidate;
use crate::data::columns::{Column, add, dot};
use crate::data::stacked::Data;
use crate::data::tolerance::{Of, even};
use crate::data::weights::{Rows, Weights};
use crate::data::whitening::Whitening;
use crate::evidence::block::{Block, Channel, Products, Weighed, half_log_determinant, own, weighed};
use crate::evidence::bvls::bounded;
use crate::statistics::blocks as blocks_of;

/// Precision that holds a tolerance at a limit, and a coefficient at its usual value: far above the information of any recording, far below the limit
/// of rounding errors.
const STIFF: f64 = 1e9;

/// Prior standard deviation of a law, as a share of its channel: the law may be as large as the channel or zero, and halfway favours neither.
const HALF: f64 = 0.5;

/// The fit of a set of blocks.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// The numbers of the blocks.
    pub members: Vec<usize>,
    /// Their coefficients, stacked.
    pub beta: DVector<f64>,
    /// The log of the evidence without the terms that are equal for all sets with the same weights.
    pub value: f64,
    /// The part of the value that does not come from the sum of squares: volumes and prior odds.
    pub log_prior: f64,
    /// The normal matrix of the coefficients: the inverse of their covariance.
    pub normal: DMatrix<f64>,
    /// The coefficients of the tolerances in a fit that holds them inside their limits.
    eta: Option<DVector<f64>>,
}

/// The gain from one more block.
#[derive(Clone, Debug)]
pub(crate) struct Gain {
    /// Increase of the log of the evidence, prior odds included.
    pub value: f64,
    /// The part of the increase that comes from the decrease of half the weighted squares.
    pub explained: f64,
    /// The block's coefficients.
    pub beta: DVector<f64>,
    /// True if every coefficient lies strictly between its bounds.
    pub is_inside: bool,
}

/// The system.
pub(crate) struct System<'d, 'a> {
    pub data: &'d Data<'a>,
    pub weights: Weights,
    pub target: Vec<Vec<f64>>,
    whitening: Option<Whitening>,
    tolerances: Vec<Column>,
    precision: Vec<f64>,
    /// The uncertain quantity of each tolerance.
    uncertain: Vec<Of>,
    channels: Vec<Channel>,
    /// The channels before the last change of their weights.
    before: Vec<Option<Channel>>,
    /// Number of changes of the weights of any channel.
    versions: u64,
    factor: Cholesky<f64, Dyn>,
    /// K and NᵀWy with no tolerance held at a limit.
    free: (DMatrix<f64>, DVector<f64>),
    /// L⁻¹NᵀWy.
    whitened_target: DVector<f64>,
    /// Half the log of the determinant of K with no tolerance held at a limit.
    log_volume: f64,
    /// The tolerances that are held at a limit, because a set of blocks would move them beyond it.
    held_at: Vec<Option<f64>>,
    blocks: Vec<Block>,
    /// ZᵢᵀWZⱼ by the numbers of the later and the earlier block.
    crosses: RefCell<BTreeMap<(usize, usize), Cross>>,
}

/// Products of two blocks over their common channels.
#[derive(Debug)]
struct Cross {
    by_channel: Vec<(usize, Weighed<DMatrix<f64>>)>,
    sum: Weighed<DMatrix<f64>>,
}

impl<'d, 'a> System<'d, 'a> {
    /// The system of the active rows of `data`, under `weights`; `None` if the tolerances are singular.
    pub fn new(data: &'d Data<'a>, target: Vec<Vec<f64>>, weights: Weights) -> Option<Self> {
        Self::over(data, target, weights, None)
    }

    /// The system of rows that `whitening` makes independent; it whitens all columns, too.
    pub fn white(
        data: &'d Data<'a>,
        target: &[Vec<f64>],
        weights: Weights,
        whitening: Whitening,
    ) -> Option<Self> {
        let target = target.iter().enumerate().map(|(c, rows)| whitening.channel(c).rows(rows)).collect();
        Self::over(data, target, weights, Some(whitening))
    }

    fn over(
        data: &'d Data<'a>,
        target: Vec<Vec<f64>>,
        weights: Weights,
        whitening: Option<Whitening>,
    ) -> Option<Self> {
        let (mut tolerances, precision, uncertain) = data.tolerances();
        if let Some(whitening) = &whitening {
            tolerances.iter_mut().for_each(|column| *column = whitening.column(column));
        }
        let channels: Vec<Channel> = (0..data.channels())
            .map(|c| Channel::new(c, &tolerances, &target, (0, weights.rows[c].weights())))
            .collect();
        let held_at = vec![None; precision.len()];
        let free = normal_equations(&channels, &precision);
        let (factor, whitened_target) = eliminated(&free, &held_at)?;
        let (before, blocks, crosses) = (vec![None; channels.len()], Vec::new(), RefCell::default());
        let log_volume = half_log_determinant(&factor);
        Some(Self {
            log_volume,
            data,
            weights,
            target,
            whitening,
            tolerances,
            precision,
            uncertain,
            channels,
            before,
            versions: 0,
            factor,
            free,
            whitened_target,
            held_at,
            blocks,
            crosses,
        })
    }

    /// The candidate of the block number `index`.
    pub fn candidate(&self, index: usize) -> &Candidate {
        &self.blocks[index].candidate
    }

    /// Adds `candidate` to the system, and returns its number; `None` if the rows show nothing of it.
    pub fn take(&mut self, candidate: Candidate) -> Option<usize> {
        let block = self.block(candidate)?;
        self.blocks.push(block);
        Some(self.blocks.len() - 1)
    }

    /// Removes the block number `index`, if it is the last.
    pub fn forget(&mut self, index: usize) {
        if index + 1 == self.blocks.len() {
            self.blocks.pop();
            self.crosses.borrow_mut().split_off(&(index, 0));
        }
    }

    fn block(&self, mut candidate: Candidate) -> Option<Block> {
        if let Some(whitening) = &self.whitening {
            candidate.columns = Rc::new(candidate.columns.iter().map(|c| whitening.column(c)).collect());
        }
        let size = candidate.size();
        let (channels, mut precision) = if candidate.kind.happens() {
            self.precision_of_its_own_size(&candidate)?
        } else {
            self.precision_of_a_channel(&candidate)?
        };
        for k in 0..size {
            if precision[(k, k)] <= 0.0 {
                return None;
            }
            precision[(k, k)] *= 1.0 + 1e-9;
        }
        if candidate.usual().is_some() {
            precision = DMatrix::from_diagonal_element(size, size, STIFF);
        }
        let log_prior = half_log_determinant(&Cholesky::new(precision.clone())?)
            + candidate.kind.occurs.odds().ln()
            - (candidate.forms as f64).ln();
        Some(Block::new(candidate, channels, precision, log_prior))
    }

    /// The channels with columns of `candidate`, and the precision of a prior under which its contribution is half of their measured size.
    fn precision_of_a_channel(&self, candidate: &Candidate) -> Option<(Vec<usize>, DMatrix<f64>)> {
        let mut precision = DMatrix::zeros(candidate.size(), candidate.size());
        let (mut channels, mut count) = (Vec::new(), 0.0);
        for c in self.weighed(candidate) {
            let mask = self.data.active_mask(c);
            let plain = own(&candidate.columns, c, &mask);
            let scale = HALF * self.weights.rows[c].scale;
            if scale > 0.0 && plain.diagonal().iter().any(|x| *x > 0.0) {
                precision += plain / (scale * scale);
                count += mask.iter().sum::<f64>();
                channels.push(c);
            }
        }
        (count > 0.0).then(|| (channels, precision / count))
    }

    /// The same channels, with a prior whose size comes from the rows: no machine suggests the size of an event (local empirical Bayes, Hansen & Yu
    /// 2001, J. Am. Stat. Assoc. 96:746). If the rows hold no information about the event, the prior holds as much as all rows.
    fn precision_of_its_own_size(&self, candidate: &Candidate) -> Option<(Vec<usize>, DMatrix<f64>)> {
        let size = candidate.size();
        let (mut normal, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut channels = Vec::new();
        for c in self.weighed(candidate) {
            let of_channel = self.channels[c].of(&candidate.columns, c);
            if of_channel.own.diagonal().iter().any(|x| *x > 0.0) {
                right += of_channel.target;
                normal += of_channel.own;
                channels.push(c);
            }
        }
        let explained = right.dot(&Cholesky::new(normal.clone())?.solve(&right));
        let larger = (explained / size as f64 - 1.0).max(1.0);
        Some((channels, normal / larger))
    }

    /// The channels of `candidate` that have rows with a weight.
    fn weighed<'c>(&'c self, candidate: &'c Candidate) -> impl Iterator<Item = usize> + 'c {
        candidate.channels.iter().copied().filter(|&c| !self.channels[c].span.is_empty())
    }

    /// The products of the block number `index` after the elimination of the tolerances.
    fn products(&self, index: usize) -> &Products {
        let block = &self.blocks[index];
        block.products(&self.channels, self.tolerances.len(), &self.factor, &self.whitened_target)
    }

    /// ZᵢᵀWZⱼ minus its part through the tolerances.
    fn cross(&self, i: usize, j: usize) -> DMatrix<f64> {
        if i > j {
            return self.cross(j, i).transpose();
        }
        let through = self.products(i).whitened.tr_mul(&self.products(j).whitened);
        let mut crosses = self.crosses.borrow_mut();
        let Cross { by_channel, sum } = crosses.entry((j, i)).or_insert_with(|| self.shared_channels(i, j));
        let blank = || DMatrix::zeros(self.candidate(i).size(), self.candidate(j).size());
        let parts = || {
            by_channel.iter_mut().fold(blank(), |sum, (c, part)| {
                sum + part.get(self.channels[*c].version, || self.cross_in(*c, i, j))
            })
        };
        sum.get(self.versions, parts) - through
    }

    /// The common channels of the blocks `i` and `j`, without their products.
    fn shared_channels(&self, i: usize, j: usize) -> Cross {
        let (first, second) = (self.candidate(i), self.candidate(j));
        let shared = first.channels.iter().filter(|c| second.channels.contains(c));
        Cross { by_channel: shared.map(|&c| (c, Weighed::default())).collect(), sum: Weighed::default() }
    }

    /// ZᵢᵀWZⱼ in the channel number `c`.
    fn cross_in(&self, c: usize, i: usize, j: usize) -> DMatrix<f64> {
        let (first, second) = (self.candidate(i), self.candidate(j));
        let mut cross = DMatrix::zeros(first.size(), second.size());
        let Channel { weights, span, .. } = &self.channels[c];
        for (b, column) in second.columns.iter().enumerate() {
            let Some(column) = &column[c] else { continue };
            let weighed = weighed(&column[span.clone()], &weights[span.clone()]);
            for (a, other) in first.columns.iter().enumerate() {
                if let Some(other) = &other[c] {
                    cross[(a, b)] = dot(&other[span.clone()], &weighed);
                }
            }
        }
        cross
    }

    /// The joint fit of `members`; `None` if they are singular.
    pub fn fit(&self, members: &[usize]) -> Option<Fit> {
        let sizes: Vec<usize> = members.iter().map(|&i| self.candidate(i).size()).collect();
        let all: usize = sizes.iter().sum();
        let (mut normal, mut right) = (DMatrix::zeros(all, all), DVector::zeros(all));
        let (mut limits, mut log_prior, mut log_off_mean, mut at) = (Vec::new(), 0.0, 0.0, 0);
        for (k, &i) in members.iter().enumerate() {
            let (block, products) = (&self.blocks[i], self.products(i));
            normal.view_mut((at, at), (sizes[k], sizes[k])).copy_from(&products.normal);
            right.rows_mut(at, sizes[k]).copy_from(&products.right);
            let mut before = 0;
            for (l, &j) in members[..k].iter().enumerate() {
                let cross = self.cross(j, i);
                normal.view_mut((before, at), (sizes[l], sizes[k])).copy_from(&cross);
                normal.view_mut((at, before), (sizes[k], sizes[l])).copy_from(&cross.transpose());
                before += sizes[l];
            }
            limits.extend(block.candidate.limits());
            log_prior += block.log_prior;
            log_off_mean += block.log_off_mean;
            at += sizes[k];
        }
        let volume = log_determinant(&normal)?;
        let beta = bounded(&normal, &right, &limits)?;
        let log_prior = log_prior - 0.5 * volume;
        let value = right.dot(&beta) - 0.5 * beta.dot(&(&normal * &beta)) + log_prior - log_off_mean;
        Some(Fit { members: members.to_vec(), beta, value, log_prior, normal, eta: None })
    }

    /// The fit with every tolerance inside its limits, for a machine within its data sheet. Its value is comparable only with those of other such
    /// fits.
    pub fn fit_within_tolerances(&self, members: &[usize]) -> Option<Fit> {
        self.fit_within(members, &self.widths(members))
    }

    /// The limits of each tolerance beside `members`, in standard deviations: zero for a tolerance that a member replaces, infinite for one without a
    /// prior.
    fn widths(&self, members: &[usize]) -> Vec<[f64; 2]> {
        let width = |(precision, is_named): (&f64, bool)| match (*precision < 1.0, is_named) {
            (true, _) => [f64::NEG_INFINITY, f64::INFINITY],
            (false, true) => [0.0, 0.0],
            // Half the width of a uniform distribution with the standard deviation one.
            (false, false) => [-1.0 / even(), 1.0 / even()],
        };
        self.precision.iter().zip(self.replaced_by(members)).map(width).collect()
    }

    /// [`System::fit_within_tolerances`] with the tolerances inside `widths`.
    fn fit_within(&self, members: &[usize], widths: &[[f64; 2]]) -> Option<Fit> {
        let fit = self.fit(members)?;
        let (n, m) = (self.precision.len(), fit.beta.len());
        let (mut normal, mut right) = (DMatrix::zeros(n + m, n + m), DVector::zeros(n + m));
        normal.view_mut((0, 0), (n, n)).copy_from(&self.free.0);
        right.rows_mut(0, n).copy_from(&self.free.1);
        let mut whitened = DMatrix::zeros(n, m);
        let mut limits = widths.to_vec();
        let mut at = 0;
        for &member in members {
            let (block, products) = (&self.blocks[member], self.products(member));
            let size = block.candidate.size();
            normal.view_mut((0, n + at), (n, size)).copy_from(&products.through);
            normal.view_mut((n + at, 0), (size, n)).copy_from(&products.through.transpose());
            whitened.columns_mut(at, size).copy_from(&products.whitened);
            let whole = &products.right + products.whitened.tr_mul(&self.whitened_target);
            right.rows_mut(n + at, size).copy_from(&whole);
            limits.extend(block.candidate.limits());
            at += size;
        }
        normal.view_mut((n, n), (m, m)).copy_from(&(&fit.normal + whitened.tr_mul(&whitened)));
        let solved = bounded(&normal, &right, &limits)?;
        let log_off_mean: f64 = members.iter().map(|&member| self.blocks[member].log_off_mean).sum();
        let value =
            right.dot(&solved) - 0.5 * solved.dot(&(&normal * &solved)) + fit.log_prior - log_off_mean;
        Some(Fit {
            value,
            beta: solved.rows(n, m).into_owned(),
            eta: Some(solved.rows(0, n).into_owned()),
            ..fit
        })
    }

    /// Holds the tolerances that `fit` would move beyond a limit at that limit. Returns true if the set of held tolerances changed.
    pub fn hold_tolerances(&mut self, fit: &Fit) -> Option<bool> {
        let widths = self.widths(&fit.members);
        let held = self.fit_within(&fit.members, &widths)?.eta?;
        // Zero limits hold a tolerance at zero; an infinite limit never holds one.
        let edge = |(eta, [_, most]): (&f64, &[f64; 2])| {
            (eta.abs() >= most * (1.0 - 1e-9)).then(|| most.copysign(*eta))
        };
        let held_at: Vec<Option<f64>> = held.iter().zip(&widths).map(edge).collect();
        let moved = held_at != self.held_at;
        if moved {
            self.held_at = held_at;
            self.eliminate()?;
        }
        Some(moved)
    }

    /// The tolerances of the same quantity as one of `members`, or with the same effect, with any coefficients: a named effect replaces its tolerance.
    fn replaced_by(&self, members: &[usize]) -> Vec<bool> {
        /// Share of a column's square that another column explains for both to be the same: the rest, a tenth of the standard deviation, can't be
        /// distinguished from noise beside a tolerance.
        const SAME: f64 = 0.99;
        let squares: Vec<f64> = (0..self.precision.len())
            .map(|k| {
                let shown = self.channels.iter().flat_map(|channel| {
                    let place = channel.tolerances.iter().position(|(index, _)| *index == k);
                    place.map(|place| channel.gram[(place, place)])
                });
                shown.sum()
            })
            .collect();
        let mut named = vec![false; self.precision.len()];
        for &member in members {
            for (named, of) in named.iter_mut().zip(&self.uncertain) {
                *named |= of.is_in(self.candidate(member).kind, &self.candidate(member).form.shape);
            }
            let products = self.products(member);
            let precision = &self.blocks[member].precision;
            let own = &products.normal - precision + products.whitened.tr_mul(&products.whitened);
            let Some(factor) = Cholesky::new(own) else { continue };
            for (k, square) in squares.iter().enumerate() {
                let cross = products.through.row(k).transpose();
                let said = cross.dot(&factor.solve(&cross));
                named[k] |= *square > 0.0 && said > SAME * square;
            }
        }
        named
    }

    /// Releases all tolerances.
    pub fn release_tolerances(&mut self) -> Option<()> {
        self.held_at.fill(None);
        self.eliminate()
    }

    /// The covariance of the coefficients of `members` that the tolerances hide: those that are held at a limit as wide as in the data sheet, and those that a
    /// member replaces. The data determine only the sum of a member and the tolerance that it replaces, so that one standard deviation of the tolerance changes the
    /// coefficients by what the member's columns explain of it.
    pub fn hidden_by_tolerances(&mut self, members: &[usize]) -> Option<DMatrix<f64>> {
        let named = self.replaced_by(members);
        let held_at = self.held_at.clone();
        let held = Cholesky::new(self.fit(members)?.normal)?.inverse();
        for (edge, named) in self.held_at.iter_mut().zip(&named) {
            *edge = named.then_some(0.0);
        }
        self.eliminate()?;
        let posterior = Cholesky::new(self.fit(members)?.normal)?.inverse();
        let mut hidden = &posterior - held;
        for index in (0..named.len()).filter(|&index| named[index]) {
            // NᵀWn of this tolerance n, and ZᵀWn without the part through the tolerances.
            let mut gram = self.free.0.column(index).into_owned();
            gram[index] -= self.precision[index];
            let through = self.factor.l().solve_lower_triangular(&gram)?;
            let products = members.iter().map(|&member| self.products(member));
            let explained: Vec<f64> = products
                .flat_map(|products| {
                    let own = products.through.row(index).transpose() - products.whitened.tr_mul(&through);
                    own.iter().copied().collect::<Vec<f64>>()
                })
                .collect();
            let shift = &posterior * DVector::from_vec(explained);
            hidden += &shift * shift.transpose();
        }
        self.held_at = held_at;
        self.eliminate()?;
        Some(hidden)
    }

    /// The gain from each of `candidates` beside the members of `fit`.
    pub fn gains(&self, fit: &Fit, candidates: &[usize]) -> Vec<Option<Gain>> {
        let factor = Cholesky::new(fit.normal.clone());
        let gain = |&index: &usize| {
            let (block, products) = (&self.blocks[index], self.products(index));
            let size = block.candidate.size();
            let mut cross = DMatrix::zeros(fit.beta.len(), size);
            let mut at = 0;
            for &member in &fit.members {
                let of_member = self.cross(member, index);
                cross.view_mut((at, 0), of_member.shape()).copy_from(&of_member);
                at += of_member.nrows();
            }
            let right = &products.right - cross.tr_mul(&fit.beta);
            if let Some(factor) = &factor {
                factor.l_dirty().solve_lower_triangular_mut(&mut cross);
            }
            let normal = &products.normal - cross.tr_mul(&cross);
            let volume = log_determinant(&normal)?;
            let limits = block.candidate.limits();
            let beta = bounded(&normal, &right, &limits)?;
            let explained = right.dot(&beta) - 0.5 * beta.dot(&(&normal * &beta)) - block.log_off_mean;
            let is_inside = beta.iter().zip(&limits).all(|(x, [least, most])| least < x && x < most);
            Some(Gain { value: explained - 0.5 * volume + block.log_prior, explained, beta, is_inside })
        };
        candidates.iter().map(gain).collect()
    }

    /// The weighted squares of the residuals after the fit of the tolerances alone.
    pub fn residual_squares(&self) -> f64 {
        let squares: f64 = self.channels.iter().map(|channel| channel.square).sum();
        squares - self.whitened_target.norm_squared()
    }

    /// The log of the evidence without constant terms, as far as it is common to all sets under the same weights.
    pub fn common_log_evidence(&self) -> f64 {
        let volumes: f64 = self.weights.rows.iter().map(Rows::log_volume).sum();
        let squares: f64 = self.channels.iter().map(|channel| channel.square).sum();
        let stiff: f64 = self.held_at.iter().flatten().map(|edge| STIFF * edge * edge).sum();
        volumes - 0.5 * (squares + stiff) + 0.5 * self.whitened_target.norm_squared() - self.log_volume
    }

    /// The coefficients of the tolerances beside `fit`.
    pub fn tolerances_beside(&self, fit: &Fit) -> DVector<f64> {
        if let Some(held) = &fit.eta {
            return held.clone();
        }
        let (mut right, mut at) = (self.whitened_target.clone(), 0);
        for &member in &fit.members {
            let size = self.candidate(member).size();
            right -= &self.products(member).whitened * fit.beta.rows(at, size);
            at += size;
        }
        let upper = self.factor.l().transpose();
        upper.solve_upper_triangular(&right).unwrap_or(right)
    }

    /// The residuals of `fit` in every row of the data, of all parts.
    pub fn residual(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let mut residual = self.target.clone();
        for (column, eta) in self.tolerances.iter().zip(self.tolerances_beside(fit).iter()) {
            add(&mut residual, column, -eta);
        }
        for (column, beta) in self.columns(&fit.members).zip(fit.beta.iter()) {
            add(&mut residual, column, -beta);
        }
        residual
    }

    /// The score of each block of neighbouring rows with the `residual` of a fit, for the columns of `members`, the tolerances eliminated: ZᵀW(residual) of the
    /// block.
    pub fn block_scores(&self, members: &[usize], residual: &[Vec<f64>]) -> Vec<DVector<f64>> {
        // The columns after the elimination of the tolerances, Z − N K⁻¹NᵀWZ, channel by channel.
        let upper = self.factor.l().transpose();
        let through: Vec<DMatrix<f64>> = members
            .iter()
            .filter_map(|&member| upper.solve_upper_triangular(&self.products(member).whitened))
            .collect();
        let mut blocks: BTreeMap<(usize, usize), DVector<f64>> = BTreeMap::new();
        for (c, channel) in
            self.channels.iter().enumerate().filter(|(_, channel)| !channel.tolerances.is_empty())
        {
            let mut columns = Vec::new();
            for (&member, through) in members.iter().zip(&through) {
                for (k, column) in self.candidate(member).columns.iter().enumerate() {
                    let mut own = column[c].clone().unwrap_or_else(|| vec![0.0; residual[c].len()]);
                    for (index, _) in &channel.tolerances {
                        if let Some(tolerance) = &self.tolerances[*index][c] {
                            let share = through[(*index, k)];
                            own.iter_mut().zip(tolerance).for_each(|(x, t)| *x -= share * t);
                        }
                    }
                    columns.push(own);
                }
            }
            let (recording, _) = self.data.place(c);
            for (stretch, step) in self.data.stretches(c) {
                for rows in blocks_of(stretch, step) {
                    let pull = blocks
                        .entry((recording, rows.start))
                        .or_insert_with(|| DVector::zeros(columns.len()));
                    for (k, column) in columns.iter().enumerate() {
                        pull[k] += rows
                            .clone()
                            .map(|row| column[row] * channel.weights[row] * residual[c][row])
                            .sum::<f64>();
                    }
                }
            }
        }
        blocks.into_values().collect()
    }

    /// Subtracts from `rows` the tolerances with the coefficients `eta`, except those without a prior.
    pub fn subtract_tolerances(&self, rows: &mut [Vec<f64>], eta: &DVector<f64>) {
        let bound = self.tolerances.iter().zip(&self.precision).zip(eta.iter());
        bound
            .filter(|((_, precision), _)| **precision >= 1.0)
            .for_each(|((column, _), eta)| add(rows, column, -eta));
    }

    /// The columns of `members`, in the order of their coefficients.
    pub fn columns<'s>(&'s self, members: &'s [usize]) -> impl Iterator<Item = &'s Column> {
        members.iter().flat_map(|&member| self.candidate(member).columns.iter())
    }

    /// The members of `fit` on `arm` that an arm file can describe and that `may` accepts.
    pub fn placed(&self, fit: &Fit, arm: &Arm, may: impl Fn(&Candidate) -> bool) -> Vec<Placed> {
        let members = fit.members.iter().map(|&member| self.candidate(member)).enumerate();
        let wanted = members.filter(|(_, candidate)| may(candidate));
        wanted.filter_map(|(place, candidate)| candidate.placed(arm, self.coefficients(fit, place))).collect()
    }

    /// The members of `fit` on `arm` in the recording number `recording` that an arm file can describe, each with its initial state there.
    pub fn placed_in(&self, fit: &Fit, arm: &Arm, recording: usize) -> Vec<Placed> {
        let placed = |(place, &member): (usize, &usize)| {
            self.candidate(member).placed_in(arm, self.coefficients(fit, place), recording)
        };
        fit.members.iter().enumerate().filter_map(placed).collect()
    }

    /// The coefficients of the member number `place` of `fit`.
    pub fn coefficients<'f>(&self, fit: &'f Fit, place: usize) -> &'f [f64] {
        let at: usize = fit.members[..place].iter().map(|&member| self.candidate(member).size()).sum();
        &fit.beta.as_slice()[at..at + self.candidate(fit.members[place]).size()]
    }

    /// Updates the shares of discrepancy to the residuals of `fit`. Returns true if any changed; `None` if that makes the tolerances singular.
    pub fn update_shares(&mut self, fit: &Fit) -> Option<bool> {
        let residual = self.residual(fit);
        let moved: Vec<usize> = (0..self.channels.len())
            .filter(|&c| {
                let taken = self.coefficient_count(fit, c);
                self.weights.rows[c].update_share(&residual[c], taken)
            })
            .collect();
        self.reweigh(&moved)?;
        Some(!moved.is_empty())
    }

    /// Sets the robust weight of each row from the residual of `fit`: see [`crate::data::weights::Rows::downweight_outliers`]. `None` if that makes the
    /// tolerances singular.
    pub fn downweight_outliers(&mut self, fit: &Fit) -> Option<()> {
        let residual = self.residual(fit);
        let active: Vec<usize> =
            (0..self.channels.len()).filter(|&c| self.weights.rows[c].effective() > 0.0).collect();
        active.iter().for_each(|&c| self.weights.rows[c].downweight_outliers(&residual[c]));
        self.reweigh(&active)
    }

    /// Sets the robust weight of every row to one. `None` if that makes the tolerances singular.
    pub fn reset_robust_weights(&mut self) -> Option<()> {
        self.weights.rows.iter_mut().for_each(Rows::reset_robust_weights);
        self.reweigh(&(0..self.channels.len()).collect::<Vec<_>>())
    }

    /// Sets the shares of discrepancy to `shares`. `None` if that makes the tolerances singular.
    pub fn set_shares(&mut self, shares: &[f64]) -> Option<()> {
        let moved: Vec<usize> =
            (0..self.channels.len()).filter(|&c| self.weights.rows[c].share != shares[c]).collect();
        moved.iter().for_each(|&c| self.weights.rows[c].share = shares[c]);
        self.reweigh(&moved)
    }

    /// Increase of the evidence of `fit` if the shares of discrepancy were those of its own residuals.
    pub fn share_gain(&self, fit: &Fit) -> f64 {
        let residual = self.residual(fit);
        (0..self.channels.len())
            .map(|c| self.weights.rows[c].share_gain(&residual[c], self.coefficient_count(fit, c)))
            .sum()
    }

    /// Number of coefficients of `fit` with columns in the channel number `c`.
    fn coefficient_count(&self, fit: &Fit, c: usize) -> f64 {
        let members = fit.members.iter().map(|&member| &self.blocks[member].candidate);
        members
            .filter(|candidate| candidate.channels.contains(&c))
            .map(|candidate| candidate.size() as f64)
            .sum()
    }

    /// The share of discrepancy of each channel.
    pub fn shares(&self) -> Vec<f64> {
        self.weights.rows.iter().map(|rows| rows.share).collect()
    }

    /// Recomputes the products of the channels `moved` after a change of their weights.
    fn reweigh(&mut self, moved: &[usize]) -> Option<()> {
        if moved.is_empty() {
            return Some(());
        }
        self.versions += 1;
        for &c in moved {
            let weights = self.weights.rows[c].weights();
            let is_back = self.before[c].as_ref().is_some_and(|before| before.weights == weights);
            let now = match self.before[c].take().filter(|_| is_back) {
                Some(before) => before,
                None => Channel::new(c, &self.tolerances, &self.target, (self.versions, weights)),
            };
            self.before[c] = Some(std::mem::replace(&mut self.channels[c], now));
        }
        self.free = normal_equations(&self.channels, &self.precision);
        self.log_volume = half_log_determinant(&Cholesky::new(self.free.0.clone())?);
        self.eliminate()
    }

    /// Eliminates the tolerances again.
    fn eliminate(&mut self) -> Option<()> {
        (self.factor, self.whitened_target) = eliminated(&self.free, &self.held_at)?;
        self.blocks.iter_mut().for_each(Block::forget);
        Some(())
    }
}

/// `members` without the one at `place`.
pub(crate) fn all_but(members: &[usize], place: usize) -> Vec<usize> {
    [&members[..place], &members[place + 1..]].concat()
}

/// K and NᵀWy.
fn normal_equations(channels: &[Channel], precision: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let n = precision.len();
    let mut normal = DMatrix::from_diagonal(&DVector::from_column_slice(precision));
    let mut right = DVector::zeros(n);
    for channel in channels {
        for (i, (a, _)) in channel.tolerances.iter().enumerate() {
            right[*a] += channel.against[i];
            for (j, (b, _)) in channel.tolerances.iter().enumerate() {
                normal[(*a, *b)] += channel.gram[(i, j)];
            }
        }
    }
    // Without this term, the zero of a link encoder without rows would be singular.
    (0..n).for_each(|k| normal[(k, k)] += f64::MIN_POSITIVE);
    (normal, right)
}

/// The factor of K, and L⁻¹NᵀWy, with the tolerances of `held_at` held at a limit.
fn eliminated(
    free: &(DMatrix<f64>, DVector<f64>),
    held_at: &[Option<f64>],
) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
    let (mut normal, mut right) = free.clone();
    for (k, edge) in held_at.iter().enumerate().filter_map(|(k, limit)| Some((k, (*limit)?))) {
        normal[(k, k)] += STIFF;
        right[k] += STIFF * edge;
    }
    let factor = Cholesky::new(normal)?;
    factor.l_dirty().solve_lower_triangular_mut(&mut right);
    Some((factor, right))
}

/// The log of the determinant of a positive definite matrix; `None` for any other matrix.
fn log_determinant(matrix: &DMatrix<f64>) -> Option<f64> {
    Some(2.0 * half_log_determinant(&Cholesky::new(matrix.clone())?))
}
