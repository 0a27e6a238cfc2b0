//! Inertia of rotors: asked for when all else is known, as what stiffness, damping and delay miss of each other while they are off looks like inertia.

use freeplay_servo::{Fitted, Problem, Unknown};

use super::findings::named_from;
use super::limits::lost;

/// Adds to `fitted` each of `rotors` that the fit part would gain by as much as a name needs, if the choice part gains by them. The `unknowns` grow with them.
pub fn add_rotors(
    [fit, choice]: [&Problem; 2],
    rotors: &[Unknown],
    unknowns: &mut Vec<Unknown>,
    fitted: Fitted,
    progress: &mut dyn FnMut(&str),
) -> Fitted {
    let scores = fit.scores(&fitted, unknowns, rotors);
    let least = named_from(fitted.model.joints.len());
    let added = rotors.iter().zip(scores).filter(|(_, score)| *score > least).map(|(rotor, _)| *rotor);
    let all: Vec<Unknown> = unknowns.iter().copied().chain(added).collect();
    if all.len() == unknowns.len() {
        return fitted;
    }
    let with = fit.fit(&fitted.model, &all, &mut |step, _| {
        progress(&format!("fitting the servos and the inertia of rotors, step {step}"));
    });
    if lost(choice, &with.model, &fitted.noise) >= lost(choice, &fitted.model, &fitted.noise) {
        return fitted;
    }
    *unknowns = all;
    with
}
