//! Knocks: speed that the joints gain within a tick and that no torque explains. A journal has landed.
//!
//! While a journal flies, its link turns about its own middle and not about the bearing: the arm is lighter than the model by a factor
//! that is 4 for a slender link, and every gain of the feedback is that much higher. Damping that brings the encoders to rest within
//! 10 ms then throws the journal back, harder than the restitution takes away, and with play in two joints the bouncing never ends
//! (decisions/0018). So for some time after a knock the feedback is softer,
//! where more than one joint has play.

use crate::task::Gains;

/// Speed gained in a tick that is a knock, rad/s (m/s). With play in joints 3 and 5 bounces are ended with 0.05, 0.1 and 0.3 alike.
pub const KNOCK: f64 = 0.05;
/// Share of the natural frequency that is left of the feedback after a knock.
pub const SOFTEST: f64 = 0.5;
/// Time for which it is so, and time in which it comes back to the whole, s.
const HELD: f64 = 0.015;
/// See above.
const RECOVERY: f64 = 0.03;

/// How long ago the last knock was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knocks {
    period: f64,
    /// Time since the last, s; no longer than matters.
    calm: f64,
}

impl Knocks {
    /// None so far, in ticks of `period` seconds.
    pub fn new(period: f64) -> Knocks {
        Knocks { period, calm: HELD + RECOVERY }
    }

    /// Takes in the speeds `found` of the joints, where `expected` were to be if anything was expected.
    pub fn observe(&mut self, expected: Option<&[f64]>, found: &[f64]) {
        self.calm = (self.calm + self.period).min(HELD + RECOVERY);
        let knocked = |expected: &[f64]| {
            expected.iter().zip(found).any(|(expected, found)| (found - expected).abs() > KNOCK)
        };
        if expected.is_some_and(knocked) {
            self.calm = 0.0;
        }
    }

    /// What is left of `gains`.
    pub fn soften(&self, gains: Gains) -> Gains {
        let back = ((self.calm - HELD) / RECOVERY).clamp(0.0, 1.0);
        Gains { natural_frequency: gains.natural_frequency * (SOFTEST + (1.0 - SOFTEST) * back), ..gains }
    }
}

#[cfg(test)]
mod tests {
    use super::{HELD, KNOCK, Knocks, RECOVERY, SOFTEST};
    use crate::task::Gains;

    #[test]
    fn a_knock_softens_the_feedback_for_a_while_and_nothing_else_does() {
        let gains = Gains::default();
        let mut knocks = Knocks::new(1e-3);
        knocks.observe(None, &[9.0]);
        knocks.observe(Some(&[0.0, 1.0]), &[0.9 * KNOCK, 1.0 - 0.9 * KNOCK]);
        assert_eq!(knocks.soften(gains), gains);
        knocks.observe(Some(&[0.0, 1.0]), &[0.0, 1.0 - 1.1 * KNOCK]);
        let soft = knocks.soften(gains);
        assert!((soft.natural_frequency / gains.natural_frequency - SOFTEST).abs() < 1e-12, "{soft:?}");
        let ticks = ((HELD + RECOVERY) / 1e-3).round() as usize;
        let shares: Vec<f64> = (0..=ticks)
            .map(|_| {
                knocks.observe(Some(&[0.0]), &[0.0]);
                knocks.soften(gains).natural_frequency
            })
            .collect();
        println!("back after {ticks} ticks: {:?}", shares.last());
        assert!(shares.is_sorted() && knocks.soften(gains) == gains);
    }
}
