//! Numbers that a few stretches of the motion don't bend.
//!
//! What a named law leaves is not noise alone: a link bounces on the flank that it flew to, a friction takes its time to build up, a servo
//! shakes after an impact. Such rows are few and far off, and least squares give most to them: a gap comes out too small by what the link
//! still hovers. So each row counts w² = 1/(1 + (r/(C s))²)² with its residual r and s the channel's deviation by the median, that is
//! least Σ ρ, ρ(u) = u²/(1 + u²), starting from least squares (Geman & McClure 1985; Huber 1964 for the idea). With C = 2, noise alone makes
//! the numbers 10 % less sure than least squares do.

use super::columns::left_without;
use super::search::Search;
use super::system::{Fit, System};

/// C: a row this many deviations off counts a quarter.
const HALF: f64 = 2.0;
/// Standard deviation of a normal variable over the median of its size.
const BY_THE_MEDIAN: f64 = 1.4826;
/// Most rounds, and the greatest change of any coefficient, in standard deviations, at which they end.
const ROUNDS: usize = 10;
const SETTLED: f64 = 0.03;

/// The numbers of what was found.
pub(crate) struct Numbers {
    /// The coefficients.
    pub fit: Fit,
    /// w of every row, by channel; empty where all are one.
    rows: Vec<Vec<f64>>,
}

/// Standard deviation of the prior of where a journal begins, in nudges: half a bearing.
const ANYWHERE: f64 = 25.0;

impl Numbers {
    /// The numbers of all that `search` has chosen; by least squares if these alone are possible. `None` if a fit is singular.
    pub fn of(search: &Search) -> Option<Self> {
        let active = search.active(None);
        let least_squares = || Some(Self { fit: search.system.fit(&active)?, rows: Vec::new() });
        let mut numbers = least_squares()?;
        if search.chosen.is_empty() {
            return Some(numbers);
        }
        for _ in 0..ROUNDS {
            let rows = numbers.factors(search);
            let system = search.system.with_rows(&active, &rows);
            let fit = system.fit(&active)?;
            let moved = (&fit.eta - &numbers.fit.eta).component_div(&system.deviations(&fit));
            numbers = Self { fit, rows };
            if moved.amax() < SETTLED {
                break;
            }
        }
        if search.is_possible_with(&numbers.fit) { Some(numbers) } else { least_squares() }
    }

    /// System and fit with the places where journals begin left open, too, behind all other columns: how sure the numbers are depends on how sure these
    /// are. The same where there are none; `None` if the fit is singular.
    pub fn opened(&self, search: &Search) -> Option<(System, Fit)> {
        let mut system = search.system.clone();
        let mut active = search.active(None);
        let left = search.system.residual(&self.fit);
        for index in search.in_bearings() {
            let (named, beta) = (search.named(index), search.coefficients(&self.fit, index));
            let rest = left_without(&left, &named.block.columns, &beta);
            let slopes = named.slopes_of_start(search.case, &beta, &rest).ok()?;
            let places = system.admit(&system.block(slopes));
            places.iter().for_each(|&place| system.precision[place] = ANYWHERE.powi(-2));
            active.extend(places);
        }
        if !self.rows.is_empty() {
            system = system.with_rows(&active, &self.rows);
        }
        let fit = system.fit(&active)?;
        Some((system, fit))
    }

    /// w of every row, by channel.
    fn factors(&self, search: &Search) -> Vec<Vec<f64>> {
        let residual = search.system.residual(&self.fit);
        let channels = residual.iter().zip(&search.case.kept).zip(&search.null.floor);
        let of_channel = |((rows, kept), floor): ((&Vec<f64>, &Vec<f64>), &f64)| {
            let counted = rows.iter().zip(kept).filter(|(_, kept)| **kept > 0.0);
            let mut sizes: Vec<f64> = counted.map(|(r, _)| r.abs()).collect();
            sizes.sort_by(f64::total_cmp);
            let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
            let half = HALF * (BY_THE_MEDIAN * median).max(*floor).max(f64::MIN_POSITIVE);
            rows.iter().map(|r| 1.0 / (1.0 + (r / half).powi(2))).collect()
        };
        channels.map(of_channel).collect()
    }
}
