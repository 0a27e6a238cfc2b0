//! A payload on the last link that the model does not know.
//!
//! Law: a point mass m \[kg\] at c \[m\] in the last link's frame is added to that link by the parallel axis theorem (Steiner 1840).
//! It may be negative where the model carries too much. Gravity and inertia show on every joint before it.
//! Source: Khalil & Dombre 2002, Modeling, Identification and Control of Robots, §9.

use freeplay_arm::Inertia;
use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::LawError;
use crate::effect::{ArmParts, Effect, Kind, Parameter, Range, Role, Seen, Site};
use crate::injection::Injection;

/// The entry.
pub static KIND: Kind = Kind {
    name: "payload",
    title: "payload",
    site: Site::Arm,
    parameters: &[
        Parameter {
            name: "mass",
            meaning: "mass on the last link, extra to the model's",
            range: Range::Number {
                unit: "kg",
                prismatic_unit: "kg",
                least: -1e4,
                most: 1e4,
                default: None,
                role: Role::Linear,
            },
        },
        Parameter {
            name: "com",
            meaning: "its centre of mass in the last link's frame",
            range: Range::Vector { unit: "m", default: Some([0.0; 3]), role: Role::Shape },
        },
    ],
    seen: Seen { torque: true, pose: false },
    rough: false,
    equation: "m, m·c added to the last link: gravity and inertia on all joints before it",
    source: "Khalil & Dombre 2002, §9",
    signature: "gravity and inertia of one body on all joints, growing towards the base",
    confounders: &[
        ("base_tilt", "turns gravity for all links alike"),
        ("link_mass", "does not show on the joints after that link"),
    ],
    build: |values| Ok(Box::new(Payload { mass: values.number("mass")?, com: values.vector("com")?.into() })),
};

#[derive(Clone, Copy, Debug)]
struct Payload {
    mass: f64,
    com: Vector3<f64>,
}

impl Effect for Payload {
    fn arm(&self, parts: &mut ArmParts) -> Result<(), LawError> {
        if let Some(last) = parts.joints.last_mut() {
            let body = Inertia { mass: self.mass, com: self.com, about_com: Matrix3::zeros() };
            last.inertia = last.inertia.joined_with(&body, &Isometry3::identity());
        }
        Ok(())
    }

    fn inject(&self, _injection: &mut Injection) {}
}
