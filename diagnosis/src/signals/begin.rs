//! Where memories stand as a recording begins. A motor that starts between two flanks does not meet either at once, and a journal in oil has not sunk yet;
//! where they are is in no motion. It is a state of the recording, not a property of the machine, and is taken as the recording has it, as initial
//! states are where a model is compared with data (Ljung 1999, System Identification, §4.3): one number of five for a law that stands between two
//! stops, from the torque of its joint, and a place in the bearing for one that is in a film, from the tool.

use freeplay_laws::{Baseline, LawError, Placed, Prediction, Start};
use nalgebra::{DMatrix, DVectorView};

use crate::signals::channel::Kind;
use crate::statistics::{BACKTRACKING, MOST_ROUNDS};

/// Places that are tried between two stops beside the middle: the stops and halfway, as what is left changes evenly between them.
const BEGINNINGS: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];
/// Places in a bearing from which a descent begins: the middle and one each way, since a descent from one place alone can end in a local minimum.
const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
/// A place w of the journal is moved by NUDGE · (1 + |w|) to see what the move changes: far above rounding, and well below the way over which that change
/// bends.
const NUDGE: f64 = 0.02;
/// A step to a better place is at most LONGEST · (1 + |w|): the change is linear over no longer a way.
const LONGEST: f64 = 0.5;
/// Greatest w: 0.999 of the clearance, since beyond the film is thinner than any surface is smooth.
const OUTERMOST: f64 = 22.0;
/// Share of the squares by which a step has to be better to be followed by another: far below what noise makes of them.
const WORTH_A_STEP: f64 = 1e-5;

/// Share of the squares that another beginning has to take away: less can be an accident of the noise, and the settled state is the simpler belief.
const LEAST_LESS: f64 = 0.05;

/// What effects predict, the one among them whose beginning was set, and what they leave of what tells it.
struct Began {
    said: Prediction,
    law: Placed,
    left: Vec<f64>,
}

/// The prediction of the `machine` with `effects`, each memory in the state that fits the recording best; `left` gives measured minus predicted of one kind of channel,
/// row by row, if that was measured. The effects without a memory are worked out once, however many beginnings are tried.
///
/// # Errors
/// Those of `machine`.
pub(crate) fn begun<'p>(
    effects: &[&'p Placed],
    machine: impl Fn(&[&'p Placed]) -> Result<Baseline<'p>, LawError>,
    left: impl Fn(&Prediction, Kind) -> Option<Vec<f64>>,
) -> Result<Prediction, LawError> {
    let mut best = machine(effects)?.prediction().clone();
    let (others, open): (Vec<&Placed>, Vec<&Placed>) =
        effects.iter().copied().partition(|law| told_by(law).is_empty());
    if open.is_empty() {
        return Ok(best);
    }
    let others = machine(&others)?;
    let mut known: Vec<Option<Placed>> = open.iter().map(|_| None).collect();
    for (index, law) in open.iter().enumerate() {
        let left = |said: &Prediction| -> Option<Vec<f64>> {
            Some(told_by(law).into_iter().map(|kind| left(said, kind)).collect::<Option<Vec<_>>>()?.concat())
        };
        let Some(now) = left(&best) else { continue };
        let beside = open.iter().zip(&known).enumerate().filter(|(other, _)| *other != index);
        let beside: Vec<&Placed> = beside.map(|(_, (open, known))| known.as_ref().unwrap_or(open)).collect();
        let others = others.upon(&beside)?;
        let at = |start: Start| -> Result<Option<Began>, LawError> {
            let Some(effect) = law.effect.with_initial_state(start) else { return Ok(None) };
            let law = Placed { kind: law.kind, joint: law.joint, effect, line: law.line };
            let said = others.with(&[&law])?;
            Ok(left(&said).map(|left| Began { said, law, left }))
        };
        let squares = |began: &Began| square(&began.left);
        let found = if is_between(law) {
            between(square(&now), |place| at(Start::Between(place)), squares)?
        } else {
            let step = |here: &Began, nudged: [&Began; 2]| way(&here.left, nudged.map(|there| &*there.left));
            within((square(&now), None), |place| at(Start::Within(place)), squares, step)?
                .map(|(_, began)| began)
        };
        if let Some(Began { said, law, .. }) = found {
            (best, known[index]) = (said, Some(law));
        }
    }
    Ok(best)
}

/// Whether the memory of `law` stands between two stops, and the file does not say where.
fn is_between(law: &Placed) -> bool {
    law.effect.with_initial_state(Start::Between(0.0)).is_some()
}

/// The kinds of channel that tell where the memory of `law` stands: none if it has no memory, or if the file says where it stands.
fn told_by(law: &Placed) -> Vec<Kind> {
    match law.joint {
        Some(joint) if is_between(law) => vec![Kind::Torque(joint)],
        Some(_) if law.effect.with_initial_state(Start::Within([0.0; 2])).is_some() => {
            (0..3).map(Kind::Tool).collect()
        }
        _ => Vec::new(),
    }
}

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

/// Where a journal is in its bearing: w = ε/√(1 − ε²) times the direction of its eccentricity ratio ε. A journal that is squeezed out by a steady force
/// goes evenly in w, so that later places hang on the first nearly in proportion, at the wall, too.
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

/// The place of a journal with which least is `left`, and what `at` makes of it, which is told its eccentricity; `None` if that is not less than what the
/// `settled` one leaves. From the place where it is known to be `about`, or the best of a few places, on, in the steps of Gauss and Newton: `step` says how far to
/// go from what is at a place and at the same place nudged each way, in nudges.
///
/// # Errors
/// Those of `at`.
pub(crate) fn within<T, E>(
    (settled, about): (f64, Option<InBearing>),
    at: impl Fn([f64; 2]) -> Result<Option<T>, E>,
    left: impl Fn(&T) -> f64,
    step: impl Fn(&T, [&T; 2]) -> Option<[f64; 2]>,
) -> Result<Option<(InBearing, T)>, E> {
    let at = |place: InBearing| at(place.eccentricity());
    let mut best: Option<(f64, InBearing, T)> = None;
    for place in about.map_or_else(|| PLACES.map(InBearing).to_vec(), |about| vec![about]) {
        let Some(there) = at(place)? else { return Ok(None) };
        let square = left(&there);
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
            let square = left(&there);
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

/// How many times the way from a place, where `here` is left, to each of two near it, where `there` is left, is best gone.
pub(crate) fn way(here: &[f64], there: [&[f64]; 2]) -> Option<[f64; 2]> {
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
