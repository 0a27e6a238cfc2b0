//! Servos without a given model.

use freeplay_servo::{Fitted, Problem, ServoArm, Track, Unknown, servos as begin_with, unknowns};

use super::alone::fitted_alone;
use super::burdens::add_burden;
use super::limits::add_limits;
use super::recorded::{Found, Recorded, is_same};
use super::rotors::add_rotors;

/// Fits the servos of all moving joints, and all other identifiable parameters.
pub fn servos(recorded: &Recorded, progress: &mut dyn FnMut(&str)) -> Found {
    let Recorded { file, sights, moves, tolerances, .. } = *recorded;
    let first = ServoArm::new(file.arm.clone(), begin_with(&file.arm, sights, &vec![0.0; moves.len()]));
    let all: Vec<Unknown> = unknowns(sights, &first, tolerances.zero);
    let all: Vec<Unknown> = all.into_iter().filter(|unknown| moves[unknown.joint]).collect();
    progress("fitting the servo of each joint on its own");
    let alone = fitted_alone(recorded, &first, &all);
    let first = ServoArm::new(file.arm.clone(), alone.iter().map(|one| one.servo).collect());
    let believed: Vec<Unknown> = alone.into_iter().flat_map(|one| one.unknowns).collect();
    let mut joints = Joints { recorded, all, believed };
    let (fitted, undisturbed) = joints.fit(&first, progress);
    progress("testing for a payload or a base tilt that the model lacks");
    let [fit, choice] = recorded.fit_and_choice(&undisturbed, &fitted.model);
    let (fitted, burdened) =
        add_burden([&fit, &choice], file, tolerances, &mut joints.believed, fitted, progress);
    drop((fit, choice));
    // While the burden was unknown, it may have looked like contacts and stops.
    let (fitted, undisturbed) = match burdened {
        Some(_) => joints.fit(&fitted.model, progress),
        None => (fitted, undisturbed),
    };
    let burdened = burdened.into_iter().collect();
    Found { fitted, unknowns: joints.believed, burdened, changes: None, undisturbed }
}

/// The fit of all joints together.
struct Joints<'a> {
    recorded: &'a Recorded<'a>,
    /// Possible unknowns.
    all: Vec<Unknown>,
    /// Fitted unknowns.
    believed: Vec<Unknown>,
}

impl Joints<'_> {
    /// Fits the model, starting from `begun`, to the recordings without the rows of events: no servo explains these. Also returns these recordings.
    fn fit(&mut self, begun: &ServoArm, progress: &mut dyn FnMut(&str)) -> (Fitted, Vec<Track>) {
        // Rotors and limits come first: without them, the search would take their deviations for contacts.
        let fitted = self.fit_to(self.recorded.tracks, begun, progress);
        progress("looking for contacts and stops");
        let undisturbed = self.recorded.undisturbed(self.recorded.events(&fitted, &self.believed));
        if is_same(&undisturbed, self.recorded.tracks) {
            return (fitted, undisturbed);
        }
        (self.fit_to(&undisturbed, &fitted.model, progress), undisturbed)
    }

    /// Fits the model to `tracks`, with the rotors and limits for which there is evidence.
    fn fit_to(&mut self, tracks: &[Track], begun: &ServoArm, progress: &mut dyn FnMut(&str)) -> Fitted {
        let [fit, choice]: [Problem; 2] = self.recorded.fit_and_choice(tracks, begun);
        let fitted = fit.fit(begun, &self.believed, &mut |step, _| {
            progress(&format!("fitting the servos by simulating the recordings, step {step}"));
        });
        let is_left = |unknown: &&Unknown| !self.believed.iter().any(|one| one.is_same(unknown));
        let rotors: Vec<Unknown> = self.all.iter().filter(is_left).copied().collect();
        let fitted = add_rotors([&fit, &choice], &rotors, &mut self.believed, fitted, progress);
        progress("testing whether a servo has limits");
        add_limits([&fit, &choice], self.recorded.sights, &mut self.believed, fitted, progress)
    }
}
