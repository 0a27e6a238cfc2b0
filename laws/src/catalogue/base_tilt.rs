//! A base that is not level.
//!
//! Law: the base is rotated against the level frame by R = R_y(pitch) R_x(roll), so that gravity in the base frame is Rᵀ g. A tracker
//! aligned with the base measures the same tool position as before; a level tracker measures R p, see `tracker`. \[rad\], a positive roll
//! turns y towards z, a positive pitch z towards x.
//! Source: Khalil & Dombre 2002, §9.4 (base parameters under a rotated gravity). The two terms are linear for small angles.

use freeplay_model::export::Element;
use nalgebra::{Isometry3, UnitQuaternion};

use crate::LawError;
use crate::arm_parts::ArmParts;
use crate::basis::{Term, with};
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::Site;

/// The frame of the tracker, in arm files.
const TRACKERS: &[&str] = &["base", "level"];
/// Largest angle, rad.
const MOST: f64 = 1.6;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "base_tilt",
    title: "tilt of the base",
    words: "a base tilt of {roll} about x and {pitch} about y",
    site: Site::Arm,
    parameters: &[
        Parameter::number("roll", "rotation of the base about its x axis", "rad", [-MOST, MOST]).or(0.0),
        Parameter::number(
            "pitch",
            "rotation of the base about its y axis, after the roll",
            "rad",
            [-MOST, MOST],
        )
        .or(0.0),
        Parameter {
            name: "tracker",
            meaning: "orientation of the tracker: aligned with the base, or level",
            range: Range::Word(TRACKERS),
        },
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::BOTH,
    rough: false,
    shakes: false,
    equation: "g_base = Rᵀ g, R = R_y(pitch) R_x(roll)",
    source: "Khalil & Dombre 2002, §9.4",
    signature: "gravity rotates in the same way for all links; inertia does not change",
    confounders: &[
        ("payload", "shows inertia too, and nothing on the links before the last"),
        ("encoder_offset", "of the second joint rotates gravity in one plane only, and not about the base"),
        ("link_mass", "shows inertia too"),
    ],
    contains: &[],
    needs: &[Need::TorqueOrPose],
    terms: Terms {
        list: |_, _, shape| {
            /// Small enough for sin x = x to 1e-7.
            const STEP: f64 = 1e-3;
            let both = |name| {
                let (plus, minus) = (with(shape, [(name, STEP)]), with(shape, [(name, -STEP)]));
                Term::new(name, "rad", [-MOST, MOST], plus).less(minus).stepped(2.0 * STEP)
            };
            vec![both("roll"), both("pitch")]
        },
        compose: |_, shape, coefficients| {
            with(shape, [("roll", coefficients[0]), ("pitch", coefficients[1])])
        },
    },
    shapes: |_| {
        let shape =
            |tracker: &&str| [("tracker".to_owned(), toml::Value::from(*tracker))].into_iter().collect();
        TRACKERS.iter().map(shape).collect()
    },
    build: |values| {
        let turn = UnitQuaternion::from_euler_angles(values.number("roll")?, values.number("pitch")?, 0.0);
        Ok(Box::new(BaseTilt { turn, level: values.word("tracker")? == "level" }))
    },
};

#[derive(Clone, Copy, Debug)]
struct BaseTilt {
    turn: UnitQuaternion<f64>,
    level: bool,
}

impl Effect for BaseTilt {
    fn arm(&self, parts: &mut ArmParts) -> Result<(), LawError> {
        if !self.level {
            parts.gravity = self.turn.inverse() * parts.gravity;
        } else if let Some(first) = parts.joints.first_mut() {
            // The base frame of the arm becomes the level one, and the first joint rotates with the base.
            first.placement =
                Isometry3::from_parts(nalgebra::Translation3::identity(), self.turn) * first.placement;
        }
        Ok(())
    }

    fn inject(&self, _injection: &mut Injection) {}

    fn export_elements(&self, _elements: &mut Vec<Element>) -> ExportCoverage {
        ExportCoverage::Whole
    }
}
