//! Sends `kill -9` to any process of a run at any moment, also during its start. Checks that the next run starts, that shared memory does not grow, and that
//! every recording opens.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use freeplay_recording::ReadError;
use freeplay_storage::{list, remove_folder};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::write;
use freeplay_terminal::messages;
use freeplay_terminal::output::say;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::{Pid, Signal, kill_process};
use serde::Serialize;
use serde_json::json;

/// Settings of a run that is killed: short, so that start, loop and end take about the same time.
const KILLED: [&str; 3] = ["duration=1", "recording=mcap", "patience=2"];
/// Settings of the complete run. They are those of [`KILLED`], but the run waits longer for its controller: a busy machine is slow to start one.
const WHOLE: [&str; 3] = ["duration=1", "recording=mcap", "patience=60"];
/// A run has to end within this time after a process of it was killed; long enough for a busy machine.
const LONGEST: Duration = Duration::from_secs(120);
/// Settings of the run after a kill. It waits for its controller as long as a busy machine takes to start one.
const NEXT: [&str; 3] = ["duration=0.02", "recording=none", "patience=60"];
const LOOK: Duration = Duration::from_millis(1);
/// Folder of the segments.
const SHM_FOLDER: &str = "/dev/shm";

/// The process of a run that is killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
enum Victim {
    Plant,
    Controller,
    Run,
}

/// Results of all kills.
#[derive(Debug, Default, Serialize)]
struct Tally {
    kills: u32,
    /// Kills that hit a living victim.
    struck: u32,
    /// The same by victim.
    struck_by_victim: BTreeMap<Victim, u32>,
    /// Of these, before the recording had its first tick.
    during_start: u32,
    hung: u32,
    next_did_not_start: u32,
    recordings: u32,
    recordings_that_do_not_open: u32,
    /// Kills that left files in shared memory, which the next run removed.
    left_and_swept: u32,
    /// Longest time for which the processes of a killed run outlived it, ms.
    slowest_orphan_ms: f64,
    /// Files of all these runs in shared memory at the end.
    files_left: usize,
    #[serde(skip)]
    runs: Vec<u32>,
}

/// Kills `count` runs of `controller`; after each a further run has to succeed.
///
/// # Errors
/// A run that can't be started at all; results that can't be written.
pub fn kill_runs(
    controller: &str,
    count: u32,
    seed: u64,
    out: &Path,
    stop: &AtomicBool,
) -> Result<Exit, Failure> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut tally = Tally::default();
    // The kills are spread over the time that a complete run takes on this machine under its present load.
    let begun = Instant::now();
    // A controller that does not start cannot be killed; it reports the reason on standard error.
    let mut whole = start(controller, &out.join("whole"), &WHOLE, Stdio::inherit())?;
    if !ends(&mut whole)? {
        return Err(Failure::peer(format!("a run of {controller} does not end within {LONGEST:?}")));
    }
    let status = whole.wait().map_err(Failure::internal)?;
    if let Some(exit) = status.code().and_then(failed) {
        return Err(Failure {
            exit,
            message: format!("{controller}: the reference run without a kill failed, so no run was killed"),
        });
    }
    let mut latest = begun.elapsed();
    tally.runs.push(whole.id());
    while tally.kills < count && !stop.load(Ordering::Relaxed) {
        let victim = [Victim::Plant, Victim::Controller, Victim::Run][random.random_range(0..3)];
        let after = latest.mul_f64(random.random_range(0.0..1.0));
        // A run that ended before its kill gives the present duration of a run.
        latest = kill_one(controller, out, victim, after, &mut tally)?.unwrap_or(latest);
    }
    tally.files_left = files_of(&tally.runs);
    let holds = tally.hung + tally.next_did_not_start + tally.recordings_that_do_not_open == 0
        && tally.files_left == 0;
    let report = json!({ "schema": "freeplay.kills/1", "controller": controller, "seed": seed, "holds": holds, "tally": tally });
    let text = serde_json::to_string_pretty(&report).map_err(Failure::internal)?;
    write(&out.join("kills.json"), &text)?;
    say(&format!("{text}\n"))?;
    Ok(if holds { Exit::Done } else { Exit::Verdict })
}

/// Kills `victim` in a run of `controller` at the time `after` its start. Returns the duration of the run if it ended before.
fn kill_one(
    controller: &str,
    out: &Path,
    victim: Victim,
    after: Duration,
    tally: &mut Tally,
) -> Result<Option<Duration>, Failure> {
    let folder = out.join("killed");
    remove_folder(&folder)?;
    let mut run = start(controller, &folder, &KILLED, Stdio::null())?;
    let begun = Instant::now();
    let (mut struck, mut took) = (false, None);
    // On a busy machine the victim starts late.
    while !struck && took.is_none() && begun.elapsed() < LONGEST {
        std::thread::sleep(LOOK);
        if has_ended(&mut run)? {
            took = Some(begun.elapsed());
        } else if begun.elapsed() >= after {
            let orphans = if victim == Victim::Run { children_of(run.id()) } else { Vec::new() };
            struck = strike(victim, &mut run)?;
            tally.slowest_orphan_ms = tally.slowest_orphan_ms.max(outlive_ms(&orphans));
        }
    }
    tally.kills += 1;
    tally.struck += u32::from(struck);
    *tally.struck_by_victim.entry(victim).or_default() += u32::from(struck);
    tally.hung += u32::from(!ends(&mut run)?);
    let entries = list(&folder).unwrap_or_default().into_iter();
    let recordings: Vec<PathBuf> = entries
        .map(|entry| entry.path)
        .filter(|path| path.extension().is_some_and(|extension| extension == "mcap"))
        .collect();
    let mut has_ticks = false;
    for path in &recordings {
        tally.recordings += 1;
        match freeplay_recording::read(path, None) {
            Ok(_) => has_ticks = true,
            // The recording opens; the kill came before its first tick.
            Err(ReadError::NoSamples { .. } | ReadError::Empty { .. }) => {}
            Err(error) => {
                messages::fault(format_args!("{}: {error}", path.display()));
                tally.recordings_that_do_not_open += 1;
            }
        }
    }
    tally.during_start += u32::from(struck && !has_ticks);
    tally.runs.push(run.id());
    tally.left_and_swept += u32::from(files_of(&[run.id()]) > 0);
    let mut next = start(controller, &out.join("next"), &NEXT, Stdio::null())?;
    let well = ends(&mut next)? && next.wait().is_ok_and(|status| status.success());
    tally.next_did_not_start += u32::from(!well);
    tally.runs.push(next.id());
    Ok(took)
}

/// The exit for `code`, if the run failed before its controller commanded anything.
fn failed(code: i32) -> Option<Exit> {
    [Exit::Usage, Exit::Input, Exit::Peer, Exit::Internal].into_iter().find(|exit| *exit as i32 == code)
}

fn start(controller: &str, folder: &Path, sets: &[&str], stderr: Stdio) -> Result<Child, Failure> {
    let program = std::env::current_exe().map_err(Failure::internal)?;
    Command::new(program)
        .args(["run", "--quiet", "--force", "--controller", controller, "--out"])
        .arg(folder)
        .args(sets.iter().flat_map(|set| ["--set", set]))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .map_err(Failure::internal)
}

fn has_ended(run: &mut Child) -> Result<bool, Failure> {
    Ok(run.try_wait().map_err(Failure::internal)?.is_some())
}

/// Kills the process of `victim` in `run`; true if it lived. A process that has ended but was not reaped accepts a signal, too.
fn strike(victim: Victim, run: &mut Child) -> Result<bool, Failure> {
    let pid = pid_of(victim, run.id());
    Ok(!has_ended(run)? && pid.is_some_and(kill))
}

/// Waits for the end of `run`; `false` if it has to be killed.
fn ends(run: &mut Child) -> Result<bool, Failure> {
    let begun = Instant::now();
    while begun.elapsed() < LONGEST {
        if run.try_wait().map_err(Failure::internal)?.is_some() {
            return Ok(true);
        }
        std::thread::sleep(LOOK);
    }
    let _ = run.kill();
    let _ = run.wait();
    Ok(false)
}

/// The process id of `victim` in the run of the process `run`, if it exists.
fn pid_of(victim: Victim, run: u32) -> Option<u32> {
    let word = match victim {
        Victim::Run => return Some(run),
        Victim::Plant => "plant",
        Victim::Controller => "controller",
    };
    children_of(run).into_iter().find(|id| {
        let line = std::fs::read_to_string(format!("/proc/{id}/cmdline")).unwrap_or_default();
        line.split('\0').nth(1) == Some(word)
    })
}

/// The living child processes of the process `run`.
fn children_of(run: u32) -> Vec<u32> {
    let children = std::fs::read_to_string(format!("/proc/{run}/task/{run}/children")).unwrap_or_default();
    children.split_whitespace().filter_map(|id| id.parse().ok()).collect()
}

/// Time until none of the processes `orphans` runs, ms; a zombie does not count as running.
fn outlive_ms(orphans: &[u32]) -> f64 {
    let begun = Instant::now();
    let runs = |pid: &u32| {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        // The state follows the name, which is in brackets.
        stat.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with(['Z', 'X']))
    };
    while orphans.iter().any(runs) && begun.elapsed() < LONGEST {
        std::thread::sleep(LOOK);
    }
    if orphans.is_empty() { 0.0 } else { begun.elapsed().as_secs_f64() * 1e3 }
}

fn kill(pid: u32) -> bool {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
    pid.is_some_and(|pid| kill_process(pid, Signal::KILL).is_ok())
}

/// The files in shared memory of the runs that the processes `runs` made: a run's id begins with that of its process.
fn files_of(runs: &[u32]) -> usize {
    let is_theirs = |name: &str| {
        let id = name.strip_prefix("freeplay-").and_then(|rest| rest.split('-').next()?.parse().ok());
        id.is_some_and(|id| runs.contains(&id))
    };
    let entries = std::fs::read_dir(SHM_FOLDER).into_iter().flatten().flatten();
    entries.filter(|entry| is_theirs(&entry.file_name().to_string_lossy())).count()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use std::process::Command;

    use super::{Victim, ends, outlive_ms, strike};

    #[test]
    fn what_has_ended_is_not_struck() {
        let mut sleeps = Command::new("sleep").arg("1000").spawn().unwrap();
        assert!(strike(Victim::Run, &mut sleeps).unwrap());
        assert!(ends(&mut sleeps).unwrap());
        let mut ended = Command::new("true").spawn().unwrap();
        // It has ended but was not reaped.
        assert!(outlive_ms(&[ended.id()]) < super::LONGEST.as_secs_f64() * 1e3);
        assert!(!strike(Victim::Run, &mut ended).unwrap());
    }
}
