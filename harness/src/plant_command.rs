//! `freeplay plant`: the process that plays the machine for one run.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant, SystemTime};

use clap::Args;
use crossbeam::queue::ArrayQueue;
use freeplay_plant::{Ending, Plant, PlantError, PlantOutcome, Rejection, StopReason};
use freeplay_recording::RowWriter;
use freeplay_shm::{Address, Mode, Offer, PlantLink, realtime};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::write;

use crate::columns::RunColumns;
use crate::histogram_files::{write_hgrm, write_hlog};
use crate::live::{Console, Observer};
use crate::recorder::{QUEUE, Recorder};
use crate::scenario::{Pacing, RecordingKind, Scenario};
use crate::setup::{Setup, realtime_request};
use crate::summary::{RunFacts, RunSummary};
use crate::swaps;
use freeplay_terminal::messages;

/// Longest time for which killed controllers may keep their seats.
const LAST_SEAT: Duration = Duration::from_millis(100);

/// Simulates the machine of one run. `freeplay run` starts this process.
#[derive(Args, Debug)]
pub struct PlantArgs {
    /// Address of the run in shared memory.
    #[arg(long, env = "FREEPLAY_RUN")]
    run: String,
    /// File of the effective scenario.
    #[arg(long)]
    scenario: PathBuf,
    /// Task file for the controllers.
    #[arg(long)]
    task: PathBuf,
    /// Write the results of the run to this folder.
    #[arg(long)]
    out: PathBuf,
    /// Name of the run's files and of its controller in the summary.
    #[arg(long)]
    name: String,
    /// Controller name as requested, if it differs from --name.
    #[arg(long)]
    controller: Option<String>,
    /// End when the parent process with this ID ends.
    #[arg(long, value_name = "PID")]
    with_parent: Option<u32>,
    /// Report the run on standard output, and read requests from standard input.
    #[arg(long)]
    live: bool,
}

/// Runs the plant of one run.
///
/// # Errors
/// Bad input; no controller; a failed integration.
pub fn plant(args: &PlantArgs) -> Result<Exit, Failure> {
    args.with_parent.map_or(Ok(()), freeplay_terminal::process::stop_with_parent)?;
    let scenario = Scenario::load(Some(&args.scenario), &[]).map_err(Failure::input)?;
    let mut setup = Setup::new(&scenario)?;
    let names = swaps::names(args.controller.as_deref().unwrap_or(&args.name), &scenario.standby);
    let period = setup.plant.period_ns as f64 * 1e-9;
    setup.plant.controller_set = swaps::controller_set(&scenario, &names, setup.plant.ticks, period)?;
    let address = Address::parse(&args.run).map_err(Failure::usage)?;
    let offer = Offer {
        joints: setup.plant.arm.dof(),
        mode: setup.plant.mode,
        pace: setup.plant.pace,
        period_ns: setup.plant.period_ns,
        ticks: setup.plant.ticks,
        task: args.task.display().to_string(),
    };
    // Before this point no clean-up is needed: a signal ends the process at once, even during long preparations.
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    let link = PlantLink::open(&address, names.len(), offer).map_err(Failure::internal)?;
    let queue = Arc::new(ArrayQueue::new(QUEUE));
    let plays: Vec<String> = setup.plays().into_iter().map(|(joint, _)| joint).collect();
    let joints: Vec<String> = setup.arm().joints().iter().map(|joint| joint.name.clone()).collect();
    let joint_names = joints.join(",");
    let mut plant =
        Plant::new(setup.plant.clone(), Arc::clone(&setup.path), link, address.run(), Arc::clone(&queue))
            .map_err(failure)?;
    let period = setup.plant.period_ns as f64 * 1e-9;
    let tracked = scenario.sensors.track_tool;
    let columns = RunColumns::new(setup.plant.arm.dof(), plays.clone(), tracked, period)
        .with_links(plant.system().decoupled_joints().next().is_some())
        .with_commands(setup.plant.mode == Mode::Servo)
        .with_standbys(names.len() - 1);
    let (console, observer) = if args.live {
        let (console, snapshots) = Console::start(plant.requests())?;
        let is_realtime = scenario.pace == Pacing::Realtime;
        let observer =
            Observer::new(snapshots, plays.len(), period, is_realtime).map_err(Failure::internal)?;
        (Some(console), Some(observer))
    } else {
        (None, None)
    };
    let recorder = start_recorder(args, &scenario, (columns, joint_names), queue, observer)?;
    let request = realtime_request(&scenario, scenario.realtime.plant_cpu);
    let granted = realtime::prepare(&request);
    let (began, clock) = (SystemTime::now(), Instant::now());
    let outcome = plant.run(&stop);
    let kept =
        recorder.finish().ok_or_else(|| Failure::internal("the recorder failed; its message is above"))?;
    if let Some(console) = console {
        console.finish();
    }
    let outcome = outcome.map_err(failure)?;
    let fault = kept.fault.map(|fault| format!("the recording ends early: {fault}"));
    if let Some(fault) = &fault {
        // The fault is printed at once, because on a full disk there may be no summary to contain it.
        messages::fault(fault);
    }
    let mut notes = outcome.refused.iter().map(|who| format!("refused: {who}")).collect::<Vec<_>>();
    notes.extend(fault.clone());
    notes.extend(names.iter().enumerate().filter_map(|(slot, name)| {
        let foreign = plant.foreign(slot);
        let process = foreign.process?;
        Some(format!(
            "{} commands for {name} came from process {process}, which is not that controller; they were ignored",
            foreign.commands
        ))
    }));
    notes.extend(outcome.divergence.iter().map(ToString::to_string));
    let summary = RunSummary::new(
        &plant,
        RunFacts {
            controller: args.name.clone(),
            controllers: names,
            pace: pace_name(scenario.pace).to_owned(),
            ticks: outcome.ticks,
            ending: outcome.ending,
            state_hash: kept.state_hash,
            joints,
            plays,
            realtime: granted,
            recording: kept.recording.and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned())),
            notes,
        },
    );
    let text = serde_json::to_string_pretty(&summary).map_err(Failure::internal)?;
    write(&args.out.join(format!("{}.json", args.name)), &text)?;
    write_hlog(&args.out.join(format!("{}.hlog", args.name)), plant.stages(), began, clock.elapsed())?;
    write_hgrm(&args.out, &args.name, plant.stages())?;
    if args.with_parent.is_some_and(|parent| !freeplay_terminal::process::is_parent_alive(parent)) {
        // The system kills the controllers of a killed run. The last participant of a run removes it.
        await_free_seats(&plant);
    }
    Ok(match exit(&outcome) {
        Exit::Done if summary.verdict == "failed" => Exit::Verdict,
        Exit::Done if fault.is_some() => Exit::Input,
        exit => exit,
    })
}

/// Waits briefly until no controller of `plant` lives.
fn await_free_seats(plant: &Plant) {
    let begun = Instant::now();
    let slots = 0..plant.manager().len();
    while slots.clone().any(|slot| plant.has_controller(slot)) && begun.elapsed() < LAST_SEAT {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// "lockstep" or "realtime".
pub fn pace_name(pace: Pacing) -> &'static str {
    match pace {
        Pacing::Lockstep => "lockstep",
        Pacing::Realtime => "realtime",
    }
}

fn start_recorder(
    args: &PlantArgs,
    scenario: &Scenario,
    (columns, joints): (RunColumns, String),
    queue: Arc<ArrayQueue<freeplay_plant::TickRecord>>,
    observer: Option<Observer>,
) -> Result<Recorder, Failure> {
    let layout = columns.layout().map_err(Failure::input)?;
    let extension = match scenario.recording {
        RecordingKind::Mcap => Some("mcap"),
        RecordingKind::Csv => Some("csv"),
        RecordingKind::None => None,
    };
    let metadata = [
        ("freeplay".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("controller".to_owned(), args.name.clone()),
        ("scenario".to_owned(), scenario.to_toml().map_err(Failure::internal)?),
        ("joints".to_owned(), joints),
    ];
    let writer = extension
        .map(|extension| {
            let path = args.out.join(format!("{}.{extension}", args.name));
            RowWriter::create(&path, &layout, &metadata).map(|writer| (path, writer)).map_err(Failure::input)
        })
        .transpose()?;
    Recorder::start(queue, columns, writer, observer).map_err(Failure::no_thread)
}

fn failure(error: PlantError) -> Failure {
    match error {
        // A controller came but was refused, which is an error of the configuration.
        PlantError::NoController { ref refused, .. } if !refused.is_empty() => Failure::input(error),
        PlantError::NoController { .. } | PlantError::ControllerEnded { .. } => Failure::peer(error),
        PlantError::Law(_) | PlantError::TooManyJoints { .. } => Failure::input(error),
        PlantError::System(_) => Failure { exit: Exit::Verdict, message: error.to_string() },
        PlantError::Link(_) | PlantError::Histogram(_) => Failure::internal(error),
    }
}

fn exit(outcome: &PlantOutcome) -> Exit {
    match outcome.ending {
        Ending::Finished => Exit::Done,
        Ending::Braked { reason: StopReason::Rejected(Rejection::Missing), .. } => Exit::Peer,
        Ending::Braked { .. } | Ending::Diverged { .. } => Exit::Verdict,
        Ending::Interrupted { .. } => Exit::Interrupted,
    }
}
