//! Two joints whose gears share a shaft, as the last two axes of many wrists do.
//!
//! Law: a shaft turns at u = q̇ᵢ + s q̇ⱼ, with i the joint of the effect, j = `with` and s = `sign`; its inertia I \[kg·m²\], viscous friction
//! F_v \[N·m·s/rad\] and Coulomb friction F_c \[N·m\], all ≥ 0, load both joints: X = I u̇ + F_v u + F_c sign(u), τᵢ = X and τⱼ = s X, extra to what
//! the model has. Terms of one joint so depend on the motion of the other, in both rows; power τᵢ q̇ᵢ + τⱼ q̇ⱼ = X u is never negative
//! but for the inertia's.
//! Source: Janot, Vandanjon & Gautier 2014, IEEE Trans. Control Syst. Technol. 22:132, §IV (coupled joints 5 and 6 of a Stäubli TX40).
//! Departure: the joint's own share of the shaft is counted here, so that the law is that of a body.

use toml::{Table, Value};

use crate::DriveFriction;
use crate::basis::{Place, Terms, with};
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::kind::{Kind, Seen, Site};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::scene::Scene;

/// The entry.
pub static KIND: Kind = Kind {
    name: "joint_coupling",
    title: "coupling of two joints",
    site: Site::Joint,
    parameters: &[
        Parameter { name: "with", meaning: "the other joint", range: Range::OtherJoint },
        Parameter::number("inertia", "inertia of the shaft", "kg*m^2", [0.0, 1e6]).or(0.0),
        Parameter::number("viscous", "viscous friction of the shaft", "N*m*s/rad", [0.0, 1e6]).or(0.0),
        Parameter::number("coulomb", "Coulomb friction of the shaft", "N*m", [0.0, 1e6]).or(0.0),
        Parameter::number("sign", "turns of the shaft for one of the other joint", "1", [-1e3, 1e3])
            .or(1.0)
            .choice(),
    ],
    seen: Seen::TORQUE,
    rough: true,
    equation: "τᵢ = X, τⱼ = s X, X = I u̇ + F_v u + F_c sign(u), u = q̇ᵢ + s q̇ⱼ",
    source: "Janot, Vandanjon & Gautier 2014, §IV",
    signature: "the residual of one joint follows the speed and acceleration of another, and the other way round",
    confounders: &[
        ("coulomb_friction", "follows the joint's own direction"),
        ("viscous_friction", "follows the joint's own speed"),
        ("rotor_inertia", "follows the joint's own acceleration"),
        ("load_dependent_friction", "follows the load"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion],
    terms: Terms::PARTS,
    shapes: partners,
    build: |values| {
        Ok(Box::new(JointCoupling {
            joints: [values.joint()?, values.other_joint("with")?],
            sign: values.number("sign")?,
            inertia: values.number("inertia")?,
            viscous: values.number("viscous")?,
            coulomb: values.number("coulomb")?,
        }))
    },
};

/// The joint before, if it moves, turning the same way or the other: a shaft that turns with two axes passes through both. With s = ±1 the
/// law is the same seen from either joint, so that each pair is asked for once, at its outer joint.
fn partners(place: &Place) -> Vec<Table> {
    let joints = place.scene.arm.joints().iter().enumerate();
    let moving = |joint: usize| place.scene.motion.v[joint].iter().any(|v| v.abs() > 1e-6);
    let near = |joint: usize| place.joint == Some(joint + 1);
    let others = joints.filter(|(joint, _)| near(*joint) && moving(*joint));
    others
        .flat_map(|(_, joint)| [1.0, -1.0].map(|sign| (joint.name.clone(), sign)))
        .map(|(name, sign)| {
            let mut shape = with(&Table::new(), [("sign", sign)]);
            shape.insert("with".to_owned(), Value::String(name));
            shape
        })
        .collect()
}

#[derive(Clone, Copy, Debug)]
struct JointCoupling {
    joints: [usize; 2],
    sign: f64,
    inertia: f64,
    viscous: f64,
    coulomb: f64,
}

impl Effect for JointCoupling {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let [own, other] = self.joints;
        let motion = scene.motion;
        let load = |point: usize| {
            let u = motion.v[own][point] + self.sign * motion.v[other][point];
            let du = motion.a[own][point] + self.sign * motion.a[other][point];
            let direction = if u == 0.0 { 0.0 } else { u.signum() };
            self.inertia * du + self.viscous * u + self.coulomb * direction
        };
        let loads: Vec<f64> = (0..motion.len()).map(load).collect();
        for (joint, share) in [(own, 1.0), (other, self.sign)] {
            torque[joint].iter_mut().zip(&loads).for_each(|(torque, load)| *torque += share * load);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        let [own, other] = self.joints;
        injection.rotors.extend([(own, self.inertia), (other, self.sign * self.sign * self.inertia)]);
        injection.drives.push(Box::new(*self));
    }
}

impl DriveLaw for JointCoupling {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        let [own, other] = self.joints;
        let u = now.v[own] + self.sign * now.v[other];
        let load = self.viscous * u + self.coulomb * DriveFriction::sign(u);
        // Each joint's own share of the inertia is in the rotors; what the other's acceleration asks for is one sub-step old, and
        // less than those shares, so that it converges.
        let across = self.sign * self.inertia;
        torque[own] -= load + across * now.a[other];
        torque[other] -= self.sign * load + across * now.a[own];
    }
}
