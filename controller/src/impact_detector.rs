//! Impact detector: an unexplained change of joint speed within a tick means that a journal has landed.
//!
//! While a journal flies, its link turns about its own centre instead of the bearing. The arm is then lighter than the model by a factor that is 4
//! for a slender link, and every gain of the feedback is effectively higher by that factor. Damping that brings the encoders to rest within 10 ms
//! then throws the journal back with more energy than the restitution removes, and with play in two joints the bouncing never ends
//! (decisions/0018). The detector therefore softens the feedback for some time after an impact. With play in more than one joint, it does so after
//! every impact. With play in one joint, bouncing ends by itself on most arms and soft feedback costs accuracy at corners, so the detector waits
//! until the bouncing has lasted for [`LONGEST_LANDING`]. While the bouncing lasts, the feedback becomes softer and softer.

use crate::task::Gains;

/// Speed change within a tick that counts as an impact, rad/s (m/s). With play in joints 3 and 5, 0.05, 0.1 and 0.3 all end the bouncing.
pub const IMPACT_SPEED_CHANGE: f64 = 0.05;
/// Factor on the natural frequency of the feedback after an impact, applied again after each further [`LONGEST_LANDING`] of bouncing.
pub const FREQUENCY_FACTOR: f64 = 0.5;
/// Longest bouncing that counts as a normal landing, s; a play of 0.6 mm on the paper's arm needs 0.23 s.
pub const LONGEST_LANDING: f64 = 0.3;
/// Least factor on the natural frequency.
pub const LEAST_FREQUENCY_FACTOR: f64 = 0.125;
/// Time for which the feedback stays softer after an impact, s.
const SOFT_TIME: f64 = 0.015;
/// Time in which the gain then rises back to its full value, s.
const GAIN_RECOVERY_TIME: f64 = 0.03;

/// Detector state: time since the last impact, and duration of the bouncing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpactDetector {
    period: f64,
    /// Time since the last impact, s; limited to the time of soft feedback and recovery.
    calm: f64,
    /// Time since the first impact of the current bouncing, s.
    bouncing: f64,
    /// Duration of bouncing before the feedback softens, s.
    patience: f64,
}

impl ImpactDetector {
    /// Creates a detector without impacts, in ticks of `period` seconds, for an arm with play in `plays` joints.
    pub fn new(period: f64, plays: usize) -> ImpactDetector {
        let patience = if plays > 1 { 0.0 } else { LONGEST_LANDING };
        ImpactDetector { period, calm: SOFT_TIME + GAIN_RECOVERY_TIME, bouncing: 0.0, patience }
    }

    /// Updates the detector by the joint speeds `found` and, if there is a prediction, the `expected` ones.
    pub fn observe(&mut self, expected: Option<&[f64]>, found: &[f64]) {
        self.calm = (self.calm + self.period).min(SOFT_TIME + GAIN_RECOVERY_TIME);
        let knocked = |expected: &[f64]| {
            expected.iter().zip(found).any(|(expected, found)| (found - expected).abs() > IMPACT_SPEED_CHANGE)
        };
        if expected.is_some_and(knocked) {
            self.calm = 0.0;
        }
        self.bouncing =
            if self.calm < SOFT_TIME + GAIN_RECOVERY_TIME { self.bouncing + self.period } else { 0.0 };
    }

    /// Factor on the natural frequency right after an impact.
    fn share(&self) -> f64 {
        if self.bouncing < self.patience {
            return 1.0;
        }
        let steps = 1.0 + ((self.bouncing - self.patience) / LONGEST_LANDING).floor();
        FREQUENCY_FACTOR.powf(steps).max(LEAST_FREQUENCY_FACTOR)
    }

    /// `gains` with the softened natural frequency.
    pub fn soften(&self, gains: Gains) -> Gains {
        let back = ((self.calm - SOFT_TIME) / GAIN_RECOVERY_TIME).clamp(0.0, 1.0);
        let share = self.share();
        Gains { natural_frequency: gains.natural_frequency * (share + (1.0 - share) * back), ..gains }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        FREQUENCY_FACTOR, GAIN_RECOVERY_TIME, IMPACT_SPEED_CHANGE, ImpactDetector, LEAST_FREQUENCY_FACTOR,
        SOFT_TIME,
    };
    use crate::task::Gains;

    #[test]
    fn a_knock_softens_the_feedback_for_a_while_and_nothing_else_does() {
        let gains = Gains::default();
        let mut knocks = ImpactDetector::new(1e-3, 2);
        knocks.observe(None, &[9.0]);
        knocks.observe(Some(&[0.0, 1.0]), &[0.9 * IMPACT_SPEED_CHANGE, 1.0 - 0.9 * IMPACT_SPEED_CHANGE]);
        assert_eq!(knocks.soften(gains), gains);
        knocks.observe(Some(&[0.0, 1.0]), &[0.0, 1.0 - 1.1 * IMPACT_SPEED_CHANGE]);
        let soft = knocks.soften(gains);
        assert!(
            (soft.natural_frequency / gains.natural_frequency - FREQUENCY_FACTOR).abs() < 1e-12,
            "{soft:?}"
        );
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
    /// One impact every 20 ms: a landing of one journal leaves the feedback unchanged, continued bouncing softens it.
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
        assert_eq!(
            found,
            [
                1.0,
                1.0,
                FREQUENCY_FACTOR,
                FREQUENCY_FACTOR * FREQUENCY_FACTOR,
                LEAST_FREQUENCY_FACTOR,
                LEAST_FREQUENCY_FACTOR
            ]
        );
        let calm = (1..=50).map(|tick| at(2000 + 20 * tick + 1)).last();
        assert_eq!(calm, Some(1.0), "after a calm it starts anew");
    }
}
