//! Initial states of laws with memory. A motor may start between the two flanks of its gear, and a journal in oil may not have sunk yet. The motion does not
//! show these states. An initial state belongs to the recording, not to the machine, so that the fit estimates it for each recording (Ljung 1999, System
//! Identification, §4.3). A law between two stops takes one of five positions, from the torque of its joint. A journal in a film takes a place in its
//! bearing, from the tool.

use freeplay_laws::{Baseline, LawError, Placed, Prediction, Start};
use nalgebra::{DMatrix, DVectorView};

use crate::signals::channel::Kind;
use crate::statistics::{BACKTRACKING, MOST_ROUNDS};

/// Positions between two stops that the search tries beside the middle: the stops and halfway. The residual changes evenly between them.
const BEGINNINGS: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];
/// Places in a bearing from which a descent begins: the middle and one in each direction, since a single descent can end in a local minimum.
const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
/// Step NUDGE · (1 + |w|) of the finite differences at a place w of the journal: far above rounding, and well below the distance over which the residual
/// curves.
const NUDGE: f64 = 0.02;
/// Longest step of the descent, LONGEST · (1 + |w|): the residual is linear over no longer distance.
const LONGEST: f64 = 0.5;
/// Greatest w: 0.999 of the clearance, since beyond the film is thinner than any surface is smooth.
const OUTERMOST: f64 = 22.0;
/// Least share of the squares that a step must gain for the descent to go on: far below the share of the noise.
const WORTH_A_STEP: f64 = 1e-5;

/// Least share of the squares by which another initial state must be better than the settled one: noise alone can give less, and the settled state is the
/// simpler hypothesis.
const LEAST_LESS: f64 = 0.05;

/// The prediction of effects, the effect whose initial state the fit set, and the residuals of the channels that determine this state.
struct Trial {
    prediction: Prediction,
    law: Placed,
    residual: Vec<f64>,
}

/// The prediction of the `machine` with `effects`, each memory in the initial state that fits the recording best. `residual` gives measured minus
/// predicted of one kind of channel, row by row, if the recording has this channel. The function computes the effects without a memory once for all
/// trials.
///
/// # Errors
/// Those of `machine`.
pub(crate) fn predicted_with_initial_states<'p>(
    effects: &[&'p Placed],
    machine: impl Fn(&[&'p Placed]) -> Result<Baseline<'p>, LawError>,
    residual: impl Fn(&Prediction, Kind) -> Option<Vec<f64>>,
) -> Result<Prediction, LawError> {
    let mut best = machine(effects)?.prediction().clone();
    let (others, open): (Vec<&Placed>, Vec<&Placed>) =
        effects.iter().copied().partition(|law| observed_by(law).is_empty());
    if open.is_empty() {
        return Ok(best);
    }
    let others = machine(&others)?;
    let mut known: Vec<Option<Placed>> = open.iter().map(|_| None).collect();
    for (index, law) in open.iter().enumerate() {
        let residual = |prediction: &Prediction| -> Option<Vec<f64>> {
            Some(
                observed_by(law)
                    .into_iter()
                    .map(|kind| residual(prediction, kind))
                    .collect::<Option<Vec<_>>>()?
                    .concat(),
            )
        };
        let Some(now) = residual(&best) else { continue };
        let beside = open.iter().zip(&known).enumerate().filter(|(other, _)| *other != index);
        let beside: Vec<&Placed> = beside.map(|(_, (open, known))| known.as_ref().unwrap_or(open)).collect();
        let others = others.extended(&beside)?;
        let at = |start: Start| -> Result<Option<Trial>, LawError> {
            let Some(effect) = law.effect.with_initial_state(start) else { return Ok(None) };
            let law = Placed { kind: law.kind, joint: law.joint, effect, line: law.line };
            let prediction = others.with(&[&law])?;
            Ok(residual(&prediction).map(|residual| Trial { prediction, law, residual }))
        };
        let squares = |trial: &Trial| square(&trial.residual);
        let found = if is_between(law) {
            between(square(&now), |place| at(Start::Between(place)), squares)?
        } else {
            let step = |here: &Trial, nudged: [&Trial; 2]| {
                gauss_newton_step(&here.residual, nudged.map(|there| &*there.residual))
            };
            within((square(&now), None), |place| at(Start::Within(place)), squares, step)?
                .map(|(_, trial)| trial)
        };
        if let Some(Trial { prediction, law, .. }) = found {
            (best, known[index]) = (prediction, Some(law));
        }
    }
    Ok(best)
}

/// Returns true if the memory of `law` lies between two stops at a position that the file does not give.
fn is_between(law: &Placed) -> bool {
    law.effect.with_initial_state(Start::Between(0.0)).is_some()
}

/// The kinds of channel that determine the initial state of `law`: none if the law has no memory, or if the file gives its state.
fn observed_by(law: &Placed) -> Vec<Kind> {
    match law.joint {
        Some(joint) if is_between(law) => vec![Kind::Torque(joint)],
        Some(_) if law.effect.with_initial_state(Start::Within([0.0; 2])).is_some() => {
            (0..3).map(Kind::Tool).collect()
        }
        _ => Vec::new(),
    }
}

/// The result of `at` for the position between two stops that minimises `residual`; `None` unless this position is surely better than the `middle`.
///
/// # Errors
/// Those of `at`.
pub(crate) fn between<T, E>(
    middle: f64,
    at: impl Fn(f64) -> Result<Option<T>, E>,
    residual: impl Fn(&T) -> f64,
) -> Result<Option<T>, E> {
    let (mut least, mut best) = ((1.0 - LEAST_LESS) * middle, None);
    for (number, place) in BEGINNINGS.into_iter().enumerate() {
        let Some(there) = at(place)? else { return Ok(None) };
        let square = residual(&there);
        // If the first full crossing comes soon, the initial state hardly matters.
        if number == 0 && (square - middle).abs() < LEAST_LESS * middle {
            return Ok(None);
        }
        if square < least {
            (least, best) = (square, Some(there));
        }
    }
    Ok(best)
}

/// The place of a journal in its bearing: w = ε/√(1 − ε²) times the direction of its eccentricity ratio ε. Under a steady force w changes at a constant
/// rate, so that later places depend on the first nearly in proportion, at the wall, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InBearing([f64; 2]);

impl InBearing {
    /// The eccentricity, as shares of the clearance.
    pub fn eccentricity(self) -> [f64; 2] {
        self.0.map(|x| x / (1.0 + square(&self.0)).sqrt())
    }

    /// Two places near by, one each way, away from the wall.
    pub fn nudged(self) -> [Self; 2] {
        [self.towards([1.0, 0.0]), self.towards([0.0, 1.0])]
    }

    /// The place so many of these nudges away, no farther than one step.
    fn towards(self, nudges: [f64; 2]) -> Self {
        let scale = 1.0 + square(&self.0).sqrt();
        let way = [0, 1].map(|i| if self.0[i] > 0.0 { -nudges[i] } else { nudges[i] } * NUDGE * scale);
        let shorter = (LONGEST * scale / square(&way).sqrt()).min(1.0);
        let there = [0, 1].map(|i| self.0[i] + shorter * way[i]);
        let inwards = (OUTERMOST / square(&there).sqrt()).min(1.0);
        Self(there.map(|x| x * inwards))
    }
}

/// Finds the place of a journal that minimises `residual`, by Gauss-Newton steps; returns the place and the result of `at` for its eccentricity. The search starts
/// at `about`, or at the best of a few places if `about` is unknown. `step` computes the step in nudges from the results at a place and at its two nudged
/// neighbours. `None` if no place leaves less than the `settled` one.
///
/// # Errors
/// Those of `at`.
pub(crate) fn within<T, E>(
    (settled, about): (f64, Option<InBearing>),
    at: impl Fn([f64; 2]) -> Result<Option<T>, E>,
    residual: impl Fn(&T) -> f64,
    step: impl Fn(&T, [&T; 2]) -> Option<[f64; 2]>,
) -> Result<Option<(InBearing, T)>, E> {
    let at = |place: InBearing| at(place.eccentricity());
    let mut best: Option<(f64, InBearing, T)> = None;
    for place in about.map_or_else(|| PLACES.map(InBearing).to_vec(), |about| vec![about]) {
        let Some(there) = at(place)? else { return Ok(None) };
        let square = residual(&there);
        if best.as_ref().is_none_or(|(least, ..)| square < *least) {
            best = Some((square, place, there));
        }
    }
    let Some((mut least, mut place, mut here)) = best else { return Ok(None) };
    for _ in 0..MOST_ROUNDS {
        let [first, second] = place.nudged().map(&at);
        let (Some(first), Some(second)) = (first?, second?) else { break };
        let Some(nudges) = step(&here, [&first, &second]) else { break };
        let before = least;
        for share in BACKTRACKING {
            let next = place.towards(nudges.map(|x| share * x));
            let Some(there) = at(next)? else { break };
            let square = residual(&there);
            if square < least {
                (least, place, here) = (square, next, there);
                break;
            }
        }
        if least > (1.0 - WORTH_A_STEP) * before {
            break;
        }
    }
    Ok((least < settled).then_some((place, here)))
}

/// The Gauss-Newton step from a place with the residuals `here`, in multiples of two nudges; `there` holds the residuals after each nudge.
pub(crate) fn gauss_newton_step(here: &[f64], there: [&[f64]; 2]) -> Option<[f64; 2]> {
    let here = DVectorView::from(here);
    let less = there.map(|there| here - DVectorView::from(there));
    let less = DMatrix::from_columns(&less);
    let found = less.tr_mul(&less).cholesky()?.solve(&less.tr_mul(&here));
    Some([found[0], found[1]])
}

/// Σ x².
pub(crate) fn square(rows: &[f64]) -> f64 {
    DVectorView::from(rows).norm_squared()
}
