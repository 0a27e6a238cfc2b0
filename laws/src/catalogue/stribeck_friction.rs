//! The Stribeck effect: friction that is higher near standstill than at speed.
//!
//! Law: τ = F e^{−(q̇/v_s)²} sign(q̇), with F \[N·m\] ≥ 0 in addition to the Coulomb friction and v_s \[rad/s\] > 0. The drive spends τ:
//! positive for a positive velocity. The identification needs samples slower than about 3 v_s.
//! Source: Stribeck 1902, Z. VDI 46:1341; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, Automatica 30:1083, Eq. 5 with δ = 2.
//! In a recording the sign is smoothed over [`crate::DriveFriction::SMOOTHING_SPEED`].

use toml::Table;

use crate::basis::with;
use crate::joint_law::{AtJoint, Instant, JointLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "stribeck_friction",
    title: "Stribeck friction",
    words: "additional friction of {extra} in slow motion, which fades over {velocity}",
    site: Site::Joint,
    parameters: &[
        Parameter::number("extra", "friction at standstill beyond the Coulomb friction", "N*m", [0.0, 1e6])
            .prismatic("N"),
        Parameter::number("velocity", "speed v_s over which it fades", "rad/s", [1e-6, 1e3])
            .prismatic("m/s")
            .shape(),
    ],
    occurs: Occurrence::Occasional,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τ = F e^{−(q̇/v_s)²} sign(q̇)",
    source: "Stribeck 1902; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994",
    signature: "the friction has a bump at low speed, below about 3 v_s",
    confounders: &[
        ("coulomb_friction", "does not fade with the speed"),
        ("presliding_friction", "depends on the travel since the reversal, not on the speed"),
        ("joint_elasticity", "smooths reversals, but moves the link"),
    ],
    contains: &[("coulomb_friction", "velocity → ∞")],
    needs: &[Need::Torque, Need::Motion, Need::Reversals(1), Need::Speeds(3.0)],
    terms: Terms::LINEAR,
    shapes: stribeck_velocities,
    build: |values| {
        let law = Stribeck { extra: values.number("extra")?, velocity: values.number("velocity")? };
        Ok(Box::new(AtJoint { joint: values.joint()?, law }))
    },
};

/// F e^{−(q̇/v_s)²} sign(q̇).
#[derive(Clone, Copy, Debug)]
struct Stribeck {
    extra: f64,
    velocity: f64,
}

impl JointLaw for Stribeck {
    fn resisting(&self, at: &Instant) -> f64 {
        self.extra * (-(at.v / self.velocity).powi(2)).exp() * at.sign
    }
}

/// Stribeck velocities v_s that the motion can identify: with enough samples slower than 3 v_s, and enough faster than that. Each is 1.5
/// times the last.
fn stribeck_velocities(place: &Place) -> Vec<Table> {
    /// Samples that an average needs.
    const SAMPLES: usize = 8;
    let speeds = place.speeds();
    let moving = &speeds[speeds.partition_point(|speed| *speed <= 1e-9)..];
    if moving.len() < 4 * SAMPLES {
        return Vec::new();
    }
    let (slowest, fastest) = (moving[SAMPLES], moving[moving.len() - 1 - SAMPLES]);
    let velocities =
        std::iter::successors(Some(slowest / 1.5), |v| Some(1.5 * v)).take_while(|v| 2.0 * v < fastest);
    velocities.map(|v| with(&Table::new(), [("velocity", v)])).collect()
}
