//! Friction that falls as the machine warms up.
//!
//! Law: F(t) = F (1 + α e^{−(t − t₀)/T}), with F the joint's friction in the arm file, viscous and Coulomb; α \[1\] > −1 the excess at the
//! start t₀ \[s\], T \[s\] the time constant. The drive spends τ beyond F.
//! Source: Bittencourt, Wernholt, Sander-Tavallaey & Brogårdh 2010, IROS, §IV (friction against temperature); first-order warming.

use toml::Table;

use crate::DriveFriction;
use crate::archive::Archive;
use crate::basis::with;
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "friction_drift",
    title: "friction that changes with time",
    words: "friction with an initial excess of {amount} times its value, which decays over {time_constant}",
    site: Site::Joint,
    parameters: &[
        Parameter::number(
            "amount",
            "excess of the friction at the start, as a share of the arm file's Coulomb and viscous friction",
            "1",
            [-1.0, 100.0],
        ),
        Parameter::number("time_constant", "time in which the excess falls to 1/e", "s", [1e-3, 1e7]).shape(),
        Parameter::number("start", "time at which the excess equals the amount", "s", [-1e12, 1e12])
            .or(0.0)
            .given(),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "F(t) = F (1 + α e^{−(t − t₀)/T})",
    source: "Bittencourt, Wernholt, Sander-Tavallaey & Brogårdh 2010, §IV",
    signature: "the same speeds cost less torque later in the recording, in both directions",
    confounders: &[
        ("viscous_friction", "is the same at all times: the motion has to repeat its speeds"),
        ("coulomb_friction", "is the same at all times"),
        ("external_force", "does not change its sign with the direction"),
    ],
    contains: &[("coulomb_friction", "time_constant → ∞, in joints whose friction is Coulomb's alone")],
    needs: &[Need::Torque, Need::Motion, Need::NominalFriction, Need::Reversals(4)],
    terms: Terms::LINEAR,
    shapes: time_constants,
    build: |values| {
        Ok(Box::new(FrictionDrift {
            joint: values.joint()?,
            amount: values.number("amount")?,
            time_constant: values.number("time_constant")?,
            start: values.number("start")?,
            friction: DriveFriction::nominal(values.nominal_friction()),
        }))
    },
};

/// From a twentieth of the recording to all of it; beyond, the drift is only a change of slope. The time of a recording counts from its
/// beginning.
fn time_constants(place: &Place) -> Vec<Table> {
    let t = &place.scene.motion.t;
    let (Some(first), Some(last)) = (t.first(), t.last()) else { return Vec::new() };
    let lasts = last - first;
    let start = if first.abs() < 0.2 * lasts { 0.0 } else { *first };
    let shares = [0.05, 0.1, 0.2, 0.35, 0.6, 1.0];
    shares.map(|share| with(&Table::new(), [("time_constant", share * lasts), ("start", start)])).into()
}

#[derive(Clone, Copy, Debug)]
struct FrictionDrift {
    joint: usize,
    amount: f64,
    time_constant: f64,
    start: f64,
    friction: DriveFriction,
}

impl FrictionDrift {
    /// α e^{−(t − t₀)/T}; before the start it is α.
    fn excess(&self, t: f64) -> f64 {
        self.amount * (-(t - self.start).max(0.0) / self.time_constant).exp()
    }
}

impl Effect for FrictionDrift {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let points = scene.motion.t.iter().zip(&scene.motion.v[self.joint]);
        for (torque, (t, v)) in torque[self.joint].iter_mut().zip(points) {
            *torque += self.excess(*t) * self.friction.resisting(*v);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.drives.push(Box::new(*self));
    }
}

impl DriveLaw for FrictionDrift {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        let resisting = self.friction.resisting_towards(now.sign[self.joint], now.v[self.joint]);
        torque[self.joint] -= self.excess(now.t) * resisting;
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
