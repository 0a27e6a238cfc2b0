//! A run of an exam and what it recorded.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use freeplay_harness::run::{ControllerSelection, Files, play};
use freeplay_harness::scenario::Scenario;
use freeplay_harness::setup::Setup;
use freeplay_harness::summary::RunSummary;
use freeplay_recording::Recording;
use freeplay_terminal::exit::{Exit, Failure};

/// Plays `scenario` into `folder` with `contestant` in charge; `None` if interrupted.
///
/// # Errors
/// A run that fails, or that leaves no recording: it can't be judged.
pub fn play_recorded(
    scenario: &Scenario,
    contestant: &ControllerSelection,
    folder: &Path,
    stop: &Arc<AtomicBool>,
) -> Result<Option<(RunSummary, Recording)>, Failure> {
    let setup = Setup::new(scenario)?;
    let files = Files::write(scenario, &setup, folder)?;
    let (exit, summary) = play(scenario, contestant, &files, 0.0, stop)?;
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let asked = contestant.asked();
    let Some(summary) = summary else {
        return Err(Failure { exit, message: format!("{asked}: a run ended early") });
    };
    let Some(name) = &summary.recording else {
        let exit = if exit == Exit::Done { Exit::Internal } else { exit };
        let notes = summary.notes.join("; ");
        return Err(Failure { exit, message: format!("{asked}: a run left no recording to judge: {notes}") });
    };
    let recording = freeplay_recording::read(&files.out.join(name), None).map_err(Failure::input)?;
    Ok(Some((summary, recording)))
}
