//! Tests a planned passage before its use: one rollout of the model follows the passage, another the quasi-static correction.
//!
//! In both rollouts the joints follow their commands exactly, while the journals are free to detach, fly and bounce. The rollout holds the
//! acceleration of a tick from half a tick before it to half a tick after it, so that the motion passes through the positions of all ticks. It
//! evaluates the deviation half-way between ticks.

use freeplay_laws::ArmWithPlay;

use crate::passage_corner::Frame;
use crate::passage_trajectory::Instant;
use crate::rollout::{Driven, Rollout};

/// A motion for a trial rollout, tick by tick: reference positions of the joints, their corrections and the intended displacements of the journals.
pub struct TrialMotion<'a> {
    /// Reference positions of the joints, rad (m).
    pub reference: &'a [Vec<f64>],
    /// Corrections of the joints, rad (m).
    pub corrections: &'a [Vec<f64>],
    /// Intended displacements of the journals, m.
    pub journals: &'a [Vec<f64>],
}

impl TrialMotion<'_> {
    fn joints(&self, k: usize, period: f64) -> Instant {
        let rows = [k - 1, k, k + 1].map(|k| -> Vec<f64> {
            let pairs = self.reference[k].iter().zip(&self.corrections[k]);
            pairs.map(|(reference, correction)| reference + correction).collect()
        });
        Instant::centred([&rows[0], &rows[1], &rows[2]], period)
    }

    /// Positions and velocities half a tick after tick `k`, for accelerations that are held around each tick.
    fn half_way(now: &Instant, after: &[f64], period: f64) -> Instant {
        let v: Vec<f64> = now.q.iter().zip(after).map(|(now, after)| (after - now) / period).collect();
        let held = |i: usize| now.q[i] + 0.5 * period * v[i] - 0.125 * period * period * now.a[i];
        Instant { q: (0..v.len()).map(held).collect(), a: now.a.clone(), v }
    }

    /// RMS of the tool's remaining deviation in a rollout of `arm`, mm; `frames` contain the Jacobians, tick by tick.
    pub fn remaining(&self, arm: &ArmWithPlay, frames: &[Frame], period: f64) -> f64 {
        let mut rollout = Rollout::new(arm, period);
        let ticks = self.reference.len();
        let first = self.joints(1, period);
        let next: Vec<f64> =
            self.reference[2].iter().zip(&self.corrections[2]).map(|(q, dq)| q + dq).collect();
        let meant = [0, 1, 2].map(|k| self.journals[k].as_slice());
        let journals = Self::half_way(&Instant::centred(meant, period), meant[2], period);
        rollout.start(Self::half_way(&first, &next, period).as_motion(), journals.as_motion());
        let slides: Vec<usize> = arm.plays().iter().flat_map(|play| play.slides).collect();
        let mut squares = 0.0;
        for (k, frame) in frames.iter().enumerate().take(ticks - 1).skip(2) {
            rollout.tick(Driven::Acceleration(&self.joints(k, period).a));
            let corrections = self.corrections[k]
                .iter()
                .zip(&self.corrections[k + 1])
                .map(|(now, next)| 0.5 * (now + next));
            let moved: Vec<f64> = corrections.chain(slides.iter().map(|&slide| rollout.q()[slide])).collect();
            for row in frame.tool.row_iter().take(3) {
                squares += row.iter().zip(&moved).map(|(j, moved)| j * moved).sum::<f64>().powi(2);
            }
        }
        1e3 * (squares / (ticks - 3) as f64).sqrt()
    }
}
