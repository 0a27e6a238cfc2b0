//! A wrong torque constant: the measured torque differs from the true one by a factor.
//!
//! Law: τ_true = g τ_measured, with the gain g \[1\] > 0; 1 means no error. The recording shows τ/g.
//! Source: Gautier & Briot 2014, J. Dyn. Sys. Meas. Control 136:031004, §3. The term is 1/g − 1; the effect is linear in it.

use freeplay_model::export::Element;
use toml::Table;

use crate::archive::Archive;
use crate::basis::{Term, with};
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
    name: "torque_gain",
    title: "gain of the torque measurement",
    words: "a torque measurement whose true value is {gain} times the reading",
    site: Site::Joint,
    parameters: &[Parameter::number("gain", "true over measured torque", "1", [0.1, 10.0])],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "τ_true = g τ_measured",
    source: "Gautier & Briot 2014, §3",
    signature: "the whole torque of a joint, gravity, inertia and friction alike, deviates by one factor",
    confounders: &[
        ("load_dependent_friction", "changes its sign with the direction"),
        ("link_mass", "shows on the joints before it too"),
        ("payload", "shows on the joints before it too"),
        ("rotor_inertia", "does not change gravity"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::Motion, Need::LoadRange(0.3)],
    terms: Terms {
        list: |_, _, _| vec![Term::new("excess", "1", EXCESS, gain(0.5)).stepped(0.5)],
        compose: |_, _, coefficients| gain(coefficients[0]),
    },
    shapes: one_shape,
    build: |values| Ok(Box::new(TorqueGain { joint: values.joint()?, gain: values.number("gain")? })),
};

/// A measured torque is half to twice the true one: a greater error indicates another unit.
const EXCESS: [f64; 2] = [-0.5, 1.0];

/// The parameters for an excess 1/g − 1 of the measured torque over the true one.
fn gain(excess: f64) -> Table {
    with(&Table::new(), [("gain", 1.0 / (1.0 + excess))])
}

#[derive(Clone, Copy, Debug)]
struct TorqueGain {
    joint: usize,
    gain: f64,
}

impl Effect for TorqueGain {
    fn measures(&self) -> bool {
        true
    }

    fn measure(&self, _scene: &Scene, prediction: &mut Prediction) {
        prediction.torque[self.joint].iter_mut().for_each(|torque| *torque /= self.gain);
    }

    fn inject(&self, injection: &mut Injection) {
        injection.sensors.push(Box::new(*self));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::TorqueGain { joint: self.joint, gain: self.gain });
        ExportCoverage::Whole
    }
}

impl SensorLaw for TorqueGain {
    fn read(&mut self, readings: &mut Readings) {
        readings.torque[self.joint] /= self.gain;
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
