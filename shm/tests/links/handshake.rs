//! Tests of accepted and refused handshakes, with the messages on both sides.

use std::fs;
use std::time::{Duration, Instant};

use freeplay_shm::{
    Address, Command, ControllerLink, Greeting, Hello, LinkError, MAX_SLOTS, Pace, PlantLink, RunFolder,
    Verdict, Welcome,
};

use iceoryx2::prelude::ZeroCopySend;

use crate::child::{Role, bare_node};
use crate::{PATIENCE, connect_while_greeting, greet, offer, open_plant};

/// Sends `hello` to a plant with two slots and seven joints and returns both sides' view of the refusal.
fn refusal(change: impl FnOnce(&mut Hello)) -> (Option<Verdict>, String) {
    let run = RunFolder::create().unwrap();
    let mut plant = open_plant(&run, 2);
    let mut hello = Hello::new("stranger", 1, 7);
    change(&mut hello);
    let (error, greeting) = connect_while_greeting(&mut plant, run.address(), hello, Result::unwrap_err);
    let LinkError::Refused { verdict, .. } = &error else { panic!("{error}") };
    let expected = Greeting::Refused {
        slot: hello.slot,
        pid: std::process::id(),
        name: "stranger".to_owned(),
        verdict: verdict.unwrap(),
    };
    assert_eq!(greeting, expected);
    // A refusal has no side effect: the slot is still free.
    let good = Hello::new("friend", 1, 7);
    let ((), greeting) = connect_while_greeting(&mut plant, run.address(), good, |connected| {
        connected.map(|_| ()).unwrap();
    });
    assert!(matches!(greeting, Greeting::Accepted { slot: 1, .. }), "{greeting:?}");
    println!("{error}");
    (*verdict, error.to_string())
}

#[test]
fn every_refusal_names_its_reason() {
    let (verdict, text) = refusal(|hello| hello.magic = 5);
    assert!(verdict == Some(Verdict::WrongMagic) && text.contains("0x0000000000000005"), "{text}");
    let (verdict, text) = refusal(|hello| hello.layout = 99);
    assert!(verdict == Some(Verdict::WrongLayout) && text.contains("it speaks layout 99"), "{text}");
    let (verdict, text) = refusal(|hello| hello.state_size = 1080);
    assert!(verdict == Some(Verdict::WrongLayout) && text.contains("State 1080 B"), "{text}");
    let (verdict, text) = refusal(|hello| hello.joints = 6);
    assert!(verdict == Some(Verdict::WrongJoints) && text.contains("for 6 joints, the arm has 7"), "{text}");
    let (verdict, text) = refusal(|hello| hello.slot = 2);
    assert!(verdict == Some(Verdict::NoSuchSlot) && text.contains("slots 0 to 1"), "{text}");
    let (verdict, text) = refusal(|hello| hello.run = 12);
    assert!(verdict == Some(Verdict::WrongRun) && text.contains("another run"), "{text}");
}

#[test]
fn a_second_controller_in_another_process_finds_the_slot_taken() {
    let run = RunFolder::create().unwrap();
    let mut plant = open_plant(&run, 2);
    let mut first = Role::start("controller", Some(run.address()));
    greet(&mut plant, 1);
    first.hear("connected");
    let second = Hello::new("second", 0, 7);
    let (error, greeting) = connect_while_greeting(&mut plant, run.address(), second, Result::unwrap_err);
    assert!(error.to_string().contains("slot 0 is held by another controller"), "{error}");
    assert!(matches!(greeting, Greeting::Refused { verdict: Verdict::SlotTaken, .. }), "{greeting:?}");
    assert!(plant.has_controller(0) && !plant.has_controller(1) && !plant.has_controller(2));
}

#[test]
fn a_welcome_tells_the_run_and_leaving_frees_the_slot() {
    let run = RunFolder::create().unwrap();
    let mut plant = open_plant(&run, 1);
    for _ in 0..3 {
        let hello = Hello::new("Größe", 0, 0);
        let (welcome, greeting) = connect_while_greeting(&mut plant, run.address(), hello, |c| c.unwrap().1);
        let pid = std::process::id();
        assert_eq!(greeting, Greeting::Accepted { slot: 0, pid, name: "Größe".to_owned() });
        assert_eq!((welcome.run, welcome.joints, welcome.slots), (run.address().run(), 7, 1));
        assert_eq!(
            (welcome.period_ns, welcome.ticks, welcome.pace()),
            (1_000_000, 100, Some(Pace::Lockstep))
        );
        assert_eq!(welcome.task(), "/tmp/task.toml");
        assert!(!plant.has_controller(0));
    }
}

#[test]
fn patience_ends() {
    let run = RunFolder::create().unwrap();
    let hello = Hello::new("alone", 0, 0);
    let connect = |address: &Address| {
        let start = Instant::now();
        let error = ControllerLink::connect(address, hello, Duration::from_millis(60)).unwrap_err();
        println!("after {:?}: {error}", start.elapsed());
        assert!(start.elapsed() < PATIENCE);
        error.to_string()
    };
    let text = connect(run.address());
    assert!(
        text.contains("no plant answered within 60ms (last: the plant has not opened its door"),
        "{text}"
    );
    let _silent = open_plant(&run, 1);
    let text = connect(run.address());
    assert!(text.contains("the plant is running, but does not answer the hello"), "{text}");
    let text = connect(&Address::parse("/dev/shm/freeplay-0/never-lived").unwrap());
    assert!(text.contains("no run lives at /dev/shm/freeplay-0/never-lived"), "{text}");
}

#[test]
fn a_run_has_one_plant_and_one_to_eight_slots() {
    let run = RunFolder::create().unwrap();
    for slots in [0, MAX_SLOTS + 1] {
        let error = PlantLink::open(run.address(), slots, offer(1)).unwrap_err();
        assert!(matches!(error, LinkError::SlotCount { .. }), "{error}");
    }
    let mut plant = open_plant(&run, MAX_SLOTS);
    let error = PlantLink::open(run.address(), 1, offer(1)).unwrap_err();
    assert!(matches!(error, LinkError::PlantExists { .. }), "{error}");
    assert!(plant.newest_command(MAX_SLOTS - 1).unwrap().is_none());
    let error = plant.newest_command(MAX_SLOTS).unwrap_err();
    assert!(matches!(error, LinkError::NoSlot { slot: 8, slots: 8 }), "{error}");
}

#[test]
fn programs_in_other_languages_find_the_types_by_name() {
    let run = RunFolder::create().unwrap();
    let _plant = open_plant(&run, 1);
    let services = fs::read_dir(run.address().root().join("services")).unwrap().flatten();
    let text: String = services.map(|entry| fs::read_to_string(entry.path()).unwrap()).collect();
    for name in ["freeplay.State", "freeplay.Command", "freeplay.Hello", "freeplay.Welcome"] {
        assert!(text.contains(name), "no {name} in:\n{text}");
    }
}

/// The state of a plant of another version; iceoryx2 itself refuses to open it as the current type.
#[derive(Debug, Clone, Copy, ZeroCopySend)]
#[repr(C)]
#[type_name("freeplay.State")]
struct OtherState {
    magic: u64,
    more: [f64; 200],
}

#[test]
fn a_plant_of_another_version_refuses_in_the_same_words() {
    let run = RunFolder::create().unwrap();
    let node = bare_node(run.address());
    let states =
        node.service_builder(&"freeplay/state".try_into().unwrap()).publish_subscribe::<OtherState>();
    let _states = states.create().unwrap();
    let commands =
        node.service_builder(&"freeplay/command/0".try_into().unwrap()).publish_subscribe::<Command>();
    let _commands = commands.create().unwrap();
    let door =
        node.service_builder(&"freeplay/hello".try_into().unwrap()).request_response::<Hello, Welcome>();
    let server = door.create().unwrap().server_builder().create().unwrap();

    let address = run.address().clone();
    let controller = std::thread::spawn(move || {
        ControllerLink::connect(&address, Hello::new("old", 0, 7), PATIENCE).unwrap_err()
    });
    let hello = loop {
        assert!(!controller.is_finished(), "{:?}", controller.join());
        let Some(request) = server.receive().unwrap() else { continue };
        let mut welcome = offer(1).welcome(run.address().run(), 1, Verdict::WrongLayout);
        (welcome.layout, welcome.state_size) = (2, size_of::<OtherState>() as u32);
        request.send_copy(welcome).unwrap();
        break *request.payload();
    };
    assert_eq!((hello.layout, hello.state_size, hello.claim), (1, 1072, 1));
    let text = controller.join().unwrap().to_string();
    println!("{text}");
    assert!(text.contains("it speaks layout 1 (State 1072 B"), "{text}");
    assert!(text.contains("the plant speaks layout 2 (State 1608 B"), "{text}");
}
