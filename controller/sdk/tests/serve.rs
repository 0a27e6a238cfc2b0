//! Tests of a controller's process, run in threads: handshake, answers, and every way of ending.

#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

use std::process::Command as Process;
use std::sync::{Arc, Barrier};
use std::thread;
use std::time::{Duration, Instant};

use freeplay_controller_sdk::{
    Answer, Controller, ControllerError, Ended, RunInfo, ServeError, ServeOptions, ServeReport, Task,
    serve_with,
};
use freeplay_shm::{
    Address, Command, CommandStatus, Greeting, Mode, Offer, Pace, PlantLink, RunFolder, State,
};

const LONG: Duration = Duration::from_secs(10);

/// A controller that answers with the tick; it panics or gives up at given ticks.
struct Probe {
    panic_at: Option<u64>,
    give_up_at: Option<u64>,
    fails_to_start: bool,
}

const PROBE: Probe = Probe { panic_at: None, give_up_at: None, fails_to_start: false };

impl Controller for Probe {
    fn name(&self) -> &str {
        "probe"
    }

    fn start(&mut self, _: &Task, run: &RunInfo) -> Result<(), ControllerError> {
        assert_eq!((run.joints, run.ticks), (6, 100));
        if self.fails_to_start {
            return Err(ControllerError::Custom("no such luck".into()));
        }
        Ok(())
    }

    fn answer(&mut self, state: &State, answer: &mut Answer) {
        assert_ne!(Some(state.tick), self.panic_at, "told to panic");
        answer.value[0] = state.tick as f64;
        answer.deviation = [1.0, 2.0, 3.0];
        answer.qp_iterations = 7;
        if self.give_up_at == Some(state.tick) {
            answer.give_up();
        }
    }
}

/// A run whose plant side is in this thread.
struct Bench {
    link: PlantLink,
    address: Address,
    _root: RunFolder,
    _folder: tempfile::TempDir,
}

impl Bench {
    fn new(pace: Pace, task: &str) -> Bench {
        let root = RunFolder::create().unwrap();
        let address = root.address().clone();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("task.toml");
        std::fs::write(&file, task).unwrap();
        let offer = Offer {
            joints: 6,
            mode: Mode::Torque,
            pace,
            period_ns: 1_000_000,
            ticks: 100,
            task: file.display().to_string(),
        };
        let link = PlantLink::open(&address, 1, offer).unwrap();
        Bench { link, address, _root: root, _folder: folder }
    }

    fn options(&self) -> ServeOptions {
        ServeOptions { patience: LONG, ..ServeOptions::new(self.address.clone()) }
    }

    fn greet(&mut self) {
        let begun = Instant::now();
        while begun.elapsed() < LONG {
            match self.link.greet().unwrap().first() {
                Some(Greeting::Accepted { .. }) => return,
                Some(refused) => panic!("{refused:?}"),
                None => thread::sleep(Duration::from_millis(1)),
            }
        }
        panic!("nobody came");
    }

    fn publish(&mut self, tick: u64, last: bool) {
        let mut state = State::new(self.address.run(), 6);
        state.tick = tick;
        state.flags = if last { State::FLAG_LAST } else { 0 };
        state.scheduled_ns = freeplay_shm::now_ns();
        self.link.publish(&state).unwrap();
    }

    fn answer(&mut self) -> Command {
        let begun = Instant::now();
        loop {
            if let Some(command) = self.link.next_command(0).unwrap() {
                return command;
            }
            assert!(begun.elapsed() < LONG, "no answer");
            thread::yield_now();
        }
    }
}

const TASK: &str = "model = \"paper\"";

/// Serves `controller` in a thread while `plant` acts as the plant.
fn play(
    mut bench: Bench,
    controller: impl Controller + Send + 'static,
    plant: impl FnOnce(Bench),
) -> Result<ServeReport, ServeError> {
    let options = bench.options();
    let served = thread::spawn(move || {
        let mut controller = controller;
        serve_with(&mut controller, &options)
    });
    bench.greet();
    plant(bench);
    served.join().unwrap()
}

/// Works as [`play`] does, but the plant stays until the controller's process has ended.
fn play_to_its_end(
    mut bench: Bench,
    controller: impl Controller + Send + 'static,
    plant: impl FnOnce(&mut Bench),
) -> Result<ServeReport, ServeError> {
    let options = bench.options();
    let served = thread::spawn(move || {
        let mut controller = controller;
        serve_with(&mut controller, &options)
    });
    bench.greet();
    plant(&mut bench);
    let begun = Instant::now();
    while !served.is_finished() {
        assert!(begun.elapsed() < LONG, "the controller has not ended");
        thread::yield_now();
    }
    served.join().unwrap()
}

#[test]
fn every_state_is_answered_until_the_last() {
    for pace in [Pace::Lockstep, Pace::RealTime] {
        let report = play(Bench::new(pace, TASK), Probe { give_up_at: Some(3), ..PROBE }, |mut bench| {
            for tick in 0..20 {
                bench.publish(tick, tick == 19);
                let command = bench.answer();
                command.check(bench.address.run()).unwrap();
                assert_eq!(command.tick, tick);
                assert!(command.sent_ns >= command.received_ns && command.received_ns > 0);
                if tick == 3 {
                    assert_eq!(command.status, CommandStatus::NoAnswer.code());
                } else {
                    assert_eq!(
                        (command.value[0], command.deviation, command.qp_iterations),
                        (tick as f64, [1.0, 2.0, 3.0], 7)
                    );
                }
            }
        })
        .unwrap();
        println!("{pace:?}: {report:?}");
        assert_eq!((report.ended, report.answered, report.lost, report.skipped), (Ended::LastTick, 20, 0, 0));
    }
}

#[test]
fn in_real_time_a_slow_controller_takes_the_newest_state() {
    /// Answers the first state only when the test has published the others.
    struct Slow(Arc<Barrier>);
    impl Controller for Slow {
        fn name(&self) -> &str {
            "slow"
        }
        fn start(&mut self, _: &Task, _: &RunInfo) -> Result<(), ControllerError> {
            Ok(())
        }
        fn answer(&mut self, state: &State, _: &mut Answer) {
            if state.tick == 0 {
                self.0.wait();
                self.0.wait();
            }
        }
    }
    let both = Arc::new(Barrier::new(2));
    let slow = Slow(Arc::clone(&both));
    let report = play(Bench::new(Pace::RealTime, TASK), slow, |mut bench| {
        bench.publish(0, false);
        both.wait();
        for tick in 1..4 {
            bench.publish(tick, tick == 3);
        }
        both.wait();
        assert_eq!((bench.answer().tick, bench.answer().tick), (0, 3));
    })
    .unwrap();
    println!("{report:?}");
    assert_eq!((report.answered, report.skipped), (2, 2));
}

#[test]
fn endings_have_their_exit_codes() {
    let dead = play(Bench::new(Pace::Lockstep, TASK), PROBE, |mut bench| {
        bench.publish(0, false);
        bench.answer();
    })
    .unwrap_err();
    let panicked =
        play(Bench::new(Pace::Lockstep, TASK), Probe { panic_at: Some(1), ..PROBE }, |mut bench| {
            bench.publish(0, false);
            bench.answer();
            bench.publish(1, false);
            // The slot is free again after the panic.
            let begun = Instant::now();
            while bench.link.has_controller(0) {
                assert!(begun.elapsed() < LONG, "the slot of a controller that panicked is still held");
                thread::sleep(Duration::from_millis(1));
            }
        })
        .unwrap_err();
    let fails = Probe { fails_to_start: true, ..PROBE };
    let bad_start = play_to_its_end(Bench::new(Pace::Lockstep, TASK), fails, |_| {}).unwrap_err();
    let bad_task = play_to_its_end(Bench::new(Pace::Lockstep, "modle = 1"), PROBE, |_| {}).unwrap_err();
    let strange = play_to_its_end(Bench::new(Pace::Lockstep, TASK), PROBE, |bench| {
        let mut state = State::new(bench.address.run(), 6);
        state.joints = 5;
        bench.link.publish(&state).unwrap();
    })
    .unwrap_err();
    let mut nobody = Bench::new(Pace::Lockstep, TASK).options();
    nobody.patience = Duration::from_millis(20);
    let no_run = serve_with(&mut Probe { ..PROBE }, &nobody).unwrap_err();
    for (error, code, words) in [
        (dead, 5, "the plant is gone"),
        (panicked, 70, "panicked at tick 1"),
        (bad_start, 3, "no such luck"),
        (bad_task, 3, "unknown field"),
        (strange, 3, "joints"),
        (no_run, 5, "run"),
    ] {
        println!("{code}: {error}");
        assert_eq!(error.exit_code(), code, "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn a_plant_that_falls_silent_is_given_up_on() {
    let bench = Bench::new(Pace::Lockstep, TASK);
    let options = ServeOptions { patience: Duration::from_millis(300), ..bench.options() };
    let mut bench = bench;
    let served = thread::spawn(move || serve_with(&mut Probe { ..PROBE }, &options));
    bench.greet();
    bench.publish(0, false);
    bench.answer();
    let error = served.join().unwrap().unwrap_err();
    println!("{error}");
    assert!(matches!(error, ServeError::PlantGone { states: 1, .. }), "{error}");
}

#[test]
fn the_command_line_names_run_and_slot() {
    let parse = |arguments: &[&str]| ServeOptions::from_args(arguments.iter().map(ToString::to_string));
    let options = parse(&["--run", "/dev/shm/freeplay-0/1-a", "--verbose", "--slot=2"]).unwrap();
    assert_eq!((options.address.id(), options.slot), ("1-a", 2));
    for (arguments, words) in [
        (&["--slot", "two", "--run", "/dev/shm/x"][..], "\"two\" is not a number"),
        (&["--run"], "--run needs a value"),
        (&["--run", "relative"], "'relative' is no address"),
    ] {
        let error = parse(arguments).unwrap_err();
        println!("{error}");
        assert!(error.to_string().contains(words) && error.exit_code() == 2);
    }
}

#[test]
fn a_signal_ends_the_process_with_130() {
    let example = std::env::current_exe().unwrap().with_file_name("").join("../examples/minimal");
    if !example.exists() {
        freeplay_skip::skip(freeplay_skip::Need::Example, format_args!("{} is not built", example.display()));
        return;
    }
    for signal in ["-TERM", "-INT"] {
        let mut bench = Bench::new(Pace::Lockstep, TASK);
        let mut child = Process::new(&example).args(["--run", &bench.address.to_string()]).spawn().unwrap();
        bench.greet();
        bench.publish(0, false);
        bench.answer();
        let sent = Process::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let status = child.wait().unwrap();
        println!("{signal}: {status}");
        assert_eq!(status.code(), Some(130));
    }
}
