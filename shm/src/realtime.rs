//! Real-time set-up of the calling thread: requested and reported, never required.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, geteuid, getrlimit};
use rustix::thread::{CpuSet, sched_setaffinity};
use serde::Serialize;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

use crate::cores::core_count;
use crate::machine::Machine;

/// Request to the system for the calling thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RtRequest {
    /// `SCHED_FIFO` priority, 1 to 99; `None` keeps the scheduler as it is.
    pub priority: Option<u8>,
    /// Number of the core to stay on; `None` leaves the choice to the system.
    pub cpu: Option<usize>,
    /// If true, all present and future pages of the process are kept in memory.
    pub lock_memory: bool,
}

/// Result of one request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Not requested.
    NotAsked,
    /// In force.
    Granted,
    /// Refused; the text gives the reason.
    Refused(String),
}

/// Result of a [`RtRequest`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RtReport {
    /// `SCHED_FIFO` at the requested priority.
    pub priority: Outcome,
    /// Affinity to the requested core.
    pub cpu: Outcome,
    /// All pages kept in memory.
    pub lock_memory: Outcome,
    /// The machine and this thread afterwards.
    pub machine: Machine,
}

/// Applies `request` to the calling thread (memory: to the process) and reports the results.
#[must_use]
pub fn prepare(request: &RtRequest) -> RtReport {
    // Count the cores before this thread is tied to one, because the waiting strategy depends on the cores of the process.
    let _ = core_count();
    RtReport {
        priority: outcome(request.priority.map(set_priority)),
        cpu: outcome(request.cpu.map(stay_on)),
        lock_memory: outcome(request.lock_memory.then(lock_memory)),
        machine: Machine::read(),
    }
}

impl RtReport {
    /// One line per refused request, with the remedy.
    #[must_use]
    pub fn refusals(&self) -> Vec<String> {
        let items = [
            ("real-time priority", &self.priority),
            ("staying on one core", &self.cpu),
            ("locking memory", &self.lock_memory),
        ];
        let lines = items.into_iter().filter_map(|(item, outcome)| match outcome {
            Outcome::Refused(why) => Some(format!("{item} refused: {why}")),
            Outcome::NotAsked | Outcome::Granted => None,
        });
        lines.collect()
    }
}

fn outcome(result: Option<Result<(), String>>) -> Outcome {
    match result {
        None => Outcome::NotAsked,
        Some(Ok(())) => Outcome::Granted,
        Some(Err(why)) => Outcome::Refused(why),
    }
}

fn set_priority(priority: u8) -> Result<(), String> {
    let value =
        ThreadPriorityValue::try_from(priority).map_err(|_| format!("{priority} is not within 1 to 99"))?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
        .map_err(|error| format!("{error}; run as root or grant it (ulimit -r, LimitRTPRIO)"))
}

fn stay_on(cpu: usize) -> Result<(), String> {
    if cpu >= CpuSet::MAX_CPU {
        return Err(format!("there is no core {cpu}"));
    }
    let mut set = CpuSet::new();
    set.set(cpu);
    sched_setaffinity(None, &set).map_err(|error| format!("core {cpu}: {error}"))
}

/// Locks present and future pages. With a limit on locked memory, locking future pages would let a later allocation fail, so the
/// function then locks nothing.
fn lock_memory() -> Result<(), String> {
    let limit = getrlimit(Resource::Memlock).current;
    if let (Some(bytes), false) = (limit, geteuid().is_root()) {
        let kib = bytes / 1024;
        return Err(format!(
            "limited to {kib} KiB, later allocations would fail; lift it (ulimit -l, LimitMEMLOCK)"
        ));
    }
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| error.to_string())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_asked_for_is_left_alone() {
        let report = prepare(&RtRequest::default());
        assert_eq!(
            (&report.priority, &report.cpu, &report.lock_memory),
            (&Outcome::NotAsked, &Outcome::NotAsked, &Outcome::NotAsked)
        );
        assert!(report.refusals().is_empty());
    }

    #[test]
    fn what_cannot_be_granted_is_told_in_one_line_each() {
        let report = prepare(&RtRequest { priority: Some(100), cpu: Some(100_000), lock_memory: false });
        println!("{:#?}", report.refusals());
        assert_eq!(report.refusals().len(), 2);
        assert!(report.refusals().iter().all(|line| line.contains("refused: ") && !line.contains('\n')));
    }

    #[test]
    fn what_is_granted_is_in_force() {
        let thread = std::thread::spawn(|| {
            prepare(&RtRequest { priority: Some(7), cpu: Some(0), lock_memory: false })
        });
        let report = thread.join().unwrap();
        println!("{report:?}");
        let is_fifo = (report.machine.scheduler.as_str(), report.machine.priority) == ("SCHED_FIFO", 7);
        assert_eq!(report.priority == Outcome::Granted, is_fifo, "granted to root, refused to others");
        assert_eq!(
            report.refusals().len(),
            usize::from(!is_fifo) + usize::from(report.cpu != Outcome::Granted)
        );
        let json = serde_json::to_value(&report).unwrap();
        assert_eq!(json["lock_memory"], "not_asked");
    }
}
