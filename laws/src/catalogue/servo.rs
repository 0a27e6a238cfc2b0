//! The position servo of a joint: from the commanded to the measured position.
//!
//! Law: τ = k e′ − d q̇, clipped to the torque limit; e = r − q, e′ = e outside of the dead band less its half width, and zero inside. The
//! set-point r is the command, rounded down to `resolution`, shifted by `offset` and never faster than the speed limit. Friction is that of
//! the nominal model and of the effects `coulomb_friction`, `viscous_friction` and `stribeck_friction`. The crate `freeplay-servo`
//! integrates the law along recorded commands, the plant in its mode `servo`.
//! Source: Åström & Murray 2008, Feedback Systems, §10.

use freeplay_model::export::Element;

use super::commanded::{NO_TERMS, no_shape};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{Injection, ServoLaw};
use crate::kind::{Kind, Occurrence, Seen};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "servo",
    title: "position servo",
    words: "a position servo of {stiffness} with a damping of {damping}",
    site: Site::Joint,
    parameters: &[
        Parameter::number("stiffness", "torque per position error", "N*m/rad", [1e-9, 1e9]).prismatic("N/m"),
        Parameter::number(
            "damping",
            "torque per speed, in addition to the viscous friction",
            "N*m*s/rad",
            [0.0, 1e9],
        )
        .prismatic("N*s/m")
        .or(0.0),
        Parameter::number("deadband", "position error without torque, half width", "rad", [0.0, 10.0])
            .prismatic("m")
            .or(0.0),
        Parameter::number("torque_limit", "greatest torque of the servo", "N*m", [1e-9, 1e9])
            .prismatic("N")
            .or_else("no limit"),
        Parameter::number("speed_limit", "greatest speed of the set-point", "rad/s", [1e-9, 1e9])
            .prismatic("m/s")
            .or_else("no limit"),
        Parameter::number("resolution", "step to which commands are rounded down", "rad", [0.0, 10.0])
            .prismatic("m")
            .or(0.0),
        Parameter::number("offset", "set-point minus command", "rad", [-10.0, 10.0]).prismatic("m").or(0.0),
    ],
    occurs: Occurrence::Common,
    tolerance: None,
    seen: Seen { torque: false, pose: false },
    rough: true,
    shakes: false,
    equation: "τ = k e′ − d q̇, |τ| ≤ limit",
    source: "Åström & Murray 2008, §10",
    signature: "the measured position lags the commanded one by d/k, droops under load by load/k and rests where friction holds it",
    confounders: &[
        ("command_delay", "shifts the whole motion in time, fast and slow parts alike"),
        ("joint_elasticity", "sits behind the encoder: only the tool or the link's encoder shows it"),
        (
            "backlash",
            "sits behind the encoder: only the tool, the link's encoder, or the weight of the links on given servos shows it",
        ),
    ],
    contains: &[],
    needs: &[Need::Motion],
    terms: NO_TERMS,
    shapes: no_shape,
    build: |values| {
        let law = ServoLaw {
            stiffness: values.number("stiffness")?,
            damping: values.number("damping")?,
            deadband: values.number("deadband")?,
            torque_limit: values.optional("torque_limit")?.unwrap_or(f64::INFINITY),
            speed_limit: values.optional("speed_limit")?.unwrap_or(f64::INFINITY),
            resolution: values.number("resolution")?,
            offset: values.number("offset")?,
        };
        Ok(Box::new(Servo { joint: values.joint()?, law }))
    },
};

#[derive(Clone, Copy, Debug)]
struct Servo {
    joint: usize,
    law: ServoLaw,
}

impl Effect for Servo {
    fn inject(&self, injection: &mut Injection) {
        injection.servos.push((self.joint, self.law));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        let ServoLaw { stiffness, damping, offset, torque_limit: limit, .. } = self.law;
        elements.push(Element::Servo { joint: self.joint, stiffness, damping, offset, limit });
        let ServoLaw { deadband, speed_limit, resolution, .. } = self.law;
        match deadband > 0.0 || resolution > 0.0 || speed_limit.is_finite() {
            true => ExportCoverage::But("dead band, speed limit and resolution of the set-point"),
            false => ExportCoverage::Whole,
        }
    }
}
