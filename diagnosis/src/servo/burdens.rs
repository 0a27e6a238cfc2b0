//! Payloads and tilted bases that the model does not have. The droop of the servos changes with the pose in another way for each of them, whatever the servos' stiffness.
//! One link's mass is not among them: at its own joint it is a softer servo, and of what it is at those before little is left then that tells it from the rest of the law.

use std::collections::BTreeSet;

use freeplay_arm::ArmFile;
use freeplay_servo::{Fitted, Problem, Quantity, ServoArm, Unknown};

use super::limits::{BELIEVED, lost};
use crate::diagnose::Tolerances;

/// Standard deviation of the prior of a base's roll and pitch, rad: a third of a right angle.
const LEAN: f64 = 0.5;
/// Steps of finite differences over what a number may be.
const STEP: f64 = 0.03;

/// One thing that an arm may carry, or how it may stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Burdened {
    /// Its kind in the catalogue.
    pub kind: &'static str,
    /// Its numbers.
    pub unknowns: Vec<Unknown>,
    /// Others that the recordings don't tell from it, with the log of the odds against them.
    pub rivals: Vec<(&'static str, f64)>,
}

fn unknown(joint: usize, quantity: Quantity, deviation: f64) -> Unknown {
    Unknown { joint, quantity, expected: 0.0, deviation, step: STEP * deviation }
}

/// All that is looked for in the arm of `file`: nothing that it names already.
fn candidates(file: &ArmFile) -> Vec<Burdened> {
    let joints = file.arm.joints();
    let is_free = |kind: &str| !file.effects.iter().any(|table| table.kind == kind);
    let all: f64 = joints.iter().map(|joint| joint.inertia.mass).sum();
    let burdened = |kind, unknowns| Burdened { kind, unknowns, rivals: Vec::new() };
    let lean = [Quantity::Roll, Quantity::Pitch].map(|quantity| unknown(0, quantity, LEAN));
    let whole =
        [burdened("payload", vec![unknown(0, Quantity::Payload, all)]), burdened("base_tilt", lean.to_vec())];
    whole.into_iter().filter(|one| is_free(one.kind)).collect()
}

/// The masses of links inside of their tolerance: no finding, and nothing may be one that they explain.
fn masses(file: &ArmFile, tolerances: &Tolerances) -> Vec<Unknown> {
    let named = |joint: usize| {
        let name = &file.arm.joints()[joint].name;
        file.effects.iter().any(|table| table.kind == "link_mass" && table.joint.as_ref() == Some(name))
    };
    let links = (0..file.arm.dof()).filter(|joint| !named(*joint));
    links.map(|joint| unknown(joint, Quantity::LinkMass, tolerances.mass)).collect()
}

/// What a payload may weigh, as shares of the arm; how far a base may lean, rad: where a fit begins that does not lead there from nothing.
const PAYLOADS: [f64; 5] = [0.03, 0.1, 0.2, 0.4, 0.8];
const LEANS: [[f64; 2]; 8] =
    [[-0.2, -0.2], [-0.2, 0.0], [-0.2, 0.2], [0.0, -0.2], [0.0, 0.2], [0.2, -0.2], [0.2, 0.0], [0.2, 0.2]];

/// `model` with `burdened` at some sizes.
fn at_some_sizes(model: &ServoArm, burdened: &Burdened) -> Vec<ServoArm> {
    let of = |values: &[f64]| {
        let mut model = model.clone();
        burdened.unknowns.iter().zip(values).for_each(|(unknown, x)| unknown.set(&mut model, *x));
        model
    };
    match burdened.kind {
        "payload" => PAYLOADS.iter().map(|share| of(&[share * burdened.unknowns[0].deviation])).collect(),
        _ => LEANS.iter().map(|lean| of(lean)).collect(),
    }
}

/// A fit with a burden.
struct Tried {
    burdened: Burdened,
    unknowns: Vec<Unknown>,
    fitted: Fitted,
    /// What it leaves of the fit and of the choice part, log-likelihood.
    left: [f64; 2],
}

/// Adds the burden to `fitted` that the fit part would gain most by, if it gains by what a name needs, and the choice part gains, too. The `unknowns` grow with it. Asked are the fitted servos, and those of
/// the model that was `given`: with them one payload says what else would take other servos at all joints.
pub fn add_burden(
    [fit, choice]: [&Problem; 2],
    (file, given): (&ArmFile, Option<&ServoArm>),
    tolerances: &Tolerances,
    unknowns: &mut Vec<Unknown>,
    fitted: Fitted,
    progress: &mut dyn FnMut(&str),
) -> (Fitted, Option<Burdened>) {
    let candidates = candidates(file);
    let least = BELIEVED + (candidates.len() as f64).ln();
    let masses = masses(file, tolerances);
    let beside: Vec<Unknown> = unknowns.iter().chain(&masses).copied().collect();
    let all: Vec<Unknown> = candidates.iter().flat_map(|one| one.unknowns.iter().copied()).collect();
    let mut scores = fit.scores(&fitted, &beside, &all).into_iter();
    let scored =
        candidates.iter().filter(|one| scores.by_ref().take(one.unknowns.len()).sum::<f64>() > least);
    let mut begun: Vec<(ServoArm, Burdened)> =
        scored.map(|one| (fitted.model.clone(), one.clone())).collect();
    if let Some(given) = given {
        let as_given = lost(fit, given, &fitted.noise);
        let nearest = candidates.iter().flat_map(|one| {
            let sizes = at_some_sizes(given, one).into_iter();
            let gains = sizes.map(|model| (as_given - lost(fit, &model, &fitted.noise), model));
            let best = gains.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(gain, _)| *gain > least);
            best.map(|(_, model)| (model, one.clone()))
        });
        begun.extend(nearest);
    }
    let before = [fit, choice].map(|part| lost(part, &fitted.model, &fitted.noise));
    let mut tried: Vec<Tried> = Vec::new();
    for (model, burdened) in begun {
        let all: Vec<Unknown> = beside.iter().chain(&burdened.unknowns).copied().collect();
        let with = fit.fit(&model, &all, &mut |step, _| {
            progress(&format!("fitting the servos and what the arm carries, step {step}"));
        });
        let left = [fit, choice].map(|part| lost(part, &with.model, &fitted.noise));
        if before[0] - left[0] > least && left[1] < before[1] {
            tried.push(Tried { burdened, unknowns: all, fitted: with, left });
        }
    }
    let total = |one: &Tried| one.left[0] + one.left[1];
    tried.sort_by(|a, b| total(a).total_cmp(&total(b)));
    // Of the same burden the better fit.
    let mut met = BTreeSet::new();
    tried.retain(|one| met.insert(one.burdened.kind));
    let mut tried = tried.into_iter();
    let Some(best) = tried.next() else { return (fitted, None) };
    let rivals = tried
        .map(|other| (other.burdened.kind, total(&other) - total(&best)))
        .filter(|(.., against)| *against < BELIEVED)
        .collect();
    *unknowns = best.unknowns;
    (best.fitted, Some(Burdened { rivals, ..best.burdened }))
}
