//! Where memories stand as a recording begins. A motor that starts between two flanks does not meet either at once; which, and when, is in no
//! motion. It is a state of the recording, not a property of the machine, and is taken as its torque has it, as initial states are
//! where a model is compared with data (Ljung 1999, System Identification, §4.3): one number of five for each law with such a memory.

use freeplay_laws::{LawError, Placed, Prediction};

/// What is tried beside the middle.
pub(crate) const BEGINNINGS: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];

/// Share of the squares that another beginning has to take away.
pub(crate) const LEAST_LESS: f64 = 0.05;

/// Prediction of `effects` with each memory as the recording has it: `predict` says what effects predict, `left` the squares of the torque of a
/// joint that a prediction leaves, if it was measured.
///
/// # Errors
/// Those of `predict`.
pub(crate) fn begun(
    effects: &[&Placed],
    predict: impl Fn(&[&Placed]) -> Result<Prediction, LawError>,
    left: impl Fn(&Prediction, usize) -> Option<f64>,
) -> Result<Prediction, LawError> {
    let mut best = predict(effects)?;
    let mut known: Vec<Option<Placed>> = effects.iter().map(|_| None).collect();
    for (index, placed) in effects.iter().enumerate() {
        let Some(joint) = placed.joint.filter(|_| placed.effect.begun(0.0).is_some()) else { continue };
        let Some(middle) = left(&best, joint) else { continue };
        let mut least = (1.0 - LEAST_LESS) * middle;
        for start in BEGINNINGS {
            let Some(effect) = placed.effect.begun(start) else { continue };
            let other = Placed { kind: placed.kind, joint: placed.joint, effect, line: placed.line };
            let tried = predict(&with(effects, &known, index, &other))?;
            if let Some(square) = left(&tried, joint).filter(|square| *square < least) {
                (least, best, known[index]) = (square, tried, Some(other));
            }
        }
    }
    Ok(best)
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
