//! `kill -9` at each step of a run with its shared memory: the run itself, its plant or its controller dies at the n-th system call that makes, opens, sizes,
//! locks, maps, closes or removes an object of the run. The next run starts, no file remains, and every recording opens.
//!
//! strace delivers the kills. On a machine without strace the test prints a message and passes. The test tries a few steps; `FREEPLAY_KILLS=N` tries N, spread
//! over all, `FREEPLAY_KILLS=all` tries each. `freeplay faults --kills N` kills at random moments; `blind_kills.rs` kills the processes of a blind set.

mod common;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use common::{FREEPLAY, assert_recordings_open, fresh_folder, in_own_shared_memory, processes_with, until};
use freeplay_shm::RunFolder;

const SHM: &str = "/dev/shm";

/// The system calls that make, open, size, close to others, lock, map, close and remove shared memory.
const CALLS: &str =
    "openat,mkdir,mkdirat,ftruncate,fallocate,fchmod,chmod,flock,fcntl,mmap,close,unlink,unlinkat,rmdir";

/// After so many kills a whole run follows; after the others only the start of one, which removes dead runs.
const WHOLE_RUN: usize = 10;

/// A killed or surviving process counts as hung after this time.
const LONGEST: Duration = Duration::from_secs(120);

/// The killed process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Victim {
    Run,
    Plant,
    Controller,
}

/// The `when`-th system call `call` of a victim.
#[derive(Clone, Debug)]
struct Step {
    victim: Victim,
    call: String,
    when: usize,
}

/// Environment of a test: the shared files of the run's processes, and a mark in their environment variables.
struct Stage {
    folder: tempfile::TempDir,
    mark: String,
    /// Longest time by which processes outlived the awaited one.
    slowest: Cell<Duration>,
}

impl Stage {
    fn new() -> Self {
        let folder = fresh_folder();
        let mark = folder.path().display().to_string();
        Self { folder, mark, slowest: Cell::default() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `freeplay` with `arguments`, under strace with `options` if there are any.
    fn freeplay(&self, strace: &[String], arguments: &[&str]) -> Command {
        let mut command = Command::new(if strace.is_empty() { FREEPLAY } else { "strace" });
        if !strace.is_empty() {
            command.args(strace).arg(FREEPLAY);
        }
        command.args(arguments).current_dir(self.folder.path()).env("FREEPLAY_TEST_MARK", &self.mark);
        command.env_remove("FREEPLAY_SHM").env_remove("FREEPLAY_RUN");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    /// A whole run, under strace with `options` if there are any.
    fn whole(&self, strace: &[String]) -> Child {
        let arguments = ["run", "--quiet", "--controller", "computed-torque", "--out", "out", "--force"];
        let sets = ["--set", "duration=0.02", "--set", "recording=mcap", "--set", "patience=60"];
        self.freeplay(strace, &[&arguments[..], &sets].concat()).spawn().expect("it starts")
    }

    /// Waits for the end of `child`; fails if it hangs.
    fn await_end(&self, child: &mut Child) {
        let begun = Instant::now();
        while child.try_wait().expect("a child").is_none() {
            assert!(begun.elapsed() < LONGEST, "hung: {:?}", self.members());
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Plant and controller in a run of this process, `victim` under strace with `options`.
    fn in_parts(&self, victim: Victim, strace: &[String]) {
        let root = RunFolder::create().expect("a run");
        let address = root.address().to_string();
        let of = |who: Victim| if who == victim { strace } else { &[] };
        let plant =
            ["plant", "--run", &address, "--scenario", "out/scenario.toml", "--task", "out/task.toml"];
        let plant = [&plant[..], &["--out", "out", "--name", "computed-torque"]].concat();
        let mut plant = self.freeplay(of(Victim::Plant), &plant).spawn().expect("it starts");
        let controller = ["controller", "computed-torque", "--run", &address];
        let mut controller = self.freeplay(of(Victim::Controller), &controller);
        let mut controller = controller.env("FREEPLAY_PATIENCE", "60").spawn().expect("it starts");
        if victim == Victim::Plant {
            self.await_end(&mut plant);
            // It would detect the end of the plant by itself; the tests of faults measure the time.
            let _ = controller.kill();
        }
        self.await_end(&mut controller);
        root.report_process_exit(0);
        self.await_end(&mut plant);
        self.until_gone();
    }

    fn play(&self, victim: Victim, strace: &[String]) {
        match victim {
            Victim::Run => {
                self.await_end(&mut self.whole(strace));
                self.until_gone();
            }
            victim => self.in_parts(victim, strace),
        }
    }

    /// Waits until no process of the stage lives.
    fn until_gone(&self) {
        let begun = Instant::now();
        until("the end of all processes", || self.members().is_empty().then_some(()));
        self.slowest.set(self.slowest.get().max(begun.elapsed()));
    }

    /// The processes of the stage that live.
    fn members(&self) -> Vec<u32> {
        processes_with(&format!("FREEPLAY_TEST_MARK={}", self.mark))
    }

    /// The steps of `victim` that concern shared memory, from an undisturbed run.
    fn steps(&self, victim: Victim) -> Vec<Step> {
        let trace = self.path("trace");
        // strace prints descriptors with their paths.
        let options =
            ["-y", "-o", &trace.display().to_string(), "-e", &format!("trace={CALLS}")].map(str::to_owned);
        self.play(victim, &options);
        let text = std::fs::read_to_string(&trace).unwrap_or_default();
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        let mut steps = Vec::new();
        for line in text.lines() {
            let Some((call, rest)) = line.split_once('(') else { continue };
            let count = counts.entry(call).or_default();
            *count += 1;
            if rest.contains(SHM) {
                steps.push(Step { victim, call: call.to_owned(), when: *count });
            }
        }
        steps
    }

    /// Kills at `step`; true if the kill struck.
    fn strike(&self, step: &Step) -> bool {
        let (call, when) = (&step.call, step.when);
        let trace = self.path("trace");
        let options = [
            "-o".to_owned(),
            trace.display().to_string(),
            "-e".to_owned(),
            format!("trace={call}"),
            "-e".to_owned(),
            format!("inject={call}:signal=SIGKILL:when={when}"),
        ];
        self.play(step.victim, &options);
        std::fs::read_to_string(&trace).unwrap_or_default().contains("killed by SIGKILL")
    }
}

/// Files of runs in shared memory: segments and folders.
fn left() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(SHM).expect("shared memory").flatten().map(|entry| entry.path());
    entries.filter(|path| path.to_string_lossy().contains("freeplay-")).collect()
}

/// Load average of the machine over one, five and fifteen minutes.
fn load() -> String {
    std::fs::read_to_string("/proc/loadavg")
        .unwrap_or_default()
        .split(' ')
        .take(3)
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn a_kill_at_each_step_with_shared_memory_is_survived() {
    const NAME: &str = "a_kill_at_each_step_with_shared_memory_is_survived";
    let can = Command::new("strace").args(["-o", "/dev/null", "true"]).output();
    if !can.is_ok_and(|output| output.status.success()) {
        freeplay_skip::skip(freeplay_skip::Need::Strace, "there is no strace here, or it may not trace");
        return;
    }
    if !in_own_shared_memory(NAME) {
        return;
    }
    let stage = Stage::new();
    stage.whole(&[]).wait().expect("a child");
    assert!(Path::new(&stage.path("out/task.toml")).is_file(), "a run leaves the files of its processes");
    let steps: Vec<Step> = [Victim::Run, Victim::Plant, Victim::Controller]
        .into_iter()
        .flat_map(|victim| stage.steps(victim))
        .collect();
    let count = match std::env::var("FREEPLAY_KILLS").as_deref() {
        Ok("all") => steps.len(),
        Ok(count) => count.parse().expect("a number of kills, or all"),
        Err(_) => 12,
    };
    assert!(steps.len() > 100, "{steps:?}");
    let (mut struck, mut recordings) = (BTreeMap::<(Victim, &str), usize>::new(), 0);
    let load = load();
    let chosen = (0..count).map(|index| &steps[index * steps.len() / count % steps.len()]);
    for (index, step) in chosen.enumerate() {
        *struck.entry((step.victim, &step.call)).or_default() += usize::from(stage.strike(step));
        recordings += assert_recordings_open(&stage.path("out"), false);
        if index % WHOLE_RUN == 0 {
            let status = stage.whole(&[]).wait().expect("a child");
            assert!(status.success(), "the run after {step:?}: {status}");
        } else {
            drop(RunFolder::create().unwrap_or_else(|error| panic!("the run after {step:?}: {error}")));
        }
        let left = left();
        assert!(left.is_empty(), "after {step:?} the next run left {left:?}");
    }
    for ((victim, call), count) in &struck {
        println!("{victim:?} killed at {call}: {count}");
    }
    let struck: usize = struck.values().sum();
    println!(
        "{} steps, {count} kills, {struck} struck, none hung, {recordings} recordings opened, left in shared memory: {:?}; \
         processes outlived the one waited for by at most {:?}; load of the machine {load} before, {} after",
        steps.len(),
        left(),
        stage.slowest.get(),
        self::load()
    );
    assert!(struck * 2 > count, "most kills missed: {struck} of {count}");
}
