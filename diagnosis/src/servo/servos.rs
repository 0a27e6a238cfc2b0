//! Servos of which nothing is known before.

use freeplay_servo::{ServoArm, Unknown, servos as begin_with, unknowns};

use super::alone::alone;
use super::burdens::add_burden;
use super::limits::add_limits;
use super::recorded::{Found, Recorded, is_same};
use super::rotors::add_rotors;

/// Fits the servos of all joints that move, and all else that the recordings tell.
pub fn servos(recorded: &Recorded, progress: &mut dyn FnMut(&str)) -> Found {
    let Recorded { file, tracks, sights, moves, tolerances, .. } = recorded;
    let first = ServoArm::new(file.arm.clone(), begin_with(&file.arm, sights, &vec![0.0; moves.len()]));
    let all: Vec<Unknown> = unknowns(sights, &first, tolerances.zero);
    let all: Vec<Unknown> = all.into_iter().filter(|unknown| moves[unknown.joint]).collect();
    progress("fitting the servo of each joint on its own");
    let alone = alone(recorded, &first, &all);
    let first = ServoArm::new(file.arm.clone(), alone.iter().map(|one| one.servo).collect());
    let mut believed: Vec<Unknown> = alone.into_iter().flat_map(|one| one.unknowns).collect();
    let is_left = |unknown: &&Unknown| !believed.iter().any(|one| one.is_same(unknown));
    let rotors: Vec<Unknown> = all.iter().filter(is_left).copied().collect();
    let [fit, choice] = recorded.fit_and_choice(tracks, &first);
    let fitted = fit.fit(&first, &believed, &mut |step, _| {
        progress(&format!("fitting the servos by simulating the recordings, step {step}"));
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
