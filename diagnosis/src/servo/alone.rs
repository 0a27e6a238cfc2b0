//! Each joint alone: the others follow their measured motion. An error of one servo then can't distort the others, and many initial values cost next to
//! nothing.

use freeplay_arm::Arm;
use freeplay_servo::{Fitted, JointServo, ModelParameter, Noise, Problem, ServoArm, Track, Unknown, each};

use super::findings::named_from;
use super::limits::{add_limits, lost};
use super::parts::{WINDOW, problem};
use super::recorded::Recorded;

/// Initial delays as shares of the lag: a fast servo behind a slow line, a slow one behind a fast line, and one in between.
const DELAYS: [f64; 3] = [0.1, 0.5, 0.9];
/// Initial rotor inertias over stiffness and squared lag: none, a medium one, and the largest that the lag permits.
const ROTORS: [f64; 3] = [0.0, 0.3, 1.0];
/// Initial stiffnesses, relative to the one that the load determines: a factor of two in each direction, as servos of one arm differ.
const STIFFNESSES: [f64; 3] = [0.5, 1.0, 2.0];

/// A servo, fitted alone.
pub struct Alone {
    /// The servo.
    pub servo: JointServo,
    /// Its identifiable parameters.
    pub unknowns: Vec<Unknown>,
}

/// Fits the servo of each joint alone, starting from `first`; `all` holds the possible unknowns. A joint without any keeps its servo.
pub fn fitted_alone(recorded: &Recorded, first: &ServoArm, all: &[Unknown]) -> Vec<Alone> {
    let tracks = by_joint(recorded.tracks, &first.arm);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    each(first.joints.len(), threads, |joint| {
        let own: Vec<Unknown> = all.iter().filter(|unknown| unknown.joint == joint).copied().collect();
        if own.is_empty() {
            return Alone { servo: first.joints[joint], unknowns: own };
        }
        of_joint(
            recorded,
            joint,
            &tracks[joint],
            ServoArm::new(first.arm.clone(), vec![first.joints[joint]]),
            &own,
        )
    })
}

/// The tracks of each joint of `arm` alone, `[joint][recording]`.
pub fn by_joint(tracks: &[Track], arm: &Arm) -> Vec<Vec<Track>> {
    let mut joints = vec![Vec::with_capacity(tracks.len()); arm.dof()];
    for track in tracks {
        joints.iter_mut().zip(track.by_joint(arm)).for_each(|(joint, alone)| joint.push(alone));
    }
    joints
}

fn of_joint(recorded: &Recorded, joint: usize, tracks: &[Track], first: ServoArm, all: &[Unknown]) -> Alone {
    let sights = &recorded.sights[joint..=joint];
    let mut unknowns: Vec<Unknown> = all.iter().map(|unknown| Unknown { joint: 0, ..*unknown }).collect();
    let parts = [&recorded.parts.fit, &recorded.parts.choice];
    let [fit, choice] =
        parts.map(|part| Problem { threads: 1, ..problem(tracks, part, sights, WINDOW) }.forgetting(&first));
    // A few windows suffice to compare the initial values.
    let few = fit.coarse().map(|few| few.forgetting(&first));
    let quick = few.as_ref().unwrap_or(&fit);
    let fits = beginnings(quick, &first, sights[0].lag).into_iter().map(|model| {
        let fitted = quick.fit(&model, &unknowns, &mut |_, _| {});
        quick.escape_local_minimum(fitted, &unknowns, &mut |_, _| {})
    });
    let best = fits.min_by(|a, b| usual(&a.noise).total_cmp(&usual(&b.noise)));
    let best = match (best, &few) {
        (Some(best), None) => best,
        (best, _) => fit.fit(best.as_ref().map_or(&first, |best| &best.model), &unknowns, &mut |_, _| {}),
    };
    let best = add_limits([&fit, &choice], sights, &mut unknowns, best, &mut |_| {});
    let best = without_rotor([&fit, &choice], &mut unknowns, best, recorded.sights.len());
    let back = unknowns.into_iter().map(|unknown| Unknown { joint, ..unknown });
    Alone { servo: best.model.joints[0], unknowns: back.collect() }
}

/// Logarithm of the typical size of `noise`.
fn usual(noise: &Noise) -> f64 {
    noise.size[0].ln()
}

/// Initial models: for each share of delay, the one with the smallest residual.
fn beginnings(fit: &Problem, first: &ServoArm, lag: f64) -> Vec<ServoArm> {
    let of_share = |share: f64| {
        let rotors = ROTORS.into_iter().flat_map(|rotor| STIFFNESSES.map(|stiffness| (rotor, stiffness)));
        let models = rotors.map(|(rotor, stiffness)| {
            let mut model = first.clone();
            let joint = &mut model.joints[0];
            ModelParameter::Stiffness.set(joint, (joint.stiffness * stiffness).ln());
            ModelParameter::Delay.set(joint, share * lag);
            ModelParameter::Lag.set(joint, (1.0 - share) * lag);
            ModelParameter::Rotor.set(joint, rotor * lag * lag);
            model
        });
        let left = models.map(|model| (usual(&Noise::of(&fit.residuals(&model), &fit.rounding)), model));
        left.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, model)| model)
    };
    DELAYS.into_iter().filter_map(of_share).collect()
}

/// `fitted` without a rotor, unless the loss of fit and choice part suffices for a name.
fn without_rotor(
    [fit, choice]: [&Problem; 2],
    unknowns: &mut Vec<Unknown>,
    fitted: Fitted,
    joints: usize,
) -> Fitted {
    let others: Vec<Unknown> =
        unknowns.iter().filter(|unknown| unknown.parameter != ModelParameter::Rotor).copied().collect();
    let mut model = fitted.model.clone();
    model.joints[0].rotor_inertia = 0.0;
    let without = fit.fit(&model, &others, &mut |_, _| {});
    let loses = |problem: &Problem| {
        lost(problem, &without.model, &fitted.noise) - lost(problem, &fitted.model, &fitted.noise)
    };
    if loses(fit) > named_from(joints) && loses(choice) > 0.0 {
        return fitted;
    }
    *unknowns = others;
    without
}
