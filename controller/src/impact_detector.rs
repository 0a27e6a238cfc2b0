//! Impacts: speed that the joints gain within a tick and that no torque explains. A journal has landed.
//!
//! While a journal flies, its link turns about its own middle and not about the bearing: the arm is lighter than the model by a factor
//! that is 4 for a slender link, and every gain of the feedback is that much higher. Damping that brings the encoders to rest within
//! 10 ms then throws the journal back, harder than the restitution takes away, and with play in two joints the bouncing never ends
//! (decisions/0018). So for some time after a knock the feedback is softer: after each where more than one joint has play; with play in one joint,
//! where bouncing ends by itself on most arms and softness costs at corners, after those of a bouncing that has gone on for [`PATIENCE`]. As long as it
//! goes on, softer and softer.

use crate::task::Gains;

/// Speed gained in a tick that is a knock, rad/s (m/s). With play in joints 3 and 5 bounces are ended with 0.05, 0.1 and 0.3 alike.
pub const KNOCK: f64 = 0.05;
/// Share of the natural frequency that is left of the feedback after a knock, and again after each [`PATIENCE`] of bouncing.
pub const SOFTER: f64 = 0.5;
/// How long a journal may bounce before that is more than a landing, s: 0.23 s is what 0.6 mm of play takes on the paper's arm.
pub const PATIENCE: f64 = 0.3;
/// Least share of the natural frequency.
pub const SOFTEST: f64 = 0.125;
/// Time for which the feedback stays softer after an impact, s.
const SOFT_TIME: f64 = 0.015;
/// Time in which its gain then comes back to the whole, s.
const GAIN_RECOVERY_TIME: f64 = 0.03;

/// How long ago the last knock was, and for how long there have been knocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpactDetector {
    period: f64,
    /// Time since the last, s; no longer than matters.
    calm: f64,
    /// Time since the first without a calm after it, s.
    bouncing: f64,
    /// From when on bouncing softens, s.
    patience: f64,
}

impl ImpactDetector {
    /// None so far, in ticks of `period` seconds, for an arm with play in `plays` joints.
    pub fn new(period: f64, plays: usize) -> ImpactDetector {
        let patience = if plays > 1 { 0.0 } else { PATIENCE };
        ImpactDetector { period, calm: SOFT_TIME + GAIN_RECOVERY_TIME, bouncing: 0.0, patience }
    }

    /// Takes in the speeds `found` of the joints, where `expected` were to be if anything was expected.
    pub fn observe(&mut self, expected: Option<&[f64]>, found: &[f64]) {
        self.calm = (self.calm + self.period).min(SOFT_TIME + GAIN_RECOVERY_TIME);
        let knocked = |expected: &[f64]| {
            expected.iter().zip(found).any(|(expected, found)| (found - expected).abs() > KNOCK)
        };
        if expected.is_some_and(knocked) {
            self.calm = 0.0;
        }
        self.bouncing =
            if self.calm < SOFT_TIME + GAIN_RECOVERY_TIME { self.bouncing + self.period } else { 0.0 };
    }

    /// Share of the natural frequency right after a knock.
    fn share(&self) -> f64 {
        if self.bouncing < self.patience {
            return 1.0;
        }
        let steps = 1.0 + ((self.bouncing - self.patience) / PATIENCE).floor();
        SOFTER.powf(steps).max(SOFTEST)
    }

    /// What is left of `gains`.
    pub fn soften(&self, gains: Gains) -> Gains {
        let back = ((self.calm - SOFT_TIME) / GAIN_RECOVERY_TIME).clamp(0.0, 1.0);
        let share = self.share();
        Gains { natural_frequency: gains.natural_frequency * (share + (1.0 - share) * back), ..gains }
    }
}

#[cfg(test)]
mod tests {
    use super::{GAIN_RECOVERY_TIME, ImpactDetector, KNOCK, SOFT_TIME, SOFTER, SOFTEST};
    use crate::task::Gains;

    #[test]
    fn a_knock_softens_the_feedback_for_a_while_and_nothing_else_does() {
        let gains = Gains::default();
        let mut knocks = ImpactDetector::new(1e-3, 2);
        knocks.observe(None, &[9.0]);
        knocks.observe(Some(&[0.0, 1.0]), &[0.9 * KNOCK, 1.0 - 0.9 * KNOCK]);
        assert_eq!(knocks.soften(gains), gains);
        knocks.observe(Some(&[0.0, 1.0]), &[0.0, 1.0 - 1.1 * KNOCK]);
        let soft = knocks.soften(gains);
        assert!((soft.natural_frequency / gains.natural_frequency - SOFTER).abs() < 1e-12, "{soft:?}");
        let ticks = ((SOFT_TIME + GAIN_RECOVERY_TIME) / 1e-3).round() as usize;
        let shares: Vec<f64> = (0..=ticks)
            .map(|_| {
                knocks.observe(Some(&[0.0]), &[0.0]);
                knocks.soften(gains).natural_frequency
            })
            .collect();
        println!("back after {ticks} ticks: {:?}", shares.last());
        assert!(shares.is_sorted() && knocks.soften(gains) == gains);
    }
    /// A knock every 20 ms: a landing of one journal is left alone, bouncing that goes on is not.
    #[test]
    fn bouncing_that_goes_on_is_softened_more_and_more() {
        let gains = Gains { natural_frequency: 1.0, ..Gains::default() };
        let mut knocks = ImpactDetector::new(1e-3, 1);
        let mut at = |tick: usize| {
            let found = if tick.is_multiple_of(20) { 1.0 } else { 0.0 };
            knocks.observe(Some(&[0.0]), &[found]);
            knocks.soften(gains).natural_frequency
        };
        let shares: Vec<f64> = (0..2000).map(&mut at).collect();
        let just_after = |seconds: f64| shares[20 * (seconds * 50.0).round() as usize];
        let found = [0.1, 0.28, 0.34, 0.64, 0.94, 1.9].map(just_after);
        println!("shares {found:?}");
        assert_eq!(found, [1.0, 1.0, SOFTER, SOFTER * SOFTER, SOFTEST, SOFTEST]);
        let calm = (1..=50).map(|tick| at(2000 + 20 * tick + 1)).last();
        assert_eq!(calm, Some(1.0), "after a calm it starts anew");
    }
}
