//! What the facts of a machine mean for a run: one line an item, what to change in one line, and what the machine is fit for.

use serde::Serialize;

use crate::doctor::facts::Facts;
use crate::doctor::probe::{Around, Probe};

/// How good a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// As it should be.
    Ok,
    /// It costs something.
    Warn,
    /// It makes the machine unfit for what [`Finding::spoils`] says.
    Fail,
}

impl Level {
    /// The word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Fail => "fail",
        }
    }
}

/// What a machine can be fit for; each asks for all that those before it ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Use {
    /// Runs at all, in lockstep.
    Lockstep,
    /// Medians of latencies in real time.
    Medians,
    /// Tails of latencies in real time: what is rare is then the program's, not the machine's.
    Tails,
}

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub item: &'static str,
    /// How good it is.
    pub level: Level,
    /// What was found.
    pub found: String,
    /// What to change, if anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
    /// The least demanding use that a failure spoils.
    pub spoils: Use,
}

/// What the machine is fit for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Runs in lockstep.
    pub lockstep: bool,
    /// Medians in real time.
    pub medians: bool,
    /// Tails in real time.
    pub tails: bool,
    /// The same in words.
    pub words: String,
}

impl Verdict {
    /// From all findings.
    pub fn of(findings: &[Finding]) -> Self {
        let fails = |up_to: Use| {
            findings.iter().any(|finding| finding.level == Level::Fail && finding.spoils <= up_to)
        };
        let [lockstep, medians, tails] =
            [Use::Lockstep, Use::Medians, Use::Tails].map(|wanted| !fails(wanted));
        let words = match (lockstep, medians, tails) {
            (false, ..) => "not fit for any run",
            (_, false, _) => "fit for lockstep; not for timing",
            (.., false) => "fit for lockstep and for medians; not for tails",
            _ => "fit for lockstep, medians and tails",
        };
        Self { lockstep, medians, tails, words: words.to_owned() }
    }
}

/// A share of stolen time from which tails are the host's: a millisecond in a second.
const STOLEN_FAIL: f64 = 1e-3;
/// A share from which it shows.
const STOLEN_WARN: f64 = 1e-5;
/// Room in shared memory that a run needs with all of its slots, and with a wide margin, bytes.
const ROOM: [u64; 2] = [8 << 20, 64 << 20];
/// Coarsest timer that can keep a tick of a millisecond, ns.
const COARSEST: u64 = 10_000;
/// Wake-up p50 from which idle states are worth a change, ns.
const SLOW_WAKE_UP: u64 = 20_000;
/// Wake-up p99 with which the run's own wait (sleep, then spin the last 200 µs) no longer hides the sleep, ns.
const HIDDEN: u64 = 200_000;

fn ok(item: &'static str, found: impl Into<String>) -> Finding {
    Finding { item, level: Level::Ok, found: found.into(), remedy: None, spoils: Use::Tails }
}

fn warn(item: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
    Finding { level: Level::Warn, remedy: Some(remedy.into()), ..ok(item, found) }
}

fn fail(spoils: Use, item: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Finding {
    Finding { level: Level::Fail, spoils, ..warn(item, found, remedy) }
}

/// All findings on a machine with these `facts` for runs at real-time priority `wanted`; `probe` where its clock was tried out.
pub fn judge(facts: &Facts, around: &Around, probe: Option<&Probe>, wanted: u8) -> Vec<Finding> {
    let mut found = vec![
        kernel(facts),
        preemption(facts),
        priority(facts, wanted),
        memory(facts),
        budget(facts),
        cores(facts),
        load(facts),
        governor(facts),
        isolation(facts),
        shared_memory(around),
        timer(around),
        clock_source(facts),
        idle(facts, around, probe),
        stolen(facts, probe),
    ];
    found.extend(probe.map(wake_up));
    found
}

fn kernel(facts: &Facts) -> Finding {
    let kind = if facts.is_virtual { ", on a virtual machine" } else { "" };
    ok("kernel", format!("Linux {}{kind}", facts.kernel.as_deref().unwrap_or("of unknown release")))
}

fn preemption(facts: &Facts) -> Finding {
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
        warn(item, "none or voluntary: a system call of anybody can delay a tick by milliseconds", remedy)
    }
}

fn priority(facts: &Facts, wanted: u8) -> Finding {
    let item = "real-time priority";
    match facts.priority {
        Some(most) if most >= u64::from(wanted) => {
            ok(item, format!("allowed up to {most}, {wanted} is asked for"))
        }
        found => {
            let found = match found {
                None => "unknown".to_owned(),
                Some(0) => "refused".to_owned(),
                Some(most) => format!("allowed up to {most}, {wanted} is asked for"),
            };
            let remedy =
                "add \"@realtime - rtprio 95\" to /etc/security/limits.conf, or run with CAP_SYS_NICE";
            fail(Use::Tails, item, found, remedy)
        }
    }
}

fn memory(facts: &Facts) -> Finding {
    let item = "locking memory";
    if facts.may_lock == Some(true) {
        return ok(item, "allowed");
    }
    let remedy =
        "add \"@realtime - memlock unlimited\" to /etc/security/limits.conf, or run with CAP_IPC_LOCK";
    warn(item, "refused: a page that is not there costs a tick its time", remedy)
}

fn budget(facts: &Facts) -> Finding {
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

fn cores(facts: &Facts) -> Finding {
    let item = "cores";
    let Some(cores) = facts.cores else {
        return warn(item, "unknown", "mount /proc");
    };
    match facts.quota {
        Some(quota) => fail(
            Use::Tails,
            item,
            format!(
                "{cores}, but its control group allows {quota:.2} cores' worth of time and then stops it"
            ),
            "lift the CPU quota of the container (no --cpus; cpu.max = max)",
        ),
        None if cores < 2 => fail(
            Use::Medians,
            item,
            "1: plant and controller take turns on it",
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

fn load(facts: &Facts) -> Finding {
    let item = "load";
    match (facts.load, facts.cores) {
        (Some(load), Some(cores)) if load > 0.5 * cores as f64 => fail(
            Use::Medians,
            item,
            format!("{load:.1} processes want to run on {cores} cores"),
            "wait until nothing else runs; figures taken now are the others'",
        ),
        (Some(load), _) => ok(item, format!("{load:.1} processes want to run")),
        _ => ok(item, "unknown"),
    }
}

fn governor(facts: &Facts) -> Finding {
    let item = "frequency governor";
    let others: Vec<&str> =
        facts.governors.iter().map(String::as_str).filter(|name| *name != "performance").collect();
    if facts.governors.is_empty() {
        ok(item, "none to see: the firmware or the host sets the frequency")
    } else if others.is_empty() {
        ok(item, "performance")
    } else {
        warn(item, others.join(", "), "cpupower frequency-set --governor performance")
    }
}

fn isolation(facts: &Facts) -> Finding {
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
            "none: others run on the loop's cores",
            "with cores to spare: boot with isolcpus=2,3 nohz_full=2,3 and set realtime.plant_cpu, realtime.controller_cpu",
        ),
    }
}

fn shared_memory(around: &Around) -> Finding {
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

fn timer(around: &Around) -> Finding {
    let found = format!("{} ns", around.resolution);
    if around.resolution <= COARSEST {
        return ok("timer resolution", found);
    }
    let remedy = "boot without highres=off, with a kernel that has CONFIG_HIGH_RES_TIMERS";
    fail(Use::Medians, "timer resolution", found, remedy)
}

fn clock_source(facts: &Facts) -> Finding {
    let item = "clock source";
    match facts.clock_source.as_deref() {
        None => ok(item, "unknown"),
        Some(slow @ ("hpet" | "acpi_pm" | "jiffies" | "refined-jiffies" | "pit")) => fail(
            Use::Medians,
            item,
            format!("{slow}: reading the time costs a microsecond or more"),
            "boot with tsc=reliable, if the processor's clock is; see dmesg for why it was left",
        ),
        Some(name) => ok(item, name),
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

fn idle(facts: &Facts, around: &Around, probe: Option<&Probe>) -> Finding {
    let item = "idle states";
    let deepest =
        facts.deepest_idle.map_or(String::new(), |us| format!("; the deepest takes {us} µs to leave"));
    let keep =
        "hold /dev/cpu_dma_latency open with 0 in it while measuring (as root), or boot with idle=poll";
    let Some(probe) = probe else {
        return match facts.deepest_idle {
            Some(latency) if latency * 1000 > SLOW_WAKE_UP => {
                warn(item, format!("the deepest takes {latency} µs to leave"), keep)
            }
            _ => ok(item, format!("not measured{deepest}")),
        };
    };
    let plain = us(probe.asleep.p50);
    let held = match probe.asleep_held {
        Some(held) => format!("; with /dev/cpu_dma_latency held at 0: {:.0} µs", us(held.p50)),
        None if around.may_hold => String::new(),
        None => {
            "; what holding /dev/cpu_dma_latency at 0 brings cannot be tried: it cannot be opened".to_owned()
        }
    };
    let found = format!("waking an idle core costs {plain:.0} µs (p50){held}{deepest}");
    let helps = probe.asleep_held.is_none_or(|held| 2 * held.p50 < probe.asleep.p50);
    if probe.asleep.p50 > SLOW_WAKE_UP && helps { warn(item, found, keep) } else { ok(item, found) }
}

fn stolen(facts: &Facts, probe: Option<&Probe>) -> Finding {
    let item = "time stolen by the hypervisor";
    let Some(time) = facts.cpu_time else { return ok(item, "unknown") };
    let since_start = time.stolen as f64 / time.total.max(1) as f64;
    let (now, share) = match probe {
        Some(probe) => (
            format!("{} clock ticks in the {:.1} s of this look, ", probe.stolen, probe.seconds),
            since_start.max(probe.stolen as f64 / probe.clock_ticks.max(1) as f64),
        ),
        None => (String::new(), since_start),
    };
    let found = format!("{now}{:.4} % since the machine was started", since_start * 100.0);
    let remedy = "ask for dedicated cores, or measure on a machine of your own";
    if share >= STOLEN_FAIL {
        fail(Use::Tails, item, format!("{found}: tails above a millisecond will not be yours"), remedy)
    } else if share >= STOLEN_WARN {
        warn(item, found, remedy)
    } else {
        ok(item, found)
    }
}

fn wake_up(probe: &Probe) -> Finding {
    let found = format!(
        "at 1 kHz under {}: p50 {:.2}, p99 {:.1}, max {:.0} µs late (asleep all the time: {:.0}, {:.0}, {:.0} µs); reading the clock {} ns",
        probe.scheduler,
        us(probe.spun.p50),
        us(probe.spun.p99),
        us(probe.spun.max),
        us(probe.asleep.p50),
        us(probe.asleep.p99),
        us(probe.asleep.max),
        probe.clock_cost,
    );
    let remedy = "look at the lines above: load, priority, isolation, time stolen";
    if probe.spun.p99 > HIDDEN {
        fail(Use::Tails, "wake-up", found, remedy)
    } else if probe.asleep.p99 > HIDDEN {
        warn("wake-up", found, remedy)
    } else {
        ok("wake-up", found)
    }
}

#[cfg(test)]
mod tests {
    use super::{Level, Use, Verdict, judge};
    use crate::doctor::facts::{CpuTime, Facts};
    use crate::doctor::probe::{Around, Lateness, Probe};

    fn good() -> (Facts, Around) {
        let facts = Facts {
            kernel: Some("6.12".to_owned()),
            build: Some("#1 SMP PREEMPT_RT".to_owned()),
            priority: Some(99),
            may_lock: Some(true),
            governors: vec!["performance".to_owned()],
            isolated: Some("2-3".to_owned()),
            tickless: Some("2-3".to_owned()),
            clock_source: Some("tsc".to_owned()),
            cores: Some(4),
            load: Some(0.1),
            cpu_time: Some(CpuTime { stolen: 0, total: 1000 }),
            ..Facts::default()
        };
        let around = Around {
            shared_memory: "/dev/shm".into(),
            is_tmpfs: true,
            free: Some(1 << 30),
            resolution: 1,
            may_hold: true,
        };
        (facts, around)
    }

    type Spoil = fn(&mut Facts, &mut Around);

    #[test]
    fn each_fault_is_one_line_that_says_what_to_change_and_what_it_spoils() {
        let (facts, around) = good();
        assert!(judge(&facts, &around, None, 80).iter().all(|finding| finding.level == Level::Ok));
        let cases: [(&str, Option<Use>, Spoil); 17] = [
            ("preemption model", None, |f, _| f.build = Some("#1 SMP PREEMPT_DYNAMIC".to_owned())),
            ("preemption model", None, |f, _| f.build = Some("#1 SMP".to_owned())),
            ("real-time priority", Some(Use::Tails), |f, _| f.priority = Some(0)),
            ("real-time priority", Some(Use::Tails), |f, _| f.priority = Some(79)),
            ("locking memory", None, |f, _| f.may_lock = Some(false)),
            ("real-time budget", Some(Use::Tails), |f, _| f.realtime_share = Some(0.0)),
            ("cores", Some(Use::Medians), |f, _| f.cores = Some(1)),
            ("cores", None, |f, _| f.cores = Some(2)),
            ("cores", Some(Use::Tails), |f, _| f.quota = Some(1.5)),
            ("load", Some(Use::Medians), |f, _| f.load = Some(7.0)),
            ("frequency governor", None, |f, _| f.governors.push("powersave".to_owned())),
            ("isolated cores", None, |f, _| f.isolated = None),
            ("shared memory", Some(Use::Lockstep), |_, a| a.free = Some(4096)),
            ("shared memory", None, |_, a| a.is_tmpfs = false),
            ("timer resolution", Some(Use::Medians), |_, a| a.resolution = 4_000_000),
            ("clock source", Some(Use::Medians), |f, _| f.clock_source = Some("hpet".to_owned())),
            ("time stolen by the hypervisor", Some(Use::Tails), |f, _| {
                f.cpu_time = Some(CpuTime { stolen: 2, total: 1000 });
            }),
        ];
        for (item, spoils, change) in cases {
            let (mut facts, mut around) = good();
            change(&mut facts, &mut around);
            let findings = judge(&facts, &around, None, 80);
            let bad: Vec<_> = findings.iter().filter(|finding| finding.level != Level::Ok).collect();
            assert_eq!((bad.len(), bad[0].item), (1, item));
            assert!(bad[0].remedy.as_ref().is_some_and(|remedy| !remedy.contains('\n')), "{item}");
            let expected = if spoils.is_some() { Level::Fail } else { Level::Warn };
            assert_eq!(bad[0].level, expected, "{item}");
            let verdict = Verdict::of(&findings);
            let held = [verdict.lockstep, verdict.medians, verdict.tails];
            let least = spoils.map_or(3, |spoils| spoils as usize);
            assert_eq!(held, [least > 0, least > 1, least > 2], "{item}: {}", verdict.words);
        }
    }

    #[test]
    fn what_was_measured_counts() {
        let (facts, around) = good();
        let late = |p50, p99| Lateness { p50, p99, max: 10 * p99 };
        let probe = Probe {
            scheduler: "SCHED_FIFO".to_owned(),
            seconds: 3.0,
            clock_cost: 30,
            asleep: late(41_000, 94_000),
            asleep_held: Some(late(4_600, 16_000)),
            spun: late(50, 140),
            stolen: 0,
            clock_ticks: 1200,
        };
        let levels = |probe: &Probe| {
            let findings = judge(&facts, &around, Some(probe), 80);
            let of = |item| findings.iter().find(|finding| finding.item == item).map(|finding| finding.level);
            ["idle states", "time stolen by the hypervisor", "wake-up"].map(|item| of(item).expect("a line"))
        };
        assert_eq!(levels(&probe), [Level::Warn, Level::Ok, Level::Ok]);
        let held_alike = Probe { asleep_held: Some(late(40_000, 90_000)), stolen: 3, ..probe.clone() };
        assert_eq!(levels(&held_alike), [Level::Ok, Level::Fail, Level::Ok], "nothing would change");
        let late_at_all = Probe { spun: late(300, 400_000), ..probe };
        assert_eq!(levels(&late_at_all)[2], Level::Fail);
    }
}
