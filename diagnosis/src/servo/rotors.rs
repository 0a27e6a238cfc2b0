//! Inertia of rotors: asked for when all else is known, as what stiffness, damping and delay miss of each other while they are off looks like inertia.

use freeplay_servo::{Fitted, Problem, Unknown};

use super::findings::named_from;
use super::limits::lost;

/// Adds to `fitted` those of `rotors` that the fit part gains by as much as a name needs, if the choice part gains, too: one after the other, first the one that the fit part would
/// gain most by. The `unknowns` grow with them.
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
