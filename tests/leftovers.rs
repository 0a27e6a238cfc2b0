//! Files of other users in shared memory, among those of our own dead runs: no run follows them, waits for them, fails or slows down because of them, and a run
//! removes only our own dead runs.
//!
//! The hostile files belong to another user if this is root, which may give files away; else to this user, with a message.

mod common;

use std::ffi::OsStr;
use std::fs::{self, Permissions};
use std::io::ErrorKind;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, PermissionsExt, lchown, symlink};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::{FREEPLAY, fresh_folder, in_own_shared_memory};
use freeplay_shm::RunFolder;
use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::getuid;
use tempfile::TempDir;

const SHM: &str = "/dev/shm";

/// Another user: nobody.
const OTHER: u32 = 65_534;

fn shm(name: impl AsRef<OsStr>) -> PathBuf {
    Path::new(SHM).join(name.as_ref())
}

/// The folder of all runs of this user.
fn all_runs() -> PathBuf {
    shm(format!("freeplay-{}", getuid().as_raw()))
}

/// Foreign files that no run may touch: a folder like that of a run, with further files.
struct Victim {
    folder: TempDir,
    files: Vec<PathBuf>,
}

impl Victim {
    fn new() -> Self {
        let folder = fresh_folder();
        let within = |path: &str| folder.path().join(path);
        let run = format!("freeplay-{}/1-0000000a", getuid().as_raw());
        for path in ["1-0000000a/nodes", "letters", "1-0000000b", &run] {
            fs::create_dir_all(within(path)).expect("a folder");
        }
        let files: Vec<PathBuf> =
            ["letter", "letters/letter", "1-0000000a/nodes/file", "1-0000000b/file", &format!("{run}/file")]
                .map(within)
                .into();
        for file in &files {
            fs::write(file, "dear").expect("a file");
        }
        // All closed to others, like a folder of runs.
        for path in ["1-0000000a", "1-0000000b", "letters", &run] {
            fs::set_permissions(within(path), Permissions::from_mode(0o700)).expect("a mode");
        }
        Self { folder, files }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn assert_untouched(&self, after: &str) {
        for file in &self.files {
            assert_eq!(fs::read_to_string(file).unwrap_or_default(), "dear", "{}: {after}", file.display());
        }
    }
}

/// Gives `path` to another user; `false` if this user may not.
fn give_away(path: &Path) -> bool {
    lchown(path, Some(OTHER), Some(OTHER)).is_ok()
}

/// Puts every file into shared memory that could mislead a search for marks to the `victim`; returns the files.
fn plant_hostile_files(victim: &Path) -> Vec<PathBuf> {
    let mut planted = Vec::new();
    let mut next = 0x1000_u32;
    let mut name = |part: &str| {
        next += 1;
        let path = shm(format!("freeplay-1-{next:08x}_{part}"));
        planted.push(path.clone());
        (path, format!("1-{next:08x}"))
    };
    let runs = format!("freeplay-{}", getuid().as_raw());
    let run = victim.join(&runs).join("1-0000000a");
    let contents: Vec<Vec<u8>> = [
        victim.to_owned(),
        victim.join("1-0000000a"),
        run.clone(),
        victim.join("letters/../1-0000000b"),
        all_runs().join("../../../").join(victim.strip_prefix("/").expect("absolute")),
        PathBuf::from("/"),
        PathBuf::from("1-0000000a"),
    ]
    .iter()
    .map(|path| path.as_os_str().as_bytes().to_owned())
    .chain([b"/tmp/\xff\xfe/1-0000000a".to_vec(), Vec::new(), vec![b'/'; 1 << 20], b"\0\0\0".to_vec()])
    .collect();
    for content in &contents {
        // With the name of an older version's mark, and with one of today.
        for part in ["root", "_root"] {
            fs::write(name(part).0, content).expect("a file");
        }
    }
    let elsewhere = victim.join("letter");
    symlink(&elsewhere, name("_root").0).expect("a link");
    symlink("nowhere", name("_root").0).expect("a link");
    symlink(name("_root").0, name("_root").0).expect("a link");
    symlink(&elsewhere, name("data").0).expect("a link");
    for part in ["_root", "root", "data"] {
        mknodat(CWD, name(part).0, FileType::Fifo, Mode::from_raw_mode(0o666), 0).expect("a pipe");
        drop(UnixListener::bind(name(part).0).expect("a socket"));
        fs::create_dir(name(part).0).expect("a folder");
        fs::File::create(name(part).0).and_then(|file| file.set_len(1 << 40)).expect("a sparse file");
        // 1:3 is the null device, 1:5 never ends.
        let device = name(part).0;
        for minor in [3, 5] {
            let made = mknodat(
                CWD,
                &device,
                FileType::CharacterDevice,
                Mode::from_raw_mode(0o666),
                rustix::fs::makedev(1, minor),
            );
            if made.is_err() && minor == 3 {
                freeplay_skip::skip(freeplay_skip::Need::Device, "device nodes take root");
                break;
            }
        }
    }
    planted.sort();
    planted.dedup();
    planted.retain(|path| fs::symlink_metadata(path).is_ok());
    planted
}

fn kinds_of(paths: &[PathBuf]) -> Vec<Option<(u32, u32)>> {
    paths.iter().map(|path| fs::symlink_metadata(path).ok().map(|it| (it.mode(), it.uid()))).collect()
}

/// A short run in shared memory itself; returns its exit code, its output and its duration.
fn run() -> (Option<i32>, String, Duration) {
    let folder = fresh_folder();
    let begun = Instant::now();
    let output = Command::new("timeout")
        .args(["--signal=KILL", "60", FREEPLAY, "run", "--quiet", "--controller", "computed-torque"])
        .args(["--set", "duration=0.02", "--recording", "none", "--out", "out"])
        .current_dir(folder.path())
        .env_remove("FREEPLAY_SHM")
        .env_remove("FREEPLAY_RUN")
        .output()
        .expect("it starts");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned(), begun.elapsed())
}

#[test]
fn hostile_files_neither_mislead_nor_stop_a_run_nor_are_they_removed() {
    if !in_own_shared_memory("hostile_files_neither_mislead_nor_stop_a_run_nor_are_they_removed") {
        return;
    }
    let victim = Victim::new();
    let planted = plant_hostile_files(victim.path());
    for is_given_away in [false, true] {
        if is_given_away && !planted.iter().all(|path| give_away(path)) {
            freeplay_skip::skip(freeplay_skip::Need::Root, "files of another user take root");
            break;
        }
        let before = kinds_of(&planted);
        let (code, said, took) = run();
        println!("{} hostile files, given away: {is_given_away}: {} ms", planted.len(), took.as_millis());
        assert_eq!(code, Some(0), "{said}");
        victim.assert_untouched("a run");
        let missing: Vec<_> = planted.iter().zip(kinds_of(&planted)).zip(&before).collect();
        for ((path, now), before) in missing {
            assert_eq!(now, *before, "{} was changed", path.display());
        }
    }
    remove(&planted);
}

fn remove(planted: &[PathBuf]) {
    for path in planted {
        let _ = fs::remove_file(path).or_else(|_| fs::remove_dir(path));
    }
}

/// Makes the files of a dead run: a folder in `all`, segments and a mark.
fn plant_dead_run(all: &Path, id: &str) -> Vec<PathBuf> {
    let root = all.join(id);
    fs::create_dir_all(root.join("nodes/1")).expect("a folder");
    for folder in [all, &root] {
        fs::set_permissions(folder, Permissions::from_mode(0o700)).expect("a mode");
    }
    fs::write(root.join("nodes/1/file"), "").expect("a file");
    let mark = shm(format!("freeplay-{id}__root"));
    fs::write(&mark, root.as_os_str().as_bytes()).expect("a mark");
    let segment = shm(format!("freeplay-{id}_0354a2_1.data"));
    fs::write(&segment, "data").expect("a segment");
    vec![root, mark, segment]
}

#[test]
fn the_own_dead_runs_are_removed_amidst_hostile_files() {
    if !in_own_shared_memory("the_own_dead_runs_are_removed_amidst_hostile_files") {
        return;
    }
    let victim = Victim::new();
    let elsewhere = fs::canonicalize(fresh_folder().keep()).expect("a path");
    let removed_folder = elsewhere.join("removed").join(format!("freeplay-{}", getuid().as_raw()));
    let mut dead = plant_dead_run(&all_runs(), "9-0000a001");
    dead.extend(plant_dead_run(&elsewhere.join(format!("freeplay-{}", getuid().as_raw())), "9-0000a002"));
    dead.extend(plant_dead_run(&removed_folder, "9-0000a003"));
    fs::remove_dir_all(removed_folder.parent().expect("a parent")).expect("removed");
    // In the folder of runs: a link, a file, a name that no run has, a folder that others could have changed, and a living run.
    let mut kept = Vec::new();
    symlink(victim.path(), all_runs().join("9-0000b001")).expect("a link");
    fs::write(all_runs().join("9-0000b002"), "").expect("a file");
    for (name, mode) in [("letters", 0o700), ("9-0000b003", 0o755)] {
        fs::create_dir(all_runs().join(name)).expect("a folder");
        fs::write(all_runs().join(name).join("file"), "").expect("a file");
        fs::set_permissions(all_runs().join(name), Permissions::from_mode(mode)).expect("a mode");
    }
    kept.extend(
        ["9-0000b001", "9-0000b002", "letters/file", "9-0000b003/file"].map(|name| all_runs().join(name)),
    );
    let alive = plant_dead_run(&all_runs(), "9-0000b004");
    let lock = fs::File::open(&alive[0]).expect("the folder");
    lock.lock_shared().expect("locked");
    kept.extend(alive);
    // Own marks that lead elsewhere: through a link, to a folder that others could write to, to a folder that is no folder of runs.
    let open =
        plant_dead_run(&elsewhere.join("open").join(format!("freeplay-{}", getuid().as_raw())), "9-0000b005");
    fs::set_permissions(open[0].parent().expect("runs"), Permissions::from_mode(0o777)).expect("a mode");
    let plain = plant_dead_run(&elsewhere.join("plain"), "9-0000b006");
    let real =
        plant_dead_run(&elsewhere.join("real").join(format!("freeplay-{}", getuid().as_raw())), "9-0000b007");
    symlink(elsewhere.join("real"), elsewhere.join("link")).expect("a link");
    let through = elsewhere.join("link").join(format!("freeplay-{}/9-0000b007", getuid().as_raw()));
    fs::write(&real[1], through.as_os_str().as_bytes()).expect("a mark");
    for planted in [open, plain, real] {
        kept.extend(planted);
    }
    let planted = plant_hostile_files(victim.path());
    let (code, said, _) = run();
    assert_eq!(code, Some(0), "{said}");
    for path in &dead {
        assert!(fs::symlink_metadata(path).is_err(), "{} is left", path.display());
    }
    for path in kept.iter().chain(&planted) {
        assert!(fs::symlink_metadata(path).is_ok(), "{} was removed", path.display());
    }
    victim.assert_untouched("a sweep of dead runs");
    remove(&planted);
    kept.iter().filter(|path| path.starts_with(SHM)).for_each(|path| {
        let _ = fs::remove_dir_all(path).or_else(|_| fs::remove_file(path));
    });
    let _ = fs::remove_dir_all(all_runs().join("letters"));
    let _ = fs::remove_dir_all(&elsewhere);
}

#[test]
fn exchanging_folders_links_and_marks_while_runs_are_swept_redirects_nothing() {
    if !in_own_shared_memory("exchanging_folders_links_and_marks_while_runs_are_swept_redirects_nothing") {
        return;
    }
    let victim = Victim::new();
    let id = "9-0000c001";
    let (done, mark, run) =
        (AtomicBool::new(false), shm(format!("freeplay-{id}__root")), all_runs().join(id));
    let sweeps = 3000;
    let (removed, exchanges) = std::thread::scope(|scope| {
        let exchanger = scope.spawn(|| {
            let mut exchanges = 0_u64;
            while !done.load(Ordering::Relaxed) {
                // The sweep may remove any of this at any moment, so that every step may fail.
                let _ = fs::create_dir_all(run.join("nodes"));
                let _ = fs::set_permissions(&run, Permissions::from_mode(0o700));
                let _ = fs::write(run.join("nodes/file"), "");
                for inner in [run.join("nodes"), run.clone(), all_runs()] {
                    let aside = shm("aside");
                    let moved = fs::rename(&inner, &aside).is_ok();
                    exchanges += u64::from(moved && symlink(victim.path(), &inner).is_ok());
                    let _ = fs::remove_file(&inner);
                    let _ = fs::rename(&aside, &inner).or_else(|_| fs::remove_dir_all(&aside));
                }
                let _ = fs::write(&mark, victim.path().join("1-0000000a").as_os_str().as_bytes());
                let _ = fs::remove_file(&mark);
                let _ = symlink(victim.path().join("letter"), &mark);
                let _ = fs::remove_file(&mark);
                let _ = mknodat(CWD, &mark, FileType::Fifo, Mode::from_raw_mode(0o600), 0);
                let _ = fs::remove_file(&mark);
                let _ = fs::write(&mark, run.as_os_str().as_bytes());
            }
            exchanges
        });
        // On a busy machine the exchanger may not have run yet.
        let (start, patience) = (Instant::now(), Duration::from_secs(60));
        let (mut swept, mut removed) = (0, 0);
        while swept < sweeps || removed == 0 && start.elapsed() < patience {
            removed += RunFolder::sweep_dead().len();
            swept += 1;
        }
        done.store(true, Ordering::Relaxed);
        (removed, exchanger.join().expect("the exchanger"))
    });
    println!("at least {sweeps} sweeps removed {removed} runs amidst {exchanges} exchanges");
    assert!(removed > 0 && exchanges > 0, "nothing was removed or exchanged: this tests nothing");
    victim.assert_untouched("the exchanges");
    let _ = fs::remove_dir_all(all_runs());
    let _ = fs::remove_file(&mark);
}

#[test]
fn ten_thousand_hostile_files_do_not_slow_down_a_start() {
    if !in_own_shared_memory("ten_thousand_hostile_files_do_not_slow_down_a_start") {
        return;
    }
    let start = || {
        let begun = Instant::now();
        drop(RunFolder::create().expect("a run"));
        begun.elapsed()
    };
    let least = || (0..9).map(|_| start()).min().unwrap_or_default();
    let without = least();
    let victim = Victim::new();
    let mut planted = Vec::new();
    for index in 0..10_000 {
        let path = shm(format!("freeplay-{index}-{index:08x}__root"));
        match index % 4 {
            0 => mknodat(CWD, &path, FileType::Fifo, Mode::from_raw_mode(0o666), 0).expect("a pipe"),
            1 => symlink(victim.path(), &path).expect("a link"),
            2 => fs::create_dir(&path).expect("a folder"),
            _ => fs::write(&path, victim.path().as_os_str().as_bytes()).expect("a file"),
        }
        if !give_away(&path) && index == 0 {
            println!("the files are this user's own: files of another user take root");
        }
        planted.push(path);
    }
    let with = least();
    println!(
        "a run is made and removed in {:.1} ms, amidst 10,000 hostile files in {:.1} ms",
        ms(without),
        ms(with)
    );
    // Generous, for a busy machine: waiting for any of the files, or comparing each with each, takes longer.
    assert!(with < without + Duration::from_secs(1), "{with:?} instead of {without:?}");
    victim.assert_untouched("many runs");
    remove(&planted);
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

#[test]
fn a_planted_folder_of_runs_is_refused_with_a_remedy_and_not_followed() {
    if !in_own_shared_memory("a_planted_folder_of_runs_is_refused_with_a_remedy_and_not_followed") {
        return;
    }
    let victim = Victim::new();
    let path = all_runs();
    let refused = |what: &str| {
        let is_foreign = give_away(&path);
        let (code, said, took) = run();
        println!("{what} (of another user: {is_foreign}): {said}");
        assert_eq!(code, Some(3), "{what}: {said}");
        assert!(said.contains("set FREEPLAY_SHM") && said.contains(SHM), "{what}: {said}");
        assert!(took < Duration::from_secs(20), "{what} takes {took:?}");
        victim.assert_untouched(what);
        remove(std::slice::from_ref(&path));
        assert!(fs::symlink_metadata(&path).is_err_and(|error| error.kind() == ErrorKind::NotFound));
    };
    symlink(victim.path(), &path).expect("a link");
    refused("a link");
    symlink("nowhere", &path).expect("a link");
    refused("a dangling link");
    fs::write(&path, "").expect("a file");
    refused("a file");
    mknodat(CWD, &path, FileType::Fifo, Mode::from_raw_mode(0o666), 0).expect("a pipe");
    refused("a pipe");
    fs::create_dir(&path).expect("a folder");
    fs::set_permissions(&path, Permissions::from_mode(0o777)).expect("a mode");
    refused("an open folder");
    fs::create_dir(&path).expect("a folder");
    fs::set_permissions(&path, Permissions::from_mode(0o700)).expect("a mode");
    if give_away(&path) {
        refused("a folder of somebody else");
    } else {
        freeplay_skip::skip(freeplay_skip::Need::Root, "a folder of another user takes root");
    }
}

#[test]
fn another_user_s_runs_and_ours_take_no_notice_of_each_other() {
    if !in_own_shared_memory("another_user_s_runs_and_ours_take_no_notice_of_each_other") {
        return;
    }
    let folder = tempfile::Builder::new()
        .permissions(Permissions::from_mode(0o777))
        .tempdir_in("/tmp")
        .expect("a folder");
    let program = folder.path().join("freeplay");
    fs::copy(FREEPLAY, &program).expect("copied");
    let mut command = Command::new("setpriv");
    command.args([&format!("--reuid={OTHER}"), &format!("--regid={OTHER}"), "--clear-groups"]).arg(&program);
    command.args([
        "run",
        "--quiet",
        "--controller",
        "computed-torque",
        "--set",
        "duration=0.02",
        "--out",
        "out",
    ]);
    command.current_dir(folder.path()).env_remove("FREEPLAY_SHM").env("HOME", folder.path());
    // The superuser's files, which lead to a folder of that user.
    let theirs = folder.path().join("theirs");
    fs::create_dir(&theirs).expect("a folder");
    fs::write(theirs.join("file"), "dear").expect("a file");
    let owned = give_away(&theirs) && give_away(&theirs.join("file"));
    give_away(folder.path());
    let planted = plant_hostile_files(&theirs);
    let output = command.output();
    if !owned || !output.as_ref().is_ok_and(|output| output.status.code() != Some(127)) {
        freeplay_skip::skip(freeplay_skip::Need::Root, "a run of another user takes root and setpriv");
        remove(&planted);
        return;
    }
    let output = output.expect("it starts");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(fs::read_to_string(theirs.join("file")).expect("there"), "dear");
    assert!(planted.iter().all(|path| fs::symlink_metadata(path).is_ok()));
    remove(&planted);
}
