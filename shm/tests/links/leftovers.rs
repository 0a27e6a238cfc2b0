//! Tests that a run leaves nothing behind, and that only its owner can read it while it lives.

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use freeplay_shm::{Address, Hello, LinkError, PlantLink, RunFolder, SHM_ENV};

use crate::child::Role;
use crate::{connect_while_greeting, offer, open_plant};

/// All objects of the run in shared memory: its folder with its contents, and its segments.
pub fn traces(address: &Address) -> Vec<PathBuf> {
    let segments = fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path());
    let of_run = |path: &PathBuf| path.to_string_lossy().contains(&address.prefix());
    let mut found: Vec<PathBuf> = segments.filter(of_run).collect();
    collect(address.root(), &mut found);
    found
}

fn collect(path: &Path, found: &mut Vec<PathBuf>) {
    if path.exists() {
        found.push(path.to_owned());
    }
    for entry in fs::read_dir(path).into_iter().flatten().flatten() {
        collect(&entry.path(), found);
    }
}

pub fn assert_nothing_left(address: &Address) {
    assert_eq!(traces(address), Vec::<PathBuf>::new());
}

/// A run with a plant and two connected controllers, of which one has left.
fn busy_run() -> (RunFolder, PlantLink) {
    let run = RunFolder::create().unwrap();
    let mut plant = open_plant(&run, 2);
    for slot in 0..2 {
        connect_while_greeting(&mut plant, run.address(), Hello::new("busy", slot, 0), |connected| {
            std::mem::forget(connected.unwrap());
        });
    }
    (run, plant)
}

#[test]
fn nothing_is_left_whatever_is_dropped_first() {
    let (run, plant) = busy_run();
    let address = run.address().clone();
    assert!(traces(&address).len() > 10, "{:?}", traces(&address));
    drop(plant);
    drop(run);
    assert_nothing_left(&address);

    let (run, plant) = busy_run();
    let address = run.address().clone();
    drop(run);
    assert_nothing_left(&address);
    drop(plant);
    assert_nothing_left(&address);
}

#[test]
fn nothing_is_open_to_others() {
    let (run, _plant) = busy_run();
    let folder = fs::metadata(run.address().root()).unwrap();
    assert_eq!(folder.permissions().mode() & 0o7777, 0o700);
    assert_eq!(fs::metadata(run.address().root().parent().unwrap()).unwrap().mode() & 0o7777, 0o700);
    for path in traces(run.address()) {
        let mode = fs::metadata(&path).unwrap().permissions().mode() & 0o7777;
        let is_inside = path.starts_with(run.address().root());
        assert!(is_inside || mode == 0o600, "{} has mode {mode:o}", path.display());
    }
}

#[test]
fn a_run_lives_as_long_as_anyone_takes_part() {
    let mut root = Role::start("root", None);
    let address = Address::parse(&root.hear("address: ")).unwrap();
    let plant = PlantLink::open(&address, 1, offer(1)).unwrap();
    root.kill();
    RunFolder::sweep_dead();
    assert!(traces(&address).len() > 5);
    drop(plant);
    // The last participant removes the run. But a process that another test is just starting shares this one's locks until its
    // exec; then a sweep is needed.
    for _ in 0..100 {
        if traces(&address).is_empty() {
            break;
        }
        sleep(Duration::from_millis(5));
        RunFolder::sweep_dead();
    }
    assert_nothing_left(&address);
    let error = PlantLink::open(&address, 1, offer(1)).unwrap_err();
    assert!(matches!(error, LinkError::NoRun { .. }), "{error}");
    assert_nothing_left(&address);
}

/// Kills a whole run in a folder with the longest permitted path; `then` gets that folder and must have it swept.
fn with_a_dead_run_elsewhere(then: impl FnOnce(&Path)) {
    let parent = tempfile::tempdir_in("/dev/shm").unwrap();
    let longest = 112 - "/freeplay-4294967295/4194304-01234567".len();
    let folder = parent.path().join("x".repeat(longest - parent.path().as_os_str().len() - 1));
    fs::create_dir(&folder).unwrap();
    let mut whole = Role::start_with("whole run", None, &[(SHM_ENV, folder.to_str().unwrap())]);
    let address = Address::parse(&whole.hear("address: ")).unwrap();
    assert!(address.root().starts_with(&folder) && traces(&address).len() > 10);
    assert!(traces(&address).iter().any(|path| !path.starts_with(&folder)), "all lies in the folder");
    // From now on any other test that starts a run may sweep this one.
    whole.kill();
    then(&folder);
    assert_nothing_left(&address);
}

#[test]
fn a_dead_run_in_another_folder_is_swept_from_there_and_from_anywhere() {
    with_a_dead_run_elsewhere(|folder| {
        Role::start_with("sweeper", None, &[(SHM_ENV, folder.to_str().unwrap())]).hear("swept: ");
        assert_eq!(fs::read_dir(folder).unwrap().count(), 0);
    });
    with_a_dead_run_elsewhere(|_| {
        RunFolder::sweep_dead();
    });
    with_a_dead_run_elsewhere(|folder| {
        fs::remove_dir_all(folder).unwrap();
        RunFolder::sweep_dead();
    });
}

#[test]
fn a_folder_that_others_can_change_is_refused() {
    let parent = tempfile::tempdir().unwrap();
    let all_runs = parent.path().join(format!("freeplay-{}", parent.path().metadata().unwrap().uid()));
    let refused = |remedy: &str| {
        let shm = [(SHM_ENV, parent.path().to_str().unwrap())];
        let reason = Role::start_with("refused root", None, &shm).hear("refused: ");
        println!("{reason}");
        assert!(reason.contains(remedy), "{reason}");
    };
    fs::create_dir(&all_runs).unwrap();
    fs::set_permissions(&all_runs, fs::Permissions::from_mode(0o777)).unwrap();
    refused("mode 777");
    fs::remove_dir(&all_runs).unwrap();
    symlink("/tmp", &all_runs).unwrap();
    refused("is not a folder of this user alone");
    fs::remove_file(&all_runs).unwrap();
    fs::write(&all_runs, "").unwrap();
    refused("set FREEPLAY_SHM");
    fs::remove_file(&all_runs).unwrap();
    for mode in [0o777, 0o770, 0o775, 0o702] {
        fs::set_permissions(parent.path(), fs::Permissions::from_mode(mode)).unwrap();
        refused("other users can rename files");
    }
    // The owner of a folder can rename its contents, whatever its mode.
    if chown(parent.path(), Some(65_534), None).is_ok() {
        for mode in [0o755, 0o1777] {
            fs::set_permissions(parent.path(), fs::Permissions::from_mode(mode)).unwrap();
            refused("other users can rename files");
        }
    } else {
        freeplay_skip::skip(freeplay_skip::Need::Root, "a folder of another user takes root");
    }
}
