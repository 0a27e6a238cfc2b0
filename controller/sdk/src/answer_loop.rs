//! The loop of a controller's process: it waits for a state, answers it and sends the answer.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use freeplay_shm::{
    Backoff, Command, ControllerLink, Joints, MAX_JOINTS, MessageFault, Mode, Pace, State, now_ns,
    sleep_then_spin_until,
};
use signal_hook::SigId;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::controller::{Answer, Controller};
use crate::run_info::RunInfo;
use crate::serve_error::ServeError;
use crate::serve_options::ServeOptions;

/// A paced controller stops sleeping this long before a tick is due, ns, because the system wakes sleepers 40 to 130 µs late.
const EARLY_NS: u64 = 200_000;
/// Longest sleep between two checks of the signals, ns.
const LONGEST_SLEEP_NS: u64 = 100_000_000;
/// After this long without a state, the controller checks that the run still lives, ns.
const LOOK_AROUND_NS: u64 = 200_000_000;

/// Flag that SIGINT or SIGTERM has arrived. Dropping it removes the handlers.
pub struct Stop {
    asked: Arc<AtomicBool>,
    handlers: Vec<SigId>,
}

impl Stop {
    /// Installs the handlers.
    pub fn on_signals() -> Result<Stop, std::io::Error> {
        let mut stop = Stop { asked: Arc::new(AtomicBool::new(false)), handlers: Vec::new() };
        for signal in [SIGINT, SIGTERM] {
            stop.handlers.push(signal_hook::flag::register(signal, Arc::clone(&stop.asked))?);
        }
        Ok(stop)
    }

    fn is_asked(&self) -> bool {
        // The flag stands alone: no other data depends on it, so relaxed ordering suffices.
        self.asked.load(Ordering::Relaxed)
    }
}

impl Drop for Stop {
    fn drop(&mut self) {
        for handler in self.handlers.drain(..) {
            signal_hook::low_level::unregister(handler);
        }
    }
}

/// Runs `action` on `controller` and turns a panic into an error, so that the link is left in order. `at` gives the time of the
/// panic for the error.
pub fn guarded<T>(
    controller: &mut dyn Controller,
    at: impl FnOnce() -> String,
    action: impl FnOnce(&mut dyn Controller) -> T,
) -> Result<T, ServeError> {
    // After a panic, the loop uses only the controller's name.
    catch_unwind(AssertUnwindSafe(|| action(controller)))
        .map_err(|_| ServeError::Panicked { controller: controller.name().to_owned(), at: at() })
}

/// Regular end of a controller's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The controller answered the last state of the run.
    LastTick,
    /// SIGINT or SIGTERM arrived.
    Interrupted,
}

/// Answer loop of one link.
pub struct AnswerLoop {
    link: ControllerLink,
    run: RunInfo,
    run_hash: u64,
    slot: u32,
    patience: Duration,
    parent: Option<rustix::process::Pid>,
    backoff: Backoff,
    /// Due time of the next state in a paced run, `CLOCK_MONOTONIC`, ns.
    due_ns: u64,
    /// True if another controller is active: the plant does not wait for this one before the tick has begun.
    stands_by: bool,
    answered: u64,
}

impl AnswerLoop {
    /// Creates a loop over `link` in the run `run`, whose messages carry `run_hash`.
    pub fn new(link: ControllerLink, run: RunInfo, options: &ServeOptions, run_hash: u64) -> AnswerLoop {
        AnswerLoop {
            link,
            run,
            run_hash,
            slot: options.slot,
            patience: options.patience,
            parent: rustix::process::getppid(),
            backoff: Backoff::for_this_machine(),
            due_ns: 0,
            stands_by: false,
            answered: 0,
        }
    }

    /// Number of answered states.
    pub fn answered(&self) -> u64 {
        self.answered
    }

    /// The link, for its counters.
    pub fn link(&self) -> &ControllerLink {
        &self.link
    }

    /// Answers state after state until the last one of the run or a signal.
    ///
    /// # Errors
    /// The plant is gone, a message is invalid, the link fails, or the controller panics.
    pub fn run(&mut self, controller: &mut dyn Controller, stop: &Stop) -> Result<Ended, ServeError> {
        loop {
            let Some(state) = self.wait(stop)? else { return Ok(Ended::Interrupted) };
            let received_ns = now_ns();
            self.check(&state)?;
            let mut answer = Answer::BLANK;
            let at = || format!("at tick {}", state.tick);
            let takes_over = state.next_active_slot() == self.slot && state.active_slot() != self.slot;
            guarded(controller, at, |controller| {
                if takes_over {
                    controller.take_over(&state);
                }
                controller.answer(&state, &mut answer);
            })?;
            self.link.send(&self.command(&state, &answer, received_ns))?;
            self.answered += 1;
            if state.has(State::FLAG_LAST) {
                return Ok(Ended::LastTick);
            }
        }
    }

    /// Waits for the next state: in lockstep for every one in order, in a paced run for the newest. Returns `None` after a
    /// signal.
    fn wait(&mut self, stop: &Stop) -> Result<Option<State>, ServeError> {
        self.backoff.reset();
        let begun_ns = now_ns();
        let mut looked_ns = begun_ns;
        loop {
            if stop.is_asked() {
                return Ok(None);
            }
            let state = match self.run.pace {
                Pace::Lockstep => self.link.next_state()?,
                Pace::RealTime => self.link.newest_state()?,
            };
            if let Some(state) = state {
                // If the clocks of the two sides disagree, the state is due one period from now at the latest.
                self.due_ns = (state.scheduled_ns + self.run.period_ns).min(now_ns() + self.run.period_ns);
                self.stands_by = state.next_active_slot() != self.slot;
                return Ok(Some(state));
            }
            let now = now_ns();
            if now - looked_ns > LOOK_AROUND_NS {
                looked_ns = now;
                self.look_around(Duration::from_nanos(now - begun_ns))?;
            }
            self.pass_time(now);
        }
    }

    /// Waits according to the pace: sleeps, then polls busily around the due time, and otherwise backs off.
    fn pass_time(&mut self, now: u64) {
        if self.run.pace == Pace::Lockstep || now > self.due_ns + self.run.period_ns {
            self.backoff.wait();
            return;
        }
        // On few cores, standbys that poll before the tick would occupy the core of the active controller.
        let early_ns = if self.stands_by { 0 } else { EARLY_NS };
        let wake_ns = self.due_ns.saturating_sub(early_ns).min(now + LONGEST_SLEEP_NS);
        if now < wake_ns {
            sleep_then_spin_until(wake_ns, 0);
        } else {
            std::hint::spin_loop();
        }
    }

    /// Checks that the run still lives after `waited` without a state.
    fn look_around(&self, waited: Duration) -> Result<(), ServeError> {
        let cause = if !self.link.plant_lives() {
            ": its process has ended"
        } else if rustix::process::getppid() != self.parent {
            ": the process that started this controller has ended"
        } else if waited > self.patience {
            ""
        } else {
            return Ok(());
        };
        Err(ServeError::PlantGone { waited, states: self.answered, cause })
    }

    fn check(&self, state: &State) -> Result<(), MessageFault> {
        state.check(self.run_hash)?;
        if state.joints as usize == self.run.joints {
            Ok(())
        } else {
            Err(MessageFault::Joints { found: state.joints })
        }
    }

    fn command(&self, state: &State, answer: &Answer, received_ns: u64) -> Command {
        // In mode torque the command carries no motion; only an observer in the same process uses it.
        let motion = |of: &Joints| if self.run.mode == Mode::Torque { [0.0; MAX_JOINTS] } else { *of };
        Command {
            status: answer.status.code(),
            received_ns,
            predict_ns: answer.predict_ns,
            qp_ns: answer.qp_ns,
            qp_iterations: answer.qp_iterations,
            value: answer.value,
            velocity: motion(&answer.velocity),
            acceleration: motion(&answer.acceleration),
            deviation: answer.deviation,
            sent_ns: now_ns(),
            ..Command::answer_to(state, self.slot)
        }
    }
}
