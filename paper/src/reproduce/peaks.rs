//! Peaks of a force, and the states of contact of a journal over time.

use freeplay_plant::IMPACT_LIMIT;
use serde::Serialize;

use crate::simulation::TICK;

/// Threshold of a peak under gravity, N: twice the 23 N with which a resting journal presses at most on the smooth path.
const UNDER_GRAVITY: f64 = 50.0;
/// Threshold of a peak without gravity, N: a resting journal presses with less than 3 N.
const WEIGHTLESS: f64 = 20.0;
/// A peak is the maximum within this number of ticks on both sides: the longest impact lasts 2 ms.
const REACH: usize = 2;

/// A peak of the normal force.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Time, s.
    pub time: f64,
    /// Height, N.
    pub force: f64,
}

/// Threshold of a peak, N.
pub fn threshold(gravity: bool) -> f64 {
    if gravity { UNDER_GRAVITY } else { WEIGHTLESS }
}

/// The peaks of `force`, one value a tick, above `threshold`: the greatest within [`REACH`] ticks, the first of equals.
pub fn peaks(force: &[f64], threshold: f64) -> Vec<Peak> {
    let stands_out = |tick: usize| {
        let before = &force[tick.saturating_sub(REACH)..tick];
        let after = &force[tick + 1..(tick + 1 + REACH).min(force.len())];
        before.iter().all(|other| *other < force[tick]) && after.iter().all(|other| *other <= force[tick])
    };
    (0..force.len())
        .filter(|&tick| force[tick] > threshold && stands_out(tick))
        .map(|tick| Peak { time: tick as f64 * TICK, force: force[tick] })
        .collect()
}

/// State of contact of a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactMode {
    /// Without contact.
    Free,
    /// In a contact shorter than [`IMPACT_LIMIT`].
    Impact,
    /// In a longer one.
    Continuous,
}

impl ContactMode {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Free, Self::Impact, Self::Continuous];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free flight",
            Self::Impact => "impact",
            Self::Continuous => "continuous contact",
        }
    }
}

/// The mode at every instant, from the duration of the contact up to then, s (zero in free flight). A contact that continues beyond the end counts with its
/// duration so far.
pub fn contact_modes(episode: &[f64]) -> Vec<ContactMode> {
    let mut modes = Vec::with_capacity(episode.len());
    let is_same = |pair: &f64, next: &f64| (*pair > 0.0) == (*next > 0.0) && next >= pair;
    for contact in episode.chunk_by(is_same) {
        let lasted = contact.last().copied().unwrap_or(0.0);
        let mode = if lasted <= 0.0 {
            ContactMode::Free
        } else if lasted < IMPACT_LIMIT {
            ContactMode::Impact
        } else {
            ContactMode::Continuous
        };
        modes.extend(contact.iter().map(|_| mode));
    }
    modes
}

#[cfg(test)]
mod tests {
    use super::{ContactMode, contact_modes, peaks};

    #[test]
    fn a_peak_is_counted_once_and_a_plateau_at_its_beginning() {
        let mut force = vec![20.0; 40];
        force[5..8].copy_from_slice(&[60.0, 90.0, 55.0]);
        force[20..23].copy_from_slice(&[70.0, 70.0, 70.0]);
        force[30] = 49.0;
        let found: Vec<(f64, f64)> = peaks(&force, 50.0).iter().map(|p| (p.time, p.force)).collect();
        assert_eq!(found, [(0.006, 90.0), (0.020, 70.0)]);
        assert!(peaks(&[], 50.0).is_empty());
    }

    #[test]
    fn a_contact_is_judged_by_how_long_it_lasted() {
        use ContactMode::{Continuous, Free, Impact};
        let episode = [0.0, 0.0, 2e-4, 4e-4, 0.0, 1e-3, 2e-3, 3e-3, 1e-4, 0.0];
        let expected = [Free, Free, Impact, Impact, Free, Continuous, Continuous, Continuous, Impact, Free];
        assert_eq!(contact_modes(&episode), expected);
    }
}
