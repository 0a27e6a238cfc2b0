//! The controllers whose answers lockstep awaits.
//!
//! A controller that exceeds the patience of lockstep once is absent. The plant never again waits for the only controller of a run. Of
//! several controllers, it waits for an absent one again after a while, which doubles after each failure. Meanwhile the answers of an
//! absent controller do not count, so that the run depends on ticks and not on the speed of processes.

/// Ticks without waiting after a controller has exceeded the patience for the first time.
const FIRST_ABSENCE: u64 = 50;

#[derive(Clone, Copy, Debug)]
struct Seat {
    /// The first tick at which the plant waits for it.
    back: u64,
    /// Length of its next absence, ticks.
    absence: u64,
}

const PRESENT: Seat = Seat { back: 0, absence: FIRST_ABSENCE };

/// The end of each controller's absence.
#[derive(Clone, Debug)]
pub struct ResponseTimeouts {
    seats: Vec<Seat>,
}

impl ResponseTimeouts {
    /// Timeouts for `slots` slots, all present.
    pub fn new(slots: usize) -> Self {
        Self { seats: vec![PRESENT; slots.max(1)] }
    }

    /// True if the plant does not wait for `slot` at `tick`.
    pub fn is_unresponsive(&self, slot: usize, tick: u64) -> bool {
        tick < self.seats[slot].back
    }

    /// Marks the controller of `slot` as ended.
    pub fn mark_ended(&mut self, slot: usize) {
        self.seats[slot].back = u64::MAX;
    }

    /// Marks `slot` as present: another process has taken it.
    pub fn renew(&mut self, slot: usize) {
        self.seats[slot] = PRESENT;
    }

    /// At the end of `tick`, records whether the answer of `slot` `came`; one of `several` controllers gets another chance.
    pub fn note(&mut self, slot: usize, tick: u64, came: bool, several: bool) {
        if came {
            self.seats[slot] = PRESENT;
        } else if !self.is_unresponsive(slot, tick) {
            let absence = self.seats[slot].absence;
            let back = if several { tick.saturating_add(absence) } else { u64::MAX };
            self.seats[slot] = Seat { back, absence: absence.saturating_mul(2) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ResponseTimeouts;

    #[test]
    fn who_is_away_is_waited_for_again_after_a_while_that_doubles() {
        let mut timeouts = ResponseTimeouts::new(2);
        let mut waits = Vec::new();
        for tick in 100..1000 {
            if !timeouts.is_unresponsive(1, tick) {
                waits.push(tick);
            }
            timeouts.note(1, tick, false, true);
            assert!(!timeouts.is_unresponsive(0, tick));
        }
        assert_eq!(waits, [100, 150, 250, 450, 850]);
        timeouts.note(1, 1650, true, true);
        assert!(!timeouts.is_unresponsive(1, 1651));
    }

    #[test]
    fn the_only_controller_and_one_that_ended_are_not_waited_for_again() {
        let mut timeouts = ResponseTimeouts::new(1);
        timeouts.note(0, 7, false, false);
        assert!(!timeouts.is_unresponsive(0, u64::MAX) && timeouts.is_unresponsive(0, u64::MAX - 1));
        timeouts.renew(0);
        timeouts.mark_ended(0);
        assert!(timeouts.is_unresponsive(0, 1_000_000));
    }
}
