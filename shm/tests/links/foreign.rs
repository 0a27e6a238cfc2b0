//! Test of commands from a process of the same user that does not hold the seat of the slot.

use std::time::Instant;

use freeplay_shm::{
    Address, Command, ControllerLink, Foreign, Greeting, Hello, RunFolder, State, Verdict, Welcome,
};

use crate::child::{Role, bare_node, say, sleep_until_killed};
use crate::{PATIENCE, greet, open_plant};

/// Number of commands from the intruder.
const FORGED: u64 = 5;
/// Value in these commands.
const VALUE: f64 = 3.125;

/// Role of the intruder: it sends complete commands for slot 0 over iceoryx2 itself, and claims the seat.
pub fn intruder() {
    let address = Address::from_env().unwrap();
    let node = bare_node(&address);
    let service = "freeplay/command/0".try_into().unwrap();
    let commands = node.service_builder(&service).publish_subscribe::<Command>().open().unwrap();
    let publisher = commands.publisher_builder().create().unwrap();
    for tick in 0..FORGED {
        publisher.send_copy(forged(&address, tick)).unwrap();
    }
    say("sent");
    let service = "freeplay/hello".try_into().unwrap();
    let door = node.service_builder(&service).request_response::<Hello, Welcome>().open().unwrap();
    let client = door.client_builder().create().unwrap();
    let mut hello = Hello::new("intruder", 0, 7);
    (hello.claim, hello.run) = (1, address.run());
    let pending = client.send_copy(hello).unwrap();
    let begun = Instant::now();
    let welcome = loop {
        if let Some(welcome) = pending.receive().unwrap() {
            break *welcome.payload();
        }
        assert!(begun.elapsed() < PATIENCE);
    };
    say(&format!("told: {}", welcome.verdict));
    sleep_until_killed();
}

fn forged(address: &Address, tick: u64) -> Command {
    let state = State { tick, ..State::new(address.run(), 7) };
    let mut command = Command::answer_to(&state, 0);
    command.value[0] = VALUE;
    command
}

#[test]
fn commands_count_from_the_seat_alone() {
    let run = RunFolder::create().unwrap();
    let mut plant = open_plant(&run, 1);
    // A subscriber without a check of the sender, to see the commands that reach the slot.
    let node = bare_node(run.address());
    let service = "freeplay/command/0".try_into().unwrap();
    let commands = node.service_builder(&service).publish_subscribe::<Command>().open().unwrap();
    let gullible = commands.subscriber_builder().create().unwrap();

    let address = run.address().clone();
    let (tell, told) = std::sync::mpsc::channel::<()>();
    let seated = std::thread::spawn(move || {
        let (mut link, _) = ControllerLink::connect(&address, Hello::new("seated", 0, 7), PATIENCE).unwrap();
        told.recv().unwrap();
        link.send(&forged(&address, 70)).unwrap();
        told.recv().unwrap();
    });
    greet(&mut plant, 1);
    let mut intruder = Role::start("intruder", Some(run.address()));
    intruder.hear("sent");

    // All commands of the attack arrive; only their sender is wrong.
    let mut arrived = 0;
    while let Some(command) = gullible.receive().unwrap() {
        assert_eq!((command.check(run.address().run()), command.value[0]), (Ok(()), VALUE));
        arrived += 1;
    }
    // The buffer of a subscriber with the settings of this service has room for all of them.
    assert_eq!(arrived, FORGED);
    assert_eq!(plant.next_command(0).unwrap(), None);
    assert_eq!(plant.foreign(0), Foreign { commands: FORGED, process: Some(intruder.pid()) });

    // Claiming the seat in a hello does not give the intruder the seat.
    let greeting = greet(&mut plant, 1).remove(0);
    assert!(
        matches!(greeting, Greeting::Refused { slot: 0, verdict: Verdict::SlotTaken, .. }),
        "{greeting:?}"
    );
    assert_eq!(intruder.hear("told: "), Verdict::SlotTaken.code().to_string());

    // The plant accepts the same command from the holder of the seat.
    tell.send(()).unwrap();
    let begun = Instant::now();
    let taken = loop {
        if let Some(command) = plant.next_command(0).unwrap() {
            break command;
        }
        assert!(begun.elapsed() < PATIENCE);
    };
    assert_eq!((taken.tick, taken.value[0]), (70, VALUE));
    assert_eq!(plant.foreign(0).commands, FORGED);
    tell.send(()).unwrap();
    seated.join().unwrap();
}
