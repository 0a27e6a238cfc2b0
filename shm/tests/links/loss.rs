//! Tests of loss: a slow reader loses the oldest messages and counts them; a fast writer does not wait.

use std::sync::mpsc;

use freeplay_shm::{
    COMMAND_BUFFER, Command, ControllerLink, Hello, PlantLink, RunFolder, STATE_BUFFER, State,
};

use crate::{PATIENCE, greet, open_plant};

/// A plant here and a controller on its own thread: `on_plant` runs first, then `on_controller`, then `after`.
fn in_turn(
    on_plant: impl FnOnce(&mut PlantLink, u64),
    on_controller: impl FnOnce(&mut ControllerLink) + Send + 'static,
    after: impl FnOnce(&mut PlantLink),
) {
    let run = RunFolder::create().unwrap();
    let mut plant = open_plant(&run, 1);
    let address = run.address().clone();
    let (your_turn, my_turn) = mpsc::channel();
    let controller = std::thread::spawn(move || {
        let (mut link, _) = ControllerLink::connect(&address, Hello::new("slow", 0, 0), PATIENCE).unwrap();
        my_turn.recv().unwrap();
        on_controller(&mut link);
    });
    greet(&mut plant, 1);
    on_plant(&mut plant, run.address().run());
    your_turn.send(()).unwrap();
    controller.join().unwrap();
    after(&mut plant);
}

fn publish(plant: &mut PlantLink, run: u64, ticks: std::ops::Range<u64>) {
    for tick in ticks {
        plant.publish(&State { tick, ..State::new(run, 7) }).unwrap();
    }
}

#[test]
fn a_slow_controller_loses_the_oldest_states_and_counts_them() {
    // The controller's receiver releases one state for each that it takes, so the loss appears from the second state on.
    in_turn(
        |plant, run| publish(plant, run, 0..100),
        |link| {
            let ticks: Vec<u64> =
                std::iter::from_fn(|| link.next_state().unwrap()).map(|state| state.tick).collect();
            println!("{ticks:?}, lost {}", link.lost());
            assert_eq!(ticks.len(), STATE_BUFFER);
            assert_eq!(ticks.last(), Some(&99));
            assert!(ticks.is_sorted() && ticks[STATE_BUFFER - 1] - ticks[0] == STATE_BUFFER as u64 - 1);
        },
        |_| (),
    );
}

#[test]
fn the_newest_state_is_to_be_had_at_once_and_the_others_are_counted() {
    in_turn(
        |plant, run| publish(plant, run, 5..11),
        |link| {
            assert_eq!(link.newest_state().unwrap().map(|state| state.tick), Some(10));
            assert_eq!((link.lost(), link.skipped()), (0, 5));
            assert_eq!(link.newest_state().unwrap(), None);
        },
        |_| (),
    );
}

#[test]
fn a_busy_plant_gets_the_newest_command_and_counts_the_others() {
    let taken = COMMAND_BUFFER as u64;
    in_turn(
        |_, _| (),
        |link| {
            for tick in 0..1000 {
                let state = State { tick, ..State::new(1, 7) };
                link.send(&Command::answer_to(&state, 0)).unwrap();
            }
        },
        |plant| {
            assert_eq!(plant.newest_command(0).unwrap().map(|command| command.tick), Some(999));
            assert_eq!(plant.skipped(0), taken - 1);
            assert_eq!(plant.next_command(0).unwrap(), None);
        },
    );
}
