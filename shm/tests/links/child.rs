//! Further processes of the tests: this binary started again in a role.

use std::env;
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command as Process, Stdio};
use std::time::Duration;

use freeplay_shm::{Address, ControllerLink, Hello, PlantLink, RUN_ENV, RunFolder, State};
use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{FileName, Path, SemanticString, SignalHandlingMode, ipc};

use crate::{PATIENCE, expected_answers, greet, offer, run_lockstep, serve};

const ROLE_ENV: &str = "FREEPLAY_TEST_ROLE";

/// Not a test of its own, but the entry point of this binary when [`Role::start`] has started it.
#[test]
fn role() {
    match env::var(ROLE_ENV).as_deref() {
        Ok("controller") => controller(),
        Ok("plant") => plant(),
        Ok("intruder") => crate::foreign::intruder(),
        Ok("grabber") => grabber(),
        Ok("whole run") => whole_run(),
        Ok("root") => root(),
        Ok("sweeper") => say(&format!("swept: {:?}", RunFolder::sweep_dead())),
        Ok("refused root") => say(&format!("refused: {}", RunFolder::create().unwrap_err())),
        Ok(other) => panic!("no role '{other}'"),
        Err(_) => (),
    }
}

/// Another process; killed when dropped.
pub struct Role {
    process: Child,
    out: BufReader<ChildStdout>,
}

impl Role {
    pub fn start(role: &str, run: Option<&Address>) -> Self {
        Self::start_with(role, run, &[])
    }

    pub fn start_with(role: &str, run: Option<&Address>, variables: &[(&str, &str)]) -> Self {
        let mut command = Process::new(env::current_exe().unwrap());
        command.args(["--exact", "child::role", "--nocapture", "--test-threads=1"]).env(ROLE_ENV, role);
        command.envs(run.map(|run| (RUN_ENV, run.to_string()))).envs(variables.iter().copied());
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let out = BufReader::new(process.stdout.take().unwrap());
        Self { process, out }
    }

    /// The rest of the next line that begins with `key`.
    pub fn hear(&mut self, key: &str) -> String {
        let mut heard = String::new();
        loop {
            let mut line = String::new();
            assert!(self.out.read_line(&mut line).unwrap() > 0, "no '{key}' in:\n{heard}");
            // The test harness may have left its own text on the line.
            if let Some((_, rest)) = line.split_once(key) {
                return rest.trim().to_owned();
            }
            heard += &line;
        }
    }

    pub fn pid(&self) -> u32 {
        self.process.id()
    }

    /// Ends the process with `kill -9`.
    pub fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }

    /// Waits for the end of the process, which must succeed.
    pub fn end(mut self) {
        let mut rest = String::new();
        while self.out.read_line(&mut rest).unwrap() > 0 {}
        let status = self.process.wait().unwrap();
        assert!(status.success(), "{status}:\n{rest}");
    }
}

impl Drop for Role {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

pub fn say(line: &str) {
    println!("{line}");
}

/// Sleeps until killed, with a time limit.
pub fn sleep_until_killed() {
    std::thread::sleep(PATIENCE);
}

/// Serves slot 0 to the end of the run.
fn controller() {
    let address = Address::from_env().unwrap();
    say("starting");
    let (mut link, welcome) = ControllerLink::connect(&address, Hello::new("child", 0, 7), PATIENCE).unwrap();
    say(&format!("connected: {}", welcome.task()));
    serve(&mut link, 0);
    assert_eq!((link.lost(), link.skipped()), (0, 0));
    // The plant must have taken the last answer before this end of the link closes.
    while link.plant_lives() {
        std::thread::sleep(Duration::from_micros(200));
    }
}

/// Opens the plant's end, greets one controller, and stays.
fn plant() {
    let address = Address::from_env().unwrap();
    let mut plant = PlantLink::open(&address, 1, offer(100)).unwrap();
    say("open");
    greet(&mut plant, 1);
    plant.publish(&State::new(address.run(), 7)).unwrap();
    say("greeted");
    sleep_until_killed();
}

/// Holds slot 0, a borrowed state and a loaned command until killed, through iceoryx2 itself. It imitates a controller in another
/// language, which knows only the address and the names of the services.
fn grabber() {
    let address = Address::from_env().unwrap();
    let (link, _) = ControllerLink::connect(&address, Hello::new("grabber", 0, 7), PATIENCE).unwrap();
    let node = bare_node(&address);
    let states =
        node.service_builder(&"freeplay/state".try_into().unwrap()).publish_subscribe::<State>().open();
    let states = states.unwrap().subscriber_builder().create().unwrap();
    say("listening");
    let (first, second) = loop {
        if let Some(first) = states.receive().unwrap() {
            break (first, states.receive().unwrap());
        }
    };
    say(&format!("holding: {}", first.tick));
    sleep_until_killed();
    drop((first, second, link));
}

/// A node of the run over iceoryx2 itself, built from the address alone.
pub fn bare_node(address: &Address) -> Node<ipc::Service> {
    let mut config = Config::default();
    config.global.set_root_path(&Path::new(address.root().as_os_str().as_encoded_bytes()).unwrap());
    config.global.prefix = FileName::new(address.prefix().as_bytes()).unwrap();
    let node = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
    node.create().unwrap()
}

/// A run with both ends in this process; it prints its address, answers 50 ticks, and stays.
fn whole_run() {
    let run = RunFolder::create().unwrap();
    let mut plant = PlantLink::open(run.address(), 1, offer(100)).unwrap();
    let address = run.address().clone();
    let served = std::thread::spawn(move || {
        let (mut link, _) = ControllerLink::connect(&address, Hello::new("inside", 0, 7), PATIENCE).unwrap();
        serve(&mut link, 0);
        sleep_until_killed();
    });
    greet(&mut plant, 1);
    assert_eq!(run_lockstep(&mut plant, run.address().run(), 50), expected_answers(50));
    say(&format!("address: {}", run.address()));
    served.join().unwrap();
}

/// Owns a run, prints its address, and stays.
fn root() {
    let run = RunFolder::create().unwrap();
    say(&format!("address: {}", run.address()));
    sleep_until_killed();
}
