//! The yardsticks: a bare loop on an absolute clock, and bare iceoryx2 with the same messages at the same rate. Both wait like runs, on the same cores and at
//! the same priority, each in separate processes.

use std::path::PathBuf;
use std::time::{Instant, SystemTime};

use clap::{Args, ValueEnum};
use freeplay_harness::histogram_files::write_hlog;
use freeplay_plant::{Stage, Stages};
use freeplay_shm::{
    Address, BareController, BarePlant, Command, RtRequest, Schedule, State, now_ns, prepare,
    sleep_then_spin_until,
};
use freeplay_terminal::exit::{Exit, Failure};

/// The loops stop sleeping this long before a tick, ns, like runs.
const SPIN_NS: u64 = 200_000;
/// The plant gives up a command this long before the next tick, ns, like runs.
const JUDGING_NS: u64 = 50_000;
/// Delay of the answering end, ns: about the compute time of the fastest controller. Without it the answer would arrive before the other end polls for it,
/// which no controller achieves.
const THOUGHT_NS: u64 = 10_000;
/// Time limit for the two ends to meet, ns.
const PATIENCE_NS: u64 = 10_000_000_000;
/// Number of joints in the messages, whose size does not depend on it.
const JOINTS: usize = 6;

/// Role of a process in a reference measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Role {
    /// A loop that only wakes at each tick.
    Clock,
    /// The process that publishes states by the clock.
    Plant,
    /// The process that answers.
    Controller,
}

/// Plays one role of a reference measurement. `freeplay bench` starts this process.
#[derive(Args, Debug)]
pub struct YardstickArgs {
    /// Role to play.
    role: Role,
    /// Address of the run in shared memory.
    #[arg(long)]
    run: String,
    /// Number of ticks.
    #[arg(long)]
    ticks: u64,
    /// Time between two ticks, ns.
    #[arg(long)]
    period: u64,
    /// Core to which this process is pinned.
    #[arg(long)]
    cpu: Option<usize>,
    /// SCHED_FIFO priority to request.
    #[arg(long)]
    priority: Option<u8>,
    /// Lock all memory in RAM.
    #[arg(long)]
    lock_memory: bool,
    /// Write the histograms to this path.
    #[arg(long)]
    out: Option<PathBuf>,
    /// End when the parent process with this ID ends.
    #[arg(long, value_name = "PID")]
    with_parent: Option<u32>,
}

/// Plays the part of `args`.
///
/// # Errors
/// A run that can't be joined; a peer that does not come; a file that can't be written.
pub fn yardstick(args: &YardstickArgs) -> Result<Exit, Failure> {
    args.with_parent.map_or(Ok(()), freeplay_terminal::process::die_with_parent)?;
    let address = Address::parse(&args.run).map_err(Failure::usage)?;
    let request = RtRequest { priority: args.priority, cpu: args.cpu, lock_memory: args.lock_memory };
    let mut stages = Stages::new().map_err(Failure::internal)?;
    let (began, clock) = (SystemTime::now(), Instant::now());
    match args.role {
        Role::Clock => {
            let _ = prepare(&request);
            wake(args, &mut stages);
        }
        Role::Plant => {
            let plant = BarePlant::open(&address).map_err(Failure::internal)?;
            let _ = prepare(&request);
            exchange(args, plant, address.run(), &mut stages)?;
        }
        Role::Controller => {
            let controller = BareController::open(&address).map_err(Failure::internal)?;
            let _ = prepare(&request);
            answer(args, controller)?;
        }
    }
    if let Some(path) = &args.out {
        write_hlog(path, &stages, began, clock.elapsed())?;
    }
    Ok(Exit::Done)
}

fn wake(args: &YardstickArgs, stages: &mut Stages) {
    let schedule = Schedule { start_ns: now_ns() + args.period, period_ns: args.period };
    for tick in 0..args.ticks {
        stages.record_arrival(schedule.await_tick(tick, SPIN_NS));
    }
}

/// The command that answers `state`; `None` if it does not arrive before `deadline`.
fn command(plant: &BarePlant, state: &State, deadline: u64) -> Result<Option<(Command, u64)>, Failure> {
    loop {
        let command = plant.next_command().map_err(Failure::internal)?;
        let now = now_ns();
        match command {
            Some(command) if command.tick == state.tick => return Ok(Some((command, now))),
            _ if now >= deadline => return Ok(None),
            _ => std::hint::spin_loop(),
        }
    }
}

fn exchange(
    args: &YardstickArgs,
    mut plant: BarePlant,
    run: u64,
    stages: &mut Stages,
) -> Result<(), Failure> {
    let mut state = State::new(run, JOINTS);
    let patience = now_ns() + PATIENCE_NS;
    // The other end may still be opening: tick 0 is repeated until it is answered.
    while command(&plant, &state, now_ns() + args.period)?.is_none() {
        plant.publish(&state).map_err(Failure::internal)?;
        if now_ns() > patience {
            return Err(Failure::peer("the other process of the yardstick did not start"));
        }
    }
    let schedule = Schedule { start_ns: now_ns(), period_ns: args.period };
    for tick in 1..=args.ticks {
        stages.record_arrival(schedule.await_tick(tick, SPIN_NS));
        (state.tick, state.scheduled_ns, state.published_ns) = (tick, schedule.due_ns(tick), now_ns());
        state.flags = if tick == args.ticks { State::FLAG_LAST } else { 0 };
        plant.publish(&state).map_err(Failure::internal)?;
        let deadline = schedule.due_ns(tick + 1) - JUDGING_NS;
        if let Some((command, received)) = command(&plant, &state, deadline)? {
            stages.record(Stage::StateTransport, command.received_ns.saturating_sub(state.published_ns));
            stages.record(Stage::CommandTransport, received.saturating_sub(command.sent_ns));
            stages.record(Stage::Uncorrected, received.saturating_sub(state.published_ns));
        }
    }
    Ok(())
}

fn answer(args: &YardstickArgs, mut controller: BareController) -> Result<(), Failure> {
    let mut last = now_ns();
    let mut due = 0;
    loop {
        let Some(state) = controller.next_state().map_err(Failure::internal)? else {
            let now = now_ns();
            if now > last + PATIENCE_NS {
                return Err(Failure::peer("the other process of the yardstick has ended"));
            }
            // Waits like a controller in real time: asleep until shortly before the next state is due.
            if now + SPIN_NS < due {
                sleep_then_spin_until(due - SPIN_NS, 0);
            } else {
                std::hint::spin_loop();
            }
            continue;
        };
        last = now_ns();
        let received_ns = last;
        due = state.scheduled_ns + args.period;
        while now_ns() < received_ns + THOUGHT_NS {
            std::hint::spin_loop();
        }
        let answer = Command { received_ns, sent_ns: now_ns(), ..Command::answer_to(&state, 0) };
        controller.send(&answer).map_err(Failure::internal)?;
        if state.has(State::FLAG_LAST) {
            return Ok(());
        }
    }
}
