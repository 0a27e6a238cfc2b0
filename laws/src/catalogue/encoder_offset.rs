//! A wrong zero of a joint's encoder.
//!
//! Law: q_true = q − q₀ with the offset q₀ \[rad\]: the encoder reads q₀ at the zero of the joint.
//! Source: Mooring, Roth & Driels 1991, Fundamentals of Manipulator Calibration, §2.

use freeplay_model::export::Element;

use crate::archive::Archive;
use crate::basis::{Term, with};
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, Seen, Terms, Tolerance, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::scene::Scene;

/// Greatest plausible offset of an encoder's zero, rad (m): with a greater one the arm would not have come up.
pub const MOST_ENCODER_OFFSET: f64 = 0.3;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "encoder_offset",
    title: "encoder zero offset",
    words: "an encoder that reads {offset} where the joint is at zero",
    site: Site::Joint,
    parameters: &[Parameter::number(
        "offset",
        "reading of the encoder with the joint at zero",
        "rad",
        [-3.2, 3.2],
    )
    .prismatic("m")],
    occurs: Occurrence::Rare,
    tolerance: Some(Tolerance::Zero),
    seen: Seen::BOTH,
    rough: false,
    shakes: false,
    equation: "q_true = q − q₀",
    source: "Mooring, Roth & Driels 1991, §2",
    signature: "the tool deviates by J_q q₀ in every pose, the gravity torque by ∂g/∂q q₀",
    confounders: &[
        ("base_tilt", "tilts the tool too, about another axis"),
        ("link_length", "shifts the tool along the link, not about the joint"),
    ],
    contains: &[],
    needs: &[Need::TorqueOrPose],
    terms: Terms {
        list: |kind, place, shape| {
            /// Small enough to act linearly to 1e-4.
            const STEP: f64 = 1e-4;
            let term = Term::new(
                "offset",
                kind.unit("offset", place.joint()),
                [-MOST_ENCODER_OFFSET, MOST_ENCODER_OFFSET],
                with(shape, [("offset", STEP)]),
            );
            vec![term.stepped(STEP)]
        },
        compose: |_, shape, coefficients| with(shape, [("offset", coefficients[0])]),
    },
    shapes: one_shape,
    build: |values| Ok(Box::new(EncoderOffset { joint: values.joint()?, offset: values.number("offset")? })),
};

#[derive(Clone, Copy, Debug)]
struct EncoderOffset {
    joint: usize,
    offset: f64,
}

impl Effect for EncoderOffset {
    fn shift(&self, _scene: &Scene, shift: &mut Columns) {
        shift[self.joint].iter_mut().for_each(|shift| *shift -= self.offset);
    }

    fn inject(&self, injection: &mut Injection) {
        injection.sensors.push(Box::new(*self));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::EncoderZero { joint: self.joint, offset: self.offset });
        ExportCoverage::Whole
    }
}

impl SensorLaw for EncoderOffset {
    fn read(&mut self, readings: &mut Readings) {
        readings.q[self.joint] += self.offset;
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
