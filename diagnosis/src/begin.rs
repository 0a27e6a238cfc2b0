//! Where memories stand as a recording begins. A motor that starts between two flanks does not meet either at once, and a journal in oil has not sunk yet;
//! where they are is in no motion. It is a state of the recording, not a property of the machine, and is taken as the recording has it, as initial
//! states are where a model is compared with data (Ljung 1999, System Identification, §4.3): one number of five for a law that stands between two
//! stops, from the torque of its joint, and a place in the bearing for one that is in a film, from the tool.

use freeplay_laws::{LawError, Placed, Prediction, Start};
use nalgebra::{DMatrix, DVectorView};

use crate::residual::Kind;

/// What is tried between two stops beside the middle.
const BEGINNINGS: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];
/// What is tried in a bearing first.
const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [0.7, 0.0], [0.0, 0.7], [-0.7, 0.0], [0.0, -0.7]];
/// How far a place is moved to see what that changes.
const NUDGE: f64 = 0.02;
/// The longest step from one place to a better one, most steps, and how far out they go.
const LONGEST: f64 = 0.5;
const MOST_STEPS: usize = 6;
const OUTERMOST: f64 = 0.98;
/// Share of the squares by which a step has to be better to be followed by another.
const WORTH_A_STEP: f64 = 1e-5;

/// Share of the squares that another beginning has to take away.
const LEAST_LESS: f64 = 0.05;

/// What `predict` says of `effects`, each memory standing as the recording has it; `left` says what a prediction leaves of what was measured of one
/// kind, row by row, if it was.
///
/// # Errors
/// Those of `predict`.
pub(crate) fn begun(
    effects: &[&Placed],
    predict: impl Fn(&[&Placed]) -> Result<Prediction, LawError>,
    left: impl Fn(&Prediction, Kind) -> Option<Vec<f64>>,
) -> Result<Prediction, LawError> {
    let mut best = predict(effects)?;
    let mut known: Vec<Option<Placed>> = effects.iter().map(|_| None).collect();
    for (index, placed) in effects.iter().enumerate() {
        let at = |start: Start| -> Result<Option<Began>, LawError> {
            let Some(effect) = placed.effect.begun(start) else { return Ok(None) };
            let law = Placed { kind: placed.kind, joint: placed.joint, effect, line: placed.line };
            Ok(Some((predict(&with(effects, &known, index, &law))?, law)))
        };
        let torque = |said: &Prediction| Some(square(&left(said, Kind::Torque(placed.joint?))?));
        let tool = |said: &Prediction| -> Option<Vec<f64>> {
            Some((0..3).map(|axis| left(said, Kind::Tool(axis))).collect::<Option<Vec<_>>>()?.concat())
        };
        let mut found = None;
        if let (Some(_), Some(middle)) = (placed.effect.begun(Start::Between(0.0)), torque(&best)) {
            let square = |(said, _): &Began| torque(said).unwrap_or(f64::INFINITY);
            found = between(middle, |place| at(Start::Between(place)), square)?;
        } else if let (Some(_), Some(settled)) = (placed.effect.begun(Start::Within([0.0; 2])), tool(&best)) {
            let off = |(said, _): &Began| tool(said).unwrap_or_default();
            let step = |here: &Began, nudged: [&Began; 2]| way(&off(here), nudged.map(off));
            found = within(
                square(&settled),
                |place| at(Start::Within(place)),
                |there| square(&off(there)),
                step,
            )?
            .map(|(_, began)| began);
        }
        if let Some((said, law)) = found {
            (best, known[index]) = (said, Some(law));
        }
    }
    Ok(best)
}

/// What effects predict, and the one among them whose beginning was set.
type Began = (Prediction, Placed);

/// What `at` makes of the place between two stops with which least is `left`; `None` if that is not sure to be less than what the `middle` leaves.
///
/// # Errors
/// Those of `at`.
pub(crate) fn between<T, E>(
    middle: f64,
    at: impl Fn(f64) -> Result<Option<T>, E>,
    left: impl Fn(&T) -> f64,
) -> Result<Option<T>, E> {
    let (mut least, mut best) = ((1.0 - LEAST_LESS) * middle, None);
    for (number, place) in BEGINNINGS.into_iter().enumerate() {
        let Some(there) = at(place)? else { return Ok(None) };
        let square = left(&there);
        // Where the first way across comes soon, the beginning does not matter.
        if number == 0 && (square - middle).abs() < LEAST_LESS * middle {
            return Ok(None);
        }
        if square < least {
            (least, best) = (square, Some(there));
        }
    }
    Ok(best)
}

/// The place of a journal, as shares of the clearance, with which least is `left`, and what `at` makes of it; `None` if that is not less than the
/// `settled` one's. From the best of a few places on, in the steps of Gauss and Newton: `step` says how far to go from what is at a place and at the
/// same place nudged each way, in nudges.
///
/// # Errors
/// Those of `at`.
pub(crate) fn within<T, E>(
    settled: f64,
    at: impl Fn([f64; 2]) -> Result<Option<T>, E>,
    left: impl Fn(&T) -> f64,
    step: impl Fn(&T, [&T; 2]) -> Option<[f64; 2]>,
) -> Result<Option<([f64; 2], T)>, E> {
    let mut best: Option<(f64, [f64; 2], T)> = None;
    for place in PLACES {
        let Some(there) = at(place)? else { return Ok(None) };
        let square = left(&there);
        if best.as_ref().is_none_or(|(least, ..)| square < *least) {
            best = Some((square, place, there));
        }
    }
    let Some((mut least, mut place, mut here)) = best else { return Ok(None) };
    for _ in 0..MOST_STEPS {
        let nudges = nudges(place);
        let [first, second] = nudges.map(|by| at(moved(place, by)));
        let (Some(first), Some(second)) = (first?, second?) else { break };
        let Some([a, b]) = step(&here, [&first, &second]) else { break };
        let way = [a * nudges[0][0], b * nudges[1][1]];
        let shorter = (LONGEST / way[0].hypot(way[1])).min(1.0);
        let next = inside(moved(place, way.map(|x| x * shorter)));
        let Some(there) = at(next)? else { break };
        let square = left(&there);
        let is_worth_more = square < (1.0 - WORTH_A_STEP) * least;
        if square < least {
            (least, place, here) = (square, next, there);
        }
        if !is_worth_more {
            break;
        }
    }
    Ok((least < settled).then_some((place, here)))
}

/// The nudges of `place`, one each way, away from the wall.
pub(crate) fn nudges(place: [f64; 2]) -> [[f64; 2]; 2] {
    let [first, second] = place.map(|x| if x > 0.0 { -NUDGE } else { NUDGE });
    [[first, 0.0], [0.0, second]]
}

pub(crate) fn moved(place: [f64; 2], by: [f64; 2]) -> [f64; 2] {
    [place[0] + by[0], place[1] + by[1]]
}

/// The nearest place that is not in the wall.
fn inside(place: [f64; 2]) -> [f64; 2] {
    let out = place[0].hypot(place[1]);
    if out > OUTERMOST { place.map(|x| x * OUTERMOST / out) } else { place }
}

/// How many times the way from a place, where `here` is left, to each of two near it, where `there` is left, is best gone.
pub(crate) fn way(here: &[f64], there: [Vec<f64>; 2]) -> Option<[f64; 2]> {
    let here = DVectorView::from(here);
    let less = there.map(|there| here - DVectorView::from(&there[..]));
    let less = DMatrix::from_columns(&less);
    let found = less.tr_mul(&less).cholesky()?.solve(&less.tr_mul(&here));
    Some([found[0], found[1]])
}

/// Σ x².
pub(crate) fn square(rows: &[f64]) -> f64 {
    DVectorView::from(rows).norm_squared()
}

/// `effects`, those that are `known` to begin elsewhere so, and the one number `index` as `other`.
fn with<'p>(
    effects: &[&'p Placed],
    known: &'p [Option<Placed>],
    index: usize,
    other: &'p Placed,
) -> Vec<&'p Placed> {
    let begins = |(at, placed): (usize, &&'p Placed)| -> &'p Placed {
        if at == index { other } else { known[at].as_ref().unwrap_or(placed) }
    };
    effects.iter().enumerate().map(begins).collect()
}
