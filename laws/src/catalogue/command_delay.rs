//! A delay between a command's stamp and its effect on the encoder's reading.
//!
//! Law: the servo answers at t the command of t − d. A joint whose encoder samples later than the command acts has d < 0.
//! Source: Åström & Murray 2008, Feedback Systems, §9 (time delays).

use freeplay_model::export::Element;

use super::commanded::{NO_TERMS, no_shape};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "command_delay",
    title: "delay of commands",
    words: "a command delay of {delay}",
    site: Site::Joint,
    parameters: &[Parameter::number("delay", "time from a command's stamp to its effect", "s", [-1.0, 10.0])],
    occurs: Occurrence::Common,
    tolerance: None,
    seen: Seen { torque: false, pose: false },
    rough: true,
    shakes: false,
    equation: "r(t) = u(t − d)",
    source: "Åström & Murray 2008, §9",
    signature: "the measured position follows the commanded one after a constant time, at any speed and also at the start of a motion",
    confounders: &[
        ("servo", "begins a motion at once and slowly, with its lag d/k"),
        ("time_delay", "of a sensor shows in torque against position, too"),
    ],
    contains: &[],
    needs: &[Need::Motion],
    terms: NO_TERMS,
    shapes: no_shape,
    build: |values| Ok(Box::new(CommandDelay { joint: values.joint()?, delay: values.number("delay")? })),
};

#[derive(Clone, Copy, Debug)]
struct CommandDelay {
    joint: usize,
    delay: f64,
}

impl Effect for CommandDelay {
    fn inject(&self, injection: &mut Injection) {
        injection.command_delays.push((self.joint, self.delay));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        if self.delay < 0.0 {
            return ExportCoverage::Not;
        }
        elements.push(Element::CommandDelay { joint: self.joint, delay: self.delay });
        ExportCoverage::Whole
    }
}
