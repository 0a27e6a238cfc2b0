//! Coulomb friction of a joint's drive, beyond the nominal.
//!
//! Law: τ = F sign(q̇), with F \[N·m\] extra to what the arm file names; it may be negative where the file names too much.
//! Source: Coulomb 1785; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, Automatica 30:1083, §2.1.
//! In the plant the sign is smoothed over [`DriveFriction::SMOOTHING`], as the nominal friction's is.

use crate::DriveFriction;
use crate::effect::{Effect, Kind, Parameter, Range, Role, Seen, Site};
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::scene::Scene;

/// The entry.
pub static KIND: Kind = Kind {
    name: "coulomb_friction",
    title: "Coulomb friction",
    site: Site::Joint,
    parameters: &[Parameter {
        name: "coulomb",
        meaning: "friction torque at any speed, extra to the nominal",
        range: Range::Number {
            unit: "N*m",
            prismatic_unit: "N",
            least: -1e6,
            most: 1e6,
            default: None,
            role: Role::Linear,
        },
    }],
    seen: Seen { torque: true, pose: false },
    rough: true,
    equation: "τ = F sign(q̇)",
    source: "Coulomb 1785; Armstrong-Hélouvry, Dupont & Canudas de Wit 1994",
    signature: "the torque steps where the velocity changes sign and depends on nothing else",
    confounders: &[
        ("asymmetric_friction", "the step differs between the two directions"),
        ("stribeck_friction", "the friction falls with the speed near standstill"),
        ("load_dependent_friction", "the step grows with the load"),
    ],
    build: |values| {
        Ok(Box::new(CoulombFriction { joint: values.joint()?, coulomb: values.number("coulomb")? }))
    },
};

#[derive(Clone, Copy, Debug)]
struct CoulombFriction {
    joint: usize,
    coulomb: f64,
}

impl Effect for CoulombFriction {
    fn torque(&self, scene: &Scene, torque: &mut [Vec<f64>]) {
        for (torque, v) in torque[self.joint].iter_mut().zip(&scene.motion.v[self.joint]) {
            *torque += if *v == 0.0 { 0.0 } else { self.coulomb * v.signum() };
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.drives.push(Box::new(*self));
    }
}

impl DriveLaw for CoulombFriction {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        torque[self.joint] -= self.coulomb * (now.v[self.joint] / DriveFriction::SMOOTHING).tanh();
    }
}
