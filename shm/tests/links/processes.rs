//! Tests with two real processes: answers, both orders of start, and kill -9 of either and of both.

use std::thread;
use std::time::{Duration, Instant};

use freeplay_shm::{Address, ControllerLink, Greeting, Hello, RunFolder, State};

use crate::child::Role;
use crate::leftovers::{assert_nothing_left, traces};
use crate::{PATIENCE, expected_answers, greet, open_plant, run_lockstep};

/// Number of controllers killed while they start.
const STEPS: u64 = 30;

#[test]
fn it_does_not_matter_who_starts_first() {
    const TICKS: u64 = 500;
    let answers = [true, false].map(|plant_first| {
        let run = RunFolder::create().unwrap();
        let mut early = (!plant_first).then(|| Role::start("controller", Some(run.address())));
        if let Some(controller) = &mut early {
            controller.hear("starting");
            thread::sleep(Duration::from_millis(30));
        }
        let mut plant = open_plant(&run, 1);
        let mut controller = early.unwrap_or_else(|| Role::start("controller", Some(run.address())));
        greet(&mut plant, 1);
        assert_eq!(controller.hear("connected: "), "/tmp/task.toml");
        let answers = run_lockstep(&mut plant, run.address().run(), TICKS);
        assert_eq!(plant.skipped(0), 0);
        drop(plant);
        controller.end();
        answers
    });
    assert_eq!(answers[0], expected_answers(TICKS));
    assert_eq!(answers[0], answers[1]);
}

#[test]
fn a_killed_controller_frees_its_slot_and_what_it_held() {
    let run = RunFolder::create().unwrap();
    let id = run.address().run();
    let mut plant = open_plant(&run, 1);
    for _ in 0..3 {
        let mut grabber = Role::start("grabber", Some(run.address()));
        greet(&mut plant, 1);
        grabber.hear("listening");
        plant.publish(&State { tick: 7, ..State::new(id, 7) }).unwrap();
        assert_eq!(grabber.hear("holding: "), "7");
        assert!(plant.has_controller(0));
        grabber.kill();
        assert!(!plant.has_controller(0));
    }
    // More states than the publisher has memory for, if the memory of dead processes were lost.
    for tick in 0..1000 {
        plant.publish(&State { tick, ..State::new(id, 7) }).unwrap();
    }
    let controller = Role::start("controller", Some(run.address()));
    greet(&mut plant, 1);
    assert_eq!(run_lockstep(&mut plant, id, 100), expected_answers(100));
    drop(plant);
    controller.end();
}

#[test]
fn a_plant_takes_no_notice_of_a_controller_killed_in_the_middle() {
    let run = RunFolder::create().unwrap();
    let id = run.address().run();
    let mut plant = open_plant(&run, 1);
    for _ in 0..3 {
        let controller = Role::start("controller", Some(run.address()));
        greet(&mut plant, 1);
        let mut tick = 0;
        let kill = thread::spawn(move || {
            thread::sleep(Duration::from_millis(5));
            controller.kill();
        });
        while !kill.is_finished() {
            plant.publish(&State { tick, ..State::new(id, 7) }).unwrap();
            plant.newest_command(0).unwrap();
            assert_eq!(plant.greet().unwrap(), []);
            tick += 1;
        }
        kill.join().unwrap();
        println!("killed at tick {tick}");
        assert!(tick > 0 && !plant.has_controller(0));
    }
}

#[test]
fn a_controller_killed_while_it_starts_harms_nobody() {
    let run = RunFolder::create().unwrap();
    let id = run.address().run();
    let mut plant = open_plant(&run, 1);
    let mut greeted = 0;
    // The test kills at increasing times: before exec, while the process opens its end, and after it was accepted.
    for step in 0..STEPS {
        let controller = Role::start("controller", Some(run.address()));
        let deadline = Instant::now() + Duration::from_micros(500 * step);
        while Instant::now() < deadline {
            greeted += plant.greet().unwrap().len();
            plant.publish(&State::new(id, 7)).unwrap();
            plant.newest_command(0).unwrap();
        }
        controller.kill();
    }
    println!("{greeted} of {STEPS} were greeted before they were killed");
    let controller = Role::start("controller", Some(run.address()));
    // The last killed process may have left its hello.
    let is_there =
        |greeting: &Greeting| matches!(greeting, Greeting::Accepted { pid, .. } if *pid == controller.pid());
    while !greet(&mut plant, 1).iter().any(is_there) {}
    assert_eq!(run_lockstep(&mut plant, id, 50), expected_answers(50));
    drop(plant);
    controller.end();
}

#[test]
fn a_killed_plant_is_noticed_and_another_can_take_its_place() {
    let run = RunFolder::create().unwrap();
    let mut plant = Role::start("plant", Some(run.address()));
    plant.hear("open");
    let (link, _) = ControllerLink::connect(run.address(), Hello::new("left alone", 0, 0), PATIENCE).unwrap();
    plant.hear("greeted");
    assert!(link.plant_lives());
    plant.kill();
    assert!(!link.plant_lives());
    drop(link);

    let mut plant = open_plant(&run, 1);
    let controller = Role::start("controller", Some(run.address()));
    greet(&mut plant, 1);
    assert_eq!(run_lockstep(&mut plant, run.address().run(), 20), expected_answers(20));
    drop(plant);
    controller.end();
}

#[test]
fn after_both_sides_are_killed_the_next_run_starts_clean() {
    let mut dead = Role::start("whole run", None);
    let address = Address::parse(&dead.hear("address: ")).unwrap();
    assert!(traces(&address).len() > 5, "{:?}", traces(&address));
    RunFolder::sweep_dead();
    assert!(traces(&address).len() > 5, "a living run was swept");
    dead.kill();

    let run = RunFolder::create().unwrap();
    assert_nothing_left(&address);
    let mut plant = open_plant(&run, 1);
    let controller = Role::start("controller", Some(run.address()));
    greet(&mut plant, 1);
    assert_eq!(run_lockstep(&mut plant, run.address().run(), 20), expected_answers(20));
    drop(plant);
    controller.end();
}
