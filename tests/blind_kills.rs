//! `kill -9` of a blind set's parent or of one of its analysts at any moment: nothing hangs, shared memory is empty, a killed analyst counts as no answer, a
//! receipt is complete or absent, and the next call succeeds.
//!
//! `FREEPLAY_KILLS=N` tests N kills instead of a few.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::common::sealed::seal_slide;
use crate::common::{
    Call, Started, children_of, fresh_folder, left_in_shared_memory, processes_with, runs, send_signal, until,
};
use serde_json::Value;

const ANALYSE: [&str; 6] = ["blind", "--analyse", "cases", "--quiet", "--jobs", "1"];

/// After so many kills of a parent the next call runs to its end.
const NEXT: u32 = 4;

/// The killed process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Victim {
    Parent,
    Analyst,
}

/// Results of all kills.
#[derive(Debug, Default)]
struct Tally {
    parents: u32,
    analysts: u32,
    missed: u32,
    next_calls: u32,
    slowest_orphan: Duration,
}

/// A folder with two sealed cases on the machine with one axis, which are quick.
fn sealed() -> tempfile::TempDir {
    let folder = fresh_folder();
    for (seed, kind) in [(40, Some("coulomb_friction")), (41, None)] {
        seal_slide(&folder.path().join("cases").join(format!("case{seed}")), seed, kind);
    }
    folder
}

/// The living processes of the call, from any parent: an analyst has an environment of its own, and is a child.
fn members(run: &Started) -> Vec<u32> {
    processes_with(&format!("FREEPLAY_SHM={}", run.shm.path().display()))
}

fn receipt(folder: &Path) -> Option<Value> {
    let text = std::fs::read_to_string(folder.join("cases/receipt.json")).ok()?;
    Some(serde_json::from_str(&text).expect("a whole receipt"))
}

/// Kills `victim` in an analysis after `delay`.
fn kill_one(victim: Victim, delay: Duration, tally: &mut Tally) {
    let run = Call::new(sealed(), &ANALYSE).start();
    std::thread::sleep(delay);
    let children = children_of(run.pid());
    let target = if victim == Victim::Parent { Some(run.pid()) } else { children.first().copied() };
    let Some(target) = target.filter(|&target| runs(target)) else {
        tally.missed += 1;
        run.wait();
        return;
    };
    send_signal(target, "KILL");
    if victim == Victim::Parent {
        let begun = Instant::now();
        let lives = || members(&run).len() + children.iter().filter(|&&child| runs(child)).count();
        until("the end of all processes", || (lives() == 0).then_some(()));
        tally.slowest_orphan = tally.slowest_orphan.max(begun.elapsed());
        tally.parents += 1;
    }
    let ran = run.wait();
    assert_eq!(left_in_shared_memory(ran.shm.path(), ran.pid), Vec::<PathBuf>::new());
    let told = receipt(ran.folder.path());
    if victim == Victim::Parent {
        if tally.parents.is_multiple_of(NEXT) {
            let next = Call::new(ran.folder, &[&ANALYSE[..], &["--force"]].concat()).run().expect(0);
            assert!(receipt(next.folder.path()).is_some());
            tally.next_calls += 1;
        }
        return;
    }
    assert_eq!(ran.code(), 0, "{}", ran.dump());
    let told = told.expect("a receipt");
    let cases = told["cases"].as_object().expect("cases");
    let killed = cases.values().filter(|case| case["answer"]["verdict"] == "failed").count();
    // The analyst may have written its answer already.
    assert!(cases.len() == 2 && killed <= 1, "{told:#}");
    tally.analysts += 1;
}

#[test]
fn a_blind_set_survives_kills_at_any_moment() {
    let kills: u32 = std::env::var("FREEPLAY_KILLS").ok().and_then(|count| count.parse().ok()).unwrap_or(4);
    let begun = Instant::now();
    Call::new(sealed(), &ANALYSE).run().expect(0);
    let whole = begun.elapsed();
    let mut tally = Tally::default();
    for index in 0..kills {
        let victim = if index % 2 == 0 { Victim::Parent } else { Victim::Analyst };
        // Steps of the golden ratio spread any number of kills over the whole call.
        let share = (f64::from(index) * 0.618_033_988_75).fract();
        kill_one(victim, whole.mul_f64(share), &mut tally);
        println!("{} kills: {tally:?}", index + 1);
    }
    println!("{kills} kills within {whole:?}: {tally:?}, none hung, nothing left in shared memory");
    assert!(tally.parents > 0 && tally.analysts + tally.parents >= kills / 2, "most kills missed: {tally:?}");
}
