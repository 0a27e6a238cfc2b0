//! Faults outside the controller: the plant is killed, shared memory is full.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use freeplay_harness::controller_selection::ControllerSelection;
use freeplay_harness::processes::{new_run, start_in_slot, start_plant};
use freeplay_harness::run_files::Files;
use freeplay_harness::scenario::{RecordingKind, Scenario};
use freeplay_harness::setup::Setup;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::make_folder;
use freeplay_terminal::running::Running;
use serde::Serialize;

/// Time limit for the end of a process.
const LONGEST: Duration = Duration::from_secs(20);
const LOOK: Duration = Duration::from_millis(1);
/// Insufficient sizes of the shared memory: for the services, for the segments of the plant, for those of a controller.
const SIZES: [&str; 3] = ["32k", "64k", "80k"];

/// Outcome of a fault outside the controller.
#[derive(Clone, Debug, Serialize)]
pub struct EnvironmentFault {
    /// The fault.
    pub fault: &'static str,
    /// True if the outcome meets the expectation; `None` if this machine does not permit the fault.
    pub holds: Option<bool>,
    /// The observation.
    pub found: String,
}

/// Tries all these faults on `examined`.
///
/// # Errors
/// A process that can't be started.
pub fn examine(
    scenario: &Scenario,
    examined: &ControllerSelection,
    out: &Path,
) -> Result<Vec<EnvironmentFault>, Failure> {
    let mut found = vec![plant_killed(scenario, examined, out)?];
    for size in SIZES {
        found.push(memory_full(examined.asked(), size, out)?);
    }
    Ok(found)
}

/// Kills the plant in the middle of the motion: the controller has to end by itself.
fn plant_killed(
    scenario: &Scenario,
    examined: &ControllerSelection,
    out: &Path,
) -> Result<EnvironmentFault, Failure> {
    let scenario = Scenario {
        standby: Vec::new(),
        compare: None,
        swap: Vec::new(),
        duration: Some(60.0),
        recording: RecordingKind::Mcap,
        ..scenario.clone()
    };
    let files = Files::write(&scenario, &Setup::new(&scenario)?, &out.join("plant-killed"))?;
    let recording = files.out.join(format!("{}.mcap", examined.name()));
    // The recording of an earlier exam in this folder would indicate that this motion has begun.
    freeplay_storage::remove_file(&recording)?;
    let root = new_run()?;
    let mut plant = Running::alone(start_plant(examined, &files, root.address())?);
    // The controller reports that the plant has ended, which would look like a failure of the exam.
    let mut controller = start_in_slot(&scenario, examined, 0, root.address(), Stdio::null())?;
    let begun = Instant::now();
    while freeplay_recording::read(&recording, None).is_err() && begun.elapsed() < LONGEST {
        std::thread::sleep(Duration::from_millis(20));
    }
    let _ = plant.0.kill();
    let _ = plant.0.wait();
    let killed = Instant::now();
    let status = ends(&mut controller.0)?;
    let took = killed.elapsed();
    let opens = freeplay_recording::read(&recording, None).is_ok();
    let how = status.map_or_else(|| "did not end".to_owned(), |status| format!("ended ({status})"));
    Ok(EnvironmentFault {
        fault: "plant-killed",
        holds: Some(status.is_some() && opens),
        found: format!(
            "the controller {how} {:.2} s later; the recording {}",
            took.as_secs_f64(),
            if opens { "opens" } else { "does not open" }
        ),
    })
}

/// Limits shared memory to `size`: the run has to end with a message and an exit code, not hang.
fn memory_full(controller: &str, size: &str, out: &Path) -> Result<EnvironmentFault, Failure> {
    let fault = match size {
        "32k" => "memory-full-32k",
        "64k" => "memory-full-64k",
        _ => "memory-full-80k",
    };
    let mount =
        "mount -t tmpfs -o mode=1777,size=$0 tmpfs /dev/shm && : > \"$1/mounted\" && shift && exec \"$@\"";
    let folder = out.join(fault);
    make_folder(&folder)?;
    let program = std::env::current_exe().map_err(Failure::internal)?;
    let executable = std::path::absolute(controller).ok().filter(|path| path.is_file());
    let asked = executable.unwrap_or_else(|| controller.into());
    let mut command = Command::new("unshare");
    command.args(["--mount", "--propagation", "private", "sh", "-c", mount, size]).arg(&folder).arg(program);
    command
        .args(["run", "--quiet", "--set", "duration=0.2", "--set", "patience=3", "--controller"])
        .arg(asked);
    command.arg("--out").arg(&folder).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let untried = |why: &str| EnvironmentFault { fault, holds: None, found: why.to_owned() };
    let Ok(child) = command.spawn() else { return Ok(untried("not tried: this machine has no unshare")) };
    let mut run = Running::alone(child);
    let status = ends(&mut run.0)?;
    if !folder.join("mounted").exists() {
        return Ok(untried("not tried: this user may not mount a small shared memory"));
    }
    Ok(EnvironmentFault {
        fault,
        holds: Some(status.is_some_and(|status| status.code().is_some())),
        found: match status {
            Some(status) if status.success() => "enough: the run ended normally".to_owned(),
            Some(status) => format!("the run ended ({status})"),
            None => "the run hung".to_owned(),
        },
    })
}

/// Waits for the end of `child`; `None` after the time limit.
fn ends(child: &mut Child) -> Result<Option<std::process::ExitStatus>, Failure> {
    let begun = Instant::now();
    while begun.elapsed() < LONGEST {
        if let Some(status) = child.try_wait().map_err(Failure::internal)? {
            return Ok(Some(status));
        }
        std::thread::sleep(LOOK);
    }
    Ok(None)
}
