//! The processes of one run: start, supervision and end.

use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use freeplay_controller::{PATIENCE_ENV, SLOT_ENV};
use freeplay_fmi::guest::FmuController;
use freeplay_shm::{Address, LinkError, RUN_ENV, RunFolder};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::guard::Group;
use freeplay_terminal::process::command_with_locked_memory;
use freeplay_terminal::running::Running;
use rustix::process::{Pid, Signal, kill_process};

use crate::controller_selection::ControllerSelection;
use crate::live::Watch;
use crate::run_files::Files;
use crate::scenario::{Pacing, Scenario};
use freeplay_terminal::messages;

/// Creates a new run in shared memory.
///
/// # Errors
/// A location that another user occupies or could occupy, or an invalid one; otherwise an error of the operating system.
pub fn new_run() -> Result<RunFolder, Failure> {
    RunFolder::create().map_err(|error| match &error {
        LinkError::NotPrivate { .. } | LinkError::NoFolder { .. } | LinkError::Open { .. } => {
            Failure::input(error)
        }
        LinkError::BadAddress { .. } => Failure::input(error),
        _ => Failure::internal(error),
    })
}

/// Starts the plant of a run with the active controller `contestant`.
///
/// # Errors
/// A process that cannot start.
pub fn start_plant(
    contestant: &ControllerSelection,
    files: &Files,
    address: &Address,
) -> Result<Child, Failure> {
    spawn_plant(&mut plant_command(contestant, files, address)?)
}

/// Starts a plant that sends snapshots on a pipe and reads requests from another.
///
/// # Errors
/// A process that cannot start.
pub fn start_watched_plant(
    contestant: &ControllerSelection,
    files: &Files,
    address: &Address,
    watch: &mut Watch,
) -> Result<Child, Failure> {
    let mut command = plant_command(contestant, files, address)?;
    command.arg("--live").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(watch.stderr()?);
    let mut plant = spawn_plant(&mut command)?;
    watch.listen(&mut plant)?;
    Ok(plant)
}

fn spawn_plant(command: &mut Command) -> Result<Child, Failure> {
    command.spawn().map_err(|error| Failure::internal(format!("cannot start the plant: {error}")))
}

fn plant_command(
    contestant: &ControllerSelection,
    files: &Files,
    address: &Address,
) -> Result<Command, Failure> {
    let mut command = command_with_locked_memory()?;
    command
        .arg("plant")
        .args(["--run", &address.to_string(), "--name", contestant.name()])
        .args(["--controller", contestant.asked()])
        .args(["--with-parent", &std::process::id().to_string()])
        .arg("--scenario")
        .arg(&files.scenario)
        .arg("--task")
        .arg(&files.task)
        .arg("--out")
        .arg(&files.out)
        .stdin(Stdio::null())
        .stdout(Stdio::null());
    Ok(command)
}

/// Starts the process of a controller for the run at `address`.
///
/// # Errors
/// A process that cannot start.
pub fn start_controller(
    scenario: &Scenario,
    contestant: &ControllerSelection,
    address: &Address,
) -> Result<Running, Failure> {
    start_in_slot(scenario, contestant, 0, address, Stdio::inherit())
}

/// Starts the process of the controller in `slot`; its standard error goes to `stderr`.
///
/// # Errors
/// A process that cannot start.
pub fn start_in_slot(
    scenario: &Scenario,
    contestant: &ControllerSelection,
    slot: usize,
    address: &Address,
    stderr: Stdio,
) -> Result<Running, Failure> {
    let mut command = controller_command(scenario, contestant, slot)?;
    let group = contestant.executable.is_some().then(Group::start).transpose()?;
    if let Some(group) = &group {
        group.take(&mut command);
    }
    let child = command
        .env(RUN_ENV, address.to_string())
        .env(SLOT_ENV, slot.to_string())
        .env(PATIENCE_ENV, scenario.patience.to_string())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .map_err(|error| {
            Failure::peer(format!("cannot start the controller {}: {error}", contestant.asked()))
        })?;
    Ok(Running::new(child, group))
}

/// Command of this program as a wrapper, which an executable then replaces, so that it also ends with this process.
fn controller_command(
    scenario: &Scenario,
    contestant: &ControllerSelection,
    slot: usize,
) -> Result<Command, Failure> {
    let mut command = command_with_locked_memory()?;
    let built_in = Path::new(contestant.asked());
    command.arg("controller").arg(contestant.executable.as_deref().unwrap_or(built_in));
    command.args(["--with-parent", &std::process::id().to_string()]);
    if let Some(plan) = &contestant.faults {
        command.arg("--faults").arg(plan);
    }
    let is_fmu = contestant.executable.as_deref().is_some_and(FmuController::is_named);
    let understands = contestant.executable.is_none() || is_fmu || contestant.faults.is_some();
    if scenario.pace == Pacing::Realtime && understands {
        let realtime = &scenario.realtime;
        if realtime.priority > 0 {
            // A standby gets a lower priority: with equal priorities under SCHED_FIFO, a standby that polls would keep the plant from its
            // core.
            let priority = realtime.priority.saturating_sub(slot as u8).max(1);
            command.args(["--priority", &priority.to_string()]);
        }
        if let Some(cpu) = realtime.controller_cpu {
            command.args(["--cpu", &cpu.to_string()]);
        }
        if realtime.lock_memory {
            command.arg("--lock-memory");
        }
        if realtime.load > 0.0 && contestant.executable.is_none() {
            command.args(["--load", &realtime.load.to_string()]);
        }
    }
    Ok(command)
}

/// Interval at which the parent checks its children.
const LOOK: Duration = Duration::from_millis(5);
/// Longest time for the plant to end after the request.
const GRACE: Duration = Duration::from_secs(10);
/// Time for which a stopped plant may wait for an answer of its controller before the parent kills the controller.
const LAST_ANSWER: Duration = Duration::from_millis(300);

/// Exit states of the processes of a run.
pub struct Ended {
    plant: ExitStatus,
    /// The controllers by slot, if they ended before the plant did.
    controllers: Vec<Option<ExitStatus>>,
}

/// Waits for the plant of `root`, and calls `look` repeatedly. Without a controller the plant brakes and simulates the run to its end, or
/// gives up if no controller came; the function reports to it controllers that have ended.
///
/// # Errors
/// A plant that does not end, or an error of `look`.
pub fn supervise(
    root: &RunFolder,
    plant: &mut Child,
    controllers: &mut [Running],
    stop: &AtomicBool,
    mut look: impl FnMut(&mut [Running]) -> Result<(), Failure>,
) -> Result<Ended, Failure> {
    let mut asked_to_stop: Option<Instant> = None;
    let mut left: Vec<Option<ExitStatus>> = vec![None; controllers.len()];
    loop {
        if let Some(status) = plant.try_wait().map_err(Failure::internal)? {
            return Ok(Ended { plant: status, controllers: left });
        }
        for (slot, (left, controller)) in left.iter_mut().zip(controllers.iter_mut()).enumerate() {
            if left.is_none() {
                *left = controller.0.try_wait().map_err(Failure::internal)?;
                if left.is_some() {
                    root.report_process_exit(slot);
                }
            }
        }
        look(controllers)?;
        if stop.load(Ordering::Relaxed) {
            let since = asked_to_stop.get_or_insert_with(|| {
                terminate(plant);
                Instant::now()
            });
            // A hung controller would block a plant in lockstep until its patience ends.
            if since.elapsed() > LAST_ANSWER {
                controllers.iter_mut().for_each(|controller| drop(controller.0.kill()));
            }
            if since.elapsed() > GRACE {
                return Err(Failure::internal("the plant did not end after the request to end"));
            }
        }
        std::thread::sleep(LOOK);
    }
}

fn terminate(child: &Child) {
    if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
        // The process may have ended by itself meanwhile.
        let _ = kill_process(pid, Signal::TERM);
    }
}

/// The exit code of a run, from the states `ended` of its processes. The first of `members` was active at the start; `has_begun` is true
/// if all of them joined.
///
/// # Errors
/// A plant that failed.
pub fn exit_of_run(ended: &Ended, members: &[ControllerSelection], has_begun: bool) -> Result<Exit, Failure> {
    let said = |status: ExitStatus| match status.code() {
        Some(code) => format!("exit code {code}"),
        None => format!("{status}"),
    };
    match ended.plant.code() {
        Some(0) => Ok(Exit::Done),
        Some(1) => Ok(Exit::Verdict),
        Some(3) => Ok(Exit::Input),
        Some(5) => {
            let first = ended.controllers.first().copied().flatten();
            for (member, status) in members.iter().zip(&ended.controllers) {
                if let (Some(status), false) = (status, has_begun) {
                    let status = said(*status);
                    messages::fault(format_args!(
                        "the controller {} ended before it joined the run ({status})",
                        member.asked()
                    ));
                }
            }
            if has_begun || ended.controllers.iter().all(Option::is_none) {
                let how = match first {
                    Some(status) if !status.success() => {
                        format!("ended before the run did ({})", said(status))
                    }
                    _ => "did not answer in time".to_owned(),
                };
                let asked = members.first().map_or("", ControllerSelection::asked);
                messages::fault(format_args!("the controller {asked} {how}"));
            }
            // By the contract of exit codes, the controller has reported the fault of its input.
            let refused = first.and_then(|status| status.code()) == Some(3);
            Ok(if refused { Exit::Input } else { Exit::Peer })
        }
        Some(130) => Ok(Exit::Interrupted),
        // The signal arrived before the plant handled signals.
        None if ended.plant.signal() == Some(Signal::TERM.as_raw()) => Ok(Exit::Interrupted),
        Some(70) => {
            Err(Failure::internal("the plant failed; its message is above unless it lost its shared memory"))
        }
        _ => Err(Failure::internal(format!("the plant failed: {}", said(ended.plant)))),
    }
}
