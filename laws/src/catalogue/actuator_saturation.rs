//! A drive with a torque limit.
//!
//! Law: |τ| ≤ L, with the limit L \[N·m\] > 0. A recording shows the limit where the model requires more; the share `share` \[1\] of the
//! torque beyond it is lost, 1 for a hard limit, less where the current measurement saturates softly. In the plant the limit is hard.
//! Source: Khalil 2002, Nonlinear Systems, §1.2.7.

use freeplay_model::export::Element;
use toml::Table;

use crate::DriveFriction;
use crate::basis::{Term, with};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};
use crate::prediction::Prediction;
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "actuator_saturation",
    title: "limit of the drive",
    words: "a drive that is limited to {limit}",
    site: Site::Joint,
    parameters: &[
        Parameter::number("limit", "greatest torque of the drive", "N*m", [1e-9, 1e9]).prismatic("N").shape(),
        Parameter::number("share", "share of the torque beyond the limit that is lost", "1", [0.0, 1.0])
            .or(1.0),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "|τ| ≤ L",
    source: "Khalil 2002, §1.2.7",
    signature: "the torque stays below one value; the deviation has one side only, and occurs only where the motion needs much torque",
    confounders: &[
        ("external_force", "does not depend on the needed torque"),
        ("torque_gain", "acts at small torques too"),
    ],
    contains: &[],
    needs: &[Need::Torque, Need::LoadRange(0.1)],
    terms: Terms {
        list: |_, _, shape| {
            vec![
                Term::new("share", "1", [SOFTEST, OVER], with(shape, [("share", 1.0)])).with_usual_value(1.0),
            ]
        },
        compose: |_, shape, coefficients| match coefficients[0].clamp(0.0, 1.0) {
            share if share < 1.0 => with(shape, [("share", share)]),
            _ => shape.clone(),
        },
    },
    shapes: limits,
    build: |values| {
        let (limit, share) = (values.number("limit")?, values.number("share")?);
        Ok(Box::new(ActuatorSaturation { joint: values.joint()?, limit, share }))
    },
};

/// Least share of the torque beyond the limit that a drive's limit removes: a softer reduction is another law.
const SOFTEST: f64 = 0.5;

/// Greatest share while the limit is a value of a coarse grid: with a grid value that is too high, the fit would remove more than
/// everything beyond it.
const OVER: f64 = 1.5;

/// The limits of the search: shares of the greatest torque of the motion.
fn limits(place: &Place) -> Vec<Table> {
    let (Some(index), Some(joint)) = (place.joint, place.joint()) else { return Vec::new() };
    let (motion, friction) = (&place.scene.motion, DriveFriction::nominal(joint.friction));
    let asked = place.scene.load[index].iter().zip(&motion.v[index]).zip(&motion.a[index]);
    let greatest = asked.fold(0.0_f64, |most, ((load, v), a)| {
        most.max((load + friction.resisting(*v) + joint.rotor_inertia * a).abs())
    });
    let shares = if greatest > 1e-6 { [0.5, 0.6, 0.7, 0.8, 0.87, 0.93].as_slice() } else { &[] };
    shares.iter().map(|share| with(&Table::new(), [("limit", share * greatest)])).collect()
}

#[derive(Clone, Copy, Debug)]
struct ActuatorSaturation {
    joint: usize,
    limit: f64,
    share: f64,
}

impl Effect for ActuatorSaturation {
    fn measures(&self) -> bool {
        true
    }

    fn bends(&self) -> bool {
        true
    }

    fn measure(&self, _scene: &Scene, prediction: &mut Prediction) {
        for torque in &mut prediction.torque[self.joint] {
            *torque -= self.share * (*torque - torque.clamp(-self.limit, self.limit));
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.saturations.push((self.joint, self.limit));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::TorqueLimit { joint: self.joint, limit: self.limit });
        match self.share < 1.0 {
            true => {
                ExportCoverage::But("the share of the torque beyond the limit that the drive still provides")
            }
            false => ExportCoverage::Whole,
        }
    }
}
