//! Torque ripple: cogging of the motor, errors of gear teeth.
//!
//! Law: τ = a sin(Nq + φ), with a \[N·m\] ≥ 0, N \[periods per turn of the joint\] and φ \[rad\] the phase at q = 0. τ is what the drive
//! spends. It is fast where the joint is fast, so that the low-pass of the measurement acts on it.
//! Source: Holtz & Springob 1996, IEEE Trans. Ind. Electron. 43:330.

use crate::harmonic::{TERMS, orders, wave};
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Seen, Site};
use crate::needs::Need;
use crate::parameter::Parameter;

/// The entry.
pub static KIND: Kind = Kind {
    name: "torque_ripple",
    title: "torque ripple",
    site: Site::Joint,
    parameters: &[
        Parameter::number("amplitude", "greatest torque of the wave", "N*m", [0.0, 1e6]).prismatic("N"),
        Parameter::number("periods", "periods N of the wave in one turn", "1/rev", [1e-3, 1e5])
            .prismatic("rad/m")
            .shape(),
        Parameter::number("phase", "phase φ of the wave at q = 0", "rad", [-7.0, 7.0]).or(0.0),
    ],
    seen: Seen::TORQUE,
    rough: true,
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
    build: |values| {
        let [amplitude, periods, phase] =
            [values.number("amplitude")?, values.number("periods")?, values.number("phase")?];
        Ok(Box::new(AtJoint { joint: values.joint()?, law: Ripple { amplitude, periods, phase } }))
    },
};

/// The wave.
#[derive(Clone, Copy, Debug)]
struct Ripple {
    amplitude: f64,
    periods: f64,
    phase: f64,
}

impl JointLaw for Ripple {
    fn resisting(&self, at: &Instant) -> f64 {
        wave(self.amplitude, self.periods, self.phase, at.q)
    }
}
