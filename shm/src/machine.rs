//! [`Machine`]: properties of the machine that affect timing, stored with every result.

use std::fs;
use std::path::Path;

use rustix::fs::statfs;
use serde::Serialize;

use crate::cores::core_count;
use crate::pacing::Backoff;
use crate::run_folder::all_runs;

/// `f_type` of tmpfs, `statfs(2)`.
const TMPFS_MAGIC: u64 = 0x0102_1994;

/// Properties of the machine and of the calling thread that affect timing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// Model name of the processor.
    pub cpu: String,
    /// Number of cores this process may use.
    pub cores: usize,
    /// Name, release and build of the kernel; the build names its preemption model.
    pub kernel: String,
    /// True if the runs' folder is on tmpfs.
    pub tmpfs: bool,
    /// Current scheduler of the calling thread: `SCHED_OTHER`, `SCHED_FIFO`, …
    pub scheduler: String,
    /// Current real-time priority of the calling thread, 1 to 99; 0 if it has none.
    pub priority: u8,
    /// True if pages of the process are locked in memory.
    pub mlock: bool,
    /// Waiting strategy of lockstep on this machine, see [`Backoff::name`].
    pub wait_policy: String,
}

impl Machine {
    /// Reads the properties; unreadable ones are `unknown`, `false` or 0.
    #[must_use]
    pub fn read() -> Self {
        let unknown = || "unknown".to_owned();
        let (scheduler, priority) =
            scheduling(&read("/proc/thread-self/stat")).unwrap_or_else(|| (unknown(), 0));
        Self {
            cpu: value_of(&read("/proc/cpuinfo"), "model name").map_or_else(unknown, str::to_owned),
            cores: core_count(),
            kernel: ["ostype", "osrelease", "version"]
                .map(|item| read(&format!("/proc/sys/kernel/{item}")).trim().to_owned())
                .join(" "),
            tmpfs: is_tmpfs(&all_runs()),
            scheduler,
            priority,
            mlock: value_of(&read("/proc/self/status"), "VmLck")
                .is_some_and(|locked| !locked.starts_with("0 ")),
            wait_policy: Backoff::for_this_machine().name(),
        }
    }
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// The value in the first line `key: value` of a file of `/proc`.
fn value_of<'text>(text: &'text str, key: &str) -> Option<&'text str> {
    let mut pairs = text.lines().filter_map(|line| line.split_once(':'));
    pairs.find(|(name, _)| name.trim() == key).map(|(_, value)| value.trim())
}

/// Scheduler and real-time priority in `/proc/<pid>/stat`: fields 41 and 40, `proc(5)`. The name of the program, field 2, may
/// contain any character, so the function counts fields from its closing parenthesis.
fn scheduling(stat: &str) -> Option<(String, u8)> {
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let scheduler = match *fields.get(41 - 3)? {
        "0" => "SCHED_OTHER",
        "1" => "SCHED_FIFO",
        "2" => "SCHED_RR",
        "3" => "SCHED_BATCH",
        "5" => "SCHED_IDLE",
        "6" => "SCHED_DEADLINE",
        _ => "unknown",
    };
    Some((scheduler.to_owned(), fields.get(40 - 3)?.parse().ok()?))
}

/// Returns true if `path`, or its nearest existing parent, is on tmpfs.
fn is_tmpfs(path: &Path) -> bool {
    let file_system = path.ancestors().find_map(|path| statfs(path).ok());
    file_system.is_some_and(|found| found.f_type as u64 == TMPFS_MAGIC)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scheduling_is_read_behind_a_name_with_parentheses_and_blanks() {
        let numbers: Vec<String> = (4..=52).map(|field| field.to_string()).collect();
        let mut stat = format!("17 (a ) b) S {}", numbers.join(" "));
        assert_eq!(scheduling(&stat), Some(("unknown".to_owned(), 40)));
        stat = stat.replace(" 40 41 ", " 80 1 ");
        assert_eq!(scheduling(&stat), Some(("SCHED_FIFO".to_owned(), 80)));
        assert_eq!(scheduling("17 (cut off) S 1"), None);
    }

    #[test]
    fn the_facts_of_this_machine_are_known() {
        let machine = Machine::read();
        println!("{machine:?}");
        assert!(machine.cores >= 1);
        assert!(machine.kernel.starts_with("Linux "), "{}", machine.kernel);
        assert_ne!(machine.scheduler, "unknown");
    }
}
