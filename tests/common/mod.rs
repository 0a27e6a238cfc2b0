//! Runs of the real binary in fresh folders, each with shared memory of its own.
#![allow(dead_code, reason = "each test binary uses its own part")]

pub mod jargon;
pub mod sealed;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use freeplay_recording::Recording;
use serde_json::Value;
use tempfile::TempDir;

/// The binary under test.
pub const FREEPLAY: &str = env!("CARGO_BIN_EXE_freeplay");

/// Folder of the runs' shared memory, where a run could leave files.
const SHM: &str = "/dev/shm";

/// A call counts as hung after this time unless its processes are busy; long enough for a loaded machine.
const LONGEST: Duration = Duration::from_secs(300);

/// A busy call may take this many times as long.
const MOST_WORK: u32 = 10;

/// A call counts as hung after so many checks in a row without a busy process.
const IDLE_LOOKS: u32 = 100;

/// Polling interval.
const LOOK: Duration = Duration::from_millis(2);

/// A call of the binary, before it starts.
pub struct Call {
    /// Its working folder.
    pub folder: TempDir,
    /// The folder for its shared memory.
    pub shm: TempDir,
    /// The program with its arguments.
    pub command: Command,
}

impl Call {
    /// `freeplay` with `arguments`, in `folder`.
    pub fn new(folder: TempDir, arguments: &[&str]) -> Self {
        let mut command = Command::new(FREEPLAY);
        command.args(arguments);
        Self::of(folder, command)
    }

    /// Any `command`, in `folder`.
    pub fn of(folder: TempDir, mut command: Command) -> Self {
        let shm = tempfile::Builder::new().prefix("fp-").tempdir_in(SHM).expect("a folder in shared memory");
        let file = |name: &str| std::fs::File::create(folder.path().join(name)).expect("a file");
        // Files, not pipes: a process that outlives its run cannot keep the test waiting.
        command.current_dir(folder.path()).env("FREEPLAY_SHM", shm.path()).env_remove("FREEPLAY_RUN");
        command.stdin(Stdio::null()).stdout(file("stdout")).stderr(file("stderr"));
        Self { folder, shm, command }
    }

    /// A lockstep run of the default scenario cut to `duration` seconds, with more `arguments`.
    pub fn lockstep(duration: f64, arguments: &[&str]) -> Self {
        let duration = format!("duration={duration}");
        let mut all = vec!["run", "--pace", "lockstep", "--quiet", "--out", "out", "--set", &duration];
        all.extend(arguments);
        Self::new(fresh_folder(), &all)
    }

    /// Sets an environment variable of the call and its child processes.
    pub fn env(mut self, name: &str, value: impl AsRef<std::ffi::OsStr>) -> Self {
        self.command.env(name, value);
        self
    }

    /// Uses the shared memory of an earlier call.
    pub fn sharing(mut self, shm: TempDir) -> Self {
        self.command.env("FREEPLAY_SHM", shm.path());
        self.shm = shm;
        self
    }

    /// Starts it.
    pub fn start(mut self) -> Started {
        let child = self.command.spawn().expect("it starts");
        Started { folder: self.folder, shm: self.shm, child }
    }

    /// Starts it and waits for its end.
    pub fn run(self) -> Ran {
        self.start().wait()
    }
}

/// A running call; dropping it kills the call.
pub struct Started {
    /// Its working folder.
    pub folder: TempDir,
    /// The folder for its shared memory.
    pub shm: TempDir,
    child: Child,
}

impl Started {
    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// The folder of results.
    pub fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Waits until `what`, called `name`, returns a value; fails if this call ends before.
    pub fn until<T>(&self, name: &str, mut what: impl FnMut() -> Option<T>) -> T {
        until(name, || {
            let (found, lives) = (what(), runs(self.pid()));
            assert!(
                lives || found.is_some(),
                "no {name}; stderr:\n{}",
                text_of(self.folder.path(), "stderr")
            );
            found
        })
    }

    /// The id of its child process whose command line contains `word`.
    pub fn child_with(&self, word: &str) -> u32 {
        self.until(word, || {
            children_of(self.pid()).into_iter().find(|id| {
                std::fs::read_to_string(format!("/proc/{id}/cmdline"))
                    .is_ok_and(|line| line.split('\0').any(|argument| argument == word))
            })
        })
    }

    /// The address of its run in shared memory.
    pub fn address(&self) -> String {
        let all = || std::fs::read_dir(self.shm.path()).ok()?.flatten().next();
        self.until("the run's folder", || {
            let run = std::fs::read_dir(all()?.path()).ok()?.flatten().next()?;
            Some(run.path().display().to_string())
        })
    }

    /// Sends it the signal called `name`.
    pub fn signal(&self, name: &str) {
        send_signal(self.pid(), name);
    }

    /// True if a process of the call runs, or waits for a core or the disk. An analyst has an environment of its own, and its parent waits for it.
    fn is_at_work(&self) -> bool {
        let mut members = processes_with(&format!("FREEPLAY_SHM={}", self.shm.path().display()));
        members.extend(members.clone().into_iter().flat_map(children_of));
        members.into_iter().any(is_busy)
    }

    /// Waits for the end of the call; fails if it hangs.
    pub fn wait(mut self) -> Ran {
        let start = Instant::now();
        let mut idle = 0;
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                break status;
            }
            if start.elapsed() > LONGEST {
                idle = if self.is_at_work() { 0 } else { idle + 1 };
            }
            if idle > IDLE_LOOKS || start.elapsed() > LONGEST * MOST_WORK {
                let _ = self.child.kill();
                panic!("it hangs; stderr:\n{}", text_of(self.folder.path(), "stderr"));
            }
            std::thread::sleep(LOOK);
        };
        Ran::new(self.folder, self.shm, self.child.id(), status)
    }
}

/// Waits until `what`, called `name`, returns a value.
pub fn until<T>(name: &str, mut what: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = what() {
            return found;
        }
        assert!(start.elapsed() < LONGEST, "{name} did not come");
        std::thread::sleep(LOOK);
    }
}

/// Sends the signal called `name` to the process `pid`.
pub fn send_signal(pid: u32, name: &str) {
    let sent = Command::new("kill").args(["-s", name, &pid.to_string()]).status().expect("kill");
    assert!(sent.success(), "kill -s {name} {pid}");
}

/// The ids of the children of the process `pid`.
pub fn children_of(pid: u32) -> Vec<u32> {
    // The system lists children by the thread that started them.
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    let ids: String =
        threads.filter_map(|it| std::fs::read_to_string(it.path().join("children")).ok()).collect();
    ids.split_whitespace().filter_map(|id| id.parse().ok()).collect()
}

/// True if a thread of the process `pid` runs, or waits for a core or the disk.
pub fn is_busy(pid: u32) -> bool {
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("stat")).ok()).any(|stat| {
        // The state follows the name, which is in brackets.
        stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with(['R', 'D']))
    })
}

/// True if the process `pid` exists and is no zombie.
pub fn runs(pid: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The state follows the name, which is in brackets.
    stat.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with('Z'))
}

fn text_of(folder: &Path, name: &str) -> String {
    let bytes = std::fs::read(folder.join(name)).unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A finished call of the binary with its results.
pub struct Ran {
    /// Its folder; removed when this is dropped.
    pub folder: TempDir,
    /// Folder of its shared memory.
    pub shm: TempDir,
    /// Its process id.
    pub pid: u32,
    /// Its output and exit status.
    pub output: Output,
}

impl Ran {
    fn new(folder: TempDir, shm: TempDir, pid: u32, status: ExitStatus) -> Self {
        let read = |name: &str| std::fs::read(folder.path().join(name)).expect("written");
        let output = Output { status, stdout: read("stdout"), stderr: read("stderr") };
        Self { folder, shm, pid, output }
    }

    /// The exit code.
    pub fn code(&self) -> i32 {
        self.output.status.code().expect("not killed")
    }

    /// Standard error as text.
    pub fn stderr(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// Standard output as text.
    pub fn stdout(&self) -> String {
        String::from_utf8_lossy(&self.output.stdout).into_owned()
    }

    /// `summary.json`.
    pub fn summary(&self) -> Value {
        let path = self.out().join("summary.json");
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{error}: {}", self.dump()));
        serde_json::from_str(&text).expect("summary.json is JSON")
    }

    /// The summary of the only run.
    pub fn run(&self) -> Value {
        let runs = self.summary()["runs"].take();
        assert_eq!(runs.as_array().map(Vec::len), Some(1), "{runs:#}\n{}", self.dump());
        runs[0].clone()
    }

    /// The recording called `name` in the folder of results.
    pub fn recording(&self, name: &str) -> Recording {
        let read = freeplay_recording::read(&self.out().join(name), None);
        read.unwrap_or_else(|error| panic!("{error}: {}", self.dump()))
    }

    /// The folder of results.
    pub fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Everything that helps to understand a failure.
    pub fn dump(&self) -> String {
        format!("exit {:?}\nstdout:\n{}\nstderr:\n{}", self.output.status, self.stdout(), self.stderr())
    }

    /// Fails with [`Ran::dump`] unless the exit code is `code` and shared memory is empty.
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.output.status.code(), Some(code), "{}", self.dump());
        let left = self.left_in_shared_memory();
        assert!(left.is_empty(), "left in shared memory: {left:?}\n{}", self.dump());
        self
    }

    /// Files that the runs of this call left in shared memory: in their own folder, and as segments, whose names begin with the run's id and so with the id of
    /// the process that made the run.
    pub fn left_in_shared_memory(&self) -> Vec<PathBuf> {
        left_in_shared_memory(self.shm.path(), self.pid)
    }
}

/// Files in shared memory of the runs that the process `pid` made, with their folder in `shm`.
pub fn left_in_shared_memory(shm: &Path, pid: u32) -> Vec<PathBuf> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        let found = std::fs::read_dir(folder).expect("a folder");
        found.flatten().map(|entry| entry.path()).collect()
    };
    let prefix = format!("freeplay-{pid}-");
    let is_segment =
        |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&prefix));
    let segments = entries(Path::new(SHM)).into_iter().filter(is_segment);
    entries(shm).into_iter().chain(segments).collect()
}

/// A temporary folder; dropping it removes it.
pub fn fresh_folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

/// Calls `freeplay` with `arguments` in a fresh folder.
pub fn freeplay(arguments: &[&str]) -> Ran {
    freeplay_in(fresh_folder(), arguments)
}

/// Calls `freeplay` with `arguments` in `folder`.
pub fn freeplay_in(folder: TempDir, arguments: &[&str]) -> Ran {
    Call::new(folder, arguments).run()
}

/// A lockstep run of the default scenario cut to `duration` seconds, with more `arguments`.
pub fn lockstep(duration: f64, arguments: &[&str]) -> Ran {
    Call::lockstep(duration, arguments).run()
}

/// Set in a process that has shared memory of its own by [`in_own_shared_memory`].
pub const OWN_SHM_ENV: &str = "FREEPLAY_TEST_OWN_SHM";

/// Repeats the test called `name` in a mount namespace of its own with an empty `/dev/shm`, so that its files in shared memory meet no other run. Returns
/// `true` in the process that has to play the test: in the child, or in this process if the system offers no such namespace.
pub fn in_own_shared_memory(name: &str) -> bool {
    if std::env::var_os(OWN_SHM_ENV).is_some() {
        return true;
    }
    let mount = "mount -t tmpfs -o mode=1777 tmpfs /dev/shm && exec \"$@\"";
    let within = ["--mount", "--propagation", "private", "sh", "-c", mount, "sh"];
    if !Command::new("unshare").args(within).arg("true").output().is_ok_and(|output| output.status.success())
    {
        println!("{name}: played in the shared memory of all, since a namespace takes root and unshare");
        return true;
    }
    let mut command = Command::new("unshare");
    command.args(within).arg(std::env::current_exe().expect("this test has a path"));
    command.args([name, "--exact", "--nocapture", "--include-ignored"]).env(OWN_SHM_ENV, "");
    let output = command.stdin(Stdio::null()).output().expect("unshare");
    println!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{name} failed in its namespace; see above");
    false
}

/// The living processes that have `variable`, as `NAME=VALUE`, in their environment.
pub fn processes_with(variable: &str) -> Vec<u32> {
    let has_it = |pid: &u32| {
        let environment = std::fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        environment.split(|&byte| byte == 0).any(|entry| entry == variable.as_bytes()) && runs(*pid)
    };
    let entries = std::fs::read_dir("/proc").expect("the processes").flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(has_it).collect()
}

/// Fails unless every recording in the folder `out` opens, and is closed if `closed`. A recording without a tick has no samples, and the reader says so.
/// Returns the number of recordings.
pub fn assert_recordings_open(out: &Path, closed: bool) -> usize {
    let entries = std::fs::read_dir(out).into_iter().flatten().flatten().map(|entry| entry.path());
    let recordings: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|extension| extension == "mcap")).collect();
    for path in &recordings {
        match freeplay_recording::read(path, None) {
            Ok(recording) => assert!(!closed || !recording.truncated, "{} was not closed", path.display()),
            Err(
                freeplay_recording::ReadError::NoSamples { .. } | freeplay_recording::ReadError::Empty { .. },
            ) => {}
            Err(error) => panic!("{}: {error}", path.display()),
        }
    }
    recordings.len()
}
