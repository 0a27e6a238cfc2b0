//! Which inputs and layers predict held-out paths best.
//!
//! Inputs are chosen first ([`Selection`]), with one small layer; then layers are compared on these inputs. Each path is held out in turn.

use freeplay_predictor::Activation;
use freeplay_terminal::exit::Failure;

use crate::data::Data;
use crate::held_out::{HeldOut, Tried, held_out, scored};
use crate::selection::{Selection, errors, is_lower};
use crate::structure::{Fitting, MEMBERS, Structure};

/// Layers that are compared on the chosen inputs, each with how many of such networks the mean is of: of two layers as many as the tick has time for.
const LAYERS: [(&[usize], usize); 3] = [(&[8], MEMBERS), (&[16], MEMBERS), (&[10, 10], MEMBERS / 2)];
/// The hidden layers of Erkaya (2018).
pub const PAPER: [usize; 4] = [10; 4];

/// The plainest structure than which no other predicts held-out paths better by more than one standard error, its answers there, and all that was tried.
///
/// # Errors
/// Too few samples for the networks.
pub fn choose(data: &Data, fitting: Fitting) -> Result<(Structure, Vec<HeldOut>, Vec<Tried>), Failure> {
    let coarse = Fitting { stride: 2 * fitting.stride, ..fitting };
    let (inputs, mut tried) = Selection::new(data, coarse).run()?;
    let paper = Structure {
        activation: Activation::Logistic,
        decay: false,
        members: 1,
        ..Structure::plain(&inputs, &PAPER)
    };
    let layers = LAYERS
        .into_iter()
        .map(|(hidden, members)| Structure { members, ..Structure::plain(&inputs, hidden) })
        .chain([paper]);
    let mut best: Option<(Vec<f64>, Structure, Vec<HeldOut>)> = None;
    for structure in layers {
        let held = held_out(data, &structure, fitting)?;
        tried.push(scored(data, structure.words(data.joints()), held.iter().map(|held| &held.answers)));
        let left = errors(data, &held);
        // More units need more reason, as more inputs do.
        if best.as_ref().is_none_or(|(known, ..)| is_lower(&left, known)) {
            best = Some((left, structure, held));
        }
    }
    let (_, structure, held) = best.ok_or_else(|| Failure::internal("no structure was tried"))?;
    Ok((structure, held, tried))
}
