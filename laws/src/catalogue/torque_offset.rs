//! An offset of a joint's torque measurement.
//!
//! Law: τ_measured = τ + τ₀, with τ₀ \[N·m\] of either sign: the zero error of an amplifier or a strain gauge.
//! Source: Swevers, Verdonck & De Schutter 2007, IEEE Control Syst. Mag. 27(5):58, Eq. 4.

use freeplay_model::export::Element;

use crate::archive::Archive;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::prediction::Prediction;
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "torque_offset",
    title: "offset of the torque measurement",
    words: "a torque measurement that reads {offset} too much",
    site: Site::Joint,
    parameters: &[
        Parameter::number("offset", "excess of the measured torque", "N*m", [-1e6, 1e6]).prismatic("N")
    ],
    occurs: Occurrence::Occasional,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "τ_measured = τ + τ₀",
    source: "Swevers, Verdonck & De Schutter 2007, Eq. 4",
    signature: "the measured torque deviates by a constant",
    confounders: &[
        ("asymmetric_friction", "is the same together with Coulomb friction: report the class"),
        ("joint_spring", "changes with the position"),
        ("payload", "changes with the pose and shows on the joints before it"),
    ],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| Ok(Box::new(TorqueOffset { joint: values.joint()?, offset: values.number("offset")? })),
};

#[derive(Clone, Copy, Debug)]
struct TorqueOffset {
    joint: usize,
    offset: f64,
}

impl Effect for TorqueOffset {
    fn measures(&self) -> bool {
        true
    }

    fn measure(&self, _scene: &Scene, prediction: &mut Prediction) {
        prediction.torque[self.joint].iter_mut().for_each(|torque| *torque += self.offset);
    }

    fn inject(&self, injection: &mut Injection) {
        injection.sensors.push(Box::new(*self));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::TorqueOffset { joint: self.joint, offset: self.offset });
        ExportCoverage::Whole
    }
}

impl SensorLaw for TorqueOffset {
    fn read(&mut self, readings: &mut Readings) {
        readings.torque[self.joint] += self.offset;
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
