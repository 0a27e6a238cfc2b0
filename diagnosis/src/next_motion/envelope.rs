//! The envelope of a safe motion: the limits of the arm file, minus a margin.

use freeplay_arm::{Arm, Workspace, forward_kinematics, rnea};
use freeplay_laws::DriveFriction;

use crate::next_motion::RATE;
use crate::next_motion::family::Fourier;

/// Usable share of each limit: a drive overshoots its command, and the torque of a model has an error of ten to twenty per cent.
const SHARE: f64 = 0.8;
/// Unused part of the range of a joint at either end: controllers stop an arm before the end of its range.
const END: f64 = 0.03;
/// Speed limit for joints without one in the arm file, rad/s (m/s): slower than the joints of common arms may turn.
const GENTLE_SPEED: f64 = 1.0;
/// Acceleration limit for joints without one in the arm file, rad/s² (m/s²): it reaches the gentle speed in a quarter of a second.
const GENTLE_ACCELERATION: f64 = 4.0;

/// The limits of a safe motion.
#[derive(Clone, Debug)]
pub(super) struct Envelope {
    /// Least and greatest position of each joint.
    pub range: Vec<[f64; 2]>,
    speed: Vec<f64>,
    acceleration: Vec<f64>,
    effort: Vec<f64>,
    /// Least height of every joint and of the tool, against gravity, m; `None` without gravity.
    floor: Option<f64>,
    /// The assumptions, one sentence each.
    pub notes: Vec<String>,
}

/// Use of the limits by a motion: the greatest share of each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Used {
    /// Share of the distance to the nearer end of a joint's range.
    pub position: f64,
    /// Share of the speed.
    pub speed: f64,
    /// Share of the acceleration.
    pub acceleration: f64,
    /// Share of the torque, by the model with its nominal friction; 0 if no joint has a limit.
    pub torque: f64,
    /// Above 1 if a joint or the tool goes below the base, or lower than before.
    pub floor: f64,
}

impl Used {
    /// The greatest share: above 1 the motion exceeds its limits.
    pub fn most(&self) -> f64 {
        [self.position, self.speed, self.acceleration, self.torque, self.floor]
            .into_iter()
            .fold(0.0, f64::max)
    }
}

impl Envelope {
    /// The envelope of `arm` about `posture`; no joint moves farther than `reach` from it, rad (m).
    pub fn new(arm: &Arm, posture: &[f64], reach: f64) -> Self {
        let mut notes = Vec::new();
        let mut or_gentle = |limit: f64, gentle: f64, what: &str, name: &str| {
            if limit.is_finite() {
                return SHARE * limit;
            }
            notes.push(format!(
                "the arm file has no {what} of {name}; the motion keeps to {gentle} (SI units)"
            ));
            gentle
        };
        let (mut range, mut speed, mut acceleration, mut effort) = (vec![], vec![], vec![], vec![]);
        for (joint, &at) in arm.joints().iter().zip(posture) {
            let limits = &joint.limits;
            let free = END * (limits.upper - limits.lower);
            let (mut low, mut high) = (at - reach, at + reach);
            if limits.lower.is_finite() && limits.upper.is_finite() {
                (low, high) = (low.max(limits.lower + free), high.min(limits.upper - free));
            } else {
                (low, high) = (low.max(limits.lower), high.min(limits.upper));
            }
            range.push([low.min(at), high.max(at)]);
            speed.push(or_gentle(limits.velocity, GENTLE_SPEED, "speed limit", &joint.name));
            acceleration.push(or_gentle(
                limits.acceleration,
                GENTLE_ACCELERATION,
                "acceleration limit",
                &joint.name,
            ));
            effort.push(SHARE * limits.effort);
        }
        let floor = (arm.gravity().norm() > 0.0).then(|| lowest(arm, posture).min(0.0));
        Self { range, speed, acceleration, effort, floor, notes }
    }

    /// Use of the envelope by `motion`.
    pub fn used(&self, arm: &Arm, motion: &Fourier) -> Used {
        let joints = arm.dof();
        let mut ws = Workspace::new(arm);
        let (mut q, mut v, mut a, mut tau) =
            (vec![0.0; joints], vec![0.0; joints], vec![0.0; joints], vec![0.0; joints]);
        let mut used = Used::default();
        for k in 0..=(motion.duration * RATE).ceil() as usize {
            for joint in 0..joints {
                [q[joint], v[joint], a[joint]] = motion.at(joint, k as f64 / RATE);
            }
            rnea(arm, &mut ws, &q, &v, &a, &mut tau);
            for (joint, described) in arm.joints().iter().enumerate() {
                let friction = DriveFriction::nominal(described.friction).resisting(v[joint]);
                let [low, high] = self.range[joint];
                let (middle, half) = (0.5 * (low + high), 0.5 * (high - low).max(1e-9));
                used.position = used.position.max((q[joint] - middle).abs() / half);
                used.speed = used.speed.max(v[joint].abs() / self.speed[joint]);
                used.acceleration = used.acceleration.max(a[joint].abs() / self.acceleration[joint]);
                used.torque = used.torque.max((tau[joint] + friction).abs() / self.effort[joint]);
            }
            if self.floor.is_some_and(|floor| lowest(arm, &q) < floor - 1e-9) {
                used.floor = 2.0;
            }
        }
        used
    }

    /// Scales the swings of `motion` to the greatest permitted size, at most the given one; `None` if its posture alone is outside.
    pub fn inside(&self, arm: &Arm, motion: &Fourier) -> Option<Fourier> {
        if self.used(arm, motion).most() <= 1.0 {
            return Some(motion.clone());
        }
        let (mut fits, mut leaves) = (0.0, 1.0);
        for _ in 0..7 {
            let middle = 0.5 * (fits + leaves);
            if self.used(arm, &motion.scaled(middle)).most() <= 1.0 {
                fits = middle;
            } else {
                leaves = middle;
            }
        }
        (fits > 0.0).then(|| motion.scaled(fits))
    }
}

/// Height of the lowest of the joints and the tool against gravity, m above the base's origin.
fn lowest(arm: &Arm, q: &[f64]) -> f64 {
    let up = -arm.gravity().normalize();
    let mut ws = Workspace::new(arm);
    let tool = forward_kinematics(arm, &mut ws, q).translation.vector.dot(&up);
    (0..arm.dof()).map(|joint| ws.link_pose(joint).translation.vector.dot(&up)).fold(tool, f64::min)
}
