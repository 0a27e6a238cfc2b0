//! The processes of one run: how they are started, looked after and ended.

use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use freeplay_controller::serve::SLOT_ENV;
use freeplay_shm::{Address, RUN_ENV};
use rustix::process::{Pid, Signal, kill_process};

use crate::exit::{Exit, Failure};
use crate::live::Watch;
use crate::run::{Contestant, Files};
use crate::scenario::{Pacing, Scenario};
use crate::voice;

/// A child process; ended when this is dropped.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Errors here mean that the child is gone already, which is what is wanted.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts the plant of a run with the controller `contestant` in charge.
///
/// # Errors
/// A process that can't be started.
pub fn start_plant(contestant: &Contestant, files: &Files, address: &Address) -> Result<Child, Failure> {
    spawn_plant(&mut plant_command(contestant, files, address)?)
}

/// The same, watched: it tells of its ticks on a pipe and listens on another.
///
/// # Errors
/// A process that can't be started.
pub fn start_watched_plant(
    contestant: &Contestant,
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

fn plant_command(contestant: &Contestant, files: &Files, address: &Address) -> Result<Command, Failure> {
    let mut command = Command::new(std::env::current_exe().map_err(Failure::internal)?);
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
/// A process that can't be started.
pub fn start_controller(
    scenario: &Scenario,
    contestant: &Contestant,
    address: &Address,
) -> Result<Child, Failure> {
    start_in_slot(scenario, contestant, 0, address, Stdio::inherit())
}

/// Starts the process of the controller that takes `slot`; what it has to say goes to `stderr`.
///
/// # Errors
/// A process that can't be started.
pub fn start_in_slot(
    scenario: &Scenario,
    contestant: &Contestant,
    slot: usize,
    address: &Address,
    stderr: Stdio,
) -> Result<Child, Failure> {
    controller_command(scenario, contestant, slot)?
        .env(RUN_ENV, address.to_string())
        .env(SLOT_ENV, slot.to_string())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .map_err(|error| {
            Failure::peer(format!("cannot start the controller {}: {error}", contestant.asked()))
        })
}

/// This program, which an executable takes over: so it ends with this process, too.
fn controller_command(scenario: &Scenario, contestant: &Contestant, slot: usize) -> Result<Command, Failure> {
    let mut command = Command::new(std::env::current_exe().map_err(Failure::internal)?);
    let built_in = Path::new(contestant.asked());
    command.arg("controller").arg(contestant.executable.as_deref().unwrap_or(built_in));
    command.args(["--with-parent", &std::process::id().to_string()]);
    if let Some(plan) = &contestant.faults {
        command.arg("--faults").arg(plan);
    }
    let understands = contestant.executable.is_none() || contestant.faults.is_some();
    if scenario.pace == Pacing::Realtime && understands {
        let realtime = &scenario.realtime;
        if realtime.priority > 0 {
            // A standby waits its turn: of equals under SCHED_FIFO, one that polls for its state would keep the plant from its core.
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

/// How often the parent looks after its children.
const LOOK: Duration = Duration::from_millis(5);
/// How long the plant may take to end after it was asked to.
const GRACE: Duration = Duration::from_secs(10);
/// How long a stopped plant may wait for an answer of its controller before that is taken away.
const LAST_ANSWER: Duration = Duration::from_millis(300);

/// How the processes of a run ended.
pub struct Ended {
    plant: ExitStatus,
    /// The controller that began, if it ended before the plant did.
    controller: Option<ExitStatus>,
}

/// Waits for the plant; `look` is called again and again meanwhile. Without a controller the plant brakes and plays the run to
/// its end, or gives up when nobody came.
///
/// # Errors
/// A plant that does not end; what `look` says.
pub fn supervise(
    plant: &mut Child,
    controllers: &mut [Running],
    stop: &AtomicBool,
    mut look: impl FnMut(&mut [Running]) -> Result<(), Failure>,
) -> Result<Ended, Failure> {
    let (mut asked_to_stop, mut controller_left): (Option<Instant>, Option<ExitStatus>) = (None, None);
    loop {
        if let Some(status) = plant.try_wait().map_err(Failure::internal)? {
            return Ok(Ended { plant: status, controller: controller_left });
        }
        if let Some(Running(controller)) = controllers.first_mut() {
            controller_left = controller_left.or(controller.try_wait().map_err(Failure::internal)?);
        }
        look(controllers)?;
        if stop.load(Ordering::Relaxed) {
            let since = asked_to_stop.get_or_insert_with(|| {
                terminate(plant);
                Instant::now()
            });
            // A hung controller would keep a plant in lockstep waiting for as long as its patience lasts.
            if since.elapsed() > LAST_ANSWER {
                controllers.iter_mut().for_each(|controller| drop(controller.0.kill()));
            }
            if since.elapsed() > GRACE {
                return Err(Failure::internal("the plant did not end when it was asked to"));
            }
        }
        std::thread::sleep(LOOK);
    }
}

fn terminate(child: &Child) {
    if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
        // It may have ended by itself in the meantime.
        let _ = kill_process(pid, Signal::TERM);
    }
}

/// What a run of `contestant` came to, from how its processes `ended`.
///
/// # Errors
/// A plant that failed.
pub fn exit(ended: &Ended, contestant: &Contestant) -> Result<Exit, Failure> {
    let said = |status: ExitStatus| match status.code() {
        Some(code) => format!("exit code {code}"),
        None => format!("{status}"),
    };
    match ended.plant.code() {
        Some(0) => Ok(Exit::Done),
        Some(1) => Ok(Exit::Verdict),
        Some(3) => Ok(Exit::Input),
        Some(5) => {
            let how = match ended.controller {
                Some(status) if !status.success() => format!("ended before the run did ({})", said(status)),
                _ => "did not answer in time".to_owned(),
            };
            voice::fault(format_args!("the controller {} {how}", contestant.asked()));
            // By the contract of exit codes it had said what is wrong with its input.
            let refused = ended.controller.and_then(|status| status.code()) == Some(3);
            Ok(if refused { Exit::Input } else { Exit::Peer })
        }
        Some(130) => Ok(Exit::Interrupted),
        // It was asked to end before it could listen.
        None if ended.plant.signal() == Some(Signal::TERM.as_raw()) => Ok(Exit::Interrupted),
        _ => Err(Failure::internal(format!("the plant failed: {}", said(ended.plant)))),
    }
}
