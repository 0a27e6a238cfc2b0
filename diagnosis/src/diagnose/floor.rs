//! What twins of the model leave, and what every kind of effect finds in them.

use super::case::Case;
use super::hypothesis::Hypothesis;
use super::scores::Asked;
use super::search::{Null, Twin};
use super::show::tuned_elsewhere;
use super::system::System;
use super::tolerance::Tolerances;
use super::trial::bound;
use super::twins::twin;

/// Sends `count` twins through the pipeline of `case`; `None` if a fit is singular.
pub(crate) fn null(
    case: &Case,
    system: &System,
    hypotheses: &[Hypothesis],
    tolerances: &Tolerances,
    count: usize,
    seed: u64,
) -> Option<Null> {
    let all: Vec<usize> = (0..system.base.len()).collect();
    let rows = case.rows();
    let nothing = vec![0.0; rows.len()];
    let seed_of = |k: usize| seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(k as u64);
    let twins: Vec<System> =
        (0..count).map(|k| system.with_other_target(&twin(case, tolerances, seed_of(k)))).collect();
    let mut null = Null { floor: nothing.clone(), effective: nothing.clone(), ..Null::default() };
    // Weights first from what the nuisances' priors let through, then from what a fit leaves.
    for _ in 0..2 {
        let (mut squares, mut effective) = (nothing.clone(), nothing.clone());
        for twin in &twins {
            let mut twin = twin.clone();
            let first = case.weigh(&twin.target).weights(&rows, &nothing);
            twin.weights = if null.weights.is_empty() { first } else { null.weights.clone() };
            let residual = twin.residual(&twin.fit(&all)?);
            let weighing = case.weigh(&residual);
            for c in 0..rows.len() {
                squares[c] += weighing.deviation[c].powi(2) / count as f64;
                effective[c] += weighing.effective[c] / count as f64;
            }
        }
        null.floor = squares.iter().map(|square| square.sqrt()).collect();
        null.effective = effective;
        let weighing = super::case::Weighing {
            deviation: null.floor.clone(),
            effective: null.effective.clone(),
            misfit: nothing.clone(),
        };
        null.weights = weighing.weights(&rows, &nothing);
    }
    for (k, mut twin) in twins.into_iter().enumerate() {
        twin.weights.clone_from(&null.weights);
        let fit = twin.fit(&all)?;
        null.twins.push(Twin { seed: seed_of(k), tuned: fit.eta.as_slice().to_vec() });
        let with_target: Vec<_> =
            hypotheses.iter().map(|hypothesis| twin.retargeted(&hypothesis.block)).collect();
        let asked: Vec<Asked> =
            hypotheses.iter().map(|it| &it.block).zip(with_target.iter().map(Vec::as_slice)).collect();
        for (hypothesis, score) in hypotheses.iter().zip(twin.scores_of(&fit, &asked)) {
            let Some(score) = score else { continue };
            if hypothesis.is_physical(&score) {
                let greatest = null.gains.entry(hypothesis.kind.name).or_insert(0.0);
                *greatest = greatest.max(score.gain);
            }
        }
    }
    Some(null)
}

/// What the twins of `null` leave of the held-out recordings, by channel of a stage.
#[derive(Clone, Debug)]
pub(crate) struct HeldFloor {
    /// With the parameters that were tuned to the recordings of the fit: what tuning there leaves open counts as noise here.
    pub transferred: Vec<f64>,
    /// With the parameters tuned to the held-out recordings themselves.
    pub tuned_there: Vec<f64>,
}

impl HeldFloor {
    /// Measures the twins of `null` on `held`, whose nuisances are in `system`; those of the fit are in `fitted`. `None` if a fit is singular.
    pub fn of(
        null: &Null,
        fitted: &System,
        held: &Case,
        system: &System,
        tolerances: &Tolerances,
    ) -> Option<Self> {
        let all: Vec<usize> = (0..system.base.len()).collect();
        let weights = held.weights_as(&null.weights);
        let mut squares = [vec![0.0; held.per_stage()], vec![0.0; held.per_stage()]];
        for Twin { seed, tuned } in &null.twins {
            let mut there = system.with_other_target(&twin(held, tolerances, *seed));
            there.weights.clone_from(&weights);
            let transferred = tuned_elsewhere(held, &there, &bound(fitted, &there, tuned));
            let tuned_there = there.residual(&there.fit(&all)?);
            for (squares, rows) in squares.iter_mut().zip([transferred, tuned_there]) {
                squares.iter_mut().zip(held.rms(&rows)).for_each(|(square, rms)| *square += rms * rms);
            }
        }
        let count = null.twins.len().max(1) as f64;
        let [transferred, tuned_there] =
            squares.map(|squares| squares.iter().map(|square| (square / count).sqrt()).collect());
        Some(Self { transferred, tuned_there })
    }
}
