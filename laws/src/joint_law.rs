//! Effects that are a torque on one joint as a function of the instant, like most laws of friction.

use std::fmt::Debug;

use freeplay_model::export::Element;

use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::scene::Scene;

/// One joint at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Time, s.
    pub t: f64,
    /// Position, rad (m).
    pub q: f64,
    /// Velocity, rad/s (m/s).
    pub v: f64,
    /// Sign of the velocity, −1 to 1: see [`DriveFriction::sign`](crate::DriveFriction::sign).
    pub sign: f64,
    /// Torque of the rigid arm on the transmission, N·m (N).
    pub load: f64,
}

/// A torque of a drive, as a pure function of the instant.
pub trait JointLaw: Copy + Debug + Send + Sync + 'static {
    /// The torque, N·m (N); positive where it resists a positive motion.
    fn resisting(&self, at: &Instant) -> f64;

    /// As [`Effect::export_elements`], for the law at `joint`.
    fn export_elements(&self, _joint: usize, _elements: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Not
    }
}

/// A [`JointLaw`] at its joint: the same numbers in a recording and, with opposite sign, in the plant.
#[derive(Clone, Copy, Debug)]
pub struct AtJoint<L> {
    /// Index of the joint.
    pub joint: usize,
    /// The law.
    pub law: L,
}

impl<L: JointLaw> Effect for AtJoint<L> {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let (motion, load) = (scene.motion, &scene.load[self.joint]);
        let (q, v, signs) = (&motion.q[self.joint], &motion.v[self.joint], scene.signs(self.joint));
        for (point, torque) in torque[self.joint].iter_mut().enumerate() {
            let (t, q, v, sign, load) = (motion.t[point], q[point], v[point], signs[point], load[point]);
            *torque += self.law.resisting(&Instant { t, q, v, sign, load });
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.drives.push(Box::new(*self));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        self.law.export_elements(self.joint, elements)
    }
}

impl<L: JointLaw> DriveLaw for AtJoint<L> {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        let (q, v, load) = (now.q[self.joint], now.v[self.joint], now.load[self.joint]);
        let sign = now.sign[self.joint];
        torque[self.joint] -= self.law.resisting(&Instant { t: now.t, q, v, sign, load });
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
