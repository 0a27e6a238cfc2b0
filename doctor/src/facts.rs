//! Facts about a machine from `/proc` and `/sys`; an ordinary user can read all of them.
//!
//! All files are read below a root folder, so that the program can also examine a copy of them. A missing file gives `None`, which counts neither as good nor
//! as bad.

use std::path::Path;

/// `CAP_IPC_LOCK`, `capabilities(7)`.
const CAP_IPC_LOCK: u32 = 14;
/// `CAP_SYS_NICE`, `capabilities(7)`.
const CAP_SYS_NICE: u32 = 23;

/// CPU time of the whole machine since its start, in clock ticks summed over all cores (`/proc/stat`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MachineCpuTime {
    /// Time that the hypervisor gave to other machines while this one had work to do.
    pub stolen: u64,
    /// Total time.
    pub total: u64,
}

/// The facts; see the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Release of the kernel.
    pub kernel: Option<String>,
    /// Build of the kernel, which states its preemption model.
    pub build: Option<String>,
    /// True if it is a PREEMPT_RT kernel with real-time preemption active.
    pub realtime: bool,
    /// Highest real-time priority that this process may take, 1 to 99; 0 for none.
    pub priority: Option<u64>,
    /// True if this process may lock all of its memory.
    pub may_lock: Option<bool>,
    /// Share of each second that real-time threads may use; absent: all.
    pub realtime_share: Option<f64>,
    /// The frequency governors in force, each once.
    pub governors: Vec<String>,
    /// Time to leave the deepest idle state, µs.
    pub deepest_idle: Option<u64>,
    /// Cores isolated from the scheduler, as a list.
    pub isolated: Option<String>,
    /// Cores without a periodic timer interrupt while one task runs, as a list.
    pub tickless: Option<String>,
    /// The clock source.
    pub clock_source: Option<String>,
    /// Cores that this process may use.
    pub cores: Option<usize>,
    /// CPU time that its control group permits, in cores.
    pub quota: Option<f64>,
    /// Number of running and runnable processes, average over the last minute.
    pub load: Option<f64>,
    /// True if the machine is virtual.
    pub is_virtual: bool,
    /// Stolen time since the start of the machine.
    pub cpu_time: Option<MachineCpuTime>,
}

impl Facts {
    /// Reads the facts below `root`, `/` for the machine itself.
    pub fn read(root: &Path) -> Self {
        let text =
            |path: &str| std::fs::read_to_string(root.join(path)).ok().map(|text| text.trim().to_owned());
        let status = text("proc/self/status").unwrap_or_default();
        let capabilities = field(&status, "CapEff:").and_then(|bits| u64::from_str_radix(bits, 16).ok());
        let has = |bit: u32| capabilities.map(|bits| bits >> bit & 1 == 1);
        let limits = text("proc/self/limits").unwrap_or_default();
        let limit = |name: &str| field(&limits, name).and_then(|rest| rest.split_whitespace().next());
        let priority = match (has(CAP_SYS_NICE), limit("Max realtime priority")) {
            (Some(true), _) | (_, Some("unlimited")) => Some(99),
            (_, limit) => limit.and_then(|limit| limit.parse().ok()),
        };
        let may_lock = match (has(CAP_IPC_LOCK), limit("Max locked memory")) {
            (Some(true), _) => Some(true),
            (_, limit) => limit.map(|limit| limit == "unlimited"),
        };
        Self {
            kernel: text("proc/sys/kernel/osrelease"),
            build: text("proc/sys/kernel/version"),
            realtime: text("sys/kernel/realtime").as_deref() == Some("1"),
            priority,
            may_lock,
            realtime_share: realtime_share(&text),
            governors: governors(root),
            deepest_idle: deepest_idle(root),
            isolated: text("sys/devices/system/cpu/isolated").filter(|list| !list.is_empty()),
            tickless: text("sys/devices/system/cpu/nohz_full")
                .filter(|list| !list.is_empty() && !list.contains("null")),
            clock_source: text("sys/devices/system/clocksource/clocksource0/current_clocksource"),
            cores: field(&status, "Cpus_allowed_list:").and_then(count),
            quota: quota(&text),
            load: text("proc/loadavg").and_then(|text| text.split(' ').next()?.parse().ok()),
            is_virtual: text("proc/cpuinfo").is_some_and(|text| has_flag(&text, "hypervisor")),
            cpu_time: text("proc/stat").as_deref().and_then(MachineCpuTime::of),
        }
    }
}

impl MachineCpuTime {
    /// Parses the text of `/proc/stat`: the eighth number of the first line is the stolen time; the first two numbers already include the last two
    /// (`proc_stat(5)`).
    pub fn of(stat: &str) -> Option<Self> {
        let numbers = stat.lines().next()?.strip_prefix("cpu ")?;
        let numbers: Vec<u64> = numbers.split_whitespace().map_while(|number| number.parse().ok()).collect();
        Some(Self { stolen: *numbers.get(7)?, total: numbers.iter().take(8).sum() })
    }
}

/// The text after `name` in the first line that begins with it.
fn field<'text>(text: &'text str, name: &str) -> Option<&'text str> {
    text.lines().find_map(|line| line.strip_prefix(name)).map(str::trim)
}

fn has_flag(cpuinfo: &str, flag: &str) -> bool {
    let mut flags = cpuinfo.lines().filter(|line| line.starts_with("flags") || line.starts_with("Features"));
    flags.next().is_some_and(|line| line.split_whitespace().any(|word| word == flag))
}

/// Number of cores in a list such as `0-3,6`.
fn count(list: &str) -> Option<usize> {
    let size = |part: &str| match part.split_once('-') {
        None => part.parse::<usize>().ok().map(|_| 1),
        Some((first, last)) => Some(last.parse::<usize>().ok()?.checked_sub(first.parse().ok()?)? + 1),
    };
    list.split(',').map(|part| size(part.trim())).sum()
}

fn realtime_share(text: &dyn Fn(&str) -> Option<String>) -> Option<f64> {
    let number = |name: &str| text(&format!("proc/sys/kernel/{name}"))?.parse::<f64>().ok();
    let (runtime, period) = (number("sched_rt_runtime_us")?, number("sched_rt_period_us").unwrap_or(1e6));
    (runtime >= 0.0 && runtime < period).then_some(runtime / period)
}

/// The least limit of the control groups of this process, cores.
fn quota(text: &dyn Fn(&str) -> Option<String>) -> Option<f64> {
    let ratio = |quota: &str, period: &str| {
        let (quota, period) = (quota.parse::<f64>().ok()?, period.parse::<f64>().ok()?);
        (quota > 0.0 && period > 0.0).then_some(quota / period)
    };
    let groups = text("proc/self/cgroup")?;
    let allowed = groups.lines().filter_map(|line| {
        let mut parts = line.splitn(3, ':');
        let (_, controllers, path) = (parts.next()?, parts.next()?, parts.next()?.trim_matches('/'));
        if controllers.is_empty() {
            let most = text(&format!("sys/fs/cgroup/{path}/cpu.max"))?;
            let (quota, period) = most.split_once(' ')?;
            ratio(quota, period)
        } else if controllers.split(',').any(|name| name == "cpu") {
            let folder = format!("sys/fs/cgroup/{controllers}/{path}");
            ratio(
                &text(&format!("{folder}/cpu.cfs_quota_us"))?,
                &text(&format!("{folder}/cpu.cfs_period_us"))?,
            )
        } else {
            None
        }
    });
    allowed.reduce(f64::min)
}

/// The folders of the cores.
fn cores(root: &Path) -> impl Iterator<Item = std::path::PathBuf> {
    let entries = std::fs::read_dir(root.join("sys/devices/system/cpu")).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.strip_prefix("cpu").is_some_and(|number| number.parse::<u32>().is_ok())
    })
}

fn governors(root: &Path) -> Vec<String> {
    let mut found: Vec<String> = cores(root)
        .filter_map(|core| std::fs::read_to_string(core.join("cpufreq/scaling_governor")).ok())
        .map(|name| name.trim().to_owned())
        .collect();
    found.sort();
    found.dedup();
    found
}

fn deepest_idle(root: &Path) -> Option<u64> {
    let number = |path: std::path::PathBuf| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let states =
        cores(root).flat_map(|core| std::fs::read_dir(core.join("cpuidle")).into_iter().flatten().flatten());
    let enabled = states.filter(|state| number(state.path().join("disable")) != Some(1));
    enabled.filter_map(|state| number(state.path().join("latency"))).max()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]
mod tests {
    use super::{Facts, MachineCpuTime, count};

    #[test]
    fn a_machine_of_which_nothing_is_known_is_neither_good_nor_bad() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Facts::read(folder.path()), Facts::default());
    }

    #[test]
    fn facts_are_read_from_a_folder_like_the_systems() {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in [
            ("proc/self/status", "Name:\tx\nCapEff:\t0000000000800000\nCpus_allowed_list:\t0-3,6\n"),
            (
                "proc/self/limits",
                "Limit  Soft Limit  Hard Limit  Units\nMax locked memory  8388608  8388608  bytes\n\
                 Max realtime priority     0                    0\n",
            ),
            ("proc/self/cgroup", "3:cpuset:/\n2:cpu,cpuacct:/box\n0::/box\n"),
            ("sys/fs/cgroup/box/cpu.max", "150000 100000\n"),
            ("sys/fs/cgroup/cpu,cpuacct/box/cpu.cfs_quota_us", "-1\n"),
            ("sys/fs/cgroup/cpu,cpuacct/box/cpu.cfs_period_us", "100000\n"),
            ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
            ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
            ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n"),
            ("sys/devices/system/cpu/cpu10/cpufreq/scaling_governor", "powersave\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state1/latency", "2\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state2/latency", "133\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state3/latency", "800\n"),
            ("sys/devices/system/cpu/cpu0/cpuidle/state3/disable", "1\n"),
            ("sys/devices/system/cpu/cpufreq/boost", "1\n"),
            ("sys/devices/system/cpu/isolated", "\n"),
            ("sys/devices/system/cpu/nohz_full", "(null)\n"),
            ("proc/cpuinfo", "flags\t\t: fpu hypervisor sse\n"),
            ("proc/loadavg", "0.52 0.58 0.59 1/467 1\n"),
            ("proc/stat", "cpu  10 20 30 40 5 0 5 7 3 0\ncpu0 1 2\n"),
            ("sys/kernel/realtime", "1\n"),
        ] {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let expected = Facts {
            realtime: true,
            priority: Some(99),
            may_lock: Some(false),
            realtime_share: Some(0.95),
            governors: vec!["powersave".to_owned()],
            deepest_idle: Some(133),
            cores: Some(5),
            quota: Some(1.5),
            load: Some(0.52),
            is_virtual: true,
            cpu_time: Some(MachineCpuTime { stolen: 7, total: 117 }),
            ..Facts::default()
        };
        assert_eq!(Facts::read(folder.path()), expected);
    }

    #[test]
    fn lists_of_cores_are_counted() {
        assert_eq!(
            [count("0"), count("0-1"), count("0-3, 6,8-9"), count("x")],
            [Some(1), Some(2), Some(7), None]
        );
    }
}
