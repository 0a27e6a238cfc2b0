//! Inertia of rotors, tested when all other parameters are fitted: while stiffness, damping and delay are wrong, their errors look like inertia.

use freeplay_servo::{Fitted, Problem, Unknown};

use super::findings::named_from;
use super::limits::lost;

/// Adds those of `rotors` to `fitted` from which the fit part gains enough for a name, if the choice part gains, too: one after the other, the most promising
/// for the fit part first. The function appends their `unknowns`.
pub fn add_rotors(
    [fit, choice]: [&Problem; 2],
    rotors: &[Unknown],
    unknowns: &mut Vec<Unknown>,
    mut fitted: Fitted,
    progress: &mut dyn FnMut(&str),
) -> Fitted {
    let least = named_from(fitted.model.joints.len());
    let mut rotors = rotors.to_vec();
    while !rotors.is_empty() {
        let scores = fit.scores(&fitted, unknowns, &rotors);
        let best = scores.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let Some((at, _)) = best.filter(|(_, score)| **score > least) else { break };
        let all: Vec<Unknown> = unknowns.iter().copied().chain([rotors.swap_remove(at)]).collect();
        let with = fit.fit(&fitted.model, &all, &mut |step, _| {
            progress(&format!("fitting the servos and the inertia of a rotor, step {step}"));
        });
        if lost(choice, &with.model, &fitted.noise) < lost(choice, &fitted.model, &fitted.noise) {
            (fitted, *unknowns) = (with, all);
        }
    }
    fitted
}
