//! A joint whose gear, belt or shaft is elastic.
//!
//! Law: τ_L = k (θ − q) + d (θ̇ − q̇), with the motor at θ \[rad\], the link at q, the stiffness k \[N·m/rad\] > 0 and the damping d
//! \[N·m·s/rad\] ≥ 0. In a recording the link oscillates on that spring (`resonance`) under the torque τ_L of the *model*; for slow loads
//! q_link = θ − τ_L/k. The term is the compliance 1/k. It is linear for a stiff joint; otherwise the diagnosis linearises about the
//! stiffness found. The shape is the loss d/k \[s\].
//! Source: Spong 1987, J. Dyn. Sys. Meas. Control 109:310, Eqs. 3–4.

use freeplay_model::export::Element;
use toml::{Table, Value};

use crate::basis::{Term, with};
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::{Injection, Transmission};
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::resonance::Resonance;
use crate::scene::Scene;

/// A smaller compliance counts as this, rad/(N·m).
const LEAST: f64 = 1e-12;
/// Initial losses of a search, s: 3 and 30 % of the critical damping at 10 Hz.
const LOSSES: [f64; 2] = [1e-3, 1e-2];

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "joint_elasticity",
    title: "elasticity",
    words: "an elastic gear with a stiffness of {stiffness}",
    site: Site::Joint,
    parameters: &[
        Parameter::number(
            "stiffness",
            "torque per angle between motor and link",
            "N*m/rad",
            [1.0, 1.0 / LEAST],
        )
        .prismatic("N/m"),
        Parameter::number("damping", "torque per speed between motor and link", "N*m*s/rad", [0.0, 1e9])
            .prismatic("N*s/m")
            .or(0.0)
            .given(),
    ],
    occurs: Occurrence::Occasional,
    tolerance: None,
    seen: Seen::BOTH,
    rough: false,
    shakes: false,
    equation: "τ_L = k (θ − q) + d (θ̇ − q̇)",
    source: "Spong 1987, Eqs. 3–4",
    signature: "the link lags behind the motor in proportion to the transmitted torque",
    confounders: &[
        ("backlash", "steps where the load changes its sign, and contains this law: test the gap nested"),
        ("link_flexure", "has the lever of the link, and does not show on the link's encoder"),
        ("time_delay", "is proportional to the speed, not to the load"),
        ("encoder_offset", "does not change with the load"),
    ],
    contains: &[],
    needs: &[Need::TorqueOrPose, Need::LoadRange(0.2)],
    terms: Terms {
        list: |kind, place, shape| {
            /// Deflections are then small, and linear.
            const STEP: f64 = 1e-8;
            let unit = format!("1/({})", kind.unit("stiffness", place.joint()));
            vec![Term::new("compliance", unit, [0.0, 1.0], spring(shape, STEP)).stepped(STEP)]
        },
        compose: |_, shape, coefficients| spring(shape, coefficients[0]),
    },
    shapes: |_| LOSSES.map(|loss| with(&Table::new(), [("loss", loss)])).into(),
    build: |values| {
        let (stiffness, damping) = (values.number("stiffness")?, values.number("damping")?);
        Ok(Box::new(JointElasticity { joint: values.joint()?, stiffness, damping }))
    },
};

/// The parameters for a shape and a compliance.
fn spring(shape: &Table, compliance: f64) -> Table {
    let stiffness = 1.0 / compliance.max(LEAST);
    let loss = shape.get("loss").and_then(Value::as_float).unwrap_or(0.0);
    let mut parameters = with(shape, [("stiffness", stiffness), ("damping", loss * stiffness)]);
    parameters.remove("loss");
    parameters
}

#[derive(Clone, Copy, Debug)]
struct JointElasticity {
    joint: usize,
    stiffness: f64,
    damping: f64,
}

impl Effect for JointElasticity {
    fn shift(&self, scene: &Scene, shift: &mut Columns) {
        let (load, inertia) = (&scene.load[self.joint], &scene.inertia()[self.joint]);
        let yielding = scene.position_derivative(self.joint);
        for stretch in scene.motion.stretches.iter().filter(|stretch| !stretch.is_empty()) {
            let (first, step) = (stretch.start, scene.motion.step(stretch));
            let slope = if stretch.len() > 1 { (load[first + 1] - load[first]) / step } else { 0.0 };
            let spring = [self.stiffness, self.damping];
            let mut link = Resonance::settled(spring, load[first], slope, yielding[first]);
            for point in stretch.clone() {
                if point > first {
                    link.advance([load[point - 1], load[point]], inertia[point], yielding[point], step);
                }
                shift[self.joint][point] -= link.place();
            }
        }
    }

    fn inject(&self, injection: &mut Injection) {
        let (stiffness, damping) = (self.stiffness, self.damping);
        injection.transmissions.push((self.joint, Transmission { stiffness, damping, gap: 0.0 }));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        let JointElasticity { joint, stiffness, damping } = *self;
        elements.push(Element::Gear { joint, stiffness: Some(stiffness), damping, gap: 0.0, friction: 0.0 });
        ExportCoverage::Whole
    }
}
