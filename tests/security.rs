//! Protection of a run: its files belong to its owner, and the plant accepts no commands from another user, another layout, another run, or with a forged tick.

use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::{Call, FREEPLAY, Ran, Started, fresh_folder};
use serde_json::json;

/// Tick at which the controller waits for the test.
const PAUSE: u64 = 50;

/// A torque that no controller commands, within the limits of every joint, N·m.
const FORGED: f64 = 3.125;

/// A run whose controller waits at tick [`PAUSE`] until the test resumes it.
struct Paused {
    run: Started,
    resume: PathBuf,
}

impl Paused {
    fn start() -> Self {
        let faulty = Path::new(FREEPLAY).with_file_name("examples").join("faulty").display().to_string();
        let folder = fresh_folder();
        let resume = folder.path().join("resume");
        let arguments = ["run", "--quiet", "--out", "out", "--controller", &faulty, "--set", "duration=0.2"];
        let call = Call::new(folder, &[&arguments[..], &["--set", "patience=60"]].concat())
            .env("FREEPLAY_FAULT", format!("pause@{PAUSE}+1"))
            .env("FREEPLAY_RESUME", &resume);
        let run = call.start();
        run.until("the pause", || resume.with_extension("paused").exists().then_some(()));
        Self { run, resume }
    }

    /// Lets the run continue to its end, and fails unless it succeeds.
    fn finish(self) -> Ran {
        std::fs::write(&self.resume, "").expect("the controller can be told");
        self.run.wait().expect(0)
    }
}

/// `folder` and all files below it.
fn below(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![folder.to_owned()];
    if folder.is_dir() {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            found.extend(below(&entry.path()));
        }
    }
    found
}

fn mode(path: &Path) -> u32 {
    std::fs::metadata(path).expect("there").permissions().mode() & 0o7777
}

#[test]
fn what_a_run_has_and_leaves_is_its_owner_s_alone() {
    let paused = Paused::start();
    let all = std::fs::read_dir(paused.run.shm.path())
        .expect("a folder")
        .flatten()
        .next()
        .expect("the folder of all runs");
    assert_eq!(mode(&all.path()), 0o700, "nobody else gets into the folder of all runs");
    let prefix = format!("freeplay-{}-", paused.run.pid());
    let segments = std::fs::read_dir("/dev/shm").expect("shared memory").flatten().map(|entry| entry.path());
    let segments: Vec<PathBuf> = segments
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&prefix)))
        .collect();
    println!("{} segments, {} files in the run's folder", segments.len(), below(&all.path()).len());
    assert!(segments.len() > 5, "{segments:?}");
    for path in &segments {
        assert_eq!(mode(path) & 0o077, 0, "{} has mode {:o}", path.display(), mode(path));
    }
    let ran = paused.finish();
    for path in below(&ran.out()).iter().filter(|path| path.is_file()) {
        assert_eq!(mode(path), 0o600, "{}", path.display());
    }
}

/// A command that runs as nobody, if this process may change its user.
fn as_nobody(program: &str) -> Option<Command> {
    let mut probe = Command::new("setpriv");
    probe.args(["--reuid=65534", "--regid=65534", "--clear-groups", "true"]);
    if !probe.output().is_ok_and(|output| output.status.success()) {
        freeplay_skip::skip(freeplay_skip::Need::Root, "becoming another user takes root and setpriv");
        return None;
    }
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups", program]);
    Some(command)
}

#[test]
fn another_user_can_neither_join_a_run_nor_read_it_nor_take_its_place() {
    // A copy of the program that another user can run.
    let folder = tempfile::Builder::new()
        .permissions(std::fs::Permissions::from_mode(0o755))
        .tempdir_in("/tmp")
        .expect("a folder");
    let program = folder.path().join("freeplay");
    std::fs::copy(FREEPLAY, &program).expect("copied");
    let Some(mut join) = as_nobody(&program.display().to_string()) else { return };
    let undisturbed = Paused::start().finish().run()["state_hash"].clone();
    let paused = Paused::start();
    let address = paused.run.address();
    let output = join.args(["controller", "computed-torque", "--run", &address]).output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    println!("{said}");
    assert!(!output.status.success() && said.contains("no run lives at"), "{said}");
    let prefix = format!("freeplay-{}-", paused.run.pid());
    let mut tried = 0;
    for entry in std::fs::read_dir("/dev/shm").expect("shared memory").flatten() {
        if entry.file_name().to_string_lossy().starts_with(&prefix) {
            for access in ["-r", "-w"] {
                let Some(mut test) = as_nobody("test") else { return };
                let can = test.args([access, &entry.path().display().to_string()]).status().expect("test");
                assert!(!can.success(), "nobody may {access} {}", entry.path().display());
                tried += 1;
            }
        }
    }
    assert!(tried > 10);
    let run = paused.finish().run();
    assert_eq!(run["state_hash"], undisturbed, "the run takes no notice");
}

/// A process of the same user without a slot and without a hello, which forges commands for the slot of the active controller.
const INTRUDER: &str = r#"
import sys, time, freeplay

class Intruder(freeplay.Link):
    def _take_seat(self):
        return True

    def _knock(self, client, name, claim):
        return freeplay.Welcome()

link = Intruder(sys.argv[1], "intruder", 0, 10.0)
run = freeplay.run_hash(link.id)
# The first lacks nothing but the seat; what is wrong with the others, the gate would tell, too.
wrong = [dict(), dict(tick=PAUSED + 7), dict(tick=0), dict(run=run ^ 1), dict(layout=freeplay.LAYOUT_VERSION + 1), dict(magic=1), dict(joints=5)]
for forged in wrong * 2:
    good = dict(magic=freeplay.MAGIC, layout=freeplay.LAYOUT_VERSION, joints=6, run=run, tick=PAUSED)
    command = freeplay.Command(**{**good, **forged})
    command.value[:] = [FORGED] * 12
    link.send(command)
# What nobody has collected goes with its sender.
time.sleep(1.0)
link.close()
print("sent")
"#;

#[test]
fn forged_commands_of_the_same_user_are_not_applied() {
    let python = std::env::var("FREEPLAY_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let available = Command::new(&python).args(["-c", "import iceoryx2"]).output();
    if !available.is_ok_and(|output| output.status.success()) {
        freeplay_skip::skip(
            freeplay_skip::Need::Python,
            format_args!("{python} has no iceoryx2 0.10.0; FREEPLAY_PYTHON names another interpreter"),
        );
        return;
    }
    let paused = Paused::start();
    let script = INTRUDER.replace("PAUSED", &PAUSE.to_string()).replace("FORGED", &FORGED.to_string());
    let sdk = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python");
    let output =
        Command::new(python).args(["-c", &script, &paused.run.address()]).env("PYTHONPATH", sdk).output();
    let output = output.expect("it starts");
    assert_eq!(output.stdout, b"sent\n", "{}", String::from_utf8_lossy(&output.stderr));
    let ran = paused.finish();
    let run = ran.run();
    println!("{:#}", run["gate"]);
    let recording = ran.recording("faulty.mcap");
    assert_eq!(recording.len(), 200);
    for joint in 1..=6 {
        let applied = recording.column(&format!("applied_{joint}")).expect("a column");
        assert!(applied.iter().all(|&value| value != FORGED), "joint {joint}: a forged torque was applied");
    }
    // The plant refuses them by their sender, not by their content: it bridged nothing.
    let counts = run["gate"]["rejected"].as_object().expect("counts by name");
    for (reason, count) in counts {
        assert_eq!(*count, json!(if reason == "foreign" { 14 } else { 0 }), "{reason} in {counts:#?}");
    }
    let notes = run["notes"].to_string();
    assert!(notes.contains("14 commands for") && notes.contains("which is not that controller"), "{notes}");
}
