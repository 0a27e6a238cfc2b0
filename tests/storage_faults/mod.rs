//! Every call to the file system fails in turn, and power is cut after each. Afterwards old data are intact, there is one clear error with a documented exit
//! code, no partial file has a final name, and shared memory is empty.
//!
//! A debug build of the program counts and logs its calls on demand (`storage/src/injection.rs`). By default the test tries a part of the calls, evenly spread;
//! `FREEPLAY_FAULT_POINTS=all cargo test -p freeplay --test command storage_faults:: -- --nocapture` tries all, `FREEPLAY_FAULT_POINTS=3/20` one part of many.
//! Power cuts are always complete: the test replays them from the log in memory.

mod disk;
mod memory;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::common::{Call, FREEPLAY, Ran, fresh_folder};
use disk::{Disk, Survives};
use tempfile::TempDir;

/// Ending of temporary files.
const TEMPORARY: &str = ".freeplay-part";

/// Number of failing calls per command, unless all are requested.
const THINNED: usize = 12;

const ENOSPC: i32 = 28;
const EIO: i32 = 5;
const EACCES: i32 = 13;

/// A command under test.
struct Subject {
    name: &'static str,
    arguments: Vec<&'static str>,
    /// Makes its inputs, and the results of an earlier command.
    prepare: fn(&Path),
    /// Endings of files that are readable while they grow.
    live: &'static [&'static str],
}

/// The log of a successful call, and the content of its folder before.
struct Observed {
    log: Vec<disk::Call>,
    before: Disk,
    here: PathBuf,
    ran: Ran,
}

impl Subject {
    fn folder(&self) -> TempDir {
        let folder = fresh_folder();
        (self.prepare)(folder.path());
        folder
    }

    fn observe(&self) -> Option<Observed> {
        let folder = self.folder();
        let here = folder.path().to_path_buf();
        let before = Disk::of(&here);
        let log = fresh_folder();
        let log_path = log.path().join("log");
        let ran = Call::new(folder, &self.arguments).env("FREEPLAY_STORAGE_LOG", &log_path).run().expect(0);
        let Ok(text) = std::fs::read_to_string(&log_path) else {
            freeplay_skip::skip(
                freeplay_skip::Need::FaultInjection,
                "this build of the program has no fault injection",
            );
            return None;
        };
        Some(Observed { log: disk::Call::parse_all(&text), before, here, ran })
    }

    /// Lets calls fail in turn: each once, and, for a full disk, from this call on.
    fn fail_each(&self) {
        let Some(observed) = self.observe() else { return };
        let mut points: Vec<(String, i32)> = Vec::new();
        for call in &observed.log {
            let (role, number) = (&call.role, call.number);
            match call.kind.as_str() {
                "open" | "list" => points.push((format!("{role}:{number}"), EACCES)),
                "read" | "lock" => points.push((format!("{role}:{number}"), EIO)),
                _ => {
                    points.extend([(format!("{role}:{number}"), EIO), (format!("{role}:{number}+"), ENOSPC)])
                }
            }
        }
        let all = points.len();
        let (first, step) = chosen(std::env::var("FREEPLAY_FAULT_POINTS").ok().as_deref(), || {
            // Drawing and analysing a set takes seconds each time.
            let most = if self.name == "blind" { THINNED / 4 } else { THINNED };
            (0, all.div_ceil(most).max(1))
        });
        points = points.into_iter().skip(first).step_by(step).collect();
        let codes = on_all_cores(&points, |(point, errno)| self.fail_one(&observed, point, *errno));
        println!(
            "{}: {} calls, {} of {all} faults tried, exit codes {codes:?}",
            self.name,
            observed.log.len(),
            points.len()
        );
        assert!(codes.contains_key(&3), "no fault was noticed");
    }

    fn fail_one(&self, observed: &Observed, point: &str, errno: i32) -> i32 {
        let folder = self.folder();
        let old = contents(folder.path());
        let fault = format!("{point}:{errno}");
        let ran = Call::new(folder, &self.arguments).env("FREEPLAY_STORAGE_FAULT", &fault).run();
        let at = || format!("{} with {fault}: {}", self.name, ran.dump());
        let code = ran.output.status.code().unwrap_or_else(|| panic!("killed: {}", at()));
        assert!(code == 0 || code == 3, "{}", at());
        let stderr = ran.stderr();
        let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("freeplay: ")).collect();
        assert!(!stderr.contains("panicked"), "{}", at());
        assert!(code == 0 || (1..=3).contains(&errors.len()), "{}", at());
        assert!(errors.iter().all(|line| line.len() > 30), "{}", at());
        let left = ran.left_in_shared_memory();
        assert!(left.is_empty(), "left in shared memory: {left:?}; {}", at());
        self.check_files(&old, &contents(ran.folder.path()), &contents(observed.ran.folder.path()), &at);
        code
    }

    /// Checks that each file is unchanged, or new and complete, and that there are no files beyond those of a successful call.
    fn check_files(
        &self,
        old: &BTreeMap<PathBuf, Vec<u8>>,
        found: &BTreeMap<PathBuf, Vec<u8>>,
        good: &BTreeMap<PathBuf, Vec<u8>>,
        at: &dyn Fn() -> String,
    ) {
        for name in old.keys() {
            assert!(found.contains_key(name) || self.gives_up(name), "{} is gone; {}", name.display(), at());
        }
        for (name, bytes) in found {
            let text = name.to_string_lossy();
            if text.ends_with(TEMPORARY) || text == "stdout" || text == "stderr" {
                continue;
            }
            let is_known = old.get(name) == Some(bytes) || good.contains_key(name) || self.name == "blind";
            assert!(is_known, "{} is new; {}", name.display(), at());
            assert!(
                old.get(name) == Some(bytes) || self.is_whole(name, bytes),
                "{} is half; {}",
                name.display(),
                at()
            );
        }
    }

    /// True if `--force` removes an earlier result before the new one exists: a blind set is drawn anew, and the other results of a controller's run are
    /// removed with its recording, which is overwritten from the first tick on.
    fn gives_up(&self, name: &Path) -> bool {
        self.name == "blind"
            || (self.name == "run" && name.to_string_lossy().contains("out/computed-torque."))
    }

    fn is_live(&self, name: &Path) -> bool {
        self.live.iter().any(|ending| name.extension().is_some_and(|found| found == *ending))
    }

    fn is_whole(&self, name: &Path, bytes: &[u8]) -> bool {
        let text = || std::str::from_utf8(bytes).expect("text");
        let ending = name.extension().unwrap_or_default().to_string_lossy().into_owned();
        match ending.as_str() {
            _ if self.is_live(name) => true,
            "json" => serde_json::from_slice::<serde_json::Value>(bytes).is_ok(),
            "toml" => toml::from_str::<toml::Table>(text()).is_ok_and(|table| !table.is_empty()),
            "html" => text().trim_end().ends_with("</html>"),
            "csv" => bytes.ends_with(b"\n"),
            "parquet" => bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"),
            "mcap" => bytes.starts_with(b"\x89MCAP0\r\n") && bytes.ends_with(b"\x89MCAP0\r\n"),
            _ => !bytes.is_empty(),
        }
    }

    /// Cuts power after each call of a successful run.
    fn cut_power(&self) {
        let Some(observed) = self.observe() else { return };
        let Observed { log, before, here, .. } = &observed;
        let mut last = before.clone();
        log.iter().for_each(|call| last.make(call, here));
        let mut disk = before.clone();
        let mut cuts = 0;
        for call in log {
            disk.make(call, here);
            for survives in Survives::ALL {
                cuts += 1;
                let found = disk.after_cut(survives);
                let at = format!(
                    "{}: cut after {} {} {}, {survives:?}",
                    self.name, call.role, call.number, call.kind
                );
                for (name, bytes, inode) in &found {
                    self.check_after_cut(name, bytes, last.data(inode), &at);
                }
                for (name, _, _) in before.after_cut(Survives::All) {
                    let is_there = found.iter().any(|(found, _, _)| *found == name);
                    assert!(is_there || self.gives_up(&name), "{at}: {} is gone", name.display());
                }
            }
        }
        println!("{}: {} calls, {cuts} power cuts survived", self.name, log.len());
        assert!(cuts > 20);
    }

    fn check_after_cut(&self, name: &Path, bytes: &[u8], whole: &[u8], at: &str) {
        if name.to_string_lossy().ends_with(TEMPORARY) {
            return;
        }
        if self.is_live(name) {
            assert!(whole.starts_with(bytes), "{at}: {} has other bytes", name.display());
        } else {
            assert!(
                whole == bytes,
                "{at}: {} is half: {} of {} bytes",
                name.display(),
                bytes.len(),
                whole.len()
            );
        }
    }
}

/// First fault point, and the step to the next: `all`, or `I/N` for every N-th from the I-th on; else `thinned`.
fn chosen(asked: Option<&str>, thinned: impl Fn() -> (usize, usize)) -> (usize, usize) {
    match asked {
        None => thinned(),
        Some("all") => (0, 1),
        Some(part) => {
            let part = part.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
            let (index, count): (usize, usize) = part.expect("all, or I/N");
            assert!((1..=count).contains(&index), "{index}/{count}: from 1/{count} to {count}/{count}");
            (index - 1, count)
        }
    }
}

/// Calls `work` with each of `points`, with one thread per core; returns the number of times each exit code occurred.
fn on_all_cores<Point: Sync>(points: &[Point], work: impl Fn(&Point) -> i32 + Sync) -> BTreeMap<i32, usize> {
    let next = AtomicUsize::new(0);
    let codes = Mutex::new(BTreeMap::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(point) = points.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let code = work(point);
                    *codes.lock().expect("no other point has failed").entry(code).or_default() += 1;
                }
            });
        }
    });
    codes.into_inner().expect("no point has failed")
}

/// The files below `folder`, by their path in it.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn add(root: &Path, folder: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                add(root, &path, found);
            } else {
                let name = path.strip_prefix(root).expect("below").to_path_buf();
                found.insert(name, std::fs::read(&path).expect("a file"));
            }
        }
    }
    let mut found = BTreeMap::new();
    add(folder, folder, &mut found);
    found
}

/// Calls the program in `folder`, without its fault injection.
fn call(folder: &Path, arguments: &[&str]) {
    let shm = tempfile::Builder::new().prefix("fp-").tempdir_in("/dev/shm").expect("shared memory");
    let output = Command::new(FREEPLAY)
        .args(arguments)
        .current_dir(folder)
        .env("FREEPLAY_SHM", shm.path())
        .output()
        .expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

const RUN: [&str; 11] = [
    "run",
    "--quiet",
    "--force",
    "--out",
    "out",
    "--controller",
    "computed-torque",
    "--set",
    "duration=0.05",
    "--set",
    "patience=60",
];

fn a_run_before(folder: &Path) {
    // Made once per test binary; each call gets a copy of the folder.
    static EARLIER: std::sync::OnceLock<BTreeMap<PathBuf, Vec<u8>>> = std::sync::OnceLock::new();
    let earlier = EARLIER.get_or_init(|| {
        let folder = fresh_folder();
        call(folder.path(), &RUN);
        contents(folder.path())
    });
    for (name, bytes) in earlier {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, bytes).expect("a file");
    }
}

fn run() -> Subject {
    Subject { name: "run", arguments: RUN.to_vec(), prepare: a_run_before, live: &["mcap"] }
}

fn export(form: &'static str) -> Subject {
    let out = match form {
        "csv" => "old.csv",
        "parquet" => "old.parquet",
        _ => "old.mcap",
    };
    let arguments =
        vec!["record", "export", "out/computed-torque.mcap", "--format", form, "--out", out, "--force"];
    let prepare = |folder: &Path| {
        a_run_before(folder);
        for name in ["old.csv", "old.parquet", "old.mcap"] {
            std::fs::write(folder.join(name), "what was there before").expect("a file");
        }
    };
    Subject { name: form, arguments, prepare, live: &[] }
}

fn report() -> Subject {
    let prepare = |folder: &Path| {
        a_run_before(folder);
        std::fs::write(folder.join("old.html"), "what was there before").expect("a file");
    };
    Subject { name: "report", arguments: vec!["report", "out", "--out", "old.html"], prepare, live: &[] }
}

/// A pendulum of two joints as a URDF, and a recording of it with friction in one joint.
fn a_rubbing_arm(folder: &Path) {
    let link = |name: &str| {
        format!(
            "<link name='{name}'><inertial><origin xyz='0.2 0 0'/><mass value='1'/><inertia ixx='0.01' iyy='0.01' izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, x: f64| {
        format!(
            "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/><origin xyz='{x} 0 0'/><axis xyz='0 0 1'/><limit lower='-3' upper='3' effort='50' velocity='10'/></joint>"
        )
    };
    let robot = format!(
        "<robot name='two'><link name='base'/>{}{}{}{}</robot>",
        link("upper"),
        link("lower"),
        joint("shoulder", "base", "upper", 0.0),
        joint("elbow", "upper", "lower", 0.4)
    );
    std::fs::write(folder.join("two.urdf"), robot).expect("a model");
    let mut rows = String::from("t,q1,q2,tau1,tau2\n");
    for k in 0..400 {
        let t = f64::from(k) * 0.01;
        let (a, b) = ((2.0 * t).sin(), (3.1 * t).sin());
        let noise = (f64::from(k) * 12.9898).sin() * 0.01;
        rows += &format!("{t},{a},{b},{},{}\n", noise + 2.0 * (2.0 * t).cos().signum(), noise * 0.7);
    }
    std::fs::write(folder.join("recording.csv"), rows).expect("a recording");
    std::fs::create_dir(folder.join("out")).expect("a folder");
    for name in ["diagnosis.json", "model.toml", "report.html"] {
        std::fs::write(folder.join("out").join(name), "what was there before").expect("a file");
    }
}

fn diagnose() -> Subject {
    let arguments = vec![
        "diagnose",
        "--quiet",
        "--seed",
        "4",
        "--model",
        "two.urdf",
        "--recording",
        "recording.csv",
        "--out",
        "out",
        "--force",
    ];
    Subject { name: "diagnose", arguments, prepare: a_rubbing_arm, live: &[] }
}

fn blind() -> Subject {
    let prepare = |folder: &Path| {
        std::fs::create_dir(folder.join("out")).expect("a folder");
        for name in ["receipt.json", "report.html"] {
            std::fs::write(folder.join("out").join(name), "what was there before").expect("a file");
        }
    };
    // Analysts only read, in a sandbox of their own; they fail within one second.
    let arguments = vec![
        "blind",
        "--quiet",
        "--cases",
        "2",
        "--seed",
        "22",
        "--patience",
        "1",
        "--out",
        "out",
        "--force",
    ];
    Subject { name: "blind", arguments, prepare, live: &[] }
}

#[test]
fn a_run_survives_the_fault_of_each_call() {
    run().fail_each();
}

#[test]
fn an_export_survives_the_fault_of_each_call() {
    for form in ["csv", "parquet", "mcap"] {
        export(form).fail_each();
    }
}

#[test]
fn a_report_survives_the_fault_of_each_call() {
    report().fail_each();
}

#[test]
fn a_diagnosis_survives_the_fault_of_each_call() {
    diagnose().fail_each();
}

#[test]
fn a_blind_set_survives_the_fault_of_each_call() {
    blind().fail_each();
}

#[test]
fn little_memory_is_told_and_costs_nothing() {
    let subjects = [run(), export("csv"), export("parquet"), export("mcap"), diagnose(), blind()];
    let starts = memory::least_to_start();
    let felt: usize = subjects.iter().map(|subject| memory::starve(subject, starts)).sum();
    assert!(felt > 0, "no limit was felt");
}

#[test]
fn power_is_cut_after_each_call() {
    for subject in [run(), export("csv"), export("parquet"), export("mcap"), report(), diagnose(), blind()] {
        subject.cut_power();
    }
}
