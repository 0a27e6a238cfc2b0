//! A link that is heavier or lighter than the model says.
//!
//! Law: mass and inertia of the link that the joint moves are `scale` times the model's, its centre of mass stays. Gravity and inertia
//! show on that joint and on all before it.
//! Source: Khalil & Dombre 2002, Modeling, Identification and Control of Robots, §9.2. The term is `scale` − 1.

use crate::LawError;
use crate::basis::{Term, Terms, with};
use crate::effect::{ArmParts, Effect};
use crate::injection::Injection;
use crate::kind::{Kind, Seen, Site, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;

/// The entry.
pub static KIND: Kind = Kind {
    name: "link_mass",
    title: "mass of the link",
    words: "a link {scale} times as heavy",
    site: Site::Joint,
    parameters: &[Parameter::number("scale", "true over modelled mass and inertia", "1", [0.0, 1e3])],
    seen: Seen::TORQUE,
    rough: false,
    equation: "m = s m₀, J = s J₀ of one link",
    source: "Khalil & Dombre 2002, §9.2",
    signature: "gravity and inertia of one link are off by one factor, on its joint and all before it",
    confounders: &[
        ("payload", "shows on the joints after that link too"),
        ("base_tilt", "turns gravity for all links alike and leaves inertia as it is"),
        ("torque_gain", "shows on one joint alone, friction included"),
        ("joint_spring", "does not follow the direction of gravity"),
    ],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms {
        list: |_, _, shape| {
            // A link of three times its mass, or a third of it, is another link.
            vec![Term::new("excess", "1", [-2.0 / 3.0, 2.0], with(shape, [("scale", 1.5)])).stepped(0.5)]
        },
        compose: |_, shape, coefficients| with(shape, [("scale", 1.0 + coefficients[0])]),
    },
    shapes: one_shape,
    build: |values| Ok(Box::new(LinkMass { joint: values.joint()?, scale: values.number("scale")? })),
};

#[derive(Clone, Copy, Debug)]
struct LinkMass {
    joint: usize,
    scale: f64,
}

impl Effect for LinkMass {
    fn arm(&self, parts: &mut ArmParts) -> Result<(), LawError> {
        let inertia = &mut parts.joints[self.joint].inertia;
        inertia.mass *= self.scale;
        inertia.about_com *= self.scale;
        Ok(())
    }

    fn inject(&self, _injection: &mut Injection) {}
}
