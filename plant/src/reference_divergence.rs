//! By how much sound controllers differ, tick by tick: what a sound run of the same motion showed.
//!
//! Two sound controllers differ by what one corrects and the other does not see. On a straight stretch that is next to nothing, around a
//! corner a fifth of a joint's range for a few ticks, with both signs. One tolerance for the whole motion is therefore either a false alarm at
//! each corner or blind between them. What repeats is the course of the difference: it belongs to the motion, not to who is in charge.

use freeplay_shm::Joints;

/// Ticks before and after one within which the sound run's differences count: what came a little earlier or later is as sound.
const REACH: usize = 2;

/// The differences of a sound run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceDivergence {
    courses: Vec<Vec<Joints>>,
}

impl ReferenceDivergence {
    /// From the `courses` of the slots from 1 on: for each tick what the controller of that slot said less what that of slot 0 said,
    /// N·m or rad; NaN where one of them said nothing.
    #[must_use]
    pub fn new(courses: Vec<Vec<Joints>>) -> Self {
        Self { courses }
    }

    /// Controllers of the sound run.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.courses.len() + 1
    }

    /// Least and greatest difference of `joint` from the controller of slot `one` to that of slot `other` around `tick`; `None` where the
    /// sound run tells nothing.
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

    /// What the controller of `slot` said at `tick` less what that of slot 0 said.
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
