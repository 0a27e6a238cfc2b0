//! The wall clock of a paced run, and the waiting strategy of lockstep.

use std::thread;
use std::time::Duration;

use rustix::io::Errno;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

use crate::cores::core_count;

const NS_PER_S: u64 = 1_000_000_000;

/// `CLOCK_MONOTONIC` in nanoseconds: the same clock in every process of the machine.
#[inline]
#[must_use]
pub fn now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * NS_PER_S + now.tv_nsec as u64
}

/// Arrival of a loop at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// Lateness of the loop against the schedule, ns, for any reason.
    pub late_ns: u64,
    /// True if the loop arrived before the tick was due and waited for it. If false, the loop is catching up.
    pub waited: bool,
}

/// Due times of the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Time of tick 0, `CLOCK_MONOTONIC`, ns.
    pub start_ns: u64,
    /// Time between two ticks, ns.
    pub period_ns: u64,
}

impl Schedule {
    /// Time at which `tick` is due, `CLOCK_MONOTONIC`, ns.
    #[inline]
    #[must_use]
    pub fn due_ns(&self, tick: u64) -> u64 {
        self.start_ns + tick * self.period_ns
    }

    /// Lateness of `now_ns` for `tick`, ns; 0 if it is early.
    #[inline]
    #[must_use]
    pub fn late_ns(&self, tick: u64, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.due_ns(tick))
    }

    /// Waits for `tick`: sleeps until `spin_ns` before it is due, and spins from then on. The function does not wait for a tick that
    /// is already due, so that a delayed loop catches up without a pause.
    #[inline]
    pub fn await_tick(&self, tick: u64, spin_ns: u64) -> Arrival {
        let due_ns = self.due_ns(tick);
        let waited = now_ns() < due_ns;
        Arrival { late_ns: sleep_then_spin_until(due_ns, spin_ns).saturating_sub(due_ns), waited }
    }

    /// The current tick at `now_ns`: the last one that is due; 0 before the start.
    #[inline]
    #[must_use]
    pub fn tick_at(&self, now_ns: u64) -> u64 {
        now_ns.saturating_sub(self.start_ns).checked_div(self.period_ns).unwrap_or(0)
    }
}

/// Sleeps until `spin_ns` before `deadline_ns` (`CLOCK_MONOTONIC`), then spins to the deadline. Returns the time at its end, ns.
///
/// The sleep leaves the core to others; the spin hides the wake-up latency of the system (40 to 130 µs are common). Under
/// `SCHED_FIFO`, never spin longer than needed, because Linux withholds 50 ms of each second from a thread that never sleeps.
#[inline]
pub fn sleep_then_spin_until(deadline_ns: u64, spin_ns: u64) -> u64 {
    let wake_ns = deadline_ns.saturating_sub(spin_ns);
    let wake = Timespec { tv_sec: (wake_ns / NS_PER_S) as i64, tv_nsec: (wake_ns % NS_PER_S) as _ };
    if now_ns() < wake_ns {
        while clock_nanosleep_absolute(ClockId::Monotonic, &wake) == Err(Errno::INTR) {}
    }
    loop {
        let now = now_ns();
        if now >= deadline_ns {
            return now;
        }
        std::hint::spin_loop();
    }
}

/// Waiting strategy of lockstep: it spins while an answer is likely to arrive at once, then yields to other threads, then sleeps.
#[derive(Clone, Copy, Debug)]
pub struct Backoff {
    spin_ns: u64,
    yield_ns: u64,
    looks: u32,
    since_ns: u64,
}

impl Backoff {
    /// Number of checks for the answer before the first reading of the clock, which takes as long as a check.
    const FIRST_LOOKS: u32 = 64;
    /// Length of one sleep.
    const SLEEP: Duration = Duration::from_micros(50);
    /// Time of spinning and yielding before the first sleep, ns.
    const YIELD_NS: u64 = 1_000_000;

    /// The strategy for this machine. With one core spinning is useless; with two, the peer's core may be busy with something else.
    #[must_use]
    pub fn for_this_machine() -> Self {
        let spin_ns = match core_count() {
            1 => 0,
            2 | 3 => 10_000,
            _ => 20_000,
        };
        Self { spin_ns, yield_ns: Self::YIELD_NS, looks: 0, since_ns: 0 }
    }

    /// Description of the strategy, for the results.
    #[must_use]
    pub fn name(&self) -> String {
        format!(
            "spin {} µs, yield to {} µs, then sleep {} µs at a time",
            self.spin_ns / 1000,
            self.yield_ns / 1000,
            Self::SLEEP.as_micros()
        )
    }

    /// Resets the waiting time; call it when the peer has answered.
    #[inline]
    pub fn reset(&mut self) {
        self.looks = 0;
    }

    /// Waits briefly; the longer the wait has lasted, the longer the next one. Returns the duration so far, ns, without the first
    /// microseconds.
    #[inline]
    pub fn wait(&mut self) -> u64 {
        if self.looks < Self::FIRST_LOOKS && self.spin_ns > 0 {
            self.looks += 1;
            std::hint::spin_loop();
            return 0;
        }
        self.wait_by_the_clock()
    }

    #[inline]
    fn wait_by_the_clock(&mut self) -> u64 {
        let now = now_ns();
        if self.looks <= Self::FIRST_LOOKS {
            self.looks = Self::FIRST_LOOKS + 1;
            self.since_ns = now;
        }
        let waited = now - self.since_ns;
        if waited < self.spin_ns {
            std::hint::spin_loop();
        } else if waited < self.yield_ns {
            thread::yield_now();
        } else {
            thread::sleep(Self::SLEEP);
        }
        waited
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_and_its_inverse_agree_around_every_tick() {
        let schedule = Schedule { start_ns: 1_000_000_007, period_ns: 1_000_003 };
        for tick in [0, 1, 2, 1000, 3_600_000] {
            let due = schedule.due_ns(tick);
            assert_eq!((schedule.tick_at(due), schedule.tick_at(due - 1)), (tick, tick.saturating_sub(1)));
            assert_eq!((schedule.late_ns(tick, due + 5), schedule.late_ns(tick, due - 5)), (5, 0));
        }
        assert_eq!(Schedule { start_ns: 0, period_ns: 0 }.tick_at(7), 0);
    }

    #[test]
    fn waiting_never_ends_early_and_mostly_on_time() {
        for (sleep_ns, spin_ns) in
            [(0, 0), (0, 100_000), (2_000_000, 0), (2_000_000, 200_000), (50_000, 1_000_000)]
        {
            let deadline = now_ns() + sleep_ns;
            let late_ns = sleep_then_spin_until(deadline, spin_ns) - deadline;
            println!("sleep {sleep_ns} ns, spin {spin_ns} ns: late by {late_ns} ns");
            assert!(now_ns() >= deadline && late_ns < 1_000_000_000);
        }
        assert!(sleep_then_spin_until(0, 0) > 0, "a deadline long past returns at once");
    }

    #[test]
    fn a_tick_that_is_due_already_is_not_waited_for() {
        let schedule = Schedule { start_ns: now_ns(), period_ns: 20_000_000 };
        let first = schedule.await_tick(0, 0);
        let second = schedule.await_tick(1, 200_000);
        std::thread::sleep(Duration::from_millis(60));
        let third = schedule.await_tick(2, 200_000);
        println!("{first:?}, {second:?}, {third:?}");
        assert!(!first.waited && second.waited && !third.waited);
        assert!(third.late_ns >= 40_000_000 && second.late_ns < 1_000_000_000);
    }

    #[test]
    fn backoff_spins_then_yields_then_sleeps_and_starts_anew() {
        let mut backoff = Backoff::for_this_machine();
        println!("{}", backoff.name());
        assert_eq!(backoff.wait(), 0);
        let mut waits = 0_u64;
        while backoff.wait() < Backoff::YIELD_NS {
            waits += 1;
        }
        let before = now_ns();
        backoff.wait();
        let slept_ns = now_ns() - before;
        println!("{waits} waits in the first ms, then {slept_ns} ns");
        assert!(slept_ns >= Backoff::SLEEP.as_nanos() as u64);
        backoff.reset();
        assert_eq!(backoff.wait(), 0);
    }
}
