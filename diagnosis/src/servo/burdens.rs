//! Payloads and tilted bases that the model lacks. Each changes the droop of the servos with the pose in its own way, whatever the stiffness of the servos.
//! With given servos the search also tests the mass of a link, the zero of an encoder and the gap of a gear. With unknown servos a mass looks like a softer
//! servo at its own joint, and its effect on the joints before hardly separates it from the rest of the law. A gap behind the encoder shows in the position of
//! the link: a load that always presses on the same flank does not separate it from a zero.

use freeplay_arm::Arm;
use freeplay_model::ArmFile;
use freeplay_servo::{DIFFERENCE_STEP, Fitted, ModelParameter, Problem, ServoArm, Unknown};

use super::limits::lost;
use crate::data::tolerance::Tolerances;
use crate::sorting::sort_rising;
use crate::statistics::STRONG;

/// Standard deviation of the prior of a base's roll and pitch, of an encoder's zero and of a gear's gap, rad: a third of a right angle.
const LEAN: f64 = 0.5;

/// A payload of an arm, or an inclination or offset of the arm or of one of its links.
#[derive(Clone, Debug, PartialEq)]
pub struct Burdened {
    /// Its kind in the catalogue.
    pub kind: &'static str,
    /// Index of its joint; `None` if it is the whole arm's.
    pub joint: Option<usize>,
    /// Its parameters.
    pub unknowns: Vec<Unknown>,
    /// Other causes that the recordings don't distinguish from it.
    pub rivals: Vec<Rival>,
}

/// Another cause that recordings don't distinguish from the finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// Its kind in the catalogue.
    pub kind: &'static str,
    /// Index of its joint; `None` if it is the whole arm's.
    pub joint: Option<usize>,
    /// Log odds against the rival.
    pub against: f64,
}

/// The `unknowns` that must differ from zero for a burden: all but those of its position.
pub fn present(unknowns: &[Unknown]) -> impl Iterator<Item = &Unknown> {
    unknowns.iter().filter(|unknown| !unknown.parameter.is_place())
}

fn unknown(joint: usize, parameter: ModelParameter, deviation: f64) -> Unknown {
    Unknown {
        joint,
        parameter,
        expected: 0.0,
        deviation,
        step: DIFFERENCE_STEP * deviation,
        is_torque: false,
        least: parameter.least(),
    }
}

/// All burdens of the arm in `file`, each with initial values for a fit; without those that the file already has.
pub fn burdens(file: &ArmFile) -> Vec<(Burdened, Vec<Vec<f64>>)> {
    let joints = file.arm.joints();
    let is_free = |kind: &str, joint: Option<usize>| {
        let name = joint.map(|joint| &joints[joint].name);
        !file.effects.iter().any(|table| table.kind == kind && table.joint.as_ref() == name)
    };
    let all: f64 = joints.iter().map(|joint| joint.inertia.mass).sum();
    let burdened = |kind, joint, unknowns| Burdened { kind, joint, unknowns, rivals: Vec::new() };
    let (mass, length) = (unknown(0, ModelParameter::Payload, all), link_length(&file.arm));
    let place = [ModelParameter::PayloadX, ModelParameter::PayloadY, ModelParameter::PayloadZ]
        .map(|parameter| unknown(0, parameter, length));
    let payload = burdened("payload", None, [mass].into_iter().chain(place).collect());
    let lean = [ModelParameter::Roll, ModelParameter::Pitch].map(|parameter| unknown(0, parameter, LEAN));
    let lean = burdened("base_tilt", None, lean.to_vec());
    let mut burdens =
        vec![(payload, PAYLOADS.map(|share| vec![share * all, 0.0, 0.0, 0.0]).to_vec()), (lean, leans())];
    let of_joint = |joint: usize| {
        let one = |kind, parameter, deviation, places: Vec<f64>| {
            let unknowns = vec![unknown(joint, parameter, deviation)];
            (burdened(kind, Some(joint), unknowns), places.into_iter().map(|x| vec![x]).collect())
        };
        let angles = ANGLES.into_iter();
        [
            one("link_mass", ModelParameter::LinkMass, std::f64::consts::LN_2, MASSES.map(f64::ln).to_vec()),
            one(
                "encoder_offset",
                ModelParameter::Zero,
                LEAN,
                angles.clone().skip(1).rev().map(|x| -x).chain(angles.clone()).collect(),
            ),
            one("backlash", ModelParameter::Gap, LEAN, angles.collect()),
        ]
    };
    burdens.extend((0..joints.len()).flat_map(of_joint));
    burdens.retain(|(one, _)| is_free(one.kind, one.joint));
    burdens
}

/// Initial inclinations of a base for a fit: none, and the largest in both directions about either axis, since a search continues along each.
fn leans() -> Vec<Vec<f64>> {
    let most = ANGLES.into_iter().fold(0.0, f64::max);
    [[0.0, 0.0], [-most, 0.0], [0.0, -most], [0.0, most], [most, 0.0]].map(|lean| lean.to_vec()).to_vec()
}

/// Mean length of a link of `arm`, m: a payload is about as large as a link, and its centre of mass is about that far from the tool.
fn link_length(arm: &Arm) -> f64 {
    let joints = arm.joints().iter().skip(1).map(|joint| joint.placement.translation.vector.norm());
    let all: f64 = joints.sum::<f64>() + arm.tool().translation.vector.norm();
    all / arm.dof() as f64
}

/// The masses of links within their tolerance: they are no finding, and no finding may be explained by them.
pub fn masses(file: &ArmFile, tolerances: &Tolerances) -> Vec<Unknown> {
    let named = |joint: usize| {
        let name = &file.arm.joints()[joint].name;
        file.effects.iter().any(|table| table.kind == "link_mass" && table.joint.as_ref() == Some(name))
    };
    let links = (0..file.arm.dof()).filter(|joint| !named(*joint));
    links.map(|joint| unknown(joint, ModelParameter::LinkMass, tolerances.mass)).collect()
}

/// Initial factors of a link's mass for a fit: a descent from the modelled mass may not reach them.
const MASSES: [f64; 4] = [0.5, 0.75, 1.33, 2.0];
/// Initial masses of a payload, as shares of the arm's mass; the list starts at zero, since the best mass lies between two of them.
const PAYLOADS: [f64; 5] = [0.0, 0.1, 0.2, 0.4, 0.8];
/// Initial angles of an inclination, a zero and a gap, rad; the list starts at zero, since a search continues between two of them. The largest is half a tooth
/// of a servo's horn.
const ANGLES: [f64; 4] = [0.0, 0.02, 0.06, 0.2];

/// A fit with a burden.
struct Tried {
    burdened: Burdened,
    unknowns: Vec<Unknown>,
    fitted: Fitted,
    /// Loss of log-likelihood of the fit and of the choice part.
    left: [f64; 2],
}

/// Adds to `fitted` the burden from which the fit part gains most, if this gain suffices for a name and the choice part gains, too. The function appends its
/// `unknowns`.
pub fn add_burden(
    [fit, choice]: [&Problem; 2],
    file: &ArmFile,
    tolerances: &Tolerances,
    unknowns: &mut Vec<Unknown>,
    fitted: Fitted,
    progress: &mut dyn FnMut(&str),
) -> (Fitted, Option<Burdened>) {
    let candidates: Vec<Burdened> =
        burdens(file).into_iter().map(|(one, _)| one).filter(|one| one.joint.is_none()).collect();
    let least = STRONG + (candidates.len() as f64).ln();
    let masses = masses(file, tolerances);
    let beside: Vec<Unknown> = unknowns.iter().chain(&masses).copied().collect();
    let all: Vec<Unknown> = candidates.iter().flat_map(|one| one.unknowns.iter().copied()).collect();
    let mut scores = fit.scores(&fitted, &beside, &all).into_iter();
    let scored = candidates
        .into_iter()
        .filter(|one| scores.by_ref().take(one.unknowns.len()).sum::<f64>() > least)
        .collect::<Vec<_>>();
    if scored.is_empty() {
        return (fitted, None);
    }
    // A burden has to explain more than the masses of the links within their tolerances.
    let plain = fit.fit(&fitted.model, &beside, &mut |step, _| {
        progress(&format!("fitting the servos and the masses of links, step {step}"));
    });
    let left = |model: &ServoArm, all: &[Unknown]| {
        [fit.loss_of(model, &plain.noise, all), lost(choice, model, &plain.noise)]
    };
    let before = left(&plain.model, &beside);
    let mut tried: Vec<Tried> = Vec::new();
    for burdened in scored {
        let all: Vec<Unknown> = beside.iter().chain(&burdened.unknowns).copied().collect();
        let with = fit.fit(&plain.model, &all, &mut |step, _| {
            progress(&format!("fitting the servos with a payload or a base tilt, step {step}"));
        });
        let left = left(&with.model, &all);
        if before[0] - left[0] > least && left[1] < before[1] {
            tried.push(Tried { burdened, unknowns: all, fitted: with, left });
        }
    }
    let total = |one: &Tried| one.left[0] + one.left[1];
    sort_rising(&mut tried, total);
    let mut tried = tried.into_iter();
    let Some(best) = tried.next() else { return (fitted, None) };
    let rivals = tried
        .map(|other| Rival {
            kind: other.burdened.kind,
            joint: other.burdened.joint,
            against: total(&other) - total(&best),
        })
        .filter(|rival| rival.against < STRONG)
        .collect();
    *unknowns = best.unknowns;
    (best.fitted, Some(Burdened { rivals, ..best.burdened }))
}
