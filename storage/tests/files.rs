//! Tests of the crate's guarantees for files and folders, on a real file system.

use std::io::{Seek, SeekFrom, Write};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use freeplay_storage::{
    AtomicFile, Claim, EntryKind, InputFile, LiveFile, OutputFolder, PATH_LIMIT, Refusal, StorageError,
    TEMPORARY_SUFFIX, list, make_folder, open_without_links, read_bytes, read_text, write,
};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn mode(path: &Path) -> u32 {
    std::fs::symlink_metadata(path).expect("there").permissions().mode() & 0o7777
}

fn names(folder: &Path) -> Vec<String> {
    let entries = list(folder).expect("a folder");
    entries
        .iter()
        .map(|entry| entry.path.file_name().expect("a name").to_string_lossy().into_owned())
        .collect()
}

fn refused<T>(result: Result<T, StorageError>) -> String {
    match result {
        Ok(_) => panic!("it is accepted"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_file_appears_whole_or_not_at_all() {
    let folder = folder();
    let target = folder.path().join("a.csv");
    std::fs::write(&target, "old").expect("a file");
    std::fs::set_permissions(&target, std::fs::Permissions::from_mode(0o666)).expect("open to all");
    let mut file = AtomicFile::create(&target).expect("begun");
    file.write_all(b"new, and longer").expect("written");
    assert_eq!(std::fs::read(&target).expect("there"), b"old");
    drop(file);
    assert_eq!(std::fs::read(&target).expect("there"), b"old", "not committed");
    assert_eq!(names(folder.path()), ["a.csv"], "the temporary file is gone");
    let mut file = AtomicFile::create(&target).expect("begun");
    file.write_all(b"new, and longer").expect("written");
    file.seek(SeekFrom::Start(5)).expect("sought");
    file.write_all(b"far").expect("written");
    file.commit().expect("committed");
    assert_eq!(std::fs::read(&target).expect("there"), b"new, far longer");
    assert_eq!(mode(&target), 0o600, "what was open to all is private");
    assert_eq!(names(folder.path()), ["a.csv"]);
}

#[test]
fn a_planted_link_is_replaced_and_not_written_through() {
    let (folder, elsewhere) = (folder(), folder());
    let victim = elsewhere.path().join("victim");
    std::fs::write(&victim, "precious").expect("a file");
    for name in ["report.html", "run.mcap"] {
        symlink(&victim, folder.path().join(name)).expect("a link");
        // A link in the place of the temporary file must not redirect the write, either.
        symlink(&victim, folder.path().join(format!(".{name}{TEMPORARY_SUFFIX}"))).expect("a link");
    }
    write(&folder.path().join("report.html"), "page").expect("written");
    let mut live = LiveFile::create(&folder.path().join("run.mcap")).expect("begun");
    live.write_all(b"ticks").expect("written");
    assert_eq!(std::fs::read(&victim).expect("there"), b"precious");
    for (name, bytes) in [("report.html", &b"page"[..]), ("run.mcap", b"ticks")] {
        let path = folder.path().join(name);
        assert!(!path.is_symlink() && mode(&path) == 0o600);
        assert_eq!(std::fs::read(path).expect("there"), bytes);
    }
    symlink(&victim, folder.path().join("list")).expect("a link");
    refused(LiveFile::open_to_append(&folder.path().join("list")));
    symlink(elsewhere.path(), folder.path().join("cases")).expect("a link");
    assert!(refused(make_folder(&folder.path().join("cases"))).contains("it is a link"));
}

#[test]
fn what_a_killed_writer_left_is_removed_by_the_next_one_and_a_living_one_is_let_be() {
    let folder = folder();
    let target = folder.path().join("a.json");
    let temporary = folder.path().join(format!(".a.json{TEMPORARY_SUFFIX}"));
    std::fs::write(&temporary, "half").expect("a leftover");
    write(&target, "whole").expect("written");
    assert_eq!(names(folder.path()), ["a.json"]);
    let living = AtomicFile::create(&target).expect("begun");
    let error = refused(write(&target, "other"));
    assert!(error.contains("another process is writing") && error.contains("wait"), "{error}");
    assert!(temporary.exists(), "the temporary file of a living writer");
    drop(living);
    write(&target, "other").expect("written");
}

#[test]
fn devices_pipes_and_folders_are_no_targets() {
    let folder = folder();
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    symlink("/dev/null", folder.path().join("null")).expect("a link");
    let targets =
        [pipe, folder.path().join("null"), "/dev/null".into(), "/dev/stdout".into(), folder.path().into()];
    for target in &targets {
        let error = refused(write(target, "x"));
        assert!(error.starts_with(&format!("cannot write {}: ", target.display())), "{error}");
    }
    assert!(Path::new("/dev/stdout").is_symlink(), "it is what it was");
}

#[test]
fn only_regular_files_are_read_and_nothing_is_waited_for() {
    let folder = folder();
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    let socket = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a socket");
    for (path, word) in [
        (pipe, "a pipe"),
        (socket, "a socket"),
        (PathBuf::from("/dev/zero"), "a device"),
        (folder.path().into(), "directory"),
    ] {
        let error = refused(InputFile::open(&path));
        assert!(error.contains(word) && error.contains("; "), "{error}");
    }
    let file = folder.path().join("file");
    std::fs::write(&file, "x").expect("a file");
    symlink(&file, folder.path().join("link")).expect("a link");
    assert_eq!(read_text(&folder.path().join("link")).expect("followed"), "x");
    assert!(refused(open_without_links(&folder.path().join("link"))).contains("it is a link"));
    open_without_links(&file).expect("no link");
}

#[test]
fn readers_stop_at_their_limit() {
    let folder = folder();
    let path = folder.path().join("file");
    std::fs::write(&path, [b'x'; 100]).expect("a file");
    assert_eq!(read_bytes(&path, 100).expect("as long as allowed").len(), 100);
    assert!(refused(read_bytes(&path, 99)).contains("longer than 99 bytes"));
    // A file of the kernel reports zero bytes, but contains many.
    let error = read_bytes(Path::new("/proc/self/maps"), 50).expect_err("longer than it says");
    assert_eq!(error.refusal(), Some(&Refusal::TooLarge { limit: 50 }));
    std::fs::write(&path, b"\xff").expect("a file");
    assert!(refused(read_text(&path)).contains("no text in UTF-8"));
}

#[test]
fn odd_paths_are_refused_by_every_call() {
    use std::os::unix::ffi::OsStrExt;
    let odd = [
        (PathBuf::from("a/".repeat(PATH_LIMIT)), "above the limit of 1024"),
        (PathBuf::from(std::ffi::OsStr::from_bytes(b"a\xff.csv")), "not UTF-8"),
    ];
    for (path, word) in &odd {
        let claim = Claim { results: &[], force: false };
        let errors = [
            refused(InputFile::open(path)),
            refused(write(path, "")),
            refused(LiveFile::create(path)),
            refused(make_folder(path)),
            refused(list(path)),
            refused(OutputFolder::claim(path, claim)),
        ];
        for error in errors {
            assert!(error.contains(word), "{error}");
        }
    }
}

#[test]
fn a_folder_belongs_to_one_command_at_a_time() {
    let folder = folder();
    let out = folder.path().join("a").join("b");
    let claim = Claim { results: &["summary.json"], force: false };
    let first = OutputFolder::claim(&out, claim).expect("free");
    assert_eq!((mode(&out), mode(&folder.path().join("a"))), (0o700, 0o700));
    for force in [false, true] {
        let error = OutputFolder::claim(&out, Claim { force, ..claim }).expect_err("in use");
        assert_eq!(error.refusal(), Some(&Refusal::Busy));
    }
    assert!(names(&out).is_empty(), "the lock is no file");
    std::fs::write(out.join("summary.json"), "{}").expect("a result");
    drop(first);
    let error = refused(OutputFolder::claim(&out, claim));
    assert!(error.contains("holds summary.json") && error.contains("--force"), "{error}");
    OutputFolder::claim(&out, Claim { force: true, ..claim }).expect("by force");
    OutputFolder::claim(&out, Claim { results: &["other.json"], force: false }).expect("nothing in the way");
}

#[test]
fn a_folder_that_nothing_was_put_into_is_gone_again() {
    let folder = folder();
    let out = folder.path().join("a").join("b");
    drop(OutputFolder::claim(&out, Claim { results: &[], force: false }).expect("free"));
    assert!(names(folder.path()).is_empty());
    let kept = OutputFolder::claim(&out, Claim { results: &[], force: false }).expect("free");
    write(&out.join("file"), "x").expect("written");
    drop(kept);
    assert_eq!(names(&out), ["file"]);
}

#[test]
fn commands_of_the_same_second_get_folders_of_their_own() {
    let folder = folder();
    let name = folder.path().join("2026-01-01");
    let claims: Vec<OutputFolder> = std::thread::scope(|scope| {
        let threads: Vec<_> =
            (0..8).map(|_| scope.spawn(|| OutputFolder::claim_new(&name).expect("a new one"))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    let mut paths: Vec<&Path> = claims.iter().map(OutputFolder::path).collect();
    paths.sort_unstable();
    paths.dedup();
    assert_eq!(paths.len(), 8, "{paths:?}");
}

#[test]
fn the_entries_of_a_folder_are_named_and_not_followed() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("b")).expect("a folder");
    std::fs::write(folder.path().join("a"), "").expect("a file");
    symlink("/", folder.path().join("c")).expect("a link");
    let kinds: Vec<EntryKind> = list(folder.path()).expect("listed").iter().map(|entry| entry.kind).collect();
    assert_eq!(kinds, [EntryKind::File, EntryKind::Folder, EntryKind::Link]);
}
