//! Processes that run out of memory: each command runs under several limits of its address space (`ulimit -v`), from the least under which the program starts
//! to the least that is enough for the command. Each ends with a clear message and a documented exit code, old data are intact, and shared memory is empty.
//!
//! `FREEPLAY_MEMORY_LIMITS=N` tests N limits of each command instead of a few.

use std::collections::BTreeMap;
use std::process::Command;

use super::{Subject, contents, on_all_cores};
use crate::common::{Call, FREEPLAY, Ran, fresh_folder, left_in_shared_memory, until};

/// Limits of each command, unless the environment requests another number.
const LIMITS: u64 = 6;

/// Limits just below the sufficient one, at which the end of the work fails.
const CLOSE: u64 = 2;

/// Every command succeeds under this limit, KiB.
const PLENTY: u64 = 4 << 20;

/// Resolution of the search for the least sufficient limit: one part in so many.
const GRAIN: u64 = 32;

/// The program with `arguments`, and `kib` KiB of address space for each of its processes.
fn limited(folder: tempfile::TempDir, kib: u64, arguments: &[&str]) -> Call {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {kib}; exec \"$0\" \"$@\""), FREEPLAY]).args(arguments);
    let mut call = Call::of(folder, command);
    call.command.env_remove("RUST_BACKTRACE");
    call
}

/// The least limit, KiB, above `below` under which `succeeds`, if success becomes likelier with more memory. The search doubles the limit until it suffices,
/// since a failing command ends soonest, then halves the interval. If several processes share the work, a smaller limit suffices occasionally.
fn least(mut below: u64, succeeds: impl Fn(u64) -> bool) -> u64 {
    let mut enough = 2 * below;
    while enough < PLENTY && !succeeds(enough) {
        (below, enough) = (enough, 2 * enough);
    }
    while enough - below > enough / GRAIN {
        let middle = u64::midpoint(below, enough);
        if succeeds(middle) { enough = middle } else { below = middle }
    }
    enough
}

/// The least limit, KiB, under which the program starts.
pub fn least_to_start() -> u64 {
    least(1024, |kib| limited(fresh_folder(), kib, &["--version"]).run().output.status.success())
}

/// Runs `subject` under several limits from `starts` KiB on, under which the program starts; returns the number of insufficient ones.
pub fn starve(subject: &Subject, starts: u64) -> usize {
    let good = Call::new(subject.folder(), &subject.arguments).run().expect(0);
    let good = contents(good.folder.path());
    let enough = least(starts, |kib| {
        // A process that the machine starts too late is not a matter of memory.
        let ran = limited(subject.folder(), kib, &subject.arguments).run();
        !matches!(ran.output.status.code(), None | Some(3 | 70))
    });
    let count = std::env::var("FREEPLAY_MEMORY_LIMITS").ok().and_then(|count| count.parse().ok());
    let count = count.unwrap_or(LIMITS).max(1);
    let spread = (0..count).map(|index| starts + (enough - starts) * index / count);
    let close = (1..=CLOSE).map(|index| enough - enough / GRAIN * index).filter(|&kib| kib > starts);
    let limits: Vec<u64> = spread.chain(close).collect();
    let codes = on_all_cores(&limits, |&kib| starve_at(subject, kib, &good));
    println!(
        "{}: the program starts under {starts} KiB, {enough} KiB are enough; exit codes of {} limits between: {codes:?}",
        subject.name,
        limits.len()
    );
    codes.iter().filter(|(code, _)| **code != 0).map(|(_, count)| count).sum()
}

fn starve_at(subject: &Subject, kib: u64, good: &BTreeMap<std::path::PathBuf, Vec<u8>>) -> i32 {
    let folder = subject.folder();
    let old = contents(folder.path());
    let ran = limited(folder, kib, &subject.arguments).run();
    let at = || format!("{} under {kib} KiB: {}", subject.name, ran.dump());
    let code = ran.output.status.code().unwrap_or_else(|| panic!("killed: {}", at()));
    assert!([0, 1, 3, 5, 70].contains(&code), "{}", at());
    if code != 0 {
        assert_is_told(&ran, &at);
    }
    // The plant of an aborted run removes the files in shared memory after it.
    until("nothing in shared memory", || {
        left_in_shared_memory(ran.shm.path(), ran.pid).is_empty().then_some(())
    });
    subject.check_files(&old, &contents(ran.folder.path()), good, &at);
    code
}

/// Fails unless one line reports the failure: that of the process with too little memory, and perhaps another of its parent.
fn assert_is_told(ran: &Ran, at: &dyn Fn() -> String) {
    let stderr = ran.stderr();
    let is_message =
        |line: &&str| line.starts_with("freeplay: ") || line.starts_with("memory allocation of ");
    let told = stderr.lines().filter(is_message).count();
    assert!((1..=3).contains(&told), "{told} messages: {}", at());
    assert!(!stderr.contains("panicked") && !stderr.contains("os error 11)\n"), "{}", at());
}
