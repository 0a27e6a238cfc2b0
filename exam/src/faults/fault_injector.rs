//! A process between a run and a controller that makes the controller appear faulty.
//!
//! To the run it is a controller: it holds the slot and sends the commands. To the controller it is a plant: it opens a run of its own with the same offer, and
//! publishes the states that it receives. So the exam accepts any executable unchanged. The run sees a real process and a real link with a fault, and the
//! injector kills or stops the controller itself if the fault requires it. See `decisions/0006-swaps-and-faults.md`.

use std::path::Path;
use std::process::{Child, Command as Process, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use freeplay_harness::controller_command::ControllerArgs;
use freeplay_shm::{
    Address, Backoff, Command, ControllerLink, Greeting, Hello, LinkError, Offer, Pace, PlantLink, RUN_ENV,
    RtRequest, State, Welcome, now_ns, realtime, sleep_then_spin_until,
};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::read_json;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::{Pid, Signal, getpid, kill_process};

use crate::faults::active_fault::ActiveFault;
use crate::faults::kinds::{Injection, Kind, Plan};
use freeplay_harness::processes::new_run;

/// Time limit for the plant's welcome and for the controller's hello.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time without messages after which the process checks that both peers live, ns.
const LOOK_NS: u64 = 50_000_000;
/// Time limit for the last answer after the last state, ns.
const LAST_ANSWER_NS: u64 = 500_000_000;
/// Real time: pause between two polls for messages, ns.
const PAUSE_NS: u64 = 50_000;
/// Difference by which the controller's real-time priority is below that of this process.
const LOWER: u8 = 10;
/// Size of a clock jump, ns.
const JUMP_NS: u64 = 1_000_000_000;

/// Plays the controller of `args` with the faults of the file `plan`.
///
/// # Errors
/// A plan that can't be read, a run that can't be joined, a controller that does not join.
pub fn relay(args: &ControllerArgs, plan: &Path) -> Result<Exit, Failure> {
    let plan: Plan = read_json(plan, "the plan that freeplay faults wrote")?;
    let stop = Arc::new(AtomicBool::new(false));
    freeplay_terminal::process::stop_on_signals(&stop)?;
    let address = Address::parse(&args.run).map_err(Failure::usage)?;
    let name = args.name.file_name().unwrap_or(args.name.as_os_str()).to_string_lossy();
    let hello = Hello::new(&name, args.slot, 0);
    let (outer, welcome) = ControllerLink::connect(&address, hello, PATIENCE).map_err(link_failure)?;
    let root = new_run()?;
    let offer = offer(&welcome).ok_or_else(|| Failure::input("the plant's welcome is of another version"))?;
    let pace = offer.pace;
    let mut inner = PlantLink::open(root.address(), 1, offer).map_err(Failure::internal)?;
    let mut child = ControllerProcess(start(args, root.address())?);
    child.greet(&mut inner)?;
    // A refused request does not matter: an exam measures no latencies.
    let _ = realtime::prepare(&RtRequest {
        priority: args.priority,
        cpu: args.cpu,
        lock_memory: args.lock_memory,
    });
    let mut saboteur = Saboteur {
        outer,
        inner,
        child,
        plan,
        pace,
        period_ns: welcome.period_ns,
        runs: [welcome.run, root.address().run()],
        slot: args.slot,
        spoiler: None,
        last_good: None,
        signal: None,
        stopped: false,
        last: None,
        done: false,
    };
    saboteur.run(&stop)
}

fn link_failure(error: LinkError) -> Failure {
    match error {
        LinkError::NoRun { .. } | LinkError::NoPlant { .. } => Failure::peer(error),
        LinkError::Refused { .. } => Failure::input(error),
        error => Failure::internal(error),
    }
}

/// The plant's offer, for the controller.
fn offer(welcome: &Welcome) -> Option<Offer> {
    Some(Offer {
        joints: welcome.joints as usize,
        mode: welcome.mode()?,
        pace: welcome.pace()?,
        period_ns: welcome.period_ns,
        ticks: welcome.ticks,
        task: welcome.task(),
    })
}

/// Starts the controller itself in the run at `address`.
fn start(args: &ControllerArgs, address: &Address) -> Result<Child, Failure> {
    let mut process = Process::new(std::env::current_exe().map_err(Failure::internal)?);
    process.arg("controller").arg(&args.name).args(["--slot", "0"]);
    process.args(["--with-parent", &std::process::id().to_string()]);
    if let Some(priority) = args.priority {
        // Below this process: a controller that polls for its state must not take the core from the process that brings the state.
        let priority = priority.saturating_sub(LOWER).max(1);
        process.args(["--priority", &priority.to_string()]);
    }
    process.env(RUN_ENV, address.to_string()).env(freeplay_controller::SLOT_ENV, "0");
    process.stdin(Stdio::null()).stdout(Stdio::null());
    process.spawn().map_err(|error| Failure::peer(format!("cannot start {}: {error}", args.name.display())))
}

/// The controller's process; dropping it ends the process.
struct ControllerProcess(Child);

impl Drop for ControllerProcess {
    fn drop(&mut self) {
        // An error means that it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl ControllerProcess {
    /// Waits for its hello.
    fn greet(&mut self, inner: &mut PlantLink) -> Result<(), Failure> {
        let deadline = now_ns() + PATIENCE.as_nanos() as u64;
        while now_ns() < deadline {
            match inner.greet().map_err(Failure::internal)?.into_iter().next() {
                Some(Greeting::Accepted { .. }) => return Ok(()),
                Some(Greeting::Refused { name, verdict, .. }) => {
                    return Err(Failure::input(format!("{name} was refused: {verdict:?}")));
                }
                None => {}
            }
            if let Some(status) = self.0.try_wait().map_err(Failure::internal)? {
                return Err(Failure::peer(format!(
                    "the controller ended before it joined the run ({status})"
                )));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Err(Failure::peer(format!("the controller did not join the run within {PATIENCE:?}")))
    }

    fn signal(&self, signal: Signal) {
        if let Some(pid) = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw) {
            // It may have ended.
            let _ = kill_process(pid, signal);
        }
    }
}

struct Saboteur {
    outer: ControllerLink,
    inner: PlantLink,
    child: ControllerProcess,
    plan: Plan,
    pace: Pace,
    period_ns: u64,
    /// Hashes of the id of the run and of the id of the controller's run.
    runs: [u64; 2],
    slot: u32,
    spoiler: Option<(Injection, ActiveFault)>,
    last_good: Option<Command>,
    /// The signal to a process, and its time.
    signal: Option<(Kind, u64)>,
    stopped: bool,
    /// The last tick of the run, and the time at which its state was passed on, ns.
    last: Option<(u64, u64)>,
    /// True if its answer has arrived.
    done: bool,
}

impl Saboteur {
    fn run(&mut self, stop: &AtomicBool) -> Result<Exit, Failure> {
        let mut backoff = Backoff::for_this_machine();
        let mut quiet_since = now_ns();
        loop {
            if self.exchange()? {
                backoff.reset();
                quiet_since = now_ns();
                continue;
            }
            let now = now_ns();
            if self.done || self.last.is_some_and(|(_, then)| now > then + LAST_ANSWER_NS) {
                return Ok(Exit::Done);
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(Exit::Interrupted);
            }
            if now > quiet_since + LOOK_NS {
                quiet_since = now;
                if !self.outer.plant_lives() {
                    return Err(Failure::peer("the plant has ended"));
                }
                if let Some(status) = self.child.0.try_wait().map_err(Failure::internal)? {
                    return Err(Failure::peer(format!("the controller has ended ({status})")));
                }
            }
            match self.pace {
                Pace::Lockstep => drop(backoff.wait()),
                Pace::RealTime => drop(sleep_then_spin_until(now + PAUSE_NS, 0)),
            }
        }
    }

    /// Passes on the waiting messages; true if there were any.
    fn exchange(&mut self) -> Result<bool, Failure> {
        let mut moved = false;
        if let Some((kind, _)) = self.signal.filter(|(_, when)| now_ns() >= *when) {
            self.signal = None;
            self.strike(kind);
        }
        if let Some(state) = self.outer.next_state().map_err(Failure::internal)? {
            moved = true;
            self.pass_state(state)?;
        }
        while let Some(command) = self.inner.next_command(0).map_err(Failure::internal)? {
            moved = true;
            self.pass_command(command)?;
        }
        Ok(moved)
    }

    fn injection_at(&self, tick: u64) -> Option<Injection> {
        self.plan.injections.iter().copied().find(|injection| injection.holds(tick))
    }

    fn pass_state(&mut self, mut state: State) -> Result<(), Failure> {
        let injection = self.injection_at(state.tick);
        if let Some(injection) = injection.filter(|injection| injection.tick == state.tick) {
            self.prepare_signal(injection, state.scheduled_ns);
        }
        if self.stopped && injection.is_none() {
            self.stopped = false;
            self.child.signal(Signal::CONT);
        }
        if injection.is_some_and(|injection| injection.kind == Kind::ClockJump) {
            state.scheduled_ns += JUMP_NS;
            state.published_ns += JUMP_NS;
        }
        if state.has(State::FLAG_LAST) {
            self.last = Some((state.tick, now_ns()));
        }
        state.run = self.runs[1];
        self.inner.publish(&state).map_err(Failure::internal)
    }

    /// Schedules killing or stopping a process if the fault requires it: at once in lockstep, in real time at a random moment of the tick, which was due at
    /// `due_ns`. So the process never receives the next state.
    fn prepare_signal(&mut self, injection: Injection, due_ns: u64) {
        if !matches!(injection.kind, Kind::Crash | Kind::Hang | Kind::LoanLost) {
            return;
        }
        match self.pace {
            Pace::Lockstep => self.strike(injection.kind),
            Pace::RealTime => {
                let moment = ChaCha8Rng::seed_from_u64(injection.seed).random_range(0..self.period_ns);
                self.signal = Some((injection.kind, due_ns + moment));
            }
        }
    }

    fn strike(&mut self, kind: Kind) {
        match kind {
            Kind::Hang => {
                self.child.signal(Signal::STOP);
                self.stopped = true;
            }
            Kind::Crash => {
                self.child.signal(Signal::KILL);
                let _ = kill_process(getpid(), Signal::KILL);
            }
            // The outbox always holds the memory for the next message on loan.
            Kind::LoanLost => drop(kill_process(getpid(), Signal::KILL)),
            _ => {}
        }
    }

    fn pass_command(&mut self, mut command: Command) -> Result<(), Failure> {
        (command.run, command.slot) = (self.runs[0], self.slot);
        self.done |= self.last.is_some_and(|(tick, _)| tick == command.tick);
        let Some(injection) = self.injection_at(command.tick).filter(|injection| !self.is_pending(injection))
        else {
            self.last_good = Some(command);
            return self.outer.send(&command).map_err(Failure::internal);
        };
        if self.spoiler.as_ref().is_none_or(|(of, _)| *of != injection) {
            self.spoiler = Some((injection, ActiveFault::new(injection, &self.plan.limits, self.last_good)));
        }
        let outer = &mut self.outer;
        let Some((_, spoiler)) = &mut self.spoiler else { return Ok(()) };
        spoiler.spoil(command, |command| outer.send(command)).map_err(Failure::internal)
    }

    /// True if the signal of `injection` is still to be sent; until then the process answers.
    fn is_pending(&self, injection: &Injection) -> bool {
        self.signal.is_some_and(|(kind, _)| kind == injection.kind)
    }
}
