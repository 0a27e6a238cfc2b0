//! Whose answers lockstep waits for.
//!
//! Who lets the patience of lockstep pass once is away. The only controller of a run is not waited for again; of several, one
//! that is away is waited for again after a while, which doubles each time in vain. Meanwhile its answers do not count, so that
//! what the plant does depends on ticks and not on how fast who is.

/// Ticks for which a controller that let the patience pass is not waited for, the first time.
const FIRST_ABSENCE: u64 = 50;

#[derive(Clone, Copy, Debug)]
struct Seat {
    /// The first tick at which it is waited for.
    back: u64,
    /// Length of its next absence, ticks.
    absence: u64,
}

const PRESENT: Seat = Seat { back: 0, absence: FIRST_ABSENCE };

/// Who is away until when.
#[derive(Clone, Debug)]
pub struct ResponseTimeouts {
    seats: Vec<Seat>,
}

impl ResponseTimeouts {
    /// All of `slots` slots are present.
    pub fn new(slots: usize) -> Self {
        Self { seats: vec![PRESENT; slots.max(1)] }
    }

    /// Whether `slot` is not waited for at `tick`.
    pub fn is_away(&self, slot: usize, tick: u64) -> bool {
        tick < self.seats[slot].back
    }

    /// The controller of `slot` has ended.
    pub fn left(&mut self, slot: usize) {
        self.seats[slot].back = u64::MAX;
    }

    /// Another process has taken `slot`.
    pub fn renew(&mut self, slot: usize) {
        self.seats[slot] = PRESENT;
    }

    /// At the end of `tick`, whether the answer of `slot` `came`; one of `several`, it is given another chance.
    pub fn note(&mut self, slot: usize, tick: u64, came: bool, several: bool) {
        if came {
            self.seats[slot] = PRESENT;
        } else if !self.is_away(slot, tick) {
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
            if !timeouts.is_away(1, tick) {
                waits.push(tick);
            }
            timeouts.note(1, tick, false, true);
            assert!(!timeouts.is_away(0, tick));
        }
        assert_eq!(waits, [100, 150, 250, 450, 850]);
        timeouts.note(1, 1650, true, true);
        assert!(!timeouts.is_away(1, 1651));
    }

    #[test]
    fn the_only_controller_and_one_that_ended_are_not_waited_for_again() {
        let mut timeouts = ResponseTimeouts::new(1);
        timeouts.note(0, 7, false, false);
        assert!(!timeouts.is_away(0, u64::MAX) && timeouts.is_away(0, u64::MAX - 1));
        timeouts.renew(0);
        timeouts.left(0);
        assert!(timeouts.is_away(0, 1_000_000));
    }
}
