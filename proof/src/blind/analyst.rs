//! The process that answers one case. It sees only the folder of that case.

use std::path::PathBuf;

use clap::Args;
use freeplay_diagnosis::{DiagnoseSettings, diagnose};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::say;
use freeplay_terminal::process::die_with_parent;
use rustix::time::{ClockId, clock_gettime};

use super::answer::Answer;
use super::channels::Lures;
use super::sandbox;

/// The files of a case: the given model, and two recordings of one machine.
pub const FILES: [&str; 3] = ["model.toml", "recording.csv", "second.csv"];

/// Diagnoses the case in the working folder. `freeplay blind` starts this process.
#[derive(Args, Debug)]
pub struct AnalystArgs {
    /// End when the process with this ID ends.
    #[arg(long, value_name = "PID")]
    with_parent: u32,
    /// File that this process must not be able to read.
    #[arg(long, value_name = "FILE")]
    canary: Option<PathBuf>,
    /// Abstract socket that this process must not be able to reach.
    #[arg(long, value_name = "NAME")]
    socket: Option<String>,
    /// TCP port of this machine that this process must not be able to reach.
    #[arg(long, value_name = "PORT")]
    port: Option<u16>,
}

/// Writes the answer as JSON to standard output.
///
/// # Errors
/// Standard output can't be written.
pub fn analyst(args: &AnalystArgs) -> Result<Exit, Failure> {
    die_with_parent(args.with_parent)?;
    let lures = Lures { canary: args.canary.clone(), socket: args.socket.clone(), port: args.port };
    let isolation = sandbox::enter(&lures);
    let mut answer = answer().unwrap_or_else(Answer::failed);
    answer.isolation = isolation;
    let clock = clock_gettime(ClockId::ProcessCPUTime);
    answer.cpu_seconds = clock.tv_sec as f64 + (clock.tv_nsec / 1_000_000) as f64 * 1e-3;
    say(&serde_json::to_string(&answer).map_err(Failure::internal)?)?;
    Ok(Exit::Done)
}

fn answer() -> Result<Answer, String> {
    let [model, recordings @ ..] = FILES.map(PathBuf::from);
    let file = freeplay_model::load(&model).map_err(|error| error.to_string())?;
    let present = recordings.iter().filter(|path| path.is_file());
    let recordings = present
        .map(|path| freeplay_recording::read(path, Some(file.arm.dof())))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| error.to_string())?;
    let diagnosis = diagnose(&file, &recordings, &DiagnoseSettings::default(), &mut |_| {});
    diagnosis.map(|diagnosis| Answer::of(&diagnosis)).map_err(|error| error.to_string())
}
