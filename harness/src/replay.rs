//! `freeplay replay`: sends the recorded states to a new controller process and compares its commands with the recorded ones.

use std::path::PathBuf;
use std::process::Child;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use freeplay_arm::{Joint, JointKind};
use freeplay_laws::torque_unit;
use freeplay_recording::Recording;
use freeplay_shm::{Backoff, Command, Greeting, Mode, Offer, Pace, PlantLink, now_ns};
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::output::{say, show};
use serde::Serialize;

use crate::columns::state_at;
use crate::controller_selection::ControllerSelection;
use crate::processes::{new_run, start_controller};
use crate::scenario::{Pacing, Scenario};
use crate::setup::Setup;

/// Longest time for a controller to connect, and to answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// After this long without an answer, the parent checks the controller's process, ns.
const LOOK_AFTER_NS: u64 = 50_000_000;

/// Replays the recorded states of a run to a controller.
#[derive(Args, Debug)]
pub struct ReplayArgs {
    /// Recording of `freeplay run`, MCAP.
    recording: PathBuf,
    /// Controller: a built-in name, or the path of an executable or an FMU.
    #[arg(long)]
    against: String,
    /// Output format.
    #[arg(long, default_value = "text")]
    format: Format,
}

/// Differences between the new commands and the recorded ones.
#[derive(Debug, Default, Serialize)]
struct Difference {
    schema: &'static str,
    controller: String,
    ticks: usize,
    identical_ticks: usize,
    first_differing_tick: Option<u64>,
    /// Names of the joints, and units of their commands: `N*m` or `rad`; of prismatic joints `N` or `m`.
    joints: Vec<String>,
    units: Vec<&'static str>,
    /// Greatest difference of each joint's command, and the RMS over all ticks.
    greatest: Vec<f64>,
    rms: Vec<f64>,
}

impl Difference {
    /// Adds one tick with the recorded and the new values of all joints.
    fn add(&mut self, tick: u64, recorded: &[f64], new: &[f64]) {
        self.ticks += 1;
        self.greatest.resize(recorded.len(), 0.0);
        self.rms.resize(recorded.len(), 0.0);
        if recorded.iter().zip(new).all(|(old, new)| old.to_bits() == new.to_bits()) {
            self.identical_ticks += 1;
            return;
        }
        self.first_differing_tick.get_or_insert(tick);
        for (joint, (old, new)) in recorded.iter().zip(new).enumerate() {
            let error = (old - new).abs();
            self.greatest[joint] = self.greatest[joint].max(error);
            self.rms[joint] += error * error;
        }
    }

    fn finish(&mut self) {
        let ticks = self.ticks.max(1) as f64;
        self.rms.iter_mut().for_each(|sum| *sum = (*sum / ticks).sqrt());
    }
}

/// Replays a recording.
///
/// # Errors
/// A recording that is not from `freeplay run`; a controller that does not connect or stops answering.
pub fn replay(args: &ReplayArgs) -> Result<Exit, Failure> {
    let recording = freeplay_recording::read(&args.recording, None).map_err(Failure::input)?;
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let mut scenario = recorded_scenario(&recording, &args.recording, folder.path())?;
    scenario.pace = Pacing::Lockstep;
    let setup = Setup::new(&scenario)?;
    let task = setup.write_task(&scenario, folder.path())?;
    let contestant = ControllerSelection::of(&args.against)?;
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    let root = new_run()?;
    let offer = Offer {
        joints: recording.joints(),
        mode: setup.plant.mode,
        pace: Pace::Lockstep,
        period_ns: setup.plant.period_ns,
        ticks: recording.len() as u64,
        task: task.display().to_string(),
    };
    let mut link = PlantLink::open(root.address(), 1, offer).map_err(Failure::internal)?;
    let mut controller = start_controller(&scenario, &contestant, root.address())?;
    let outcome = feed(&mut link, &mut controller.0, &recording, &setup, root.address().run(), &stop);
    drop(controller);
    let unit = |joint: &Joint| match (setup.plant.mode, joint.kind) {
        (Mode::Torque, kind) => torque_unit(kind),
        (_, JointKind::Revolute) => "rad",
        (_, JointKind::Prismatic) => "m",
    };
    let difference = Difference {
        controller: args.against.clone(),
        joints: setup.arm().joints().iter().map(|joint| joint.name.clone()).collect(),
        units: setup.arm().joints().iter().map(unit).collect(),
        ..outcome?
    };
    match args.format {
        Format::Json => {
            say(&format!("{}\n", serde_json::to_string_pretty(&difference).map_err(Failure::internal)?))?
        }
        Format::Text => show(&in_words(&difference))?,
    }
    Ok(Exit::Done)
}

/// The scenario in an MCAP of `freeplay run`.
fn recorded_scenario(
    recording: &Recording,
    origin: &std::path::Path,
    folder: &std::path::Path,
) -> Result<Scenario, Failure> {
    let Some((_, text)) = recording.metadata.iter().find(|(key, _)| key == "scenario") else {
        return Err(Failure::input(format!(
            "{}: the recording carries no scenario; replay needs an MCAP recording of `freeplay run`",
            origin.display()
        )));
    };
    let file = folder.join("scenario.toml");
    freeplay_terminal::files::write(&file, text)?;
    Scenario::load(Some(&file), &[]).map_err(Failure::input)
}

fn feed(
    link: &mut PlantLink,
    controller: &mut Child,
    recording: &Recording,
    setup: &Setup,
    run: u64,
    stop: &AtomicBool,
) -> Result<Difference, Failure> {
    greet(link, controller)?;
    let mut difference = Difference { schema: "freeplay.replay/1", ..Difference::default() };
    let joints = recording.joints();
    for index in 0..recording.len() {
        if stop.load(Ordering::Relaxed) {
            let message = format!("interrupted before tick {index}");
            return Err(Failure { exit: Exit::Interrupted, message });
        }
        let state = state_at(recording, index, run, setup.plant.mode, setup.plant.period_ns);
        let mut state =
            state.ok_or_else(|| Failure::input("the recording lacks columns that `freeplay run` writes"))?;
        state.published_ns = now_ns();
        link.publish(&state).map_err(Failure::internal)?;
        let command = answer(link, controller, state.tick)?;
        let recorded: Option<Vec<f64>> = (1..=joints)
            .map(|joint| recording.column(&format!("command_{joint}")).map(|column| column[index]))
            .collect();
        let recorded =
            recorded.ok_or_else(|| Failure::input("the recording lacks the columns command_1…"))?;
        // Ticks without an answer of the recorded controller are not compared.
        if recorded.iter().all(|value| value.is_finite()) {
            difference.add(state.tick, &recorded, &command.value[..joints]);
        }
    }
    difference.finish();
    Ok(difference)
}

/// Fails if the process of the controller has ended.
fn see_alive(controller: &mut Child) -> Result<(), Failure> {
    match controller.try_wait() {
        Ok(Some(status)) => {
            Err(Failure::peer(format!("the controller ended ({status}); its message is above")))
        }
        _ => Ok(()),
    }
}

fn greet(link: &mut PlantLink, controller: &mut Child) -> Result<(), Failure> {
    let deadline = now_ns() + PATIENCE.as_nanos() as u64;
    while now_ns() < deadline {
        match link.greet().map_err(Failure::internal)?.into_iter().next() {
            Some(Greeting::Accepted { .. }) => return Ok(()),
            Some(Greeting::Refused { name, verdict, .. }) => {
                return Err(Failure::input(format!("{name} was refused: {verdict:?}")));
            }
            None => see_alive(controller)?,
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Err(Failure::peer(format!("no controller came within {PATIENCE:?}")))
}

fn answer(link: &mut PlantLink, controller: &mut Child, tick: u64) -> Result<Command, Failure> {
    let mut backoff = Backoff::for_this_machine();
    let deadline = now_ns() + PATIENCE.as_nanos() as u64;
    while now_ns() < deadline {
        match link.next_command(0).map_err(Failure::internal)? {
            Some(command) if command.tick == tick => return Ok(command),
            Some(_) => {}
            None if backoff.wait() > LOOK_AFTER_NS => see_alive(controller)?,
            None => {}
        }
    }
    Err(Failure::peer(format!("no answer to tick {tick} within {PATIENCE:?}")))
}

fn in_words(difference: &Difference) -> String {
    let mut text = format!(
        "in {} of {} ticks the commands of {} are identical to the recorded ones, to the last bit\n",
        difference.identical_ticks, difference.ticks, difference.controller
    );
    if let Some(tick) = difference.first_differing_tick {
        text += &format!(
            "the first different commands are those of tick {tick}; greatest and RMS difference by joint:\n"
        );
        let joints = difference.joints.iter().zip(&difference.units);
        for ((joint, unit), (greatest, rms)) in joints.zip(difference.greatest.iter().zip(&difference.rms)) {
            let unit = unit.replace('*', "·");
            text += &format!("  {joint}: {greatest:.1e} {unit}, {rms:.1e} {unit}\n");
        }
    }
    text
}
