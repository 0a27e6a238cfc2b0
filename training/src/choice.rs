//! Choice of the inputs and layers that best predict held-out paths.
//!
//! The program chooses the inputs first ([`Selection`]), with one small layer, and then compares layers on these inputs. Each path is held out in turn.

use freeplay_predictor::Activation;
use freeplay_terminal::exit::Failure;

use crate::data::Data;
use crate::held_out::{HeldOut, Tried, held_out, scored};
use crate::selection::{Selection, errors, is_lower};
use crate::structure::{Fitting, MEMBERS, Structure};

/// Candidate layers on the chosen inputs, each with the number of networks in its mean; the tick has time for only half as many of two layers.
const LAYERS: [(&[usize], usize); 3] = [(&[8], MEMBERS), (&[16], MEMBERS), (&[10, 10], MEMBERS / 2)];
/// The hidden layers of Erkaya (2018).
pub const PAPER: [usize; 4] = [10; 4];

/// Returns the simplest structure that no other beats on held-out paths by more than one standard error, its answers there, and all tried structures.
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
        // A structure with more units must be better by the same margin as one with more inputs.
        if best.as_ref().is_none_or(|(known, ..)| is_lower(&left, known)) {
            best = Some((left, structure, held));
        }
    }
    let (_, structure, held) = best.ok_or_else(|| Failure::internal("no structure was tried"))?;
    Ok((structure, held, tried))
}
