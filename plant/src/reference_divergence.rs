//! The differences between fault-free controllers, tick by tick, from a fault-free run of the same motion.
//!
//! Two fault-free controllers differ where one corrects an error that the other does not model. On a straight stretch the difference is
//! nearly zero, around a corner a fifth of a joint's range for a few ticks, with both signs. A single tolerance for the whole motion
//! therefore either raises a false alarm at each corner or misses faults between them. The course of the difference is repeatable: it
//! depends on the motion, not on the active controller.

use freeplay_shm::Joints;

/// Ticks before and after one within which the differences of the fault-free run count, for small shifts in time.
const REACH: usize = 2;

/// The differences of a fault-free run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceDivergence {
    courses: Vec<Vec<Joints>>,
}

impl ReferenceDivergence {
    /// From the `courses` of the slots from 1 on: for each tick the answer of that slot's controller minus that of slot 0, N·m or rad; NaN
    /// if one of them did not answer.
    #[must_use]
    pub fn new(courses: Vec<Vec<Joints>>) -> Self {
        Self { courses }
    }

    /// Number of controllers in the fault-free run.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.courses.len() + 1
    }

    /// Least and greatest difference of `joint` from the controller of slot `one` to that of slot `other` around `tick`; `None` if the
    /// fault-free run has no data there.
    pub(crate) fn span(&self, tick: u64, [one, other]: [usize; 2], joint: usize) -> Option<[f64; 2]> {
        let tick = usize::try_from(tick).ok()?;
        let around = tick.saturating_sub(REACH)..=tick.saturating_add(REACH);
        let differences = around.filter_map(|at| Some(self.at(at, one, joint)? - self.at(at, other, joint)?));
        let known = differences.filter(|difference| difference.is_finite());
        known.fold(None, |span, at| {
            let [least, most] = span.unwrap_or([at; 2]);
            Some([at.min(least), at.max(most)])
        })
    }

    /// Answer of the controller of `slot` at `tick` minus that of slot 0.
    fn at(&self, tick: usize, slot: usize, joint: usize) -> Option<f64> {
        match slot.checked_sub(1) {
            None => Some(0.0),
            Some(course) => Some(self.courses.get(course)?.get(tick)?[joint]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ReferenceDivergence;
    use freeplay_shm::MAX_JOINTS;

    #[test]
    fn a_span_is_that_of_the_ticks_around_and_turns_its_sign_with_the_slots() {
        let course = |value: &dyn Fn(usize) -> f64| (0..20).map(|tick| [value(tick); MAX_JOINTS]).collect();
        let falling = |tick| if tick == 9 { f64::NAN } else { -(tick as f64) };
        let divergence = ReferenceDivergence::new(vec![course(&|tick| 10.0 * tick as f64), course(&falling)]);
        assert_eq!(divergence.span(10, [1, 0], 0), Some([80.0, 120.0]));
        assert_eq!(divergence.span(10, [0, 1], 0), Some([-120.0, -80.0]));
        assert_eq!(divergence.span(10, [2, 0], 3), Some([-12.0, -8.0]));
        assert_eq!(divergence.span(10, [1, 2], 3), Some([88.0, 132.0]));
        assert_eq!(divergence.span(0, [1, 0], 0), Some([0.0, 20.0]));
        assert_eq!(divergence.span(40, [1, 0], 0), None, "the sound run has ended");
        assert_eq!(divergence.span(10, [3, 0], 0), None, "it had no such controller");
    }
}
