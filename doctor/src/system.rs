//! Consequences of the kernel, its rights and the memory of a machine for a run.

use crate::facts::Facts;
use crate::findings::{Finding, Use, fail, ok, warn};
use crate::probe::SystemState;

/// Free space in shared memory that a run needs with all of its slots, and a comfortable amount, bytes.
const ROOM: [u64; 2] = [8 << 20, 64 << 20];

/// The finding on the kernel.
pub fn kernel(facts: &Facts) -> Finding {
    let kind = if facts.is_virtual { ", on a virtual machine" } else { "" };
    ok("kernel", format!("Linux {}{kind}", facts.kernel.as_deref().unwrap_or("of unknown release")))
}

/// The finding on the preemption model of the kernel.
pub fn preemption(facts: &Facts) -> Finding {
    let item = "preemption model";
    let build = facts.build.as_deref().unwrap_or_default();
    let has = |word: &str| build.split_whitespace().any(|part| part == word);
    let remedy = "install a PREEMPT_RT kernel; failing that, boot with preempt=full";
    if facts.realtime || has("PREEMPT_RT") {
        ok(item, "PREEMPT_RT")
    } else if has("PREEMPT_DYNAMIC") {
        warn(item, "PREEMPT_DYNAMIC: chosen at boot, not a real-time kernel", remedy)
    } else if has("PREEMPT") {
        warn(item, "PREEMPT: not a real-time kernel", remedy)
    } else {
        warn(item, "none or voluntary: a system call of any process can delay a tick by milliseconds", remedy)
    }
}

/// The finding on the real-time priority `wanted`.
pub fn priority(facts: &Facts, wanted: u8) -> Finding {
    let item = "real-time priority";
    match facts.priority {
        Some(most) if most >= u64::from(wanted) => {
            ok(item, format!("the limit is {most}, Freeplay asks for {wanted}"))
        }
        found => {
            let found = match found {
                None => "unknown".to_owned(),
                Some(0) => "refused".to_owned(),
                Some(most) => format!("the limit is {most}, Freeplay asks for {wanted}"),
            };
            let remedy =
                "add \"@realtime - rtprio 95\" to /etc/security/limits.conf, or run with CAP_SYS_NICE";
            fail(Use::Tails, item, found, remedy)
        }
    }
}

/// The finding on locking memory.
pub fn memory(facts: &Facts) -> Finding {
    let item = "locking memory";
    if facts.may_lock == Some(true) {
        return ok(item, "allowed");
    }
    let remedy =
        "add \"@realtime - memlock unlimited\" to /etc/security/limits.conf, or run with CAP_IPC_LOCK";
    warn(item, "refused: a page fault can delay a tick", remedy)
}

/// The finding on the CPU time that real-time threads leave to others.
pub fn budget(facts: &Facts) -> Finding {
    let item = "real-time budget";
    match facts.realtime_share {
        None => ok(item, "not limited"),
        Some(share) if share > 0.5 => {
            ok(item, format!("{:.0} % of each second; the loop sleeps for most of it", share * 100.0))
        }
        Some(share) => fail(
            Use::Tails,
            item,
            format!("{:.0} % of each second", share * 100.0),
            "sysctl kernel.sched_rt_runtime_us=950000",
        ),
    }
}

/// The finding on the number of cores.
pub fn cores(facts: &Facts) -> Finding {
    let item = "cores";
    let Some(cores) = facts.cores else {
        return warn(item, "unknown", "mount /proc");
    };
    match facts.quota {
        Some(quota) => fail(
            Use::Tails,
            item,
            format!(
                "{cores}, but the control group stops the process after {quota:.2} cores of processor time"
            ),
            "lift the CPU quota of the container (no --cpus; cpu.max = max)",
        ),
        None if cores < 2 => fail(
            Use::Medians,
            item,
            "1: plant and controller share it",
            "give this process two cores or more",
        ),
        None if cores < 4 => warn(
            item,
            format!("{cores}: one for the plant, one for the controller, none for the rest"),
            "use four cores or more, or stop everything else",
        ),
        None => ok(item, cores.to_string()),
    }
}

/// The finding on the load of the machine.
pub fn load(facts: &Facts) -> Finding {
    let item = "load";
    match (facts.load, facts.cores) {
        (Some(load), Some(cores)) if load > 0.5 * cores as f64 => fail(
            Use::Medians,
            item,
            format!("{load:.1} processes are ready to run on {cores} cores"),
            "wait until nothing else runs; other processes distort figures taken now",
        ),
        (Some(load), _) => ok(item, format!("{load:.1} processes are ready to run")),
        _ => ok(item, "unknown"),
    }
}

/// The finding on the clock frequency of the cores.
pub fn governor(facts: &Facts) -> Finding {
    let item = "frequency governor";
    let others: Vec<&str> =
        facts.governors.iter().map(String::as_str).filter(|name| *name != "performance").collect();
    if facts.governors.is_empty() {
        ok(item, "not visible: the firmware or the host sets the frequency")
    } else if others.is_empty() {
        ok(item, "performance")
    } else {
        warn(item, others.join(", "), "cpupower frequency-set --governor performance")
    }
}

/// The finding on isolated cores.
pub fn isolation(facts: &Facts) -> Finding {
    let item = "isolated cores";
    match (&facts.isolated, &facts.tickless) {
        (Some(isolated), Some(tickless)) => ok(item, format!("isolcpus {isolated}, nohz_full {tickless}")),
        (Some(isolated), None) => warn(
            item,
            format!("isolcpus {isolated}, but they still have a periodic interrupt"),
            format!("boot with nohz_full={isolated}, too"),
        ),
        (None, _) => warn(
            item,
            "none: other processes run on the cores of the loop",
            "on a machine with spare cores, boot with isolcpus=2,3 nohz_full=2,3 and set realtime.plant_cpu, realtime.controller_cpu",
        ),
    }
}

/// The finding on free space in tmpfs.
pub fn shared_memory(around: &SystemState) -> Finding {
    let item = "shared memory";
    let path = around.shared_memory.display();
    let Some(free) = around.free else {
        return fail(
            Use::Lockstep,
            item,
            format!("{path} cannot be used"),
            "mount a tmpfs there, or name another folder in FREEPLAY_SHM",
        );
    };
    let found = format!("{path}, {:.1} MiB free", free as f64 / f64::from(1 << 20));
    let remedy = format!("free some of it, or mount -o remount,size=256M {path}");
    if free < ROOM[0] {
        fail(Use::Lockstep, item, found, remedy)
    } else if free < ROOM[1] {
        warn(item, found, remedy)
    } else if !around.is_tmpfs {
        warn(item, format!("{found}, on a disk"), "name a folder on a tmpfs in FREEPLAY_SHM")
    } else {
        ok(item, found)
    }
}
