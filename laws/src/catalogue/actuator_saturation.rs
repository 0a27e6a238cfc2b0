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
        Parameter::number("limit", "greatest torque of the drive", "N*m", [LEAST_LIMIT, 1e9])
            .prismatic("N")
            .shape(),
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

/// Least limit, N·m or N: a drive without any torque is not a limited drive.
const LEAST_LIMIT: f64 = 1e-9;

/// Least share of the torque beyond the limit that a drive's limit removes: a softer reduction is another law.
const SOFTEST: f64 = 0.5;

/// Greatest share while the limit is a value of a coarse grid: with a grid value that is too high, the fit would remove more than
/// everything beyond it.
const OVER: f64 = 1.5;

/// Shares of the time for which the drive needs more than the limits with which the search starts: a motion needs its greatest torque for moments or for
/// half of its time. Between neighbours, a fit of `share` stays between [`SOFTEST`] and [`OVER`], also for a sine.
const TIMES_BEYOND: [f64; 7] = [0.75, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625];

/// The limits of the search: what the motion needs for more than each of [`TIMES_BEYOND`].
fn limits(place: &Place) -> Vec<Table> {
    let (Some(index), Some(joint)) = (place.joint, place.joint()) else { return Vec::new() };
    let (motion, friction) = (&place.scene.motion, DriveFriction::nominal(joint.friction));
    let asked = place.scene.load[index].iter().zip(&motion.v[index]).zip(&motion.a[index]);
    let mut needed: Vec<f64> =
        asked.map(|((load, v), a)| (load + friction.resisting(*v) + joint.rotor_inertia * a).abs()).collect();
    needed.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut levels: Vec<f64> = TIMES_BEYOND
        .iter()
        .filter_map(|share| needed.get((share * needed.len() as f64) as usize).copied())
        .filter(|level| *level > LEAST_LIMIT)
        .collect();
    levels.dedup();
    levels.iter().map(|level| with(&Table::new(), [("limit", *level)])).collect()
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
