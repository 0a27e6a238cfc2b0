//! Tests of links between real processes: this binary starts itself again in the roles of the tests.

#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod allocation;
mod child;
mod foreign;
mod handshake;
mod leftovers;
mod loss;
mod processes;

use std::time::Duration;

use freeplay_shm::{
    Address, Backoff, Command, ControllerLink, Greeting, Hello, LinkError, Mode, Offer, Pace, PlantLink,
    RunFolder, State, Welcome,
};

/// Long enough for a process to start on a busy machine.
const PATIENCE: Duration = Duration::from_secs(20);

fn offer(ticks: u64) -> Offer {
    Offer {
        joints: 7,
        mode: Mode::Torque,
        pace: Pace::Lockstep,
        period_ns: 1_000_000,
        ticks,
        task: "/tmp/task.toml".to_owned(),
    }
}

fn open_plant(run: &RunFolder, slots: usize) -> PlantLink {
    PlantLink::open(run.address(), slots, offer(100)).unwrap()
}

/// Greets until `count` controllers have been accepted or refused.
fn greet(plant: &mut PlantLink, count: usize) -> Vec<Greeting> {
    let mut greetings = Vec::new();
    let mut backoff = Backoff::for_this_machine();
    while greetings.len() < count {
        greetings.extend(plant.greet().unwrap());
        assert!(backoff.wait() < PATIENCE.as_nanos() as u64, "only {greetings:?} came");
    }
    greetings
}

/// Connects on a separate thread while `plant` greets; the link must stay on its thread, so `then` runs there.
fn connect_while_greeting<T: Send + 'static>(
    plant: &mut PlantLink,
    address: &Address,
    hello: Hello,
    then: impl FnOnce(Result<(ControllerLink, Welcome), LinkError>) -> T + Send + 'static,
) -> (T, Greeting) {
    let address = address.clone();
    let controller = std::thread::spawn(move || then(ControllerLink::connect(&address, hello, PATIENCE)));
    let greeting = greet(plant, 1).remove(0);
    (controller.join().unwrap(), greeting)
}

/// Runs `ticks` ticks in lockstep against the controller in slot 0 and returns its answers.
fn run_lockstep(plant: &mut PlantLink, run: u64, ticks: u64) -> Vec<f64> {
    let mut answers = Vec::new();
    let mut backoff = Backoff::for_this_machine();
    for tick in 0..ticks {
        let mut state = State::new(run, 7);
        state.tick = tick;
        state.q[0] = (tick as f64).sqrt();
        state.flags = if tick + 1 == ticks { State::FLAG_LAST } else { 0 };
        plant.publish(&state).unwrap();
        backoff.reset();
        let command = loop {
            match plant.newest_command(0).unwrap() {
                Some(command) if command.tick == tick => break command,
                _ => assert!(backoff.wait() < PATIENCE.as_nanos() as u64, "no answer to tick {tick}"),
            }
        };
        assert_eq!(command.check(run), Ok(()));
        answers.push(command.value[0]);
    }
    answers
}

/// The expected result of [`run_lockstep`] against [`serve`].
fn expected_answers(ticks: u64) -> Vec<f64> {
    (0..ticks).map(|tick| 2.0 * (tick as f64).sqrt() + 1.0).collect()
}

/// Answers every state until the last of the run.
fn serve(link: &mut ControllerLink, slot: u32) {
    let mut backoff = Backoff::for_this_machine();
    loop {
        let Some(state) = link.next_state().unwrap() else {
            assert!(backoff.wait() < PATIENCE.as_nanos() as u64, "no state came");
            continue;
        };
        backoff.reset();
        let mut command = Command::answer_to(&state, slot);
        command.value = state.q.map(|q| 2.0 * q + 1.0);
        link.send(&command).unwrap();
        if state.has(State::FLAG_LAST) {
            break;
        }
    }
}
