//! What twins of the model leave, and what every kind of effect finds in them.

use std::collections::BTreeMap;

use super::case::Case;
use super::hypothesis::Hypothesis;
use super::search::Null;
use super::system::System;
use super::tolerance::Tolerances;
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
    let twins: Vec<System> = (0..count)
        .map(|k| {
            let seed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(k as u64);
            system.with_other_target(&twin(case, tolerances, seed))
        })
        .collect();
    let mut null = Null { floor: nothing.clone(), effective: nothing.clone(), gains: BTreeMap::new() };
    // Weights first from what the nuisances' priors let through, then from what a fit leaves.
    let mut weights: Option<Vec<f64>> = None;
    for _ in 0..2 {
        let (mut squares, mut effective) = (nothing.clone(), nothing.clone());
        for twin in &twins {
            let mut twin = twin.clone();
            let first = case.weigh(&twin.target).weights(&rows, &nothing);
            twin.weights = weights.clone().unwrap_or(first);
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
        weights = Some(weighing.weights(&rows, &nothing));
    }
    for mut twin in twins {
        twin.weights = weights.clone()?;
        let fit = twin.fit(&all)?;
        for hypothesis in hypotheses {
            let with_target = twin.retargeted(&hypothesis.block);
            let Some(score) = twin.score_of(&fit, &hypothesis.block, &with_target) else { continue };
            if hypothesis.is_physical(&score) {
                let greatest = null.gains.entry(hypothesis.kind.name).or_insert(0.0);
                *greatest = greatest.max(score.gain);
            }
        }
    }
    Some(null)
}
