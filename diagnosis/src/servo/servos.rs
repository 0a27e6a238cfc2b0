//! Servos of which nothing is known before.

use freeplay_servo::{Unknown, first_model, unknowns};

use super::burdens::add_burden;
use super::limits::add_limits;
use super::parts::{WINDOW, problem};
use super::recorded::{Found, Recorded, is_same};
use super::rotors::{add_rotors, without_rotors};

/// Fits the servos of all joints that move, and all else that the recordings tell.
pub fn servos(recorded: &Recorded, progress: &mut dyn FnMut(&str)) -> Found {
    let Recorded { file, tracks, parts, sights, moves, tolerances } = recorded;
    let fit = problem(tracks, &parts.fit, sights, WINDOW);
    let first = first_model(&file.arm, &fit).0;
    let all: Vec<Unknown> = unknowns(sights, &first, tolerances.zero);
    let (mut believed, rotors) =
        without_rotors(all.into_iter().filter(|unknown| moves[unknown.joint]).collect(), &first);
    let begun = fit.begin(&first, &believed, &mut |step, _| {
        progress(&format!("fitting the servos to a few of the windows, step {step}"));
    });
    let [fit, choice] = recorded.fit_and_choice(tracks, &begun.model);
    let fitted = fit.fit(&begun.model, &believed, &mut |step, _| {
        progress(&format!("fitting the servos by simulating the recordings, step {step}"));
    });
    progress("asking whether other frictions and delays are nearer");
    let fitted = fit.leap(fitted, &believed, &mut |step, _| {
        progress(&format!("fitting the servos from other frictions and delays, step {step}"));
    });
    // What a rotor or a limit explains is no contact.
    let fitted = add_rotors([&fit, &choice], &rotors, &mut believed, fitted, progress);
    progress("asking whether a servo has limits");
    let mut fitted = add_limits([&fit, &choice], sights, &mut believed, fitted, progress);
    drop((fit, choice));
    progress("looking for contacts and stops");
    // What happened to the arm is no servo's: the fit goes on without it.
    let undisturbed = recorded.undisturbed(recorded.events(&fitted, &believed));
    let [fit, choice] = recorded.fit_and_choice(&undisturbed, &fitted.model);
    let is_disturbed = !is_same(&undisturbed, tracks);
    if is_disturbed {
        fitted = fit.fit(&fitted.model, &believed, &mut |step, _| {
            progress(&format!("fitting the servos without contacts and stops, step {step}"));
        });
        fitted = fit.leap(fitted, &believed, &mut |step, _| {
            progress(&format!("fitting the servos from other frictions and delays, step {step}"));
        });
    }
    progress("asking whether the arm carries more, or stands otherwise, than its model says");
    let (fitted, burdened) = add_burden([&fit, &choice], file, tolerances, &mut believed, fitted, progress);
    // Asked again where what is fitted is not the same any more.
    let fitted = if is_disturbed || burdened.is_some() {
        let left: Vec<Unknown> = rotors.into_iter().filter(|rotor| !believed.contains(rotor)).collect();
        let fitted = add_rotors([&fit, &choice], &left, &mut believed, fitted, progress);
        add_limits([&fit, &choice], sights, &mut believed, fitted, progress)
    } else {
        fitted
    };
    drop((fit, choice));
    let burdened = burdened.into_iter().collect();
    Found { fitted, unknowns: believed, burdened, changes: None, undisturbed }
}
