//! A run of an exam with its recording.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::ending;
use freeplay_harness::run::play;
use freeplay_harness::run_files::Files;
use freeplay_harness::scenario::{Drive, Scenario};
use freeplay_harness::setup::Setup;
use freeplay_harness::summary::RunSummary;
use freeplay_recording::Recording;
use freeplay_terminal::exit::{Exit, Failure};

/// Runs `scenario` into `folder` with `contestant` as the active controller; `None` if interrupted.
///
/// # Errors
/// A run that fails, or that leaves no recording, so that it can't be judged.
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

/// Checks the `summary` of the run of the controller `name` alone. Refuses the controller if its own commands made the plant stop the arm: the exam then has no
/// sound run for comparison.
///
/// # Errors
/// A failed verdict: the reason of the stop, and the commands that `mode` requires.
pub fn check_solo_run(summary: &RunSummary, name: &str, mode: Drive) -> Result<(), Failure> {
    // Brakes that close for lack of a command may be due to a busy machine.
    let is_its_own =
        summary.stopped["reason"].is_string() && summary.stopped["reason"] == summary.stopped["quantity"];
    let Some(how) = ending(summary).filter(|_| is_its_own) else { return Ok(()) };
    let taken = match mode {
        Drive::Torque => {
            "mode torque takes its commands as torques in N·m; --set mode=driven takes positions in rad"
        }
        Drive::Driven => {
            "mode driven takes its commands as positions in rad; --set mode=torque takes torques in N·m"
        }
        Drive::Servo => {
            "mode servo takes its commands as positions in rad; --set mode=torque takes torques in N·m"
        }
    };
    let message = format!("{name} alone: {how}, so there is nothing to examine; {taken}");
    Err(Failure { exit: Exit::Verdict, message })
}
