//! An eccentric encoder disc.
//!
//! Law: the encoder reads r = q + a sin(q + φ), with the amplitude a \[rad\] ≥ 0 and the phase φ \[rad\] at q = 0; the joint is at q.
//! Source: Mancini 1998; Hagiwara et al. 1992, IEEE Trans. Instrum. Meas. 41:40: one period in one turn of the disc.
//! The terms are a cos φ and a sin φ, linear for small a.

use freeplay_model::export::Element;

use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::harmonic::TERMS;
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, Seen, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "encoder_eccentricity",
    title: "eccentricity of the encoder",
    words: "an eccentric encoder, off by up to {amplitude}",
    site: Site::Revolute,
    parameters: &[
        Parameter::number("amplitude", "greatest error of the reading", "rad", [0.0, 0.1]),
        Parameter::number("phase", "phase φ of the error at q = 0", "rad", [-7.0, 7.0]).or(0.0),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::BOTH,
    rough: false,
    shakes: false,
    equation: "q_read = q + a sin(q + φ)",
    source: "Hagiwara et al. 1992",
    signature: "the tool oscillates about its correct position, once in a turn of the joint",
    confounders: &[
        ("encoder_offset", "is the same at all positions: both need a wide range of the joint"),
        ("torque_ripple", "does not move the tool"),
        ("joint_elasticity", "follows the load"),
    ],
    contains: &[],
    needs: &[Need::TorqueOrPose, Need::Turns(0.15)],
    terms: TERMS,
    shapes: one_shape,
    build: |values| {
        let (amplitude, phase) = (values.number("amplitude")?, values.number("phase")?);
        Ok(Box::new(EncoderEccentricity { joint: values.joint()?, amplitude, phase }))
    },
};

#[derive(Clone, Copy, Debug)]
struct EncoderEccentricity {
    joint: usize,
    amplitude: f64,
    phase: f64,
}

impl EncoderEccentricity {
    /// The position for the encoder's `reading`, by iteration: each iteration multiplies the error by the amplitude.
    fn position(&self, reading: f64) -> f64 {
        (0..20).fold(reading, |q, _| reading - self.amplitude * (q + self.phase).sin())
    }
}

impl Effect for EncoderEccentricity {
    fn shift(&self, scene: &Scene, shift: &mut Columns) {
        for (shift, reading) in shift[self.joint].iter_mut().zip(&scene.motion.q[self.joint]) {
            *shift += self.position(*reading) - reading;
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.sensors.push(Box::new(*self));
    }

    fn export_elements(&self, _: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Never("encoders of other tools read the true position")
    }
}

impl SensorLaw for EncoderEccentricity {
    fn read(&mut self, readings: &mut Readings) {
        let q = readings.q[self.joint];
        readings.v[self.joint] *= 1.0 + self.amplitude * (q + self.phase).cos();
        readings.q[self.joint] = q + self.amplitude * (q + self.phase).sin();
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
