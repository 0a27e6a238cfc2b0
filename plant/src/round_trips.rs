//! Every tick's round trip, including ticks without an answer.
//!
//! A controller that was not running answers the newest state and skips the ones before. If only answers counted, a stall of twenty ticks
//! would be one long round trip among thousands of short ones (coordinated omission; Tene, "How NOT to measure latency", 2013). Here a tick
//! without an answer of its own waits, by the schedule, for the first answer to a later tick.

use freeplay_shm::Schedule;

/// The ticks that have had their answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoundTrips {
    schedule: Schedule,
    /// The first tick without an answer.
    next: u64,
}

impl RoundTrips {
    /// Round trips from the tick `first` of `schedule` on.
    pub(crate) fn new(schedule: Schedule, first: u64) -> Self {
        Self { schedule, next: first }
    }

    /// Records an answer to `tick` at `received`: passes its round trip, and those of all earlier ticks without an answer, to `record`, ns.
    pub(crate) fn answered(&mut self, tick: u64, received: u64, mut record: impl FnMut(u64)) {
        for waiting in self.next..=tick {
            record(self.schedule.late_ns(waiting, received));
        }
        self.next = self.next.max(tick + 1);
    }

    /// Completes the run: the ticks before `played` without an answer by `now` will have none. Passes the waiting time of each to `record`,
    /// ns.
    pub(crate) fn finish(&mut self, played: u64, now: u64, record: impl FnMut(u64)) {
        if let Some(last) = played.checked_sub(1) {
            self.answered(last, now, record);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::RoundTrips;
    use freeplay_shm::Schedule;

    #[test]
    fn a_stall_counts_for_every_tick_that_it_delays() {
        let mut trips = RoundTrips::new(Schedule { start_ns: 1000, period_ns: 100 }, 1);
        let mut seen = Vec::new();
        // Answers to the ticks 1 and 2 in time, none to 3, 4 and 5, a late one to 6 and then an even later one to 4, none to 7.
        for (tick, received) in [(1, 1130), (2, 1240), (6, 1750), (4, 1760)] {
            trips.answered(tick, received, |ns| seen.push(ns));
        }
        trips.finish(8, 1900, |ns| seen.push(ns));
        assert_eq!(seen, [30, 40, 450, 350, 250, 150, 200]);
    }
}
