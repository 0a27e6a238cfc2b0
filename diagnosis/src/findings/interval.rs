//! Parameters of the findings and their uncertainty: the posterior of the coefficients, and the profile of the evidence over the nonlinear parameters.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use toml::{Table, Value};

use crate::data::columns::sum_of;
use crate::evidence::parabola::Parabola;
use crate::evidence::system::{Fit, System};
use crate::random::normal;
use crate::report::diagnosis::Parameter;
use crate::search::moves::STEPS;
use crate::sorting::sort;
use crate::statistics::{DRAWS, SIGNIFICANT, TURNS};

/// Greatest standard deviation, as [`Candidate::moved`] counts: beyond it, the motion does not determine the parameter.
const VAGUE: f64 = 1.0;

/// Uncertainty of a nonlinear parameter.
struct Loose {
    /// Its name.
    name: String,
    /// Its standard deviation, as [`Candidate::moved`] counts.
    deviation: f64,
    /// Change of the coefficients per unit of it.
    pull: DVector<f64>,
}

/// The estimated parameters of a law, and whether the law may have no effect.
pub(crate) struct Estimate {
    /// The parameters by name, with intervals of 95 %.
    pub parameters: BTreeMap<String, Parameter>,
    /// True if the region that holds all coefficients with a probability of 95 % includes zero, which means that the law has no effect. The tolerance of
    /// a link's mass can hide a payload's mass whose first moments are certain, so one coefficient alone tells nothing.
    pub includes_zero: bool,
}

/// The estimate of each member of `fit`.
pub(crate) fn estimates(system: &mut System, fit: &Fit, seed: u64) -> Vec<Estimate> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let factor = Cholesky::new(covariance(system, fit)).map(|factor| factor.l());
    let draws: Vec<DVector<f64>> = (0..DRAWS)
        .map(|_| {
            let white = DVector::from_fn(fit.beta.len(), |_, _| normal(&mut rng));
            factor.as_ref().map_or_else(|| fit.beta.clone(), |lower| &fit.beta + lower * white)
        })
        .collect();
    let mut at = 0;
    let mut all = Vec::new();
    for place in 0..fit.members.len() {
        let size = system.candidate(fit.members[place]).size();
        let own: Vec<DVector<f64>> = draws.iter().map(|draw| draw.rows(at, size).into_owned()).collect();
        all.push(estimate(system, fit, place, own, &mut rng));
        at += size;
    }
    all
}

/// The estimate of member number `place` of `fit`; `draws` holds samples of its coefficients for given nonlinear parameters.
fn estimate(
    system: &mut System,
    fit: &Fit,
    place: usize,
    mut draws: Vec<DVector<f64>>,
    rng: &mut ChaCha8Rng,
) -> Estimate {
    let loose = loose(system, fit, place);
    let candidate = system.candidate(fit.members[place]);
    let limits = candidate.limits();
    let moves: Vec<Vec<(&str, f64)>> = draws
        .iter_mut()
        .map(|beta| {
            let mut along = Vec::new();
            for number in &loose {
                let by = number.deviation * normal(rng);
                along.push((number.name.as_str(), by));
                beta.axpy(by, &number.pull, 1.0);
            }
            along
        })
        .collect();
    let includes_zero = includes_zero(system.coefficients(fit, place), &draws);
    let drawn: Vec<Table> = draws
        .into_iter()
        .zip(&moves)
        .map(|(mut beta, along)| {
            let form = candidate.moved(system.data, along, 1.0);
            beta.iter_mut().zip(&limits).for_each(|(x, [least, most])| *x = x.clamp(*least, *most));
            candidate.kind.compose(&form.shape, &candidate.all_coefficients(beta.as_slice()))
        })
        .collect();
    let interval = |name: &str| {
        let mut values: Vec<f64> =
            drawn.iter().filter_map(|table| table.get(name).and_then(Value::as_float)).collect();
        sort(&mut values);
        let (first, last) = (values.first()?, values.last()?);
        (first < last).then(|| [values[values.len() / 40], values[values.len() - 1 - values.len() / 40]])
    };
    let joint = candidate.joint.map(|joint| &system.data.arm().joints()[joint]);
    let table = candidate.parameters(system.coefficients(fit, place));
    let parameter = |(name, value): (&String, &Value)| {
        let parameter = Parameter {
            value: value.clone(),
            unit: candidate.kind.unit(name, joint).to_owned(),
            ci95: interval(name).filter(|_| !candidate.kind.takes_as_given(name)),
        };
        (name.clone(), parameter)
    };
    Estimate { parameters: table.iter().map(parameter).collect(), includes_zero }
}

/// Returns true if at least 5 % of `draws` around `mean` are farther from it than zero is, measured in their own covariance (Mahalanobis 1936).
fn includes_zero(mean: &[f64], draws: &[DVector<f64>]) -> bool {
    let mean = DVector::from_column_slice(mean);
    let mut covariance = DMatrix::zeros(mean.len(), mean.len());
    for draw in draws {
        let off = draw - &mean;
        covariance.ger(1.0 / draws.len() as f64, &off, &off, 1.0);
    }
    let Some(factor) = Cholesky::new(covariance) else { return false };
    let distance = |off: &DVector<f64>| off.dot(&factor.solve(off));
    let to_zero = distance(&mean);
    let farther = draws.iter().filter(|draw| distance(&(*draw - &mean)) > to_zero).count();
    farther as f64 >= SIGNIFICANT * draws.len() as f64
}

/// Uncertainty of the nonlinear parameters of member number `place`, from the curvature of the profile of the evidence (Venzon & Moolgavkar 1988, Appl. Stat.
/// 37:87); without the parameters that the motion does not determine.
fn loose(system: &mut System, fit: &Fit, place: usize) -> Vec<Loose> {
    let member = fit.members[place];
    let mut others = fit.members.clone();
    others.remove(place);
    let Some(without) = system.fit(&others) else { return Vec::new() };
    let Some(best) = system.gains(&without, &[member]).pop().flatten() else { return Vec::new() };
    let mut all = Vec::new();
    for name in system.candidate(member).numbers() {
        let mut step = STEPS[STEPS.len() - 1];
        let mut found = None;
        // The distance becomes the standard deviation itself: a parabola needs one turn, a cusp, as at the end of an event, some more.
        for _ in 0..TURNS {
            let mut gain = |step: f64| {
                let form = system.candidate(member).moved(system.data, &[(&name, 1.0)], step);
                let at = system.take(system.candidate(member).reformed(system.data, form)?)?;
                let gain = system.gains(&without, &[at]).pop().flatten();
                system.forget(at);
                gain
            };
            let (Some(under), Some(over)) = (gain(-step), gain(step)) else { break };
            let parabola = Parabola::new([under.value, best.value, over.value], step);
            let deviation = parabola.map(|parabola| parabola.deviation().min(VAGUE));
            found = deviation.map(|deviation| (deviation, (over.beta - under.beta) / (2.0 * step))).or(found);
            step = deviation.unwrap_or(VAGUE);
        }
        all.extend(found.map(|(deviation, pull)| Loose { name, deviation, pull }));
    }
    all
}

/// The covariance of the coefficients of `fit`. It is that of the posterior, or the block-wise sandwich where blocks of neighbouring rows scatter the
/// coefficients more (Huber 1967; White 1982, Econometrica 50:1): errors of a law persist over neighbouring rows. The function adds the part that tolerances
/// hide: with a nominal friction of 10 ± 5 %, a friction of 15 is not known better than to 0.5. It also adds the part that no row shows: see [`coherent`].
fn covariance(system: &mut System, fit: &Fit) -> DMatrix<f64> {
    let n = fit.beta.len();
    let tangents = tangents(system, fit);
    let along = system.fit(&tangents).and_then(|along| Cholesky::new(along.normal));
    let Some(factor) = along else { return DMatrix::identity(n, n) };
    let posterior = factor.inverse();
    let mut scores = DMatrix::zeros(n, n);
    for pull in system.block_scores(&tangents, &system.residual(fit)) {
        scores += &pull * pull.transpose();
    }
    let sandwich = &posterior * scores * &posterior;
    // Each coefficient takes the larger of the two deviations; the correlation stays.
    let wider = DVector::from_fn(n, |k, _| (sandwich[(k, k)] / posterior[(k, k)]).max(1.0).sqrt());
    let hidden = system.hidden_by_tolerances(&tangents).unwrap_or_else(|| DMatrix::zeros(n, n));
    let coherent = coherent(system, fit);
    DMatrix::from_fn(n, n, |i, j| posterior[(i, j)] * wider[i] * wider[j] + hidden[(i, j)] + coherent[(i, j)])
}

/// The members of `fit`, each law that is linearised along a chord with its tangent at the fitted coefficient in its place: a chord is right for the value of a
/// law, and its slope at the coefficient is right for the uncertainty.
fn tangents(system: &mut System, fit: &Fit) -> Vec<usize> {
    let mut at = 0;
    let mut all = Vec::new();
    for (place, &member) in fit.members.iter().enumerate() {
        let candidate = system.candidate(member);
        let tangent = match *system.coefficients(fit, place) {
            [coefficient] => candidate.tangent(system.data, coefficient, fit.normal[(at, at)].sqrt().recip()),
            _ => None,
        };
        at += candidate.size();
        all.push(tangent.and_then(|tangent| system.take(tangent)).unwrap_or(member));
    }
    all
}

/// Covariance of the coefficients of `fit` due to the discrepancy, as far as no row shows it. A law has a relative error s. The part of this error that differs
/// in shape from the law stays in the rows, and s is estimated there. The part with the shape of the law changes the coefficients, and no row shows it; the
/// function assumes that it is as large. The same holds for the shape of a law with nonlinear parameters.
fn coherent(system: &System, fit: &Fit) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(fit.beta.len(), fit.beta.len());
    let weights = system.weights.by_row();
    let mut at = 0;
    for (place, &member) in fit.members.iter().enumerate() {
        let beta = DVector::from_column_slice(system.coefficients(fit, place));
        let columns = system.candidate(member).columns.iter().zip(beta.iter().copied());
        let says = sum_of(columns, &weights);
        let (mut off, mut said) = (0.0, 0.0);
        let is_open = system.candidate(member).has_several_solutions;
        for (c, ((rows, weights), says)) in system.weights.rows.iter().zip(&weights).zip(&says).enumerate() {
            let square: f64 = weights.iter().zip(says).map(|(weight, x)| weight * x * x).sum();
            off += rows.share.powi(2) * square;
            if is_open && square > 0.0 {
                let noise = system.weights.noise[c % system.data.channels_per_recording()];
                off += weights
                    .iter()
                    .zip(rows.row_error_squares(noise))
                    .map(|(weight, off)| weight * off)
                    .sum::<f64>();
            }
            said += square;
        }
        if said > 0.0 {
            all.view_mut((at, at), (beta.len(), beta.len()))
                .copy_from(&(&beta * beta.transpose() * (off / said)));
        }
        at += beta.len();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum known to a tenth and a difference known to ten: neither coefficient alone is certain, but both are not zero.
    #[test]
    fn coefficients_are_judged_together() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut draws = |mean: [f64; 2]| -> Vec<DVector<f64>> {
            let draw = |_| {
                let (sum, difference) = (0.1 * normal(&mut rng), 10.0 * normal(&mut rng));
                DVector::from_vec(vec![mean[0] + sum + difference, mean[1] + sum - difference])
            };
            (0..DRAWS).map(draw).collect()
        };
        // The distance of 1 from zero is ten standard deviations of the sum, that of 0.1 one.
        assert!(!includes_zero(&[1.0, 1.0], &draws([1.0, 1.0])));
        assert!(includes_zero(&[0.1, 0.1], &draws([0.1, 0.1])));
    }
}
