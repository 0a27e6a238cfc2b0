//! Whether a network is believed: whether it does better than the twin alone on runs that had no part in its training.

use freeplay_predictor::Narx;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::messages;

use crate::train::collect::Collected;
use crate::train::score::{self, LEAST_ERROR};
use crate::train::series::{View, journals};

/// `network` with a note of whether it is to be believed: in every one of `runs`, in steady contact and around detachments, its forecasts
/// are at least as good as the twin's. Says what came of it.
///
/// # Errors
/// Runs that do not suit the network.
pub fn tried(network: Narx, runs: &[Collected]) -> Result<Narx, Failure> {
    let horizon = network.layout().horizon;
    let series = View::Twin.series(runs, horizon)?;
    let mut worst: Option<(f64, String)> = None;
    for (index, run) in runs.iter().enumerate() {
        let parts = score::windows(runs, index, horizon, horizon, 0);
        for (part, windows) in ["steady contact", "detachments"].into_iter().zip(parts) {
            let truth = score::truth(runs, &windows);
            let square =
                |said: &[[f64; 2]]| -> f64 { score::errors(runs, &windows, &truth, said).iter().sum() };
            let alone: Vec<_> = windows.iter().map(|window| run.rows[window.present].forecast).collect();
            let alone = square(&alone);
            if alone < LEAST_ERROR * LEAST_ERROR {
                continue;
            }
            let ratio = (square(&journals(View::Twin, runs, &series, &windows, &network)?) / alone).sqrt();
            if worst.as_ref().is_none_or(|(most, _)| ratio > *most) {
                worst = Some((ratio, format!("{part} of {}", run.spec.name)));
            }
        }
    }
    let proved = worst.as_ref().is_some_and(|(ratio, _)| *ratio <= 1.0);
    if let Some((ratio, whereof)) = worst {
        let verdict = if proved { "narx-qp will believe it" } else { "narx-qp will not believe it" };
        messages::note(format_args!(
            "proof: at worst the network's errors are {ratio:.3} times the twin's ({whereof}): {verdict}"
        ));
    }
    Ok(network.with_proof(proved))
}
