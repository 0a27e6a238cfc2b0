//! Measurements beyond the files: the lateness of a sleeper's wake-up on this machine, and the effect of preventing deep idle states.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use freeplay_shm::{RtRequest, SHM_ENV, Schedule, now_ns, prepare, sleep_then_spin_until};
use freeplay_terminal::exit::Failure;
use hdrhistogram::Histogram;
use rustix::fs::{statfs, statvfs};
use rustix::time::{ClockId, clock_getres};
use serde::Serialize;

use crate::facts::MachineCpuTime;

/// `f_type` of tmpfs, `statfs(2)`.
const TMPFS: u64 = 0x0102_1994;
/// A process that holds this file open with a zero in it keeps the cores out of deep idle states.
const DMA_LATENCY: &str = "dev/cpu_dma_latency";
/// Time between two ticks, ns.
const PERIOD: u64 = 1_000_000;
/// Ticks of each measurement.
const TICKS: u64 = 1000;
/// Spinning time of the run's own wait, ns.
const SPIN: u64 = 200_000;

/// State of the machine from system calls.
#[derive(Clone, Debug, PartialEq)]
pub struct SystemState {
    /// Folder of the runs' shared memory.
    pub shared_memory: PathBuf,
    /// True if it is on a tmpfs.
    pub is_tmpfs: bool,
    /// Free space, bytes; `None` if it cannot be used.
    pub free: Option<u64>,
    /// Resolution of the clock, ns.
    pub resolution: u64,
    /// True if this process may prevent deep idle states.
    pub may_hold: bool,
}

impl SystemState {
    /// Reads the state from the system.
    pub fn read() -> Self {
        let shared_memory =
            std::env::var_os(SHM_ENV).map_or_else(|| PathBuf::from("/dev/shm"), PathBuf::from);
        let kind = statfs(&shared_memory).ok();
        let room = statvfs(&shared_memory).ok();
        let resolution = clock_getres(ClockId::Monotonic);
        Self {
            is_tmpfs: kind.is_some_and(|found| found.f_type as u64 == TMPFS),
            free: room.map(|room| room.f_bavail * room.f_frsize),
            resolution: resolution.tv_sec as u64 * 1_000_000_000 + resolution.tv_nsec as u64,
            may_hold: prevent_deep_idle(Path::new("/")).is_some(),
            shared_memory,
        }
    }
}

/// Lateness of a sleeper's wake-up, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Lateness {
    /// Median.
    pub p50: u64,
    /// 99th percentile.
    pub p99: u64,
    /// Maximum.
    pub max: u64,
}

/// Results of the measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// The scheduler.
    pub scheduler: String,
    /// Duration of the measurement, s.
    pub seconds: f64,
    /// Cost of reading the clock, ns.
    pub clock_cost: u64,
    /// Lateness after sleeping until the tick.
    pub asleep: Lateness,
    /// The same without deep idle states, if the system permits that.
    pub asleep_held: Option<Lateness>,
    /// Lateness after sleeping until 200 µs before the tick, then spinning, like runs.
    pub spun: Lateness,
    /// Clock ticks stolen by the hypervisor during the measurement.
    pub stolen: u64,
    /// Clock ticks of all cores during the measurement.
    pub clock_ticks: u64,
}

impl Probe {
    /// Measures for about three seconds, at real-time `priority` if it is granted.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn run(priority: u8) -> Result<Self, Failure> {
        // A thread of its own: the priority ends with it.
        let thread = std::thread::Builder::new().name("probe".to_owned()).spawn(move || measure(priority));
        let joined = thread.map_err(Failure::no_thread)?.join();
        joined.map_err(|_| Failure::internal("the wake-up measurement failed"))?.map_err(Failure::internal)
    }
}

fn measure(priority: u8) -> Result<Probe, hdrhistogram::CreationError> {
    let began = Instant::now();
    let before = cpu_time();
    let granted = prepare(&RtRequest { priority: Some(priority), cpu: None, lock_memory: false });
    let asleep = lateness(0)?;
    let asleep_held = match prevent_deep_idle(Path::new("/")) {
        Some(_held) => Some(lateness(0)?),
        None => None,
    };
    let spun = lateness(SPIN)?;
    let after = cpu_time();
    let passed = |of: fn(&MachineCpuTime) -> u64| match (&before, &after) {
        (Some(before), Some(after)) => of(after).saturating_sub(of(before)),
        _ => 0,
    };
    Ok(Probe {
        scheduler: granted.machine.scheduler,
        clock_cost: clock_cost(),
        asleep,
        asleep_held,
        spun,
        stolen: passed(|time| time.stolen),
        clock_ticks: passed(|time| time.total),
        seconds: began.elapsed().as_secs_f64(),
    })
}

fn cpu_time() -> Option<MachineCpuTime> {
    MachineCpuTime::of(&std::fs::read_to_string("/proc/stat").ok()?)
}

/// Keeps the cores out of deep idle states until the file is closed.
fn prevent_deep_idle(root: &Path) -> Option<File> {
    let mut file = OpenOptions::new().write(true).open(root.join(DMA_LATENCY)).ok()?;
    file.write_all(&0_i32.to_ne_bytes()).ok()?;
    Some(file)
}

fn lateness(spin: u64) -> Result<Lateness, hdrhistogram::CreationError> {
    let mut late = Histogram::<u64>::new_with_bounds(1, 100_000_000_000, 3)?;
    let schedule = Schedule { start_ns: now_ns() + PERIOD, period_ns: PERIOD };
    for tick in 0..TICKS {
        let awake = sleep_then_spin_until(schedule.due_ns(tick), spin);
        late.saturating_record(schedule.late_ns(tick, awake).max(1));
    }
    Ok(Lateness { p50: late.value_at_quantile(0.5), p99: late.value_at_quantile(0.99), max: late.max() })
}

/// The median time between two consecutive readings of the clock, ns.
fn clock_cost() -> u64 {
    let mut apart: Vec<u64> = (0..1001)
        .map(|_| {
            let first = now_ns();
            now_ns() - first
        })
        .collect();
    apart.sort_unstable();
    apart[500]
}
