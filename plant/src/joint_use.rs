//! Use of the drives in a run: the greatest speed, acceleration and torque of every joint, beside its limits.
//!
//! Measured once a tick on the motor's side. The speed is that of the tick. The acceleration is the mean over the tick, the change of the
//! speed over its length, which an impact in a bearing cannot make infinite. The torque is the motor's (for prescribed joints, the torque
//! that they needed in the last sub-step). A journal that lands accelerates a light joint, without a command and possibly beyond a limit.
//! [`JointUse::add_commanded`] records commanded values instead.

use freeplay_arm::{Arm, Limits};
use serde::Serialize;

use crate::{DeviationStatistics, SPEED_MARGIN, System};

/// One quantity of one joint: rad/s, rad/s² or N·m (m/s, m/s², N).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Used {
    /// Greatest magnitude of the run; includes the bounces of a journal that starts in the centre of its bearing, which accelerate a light
    /// joint.
    pub peak: f64,
    /// Greatest magnitude after [`DeviationStatistics::START_DURATION`].
    pub peak_after_start: f64,
    /// The limit; `None` if the arm file gives none.
    pub limit: Option<f64>,
    /// Peak after the start over limit; `None` without a limit.
    pub share: Option<f64>,
}

impl Used {
    fn of([peak, peak_after_start]: [f64; 2], limit: f64) -> Self {
        let limit = limit.is_finite().then_some(limit);
        Self { peak, peak_after_start, limit, share: limit.map(|limit| peak_after_start / limit) }
    }
}

/// Use of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct UsedByJoint {
    /// Speed.
    pub speed: Used,
    /// Acceleration, mean over a tick.
    pub acceleration: Used,
    /// Torque of the motor.
    pub torque: Used,
    /// Most ticks in a row with a speed beyond [`SPEED_MARGIN`](crate::SPEED_MARGIN) times its limit.
    pub ticks_beyond_speed: u32,
}

impl UsedByJoint {
    /// The quantities with their names.
    pub fn all(&self) -> [(&'static str, Used); 3] {
        [("speed", self.speed), ("acceleration", self.acceleration), ("torque", self.torque)]
    }
}

/// The greatest values of a run.
#[derive(Clone, Debug)]
pub struct JointUse {
    limits: Vec<Limits>,
    period: f64,
    /// |v|, |a|, |τ| by joint: of the run, and after its start.
    peaks: Vec<[[f64; 2]; 3]>,
    /// Speeds of the last tick.
    before: Vec<Option<f64>>,
    /// Ticks in a row beyond the speed limit: present count, and the greatest count.
    beyond: Vec<[u32; 2]>,
}

impl JointUse {
    /// A record without values for the joints of `arm`, in ticks of `period` seconds.
    pub fn new(arm: &Arm, period: f64) -> Self {
        Self {
            limits: arm.joints().iter().map(|joint| joint.limits).collect(),
            period,
            peaks: vec![[[0.0; 2]; 3]; arm.dof()],
            before: vec![None; arm.dof()],
            beyond: vec![[0; 2]; arm.dof()],
        }
    }

    /// Adds the state of `system`; call it once a tick.
    pub fn add(&mut self, system: &System) {
        for joint in 0..self.peaks.len() {
            let [_, v, _] = system.joint(joint);
            let acceleration = self.before[joint].map_or(0.0, |before| (v - before) / self.period);
            self.before[joint] = Some(v);
            let [ticks, most] = &mut self.beyond[joint];
            let is_beyond = v.abs() > SPEED_MARGIN * self.limits[joint].velocity;
            *ticks = if is_beyond { *ticks + 1 } else { 0 };
            *most = (*most).max(*ticks);
            self.raise(joint, system.time(), [v, acceleration, system.motor_torque()[joint]]);
        }
    }

    /// Adds commanded values for the instant `time`, s, instead of measured ones: the speed, the mean acceleration over the tick and the
    /// torque of each joint.
    pub fn add_commanded(&mut self, time: f64, speed: &[f64], acceleration: &[f64], torque: &[f64]) {
        for joint in 0..self.peaks.len() {
            self.raise(joint, time, [speed[joint], acceleration[joint], torque[joint]]);
        }
    }

    fn raise(&mut self, joint: usize, time: f64, values: [f64; 3]) {
        for (peak, value) in self.peaks[joint].iter_mut().zip(values) {
            peak[0] = peak[0].max(value.abs());
            if time >= DeviationStatistics::START_DURATION {
                peak[1] = peak[1].max(value.abs());
            }
        }
    }

    /// The use of each joint.
    pub fn joints(&self) -> Vec<UsedByJoint> {
        let pairs = self.peaks.iter().zip(&self.limits).zip(&self.beyond);
        pairs
            .map(|((&[speed, acceleration, torque], limits), &[_, most])| UsedByJoint {
                ticks_beyond_speed: most,
                speed: Used::of(speed, limits.velocity),
                acceleration: Used::of(acceleration, limits.acceleration),
                torque: Used::of(torque, limits.effort),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

    use super::*;
    use crate::{Hermite, Input};
    use freeplay_laws::ArmWithPlay;
    use freeplay_model::paper_arm;

    #[test]
    fn a_constant_torque_gives_the_peaks_of_the_equation_of_motion() {
        let arm = paper_arm().arm;
        let mut system = System::new(ArmWithPlay::new(&arm, &[]).unwrap(), &arm, 1e-3, 50).unwrap();
        system.start(&[0.0; 6], &[0.0; 6]);
        let mut used = JointUse::new(&arm, 1e-3);
        // The vertical first joint alone: about it gravity has no moment, so that τ = M₁₁ a.
        let torque = 300.0;
        let mut inertia = nalgebra::DMatrix::zeros(6, 6);
        freeplay_arm::crba(&arm, &mut freeplay_arm::Workspace::new(&arm), &[0.0; 6], &mut inertia);
        let expected = torque / inertia[(0, 0)];
        let driven = [false, true, true, true, true, true];
        let still = Hermite::new(6);
        for _ in 0..600 {
            used.add(&system);
            let torques = [torque, 0.0, 0.0, 0.0, 0.0, 0.0];
            system.tick(&Input { torque: &torques, driven: &driven, motion: &still }).unwrap();
        }
        used.add(&system);
        let first = used.joints()[0];
        assert!(expected > 1.0, "{expected}");
        assert!((first.acceleration.peak / expected - 1.0).abs() < 1e-3, "{first:?}, expected {expected}");
        assert!((first.speed.peak / (expected * 0.6) - 1.0).abs() < 1e-3, "{first:?}");
        assert_eq!(first.torque.peak, torque);
        let limit = arm.joints()[0].limits.effort;
        assert_eq!(first.torque.share, limit.is_finite().then(|| torque / limit));
        // A drive without a limit has no share; values before the start do not count for it.
        assert_eq!(Used::of([1.0; 2], f64::INFINITY).share, None);
        assert_eq!(Used::of([5.0, 1.0], 2.0).share, Some(0.5));
    }
}
