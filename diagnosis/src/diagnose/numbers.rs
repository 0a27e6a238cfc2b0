//! Parameters of what was named, and how sure they are.

use std::collections::BTreeMap;

use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use toml::{Table, Value};

use super::hypothesis::hypothesis;
use super::noise::normal;
use super::report::Parameter;
use super::search::Search;

/// Steps of the logarithm of a shape's number between which the curvature of the likelihood is taken.
const STEPS: [f64; 4] = [-0.1, -0.05, 0.05, 0.1];
/// Greatest standard deviation of that logarithm: beyond, the motion does not tell the number.
const VAGUE: f64 = 1.0;

/// How sure a number of a shape is.
struct Loose {
    /// Its name.
    name: String,
    /// Standard deviation of its logarithm.
    deviation: f64,
    /// By how much the coefficients of the terms change with that logarithm.
    pull: DVector<f64>,
}

/// How sure the numbers in the shape of the effect number `index` are, by the curvature of the profile of the likelihood (Venzon & Moolgavkar 1988);
/// nothing of numbers that the motion does not tell.
fn loose(search: &Search, index: usize) -> Vec<Loose> {
    let named = search.named(index);
    let Some(fit) = search.system.fit(&search.active(Some(index))) else { return Vec::new() };
    let score_at = |name: &str, value: f64| {
        let mut shape = named.shape.clone();
        shape.insert(name.to_owned(), Value::Float(value));
        let other = hypothesis(search.case, &search.system, named.kind, named.joint, shape).ok()??;
        let score = search.system.exact_score(&fit, &other.block)?;
        (score.beta.len() == named.size()).then_some(score)
    };
    let Some(best) = search.system.exact_score(&fit, &named.block) else { return Vec::new() };
    let loose = |(name, value): (&String, &Value)| {
        let value = value.as_float().filter(|value| *value != 0.0 && named.kind.refines(name))?;
        // The gain falls by (step/deviation)².
        let (mut over, mut under, mut square) = (0.0, 0.0, 0.0);
        let mut pull = DVector::zeros(named.size());
        for step in STEPS {
            let Some(score) = score_at(name, value * step.exp()) else { continue };
            over += step.powi(4);
            under += (best.gain - score.gain) * step.powi(2);
            square += step.powi(2);
            pull += step * (score.beta - &best.beta);
        }
        let deviation = (over / under).sqrt();
        deviation.is_finite().then(|| Loose {
            name: name.clone(),
            deviation: deviation.min(VAGUE),
            pull: pull / square,
        })
    };
    named.shape.iter().filter_map(loose).collect()
}

/// `draws` about `value`, spread at least as wide as `deviation`.
pub(crate) fn widened(draws: &[f64], value: f64, deviation: f64) -> Vec<f64> {
    let count = draws.len().max(1) as f64;
    let mean = draws.iter().sum::<f64>() / count;
    let spread = (draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
    let wider = if spread > 0.0 { (deviation / spread).max(1.0) } else { 1.0 };
    draws.iter().map(|x| value + wider * (x - mean)).collect()
}

/// The parameters in `table` of the effect number `index`, with intervals by the draws `spread` of the coefficients and by how sure
/// its shape is.
pub(crate) fn parameters(
    search: &Search,
    index: usize,
    table: &Table,
    spread: &[Vec<f64>],
    seed: u64,
) -> BTreeMap<String, Parameter> {
    let named = search.named(index);
    let joint = named.joint.map(|joint| &search.case.stages[0].arm().joints()[joint]);
    let count = spread.first().map_or(0, Vec::len);
    let loose = loose(search, index);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drawn: Vec<Table> = (0..count)
        .map(|k| {
            let mut beta = DVector::from_iterator(spread.len(), spread.iter().map(|column| column[k]));
            let mut shape = named.shape.clone();
            for number in &loose {
                let by = number.deviation * normal(&mut rng);
                if let Some(Value::Float(value)) = shape.get_mut(&number.name) {
                    *value *= by.exp();
                }
                beta.axpy(by, &number.pull, 1.0);
            }
            named.compose(&shape, beta.as_slice())
        })
        .collect();
    let interval = |name: &str| {
        let mut values: Vec<f64> =
            drawn.iter().filter_map(|table| table.get(name).and_then(Value::as_float)).collect();
        values.sort_by(f64::total_cmp);
        let (first, last) = (values.first()?, values.last()?);
        (first < last).then(|| [values[values.len() / 40], values[values.len() - 1 - values.len() / 40]])
    };
    table
        .iter()
        .map(|(name, value)| {
            let parameter = Parameter {
                value: value.clone(),
                unit: named.kind.unit(name, joint).to_owned(),
                ci95: interval(name).filter(|_| !named.kind.takes_as_given(name)),
            };
            (name.clone(), parameter)
        })
        .collect()
}
