//! Residuals of one law in some channels of a recording, with the tolerances fitted beside its terms.

use freeplay_laws::Term;
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::data::columns::{Answer, Column, against, gram, gram_of};
use crate::data::noise::Noises;
use crate::data::tolerance::Nuisance;
use crate::signals::channel::{Channel, Kind};
use crate::signals::initial_state::square;
use crate::statistics;

/// Least squares of some channels of a recording, tolerances included.
pub(crate) struct Beside {
    channels: Vec<usize>,
    /// Measured minus model in all channels, and its square in the selected ones.
    target: Vec<Vec<f64>>,
    square: f64,
    tolerances: Vec<Column>,
    /// Inner products of the tolerances with each other, priors included, and with the target.
    products: DMatrix<f64>,
    against: DVector<f64>,
}

impl Beside {
    /// The fit uses those of `all` channels whose kind is `among` the given ones, and the `nuisances` of the recording. The channels have these `noises`.
    pub fn new(
        all: &[Channel],
        noises: &Noises,
        nuisances: &[Nuisance],
        among: impl Fn(Kind) -> bool,
    ) -> Self {
        let channels: Vec<usize> = (0..all.len()).filter(|&c| among(all[c].kind)).collect();
        let target: Vec<Vec<f64>> = all.iter().map(Channel::residual).collect();
        let shows = |nuisance: &&Nuisance| channels.iter().any(|&c| nuisance.answer[c].is_some());
        let tolerances: Vec<Column> =
            nuisances.iter().filter(shows).map(|nuisance| nuisance.answer.clone()).collect();
        // Each tolerance has a standard deviation of one, in units of the noise.
        let noise = channels.iter().map(|&c| noises.channels[c].deviation.powi(2)).sum::<f64>()
            / channels.len().max(1) as f64;
        let n = tolerances.len();
        let square = channels.iter().map(|&c| square(&target[c])).sum();
        let mut all = Self {
            square,
            products: DMatrix::from_diagonal_element(n, n, noise),
            against: DVector::zeros(n),
            channels,
            target,
            tolerances,
        };
        for &channel in &all.channels {
            all.products += gram_of(&all.tolerances, channel);
            all.against += against(&all.tolerances, &all.target, channel);
        }
        all
    }

    /// Residual squares of `terms` with their best coefficients.
    pub fn residual_squares(&self, terms: &[(Term, Answer)]) -> f64 {
        self.fit(&columns_of(terms)).0
    }

    /// The Gauss-Newton step in multiples of two nudges, from the columns of a law's only term `here` and after each nudge; see
    /// [`crate::signals::initial_state::within`].
    pub fn step(&self, here: &[(Term, Answer)], nudged: [&Vec<(Term, Answer)>; 2]) -> Option<[f64; 2]> {
        let mut columns = columns_of(here);
        columns.truncate(1);
        for there in nudged {
            let more = columns_of(there).into_iter().next()?.into_iter().zip(&columns[0]);
            columns.push(more.map(|(there, here)| difference(there, here.as_deref())).collect());
        }
        let (_, found) = self.fit(&columns);
        let found = found.filter(|found| found[0] != 0.0)?;
        Some([found[1] / found[0], found[2] / found[0]])
    }

    /// Residual squares of `columns` with their best coefficients, and these coefficients, if there are any.
    fn fit(&self, columns: &[Column]) -> (f64, Option<Vec<f64>>) {
        let (n, more) = (self.tolerances.len(), columns.len());
        let (mut products, mut right) = (DMatrix::zeros(n + more, n + more), DVector::zeros(n + more));
        products.view_mut((0, 0), (n, n)).copy_from(&self.products);
        right.rows_mut(0, n).copy_from(&self.against);
        for &channel in &self.channels {
            let across = gram(&self.tolerances, columns, channel);
            let mut corner = products.view_mut((0, n), (n, more));
            corner += &across;
            let mut corner = products.view_mut((n, 0), (more, n));
            corner += across.transpose();
            let mut corner = products.view_mut((n, n), (more, more));
            corner += gram_of(columns, channel);
            let mut rows = right.rows_mut(n, more);
            rows += against(columns, &self.target, channel);
        }
        match Cholesky::new(products) {
            None => (self.square, None),
            Some(factor) => {
                let found = factor.solve(&right);
                (self.square - right.dot(&found), Some(found.as_slice()[n..].to_vec()))
            }
        }
    }
}

/// The columns of `terms`.
fn columns_of(terms: &[(Term, Answer)]) -> Vec<Column> {
    terms.iter().map(|(_, answer)| answer.clone()).collect()
}

/// `there` minus `here`.
fn difference(there: Option<Vec<f64>>, here: Option<&[f64]>) -> Option<Vec<f64>> {
    match (there, here) {
        (Some(there), Some(here)) => Some(statistics::difference(&there, here)),
        (Some(there), None) => Some(there),
        (None, Some(here)) => Some(here.iter().map(|here| -here).collect()),
        (None, None) => None,
    }
}
