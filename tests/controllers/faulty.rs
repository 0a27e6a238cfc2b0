//! A controller with a fault of choice: computed torque until the fault sets in.
//!
//! `FREEPLAY_FAULT` names it: `nan@100` from tick 100 on, `nan@50+5,100` for five ticks before that, too. `pause` makes the
//! file `FREEPLAY_RESUME.paused` and waits for `FREEPLAY_RESUME`, so that a test can act in the middle of a run.
//!
//! `ride`, `push`, `shake`, `leap`, `replay`, `future` and `lies` are the strategies of a hostile controller, drawn from `FREEPLAY_SEED`; the last one and
//! `times` also send false times.
//!
//! It writes the messages itself, since the SDK would not permit the faults.

mod hostile;

use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use freeplay_controller::{Answer, ComputedTorque, Controller, RunInfo, ServeOptions, Task};
use freeplay_shm::{
    Backoff, Command, CommandKind, CommandStatus, ControllerLink, Hello, Joints, LAYOUT_VERSION, MAX_JOINTS,
    Mode, State, now_ns,
};
use rustix::process::{Signal, getpid, kill_process};

use hostile::Hostile;

type Failure = Box<dyn std::error::Error>;

/// A fault, its first tick and its duration.
struct Fault {
    name: String,
    when: Vec<(u64, u64)>,
}

impl Fault {
    fn from_env() -> Result<Self, Failure> {
        let text = std::env::var("FREEPLAY_FAULT")?;
        let (name, when) = text.split_once('@').unwrap_or((&text, "0"));
        let window = |text: &str| {
            let (from, count) =
                text.split_once('+').map_or((text, None), |(from, count)| (from, Some(count)));
            Ok((from.parse()?, count.map_or(Ok(u64::MAX), str::parse)?))
        };
        let when = when.split(',').map(window).collect::<Result<_, Failure>>()?;
        Ok(Self { name: name.to_owned(), when })
    }

    fn holds(&self, tick: u64) -> bool {
        self.when.iter().any(|&(from, count)| (from..from.saturating_add(count)).contains(&tick))
    }
}

fn main() -> ExitCode {
    match Fault::from_env().and_then(|fault| play(&fault)) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("faulty: {error}");
            ExitCode::from(3)
        }
    }
}

fn play(fault: &Fault) -> Result<ExitCode, Failure> {
    match fault.name.as_str() {
        "leave" => return Ok(ExitCode::from(7)),
        "mute" => sleep_for_ever(),
        _ => {}
    }
    let options = ServeOptions::from_args(std::env::args().skip(1))?;
    let mut hello = Hello::new("faulty", options.slot, 0);
    match fault.name.as_str() {
        "other_layout" => hello.layout = LAYOUT_VERSION + 1,
        "other_arm" => hello.joints = 7,
        _ => {}
    }
    let (mut link, welcome) = ControllerLink::connect(&options.address, hello, options.patience)?;
    let run = RunInfo {
        joints: welcome.joints as usize,
        mode: welcome.mode().ok_or("a mode")?,
        pace: welcome.pace().ok_or("a pace")?,
        period_ns: welcome.period_ns,
        ticks: welcome.ticks,
    };
    let task = Task::load(welcome.task().as_ref())?;
    let mut good = ComputedTorque::default();
    good.start(&task, &run)?;
    let seed = std::env::var("FREEPLAY_SEED").map_or(Ok(0), |seed| seed.parse())?;
    let mut hostile = Hostile::new(&fault.name, seed);
    let mut last: Option<Command> = None;
    let mut backoff = Backoff::for_this_machine();
    loop {
        let Some(state) = link.next_state()? else {
            if !link.plant_lives() {
                return Ok(ExitCode::from(5));
            }
            backoff.wait();
            continue;
        };
        backoff.reset();
        let mut command = answer(&mut good, &state, options.slot);
        if fault.holds(state.tick) {
            misbehave(fault, &run);
            match &mut hostile {
                Some(hostile) => {
                    if let Some(old) = hostile.spoil(&state, &mut command) {
                        link.send(&old)?;
                    }
                }
                None if fault.name == "freeze" => freeze(last.as_ref(), &mut command),
                None => spoil(&fault.name, &state, &mut command),
            }
            if fault.name == "twice" {
                link.send(&command)?;
            }
        }
        last = Some(command);
        link.send(&command)?;
        if state.has(State::FLAG_LAST) {
            return Ok(ExitCode::SUCCESS);
        }
    }
}

fn answer(good: &mut ComputedTorque, state: &State, slot: u32) -> Command {
    let (received_ns, mut answer) = (now_ns(), Answer::BLANK);
    good.answer(state, &mut answer);
    Command {
        received_ns,
        sent_ns: now_ns(),
        value: answer.value,
        velocity: answer.velocity,
        acceleration: answer.acceleration,
        ..Command::answer_to(state, slot)
    }
}

/// Positions that come gently to rest at `last`, and stay there, wherever the reference goes.
fn freeze(last: Option<&Command>, command: &mut Command) {
    let Some(last) = last else { return };
    let (period, rate) = (1e-3, 20.0);
    for joint in 0..command.joints as usize {
        let before = last.velocity[joint];
        let after = before - before.clamp(-rate * period, rate * period);
        command.value[joint] = last.value[joint] + 0.5 * (before + after) * period;
        (command.velocity[joint], command.acceleration[joint]) = (after, 0.0);
    }
}

/// Misbehaves instead of answering.
fn misbehave(fault: &Fault, run: &RunInfo) {
    match fault.name.as_str() {
        "abort" => std::process::abort(),
        "exit" => std::process::exit(0),
        "kill" => signal_self(Signal::KILL),
        "stop" => signal_self(Signal::STOP),
        "sleep" => sleep_for_ever(),
        "late" => thread::sleep(Duration::from_nanos(3 * run.period_ns)),
        "pause" => pause(),
        _ => {}
    }
}

fn signal_self(signal: Signal) {
    kill_process(getpid(), signal).expect("a signal for this process");
}

fn sleep_for_ever() -> ! {
    loop {
        thread::sleep(Duration::from_secs(3600));
    }
}

/// Tells the test that this process waits, and waits until the test lets it continue.
fn pause() {
    let resume = PathBuf::from(std::env::var_os("FREEPLAY_RESUME").expect("FREEPLAY_RESUME names a file"));
    std::fs::write(resume.with_extension("paused"), "").expect("the test can be told");
    while !resume.exists() {
        thread::sleep(Duration::from_millis(1));
    }
}

/// Applies the fault to the command.
fn spoil(fault: &str, state: &State, command: &mut Command) {
    let joint = 1;
    match fault {
        "nan" => command.value[joint] = f64::NAN,
        "infinite" => command.value[joint] = f64::NEG_INFINITY,
        "nan_velocity" => command.velocity[joint] = f64::NAN,
        "speeding" => command.velocity[joint] = 1e6,
        "jolting" => command.acceleration[joint] = -1e9,
        "huge" => command.value = [1e9; MAX_JOINTS],
        // Positions, although the run may require torques.
        "positions" => command.value = state.reference_next.q,
        // Within the range of the paper's second joint, 4000 N·m, and farther from any torque that holds it than that.
        "jump" if state.mode == Mode::Torque.code() => {
            command.value[joint] = 3999.0_f64.copysign(-command.value[joint])
        }
        "jump" => command.value[joint] += 0.2,
        "stale" => command.tick = state.tick.saturating_sub(1),
        "early" => command.tick += 1,
        "other_slot" => command.slot += 1,
        "other_status" => command.status = 77,
        "nan_deviation" => command.deviation[1] = f64::NAN,
        "nan_unused" => command.acceleration[MAX_JOINTS - 1] = f64::NAN,
        "full" => {
            let joints = freeplay_model::paper_arm().arm;
            for (value, joint) in command.value.iter_mut().zip(joints.joints()) {
                *value = joint.limits.effort;
            }
        }
        // Impossible times: received before it was published, sent before it was received, parts longer than the whole.
        "times" => match state.tick % 4 {
            0 => command.received_ns = 1,
            1 => command.sent_ns = command.received_ns - 1,
            2 => (command.predict_ns, command.qp_ns) = (u64::MAX, 10),
            _ => (command.sent_ns, command.qp_iterations) = (u64::MAX, u32::MAX),
        },
        "other_run" => command.run ^= 1,
        "other_magic" => command.magic = 0,
        "other_version" => command.layout += 1,
        "more_joints" => command.joints += 1,
        "other_kind" => {
            command.kind = match command.kind == CommandKind::Torque.code() {
                true => CommandKind::Position,
                false => CommandKind::Torque,
            }
            .code();
        }
        "no_answer" => {
            command.status = CommandStatus::NoAnswer.code();
            command.value = Joints::default();
        }
        _ => {}
    }
}
