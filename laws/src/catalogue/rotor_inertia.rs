//! Inertia of a motor's rotor, reflected through the gear.
//!
//! Law: τ = I q̈ on the joint's own row, with I \[kg·m²\] ≥ 0 on the joint's side: gear ratio squared times the rotor's. The law neglects
//! the gyroscopic torque of the rotor on the other joints, which is smaller by the gear ratio.
//! Source: Siciliano, Sciavicco, Villani & Oriolo 2009, Robotics, §7.2.1 (with the remark on high ratios).

use freeplay_model::export::Element;

use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "rotor_inertia",
    title: "inertia of the rotor",
    words: "a rotor inertia of {inertia}",
    site: Site::Joint,
    parameters: &[Parameter::number(
        "inertia",
        "inertia seen at the joint, extra to the model's",
        "kg*m^2",
        [0.0, 1e6],
    )
    .prismatic("kg")],
    occurs: Occurrence::Occasional,
    tolerance: Some(Tolerance::Inertia),
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "τ = I q̈",
    source: "Siciliano, Sciavicco, Villani & Oriolo 2009, §7.2.1",
    signature: "the torque of one joint grows with its own acceleration",
    confounders: &[
        ("payload", "shows on the joints before it too, and under gravity"),
        ("link_mass", "shows on the joints before it too, and under gravity"),
        ("time_delay", "is proportional to dτ/dt"),
        ("sensor_lowpass", "lowers the torque in proportion to dτ/dt"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| Ok(Box::new(RotorInertia { joint: values.joint()?, inertia: values.number("inertia")? })),
};

#[derive(Clone, Copy, Debug)]
struct RotorInertia {
    joint: usize,
    inertia: f64,
}

impl Effect for RotorInertia {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        for (torque, a) in torque[self.joint].iter_mut().zip(&scene.motion.a[self.joint]) {
            *torque += self.inertia * a;
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.rotors.push((self.joint, self.inertia));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::RotorInertia { joint: self.joint, inertia: self.inertia });
        ExportCoverage::Whole
    }
}
