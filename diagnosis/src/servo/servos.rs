//! Servos of which nothing is known before.

use freeplay_servo::{Unknown, first_model, unknowns};

use super::burdens::add_burden;
use super::limits::add_limits;
use super::parts::{WINDOW, problem};
use super::recorded::{Found, Recorded, is_same};
use super::rotors::{add_rotors, without_rotors};

/// Rounds in which a fit and the contacts and stops that it leaves out agree: the first fit knows none, the second those that it could not bend to.
const ROUNDS: usize = 2;

/// Fits the servos of all joints that move, and all else that the recordings tell.
pub fn servos(recorded: &Recorded, progress: &mut dyn FnMut(&str)) -> Found {
    let Recorded { file, tracks, parts, sights, moves, tolerances } = recorded;
    let fit = problem(tracks, &parts.fit, sights, WINDOW);
    let first = first_model(&file.arm, &fit).0;
    let all: Vec<Unknown> = unknowns(sights, &first, tolerances.zero);
    let (mut believed, rotors) =
        without_rotors(all.into_iter().filter(|unknown| moves[unknown.joint]).collect(), &first);
    let mut fitted = fit.begin(&first, &believed, &mut |step, _| {
        progress(&format!("fitting the servos to a few of the windows, step {step}"));
    });
    // What happened to the arm is no servo's: the fit goes on without it.
    let mut undisturbed = tracks.to_vec();
    for round in 1..=ROUNDS {
        progress("looking for contacts and stops");
        let others = recorded.undisturbed(&fitted, &believed);
        if round > 1 && is_same(&others, &undisturbed) {
            break;
        }
        undisturbed = others;
        let of_fit = problem(&undisturbed, &parts.fit, sights, WINDOW).forgetting(&fitted.model);
        fitted = of_fit.fit(&fitted.model, &believed, &mut |step, _| {
            progress(&format!("fitting the servos by simulating the recordings, step {round}.{step}"));
        });
    }
    let [fit, choice] = recorded.fit_and_choice(&undisturbed, &fitted.model);
    progress("asking whether other frictions and delays are nearer");
    let fitted = fit.leap(fitted, &believed, &mut |step, _| {
        progress(&format!("fitting the servos from other frictions and delays, step {step}"));
    });
    progress("asking whether the arm carries more, or stands otherwise, than its model says");
    let (fitted, burdened) = add_burden([&fit, &choice], file, tolerances, &mut believed, fitted, progress);
    let fitted = add_rotors([&fit, &choice], &rotors, &mut believed, fitted, progress);
    progress("asking whether a servo has limits");
    let fitted = add_limits([&fit, &choice], sights, &mut believed, fitted, progress);
    drop((fit, choice));
    let burdened = burdened.into_iter().collect();
    Found { fitted, unknowns: believed, burdened, changes: None, undisturbed }
}
