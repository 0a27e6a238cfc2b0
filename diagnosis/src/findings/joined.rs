//! A finding of a kind that the given model already has at the same place: one effect replaces both.
//!
//! The joint contribution of both is known: that of the model with the finding after it. The parameters of the one effect reproduce it in the recorded motion,
//! by Gauss-Newton least squares over the coefficients of the law's terms, with the nonlinear parameters of either effect. Friction adds up, the masses of a
//! link multiply, springs in series add their compliances: no law needs a rule of its own.

use freeplay_laws::{LawError, Placed};
use freeplay_model::EffectTable;
use nalgebra::{DMatrix, DVector};
use toml::Table;

use crate::candidates::candidate::Candidate;
use crate::data::columns::{dot, less};
use crate::data::stacked::Data;
use crate::statistics::{MOST_ROUNDS, difference};

/// Step of a coefficient for a derivative, as a share of it, or in steps of its term if it is zero: laws are nearly linear in their coefficients, and the
/// change is far above rounding.
const NUDGE: f64 = 1e-3;

/// The table with the joint contribution of `given` and of `candidate` with the `coefficients` of its shown terms; `None` if no table reproduces nine tenths of
/// it, for instance because a machine can't have both.
pub(crate) fn joined(
    data: &Data,
    given: &EffectTable,
    candidate: &Candidate,
    coefficients: &[f64],
) -> Option<EffectTable> {
    candidate.placed(data.arm(), coefficients)?;
    let both =
        data.residual_with(|_| candidate.placed(data.arm(), coefficients).into_iter().collect()).ok()?;
    let neither = residual_replacing(data, given, None).ok()?;
    let whole: Vec<f64> = weighed(data, &less(&neither, &both));
    let of_given: Table = candidate
        .form
        .shape
        .iter()
        .map(|(name, value)| (name.clone(), given.parameters.get(name).unwrap_or(value).clone()))
        .collect();
    let start = candidate.all_coefficients(coefficients);
    let tried = [candidate.form.shape.clone(), of_given].into_iter().filter_map(|shape| {
        let table = |x: &[f64]| EffectTable {
            parameters: candidate.kind.compose(&shape, x),
            ..candidate.table(data.arm(), coefficients)
        };
        let said = |x: &[f64]| -> Option<Vec<f64>> {
            let placed = Placed::new(&table(x), data.arm()).ok()?;
            Some(weighed(data, &less(&neither, &residual_replacing(data, given, Some(&placed)).ok()?)))
        };
        let x = solved(&said, &whole, start.clone(), &scales(candidate))?;
        Some((squared_distance(&said(&x)?, &whole), table(&x)))
    });
    let (squared_distance, table) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (squared_distance < 0.01 * dot(&whole, &whole)).then_some(table)
}

/// One step of each coefficient, in its own unit.
fn scales(candidate: &Candidate) -> Vec<f64> {
    let mut scales =
        candidate.all_coefficients(&candidate.terms.iter().map(|term| 1.0 / term.weight).collect::<Vec<_>>());
    scales.iter_mut().filter(|scale| **scale == 0.0).for_each(|scale| *scale = 1.0);
    scales
}

/// The coefficients, starting from `x`, whose contribution is nearest to `whole`.
fn solved(
    said: &dyn Fn(&[f64]) -> Option<Vec<f64>>,
    whole: &[f64],
    mut x: Vec<f64>,
    scales: &[f64],
) -> Option<Vec<f64>> {
    for _ in 0..MOST_ROUNDS {
        let here = said(&x)?;
        let mut columns = Vec::with_capacity(x.len());
        for (k, scale) in scales.iter().enumerate() {
            let step = NUDGE * if x[k] == 0.0 { *scale } else { x[k].abs() };
            let mut nudged = x.clone();
            nudged[k] += step;
            let there = said(&nudged)?;
            columns.push(
                there.iter().zip(&here).map(|(there, here)| (there - here) / step).collect::<Vec<f64>>(),
            );
        }
        let missing = difference(whole, &here);
        let n = x.len();
        let mut normal = DMatrix::from_fn(n, n, |i, j| dot(&columns[i], &columns[j]));
        // A term that does not act in this motion keeps its coefficient.
        (0..n).for_each(|k| normal[(k, k)] = normal[(k, k)] * (1.0 + 1e-12) + f64::MIN_POSITIVE);
        let right = DVector::from_fn(n, |k, _| dot(&columns[k], &missing));
        let step = normal.cholesky()?.solve(&right);
        x.iter_mut().zip(step.iter()).for_each(|(x, step)| *x += step);
        if x.iter().zip(step.iter()).all(|(x, step)| step.abs() <= f64::EPSILON.sqrt() * x.abs()) {
            break;
        }
    }
    Some(x)
}

/// Measured minus the model that has `instead` in place of `given`.
fn residual_replacing(
    data: &Data,
    given: &EffectTable,
    instead: Option<&Placed>,
) -> Result<Vec<Vec<f64>>, LawError> {
    let joint = given.joint.as_ref().and_then(|name| data.arm().joint_index(name));
    let is_given = |placed: &Placed| placed.kind.name == given.kind && placed.joint == joint;
    let mut residual = Vec::new();
    for recording in &data.recordings {
        residual.extend(recording.residual_replacing(&is_given, instead)?);
    }
    for (channel, rows) in residual.iter_mut().enumerate() {
        data.apply_mask(channel, rows);
    }
    Ok(residual)
}

/// All rows in one column, each channel divided by its own size, so that torques and poses have equal weight.
fn weighed(data: &Data, rows: &[Vec<f64>]) -> Vec<f64> {
    let of_channel = |(c, rows): (usize, &Vec<f64>)| {
        let (recording, channel) = data.place(c);
        let measured = &data.recordings[recording].channels[channel].measured;
        let size = dot(measured, measured).sqrt().max(f64::MIN_POSITIVE);
        rows.iter().map(move |x| x / size).collect::<Vec<f64>>()
    };
    rows.iter().enumerate().flat_map(of_channel).collect()
}

/// Squared distance of two columns.
fn squared_distance(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum()
}
