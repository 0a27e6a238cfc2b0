//! Torque ripple: cogging of the motor, errors of gear teeth.
//!
//! Law: τ = a sin(Nq + φ), with a \[N·m\] ≥ 0, N \[periods per turn of the joint\] and φ \[rad\] the phase at q = 0. The drive spends τ.
//! Its frequency grows with the speed of the joint, so that the low-pass of the measurement affects it.
//! Source: Holtz & Springob 1996, IEEE Trans. Ind. Electron. 43:330.

use crate::harmonic::{TERMS, TORQUE_PARAMETERS, Wave, orders};
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen};
use crate::needs::Need;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "torque_ripple",
    title: "torque ripple",
    words: "a torque ripple of {amplitude}, {periods}",
    site: Site::Joint,
    parameters: TORQUE_PARAMETERS,
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τ = a sin(Nq + φ)",
    source: "Holtz & Springob 1996",
    signature: "lines at whole orders: frequencies that are proportional to the speed of the joint",
    confounders: &[
        ("position_dependent_friction", "changes its sign with the direction"),
        ("encoder_eccentricity", "is once a turn and moves the tool"),
        ("joint_spring", "does not repeat"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Travel(0.05)],
    terms: TERMS,
    shapes: orders,
    build: |values| Ok(Box::new(AtJoint { joint: values.joint()?, law: Ripple(Wave::of(values)?) })),
};

/// The law.
#[derive(Clone, Copy, Debug)]
struct Ripple(Wave);

impl JointLaw for Ripple {
    fn resisting(&self, at: &Instant) -> f64 {
        self.0.at(at.q)
    }
}
