//! Consequences of the clocks, the idle states and the host of a machine for a run.

use crate::facts::Facts;
use crate::findings::{Finding, Use, fail, ok, warn};
use crate::probe::{Probe, SystemState};

/// Share of stolen time from which the host determines the tails: a millisecond in a second.
const STOLEN_FAIL: f64 = 1e-3;
/// Share of stolen time from which it is noticeable.
const STOLEN_WARN: f64 = 1e-5;
/// Coarsest timer resolution for a tick of a millisecond, ns.
const COARSEST: u64 = 10_000;
/// Wake-up p50 from which a change of the idle states is worthwhile, ns.
const SLOW_WAKE_UP: u64 = 20_000;
/// Wake-up p99 with which the run's own wait (sleep, then spin the last 200 µs) no longer hides the sleep, ns.
const WAKE_UP_LIMIT: u64 = 200_000;

/// The finding on the resolution of the timer.
pub fn timer(around: &SystemState) -> Finding {
    let found = format!("{} ns", around.resolution);
    if around.resolution <= COARSEST {
        return ok("timer resolution", found);
    }
    let remedy = "boot without highres=off, with a kernel that has CONFIG_HIGH_RES_TIMERS";
    fail(Use::Medians, "timer resolution", found, remedy)
}

/// The finding on the clock source.
pub fn clock_source(facts: &Facts) -> Finding {
    let item = "clock source";
    match facts.clock_source.as_deref() {
        None => ok(item, "unknown"),
        Some(slow @ ("hpet" | "acpi_pm" | "jiffies" | "refined-jiffies" | "pit")) => fail(
            Use::Medians,
            item,
            format!("{slow}: reading the time takes a microsecond or more"),
            "boot with tsc=reliable if the processor's clock is reliable; dmesg says why the kernel rejected it",
        ),
        Some(name) => ok(item, name),
    }
}

/// The finding on the wake-up cost of an idle core.
pub fn idle(facts: &Facts, around: &SystemState, probe: Option<&Probe>) -> Finding {
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
        None => "; the effect of /dev/cpu_dma_latency held at 0 is unknown, because this user cannot open it"
            .to_owned(),
    };
    let found = format!("waking an idle core takes {plain:.0} µs (p50){held}{deepest}");
    let helps = probe.asleep_held.is_none_or(|held| 2 * held.p50 < probe.asleep.p50);
    if probe.asleep.p50 > SLOW_WAKE_UP && helps { warn(item, found, keep) } else { ok(item, found) }
}

/// The finding on time stolen by the hypervisor.
pub fn stolen(facts: &Facts, probe: Option<&Probe>) -> Finding {
    let item = "time stolen by the hypervisor";
    let Some(time) = facts.cpu_time else { return ok(item, "unknown") };
    let since_start = time.stolen as f64 / time.total.max(1) as f64;
    let (now, share) = match probe {
        Some(probe) => (
            format!("{} clock ticks during the {:.1} s of this check, ", probe.stolen, probe.seconds),
            since_start.max(probe.stolen as f64 / probe.clock_ticks.max(1) as f64),
        ),
        None => (String::new(), since_start),
    };
    let found = format!("{now}{:.4} % since the machine was started", since_start * 100.0);
    let remedy = "ask for dedicated cores, or measure on a machine of your own";
    if share >= STOLEN_FAIL {
        fail(
            Use::Tails,
            item,
            format!("{found}: latencies above a millisecond may come from the hypervisor"),
            remedy,
        )
    } else if share >= STOLEN_WARN {
        warn(item, found, remedy)
    } else {
        ok(item, found)
    }
}

/// The finding on the lateness of the loop's wake-up.
pub fn wake_up(probe: &Probe) -> Finding {
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
    let remedy = "see the lines above: load, priority, isolation, stolen time";
    if probe.spun.p99 > WAKE_UP_LIMIT {
        fail(Use::Tails, "wake-up", found, remedy)
    } else if probe.asleep.p99 > WAKE_UP_LIMIT {
        warn("wake-up", found, remedy)
    } else {
        ok("wake-up", found)
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}
