//! A temporary torque on one joint that the model lacks: a hand on a link, a cable that catches, a brake that drags.
//!
//! Law: a torque T \[N·m\] acts *on* the joint from t = start to end \[s\], positive in its positive direction; the drive spends τ = −T.
//! Source: De Luca & Mattone 2005, ICRA, Eq. 4 (collisions as generalised forces), with the force on one coordinate.

use super::external_force::windows;
use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "external_torque",
    title: "torque on a joint",
    words: "a torque of {torque} on the joint from {start} to {end}",
    site: Site::Joint,
    parameters: &[
        Parameter::number("torque", "torque that acts on the joint", "N*m", [-1e6, 1e6]).prismatic("N"),
        Parameter::number("start", "start of the torque", "s", [-1e12, 1e12]).shape(),
        Parameter::number("end", "end of the torque", "s", [-1e12, 1e12]).shape(),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τ = −T for start ≤ t < end",
    source: "De Luca & Mattone 2005, Eq. 4",
    signature: "the torque of one joint deviates by a constant amount for a time",
    confounders: &[
        ("external_force", "shows in the torques of several joints, in the pattern Jᵀ f"),
        ("torque_offset", "lasts"),
        ("friction_drift", "changes slowly, and with the direction of motion"),
        ("actuator_saturation", "acts where the motion needs much torque"),
    ],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms::LINEAR,
    shapes: windows,
    build: |values| {
        let (torque, start, end) = (values.number("torque")?, values.number("start")?, values.number("end")?);
        Ok(Box::new(ExternalTorque { joint: values.joint()?, torque, start, end }))
    },
};

#[derive(Clone, Copy, Debug)]
struct ExternalTorque {
    joint: usize,
    torque: f64,
    start: f64,
    end: f64,
}

impl Effect for ExternalTorque {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let shares = scene.motion.acting(self.start, self.end);
        torque[self.joint].iter_mut().zip(shares).for_each(|(torque, share)| *torque -= share * self.torque);
    }

    fn inject(&self, injection: &mut Injection) {
        injection.drives.push(Box::new(*self));
    }
}

impl DriveLaw for ExternalTorque {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        if now.t >= self.start && now.t < self.end {
            torque[self.joint] += self.torque;
        }
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
