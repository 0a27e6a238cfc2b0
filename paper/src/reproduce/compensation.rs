//! The remaining deviation with the built-in controllers: `freeplay run` in lockstep, path by path.

use std::path::Path;
use std::process::{Command, Stdio};

use freeplay_harness::run::BUILT_IN_PATIENCE;
use freeplay_path::PathKind;
use freeplay_terminal::exit::{Exit, Failure};
use serde::Serialize;
use serde_json::Value;

use super::case::{CLEARANCES, PERIODS};

/// The paths.
const PATHS: [PathKind; 3] = [PathKind::Lissajous, PathKind::Square, PathKind::SquareSharp];

/// A path, a period and a clearance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Task {
    /// Shape of the path.
    pub path: PathKind,
    /// Time of the lap, s.
    pub period: f64,
    /// Radial clearance, mm.
    pub clearance: f64,
}

/// Remaining deviation with one controller.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Left {
    /// The controller.
    pub controller: String,
    /// True if the run ended with the controller active.
    pub finished: bool,
    /// RMS of the deviation after 0.5 s, mm.
    pub rms: f64,
    /// Its maximum, mm.
    pub max: f64,
}

/// All controllers on one task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Played {
    /// The task.
    pub task: Task,
    /// Result of each controller, in the order of the built-in ones.
    pub left: Vec<Left>,
}

/// The tasks: all of them, or only the first.
pub fn tasks(quick: bool) -> Vec<Task> {
    let all = PATHS.into_iter().flat_map(|path| {
        PERIODS
            .into_iter()
            .flat_map(move |period| CLEARANCES.map(|clearance| Task { path, period, clearance }))
    });
    if quick { all.skip(2).take(1).collect() } else { all.collect() }
}

/// The independent reference with a quasi-static feed-forward of its own, c = 0.6 mm: RMS after 0.5 s, mm
/// (computed torque, prediction without friction, smoothed over 41 ms on squares).
pub fn reference(task: &Task) -> Option<f64> {
    let at =
        |values: [f64; 2]| PERIODS.iter().position(|known| *known == task.period).map(|place| values[place]);
    if task.clearance != CLEARANCES[2] {
        return None;
    }
    match task.path {
        PathKind::Lissajous => at([0.0115, 0.0091]),
        PathKind::Square => at([0.0229, 0.0052]),
        PathKind::SquareSharp => at([0.138, 0.066]),
        _ => None,
    }
}

/// Runs `task` with all built-in controllers, by `freeplay run` of this program.
///
/// # Errors
/// A run that can't be started or leaves no summary.
pub fn play(task: &Task) -> Result<Played, Failure> {
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let program = std::env::current_exe().map_err(Failure::internal)?;
    let sets = [
        format!("path.kind={}", task.path.name()),
        format!("path.period={}", task.period),
        format!("clearance.joint_5.clearance={}", task.clearance * 1e-3),
        format!("patience={BUILT_IN_PATIENCE}"),
    ];
    let mut command = Command::new(program);
    command.args(["run", "--quiet", "--pace", "lockstep", "--recording", "none", "--out"]).arg(folder.path());
    sets.iter().for_each(|set| {
        command.args(["--set", set]);
    });
    let ended = command.stdin(Stdio::null()).stdout(Stdio::null()).output().map_err(Failure::internal)?;
    let said = || String::from_utf8_lossy(&ended.stderr).trim().to_owned();
    let failed = || {
        let message = format!("freeplay run ended with {}: {}", ended.status, said());
        match ended.status.code() {
            Some(code) if code == Exit::Peer as i32 => Failure::peer(message),
            Some(code) if code == Exit::Input as i32 => Failure::input(message),
            _ => Failure::internal(message),
        }
    };
    let left = read(&folder.path().join("summary.json")).ok_or_else(failed)?;
    Ok(Played { task: *task, left })
}

/// The deviations of the controllers in a summary.
fn read(summary: &Path) -> Option<Vec<Left>> {
    let summary: Value = serde_json::from_str(&freeplay_storage::read_text(summary).ok()?).ok()?;
    let of = |run: &Value| {
        Some(Left {
            controller: run["controller"].as_str()?.to_owned(),
            finished: run["ending"] == "finished",
            rms: run["deviation_mm"]["rms_after_start"].as_f64()?,
            max: run["deviation_mm"]["max_after_start"].as_f64()?,
        })
    };
    summary["runs"].as_array()?.iter().map(of).collect()
}
