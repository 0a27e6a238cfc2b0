//! A joint whose gear, belt or shaft gives under load.
//!
//! Law: τ_L = k (θ − q) + d (θ̇ − q̇), with the motor at θ \[rad\], the link at q, the stiffness k \[N·m/rad\] > 0 and the damping
//! d \[N·m·s/rad\] ≥ 0. In a recording q_link = θ − τ_L/k with the transmitted torque τ_L of the *model*; the term is the compliance 1/k.
//! Source: Spong 1987, J. Dyn. Sys. Meas. Control 109:310, Eqs. 3–4. Departure: in a recording the deflection follows the load of the rigid
//! motion at once, and the link's acceleration that; damping and resonance are left to the plant.

use crate::basis::{Term, Terms, with};
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{Injection, Transmission};
use crate::kind::{Kind, Seen, Site, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::scene::Scene;

/// Least compliance that is one, rad/(N·m).
const LEAST: f64 = 1e-12;

/// The entry.
pub static KIND: Kind = Kind {
    name: "joint_elasticity",
    title: "elasticity",
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
    seen: Seen::BOTH,
    rough: false,
    equation: "τ_L = k (θ − q) + d (θ̇ − q̇)",
    source: "Spong 1987, Eqs. 3–4",
    signature: "the link lags behind the motor in proportion to the transmitted torque",
    confounders: &[
        ("backlash", "steps where the load changes its sign: it contains this; test the gap nested"),
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
            let soft = with(shape, [("stiffness", 1.0 / STEP)]);
            vec![Term::new("compliance", unit, [0.0, 1.0], soft).stepped(STEP)]
        },
        compose: |_, shape, coefficients| with(shape, [("stiffness", 1.0 / coefficients[0].max(LEAST))]),
    },
    shapes: one_shape,
    build: |values| {
        let (stiffness, damping) = (values.number("stiffness")?, values.number("damping")?);
        Ok(Box::new(JointElasticity { joint: values.joint()?, stiffness, damping }))
    },
};

#[derive(Clone, Copy, Debug)]
struct JointElasticity {
    joint: usize,
    stiffness: f64,
    damping: f64,
}

impl Effect for JointElasticity {
    fn shift(&self, scene: &Scene, shift: &mut Columns) {
        for (shift, load) in shift[self.joint].iter_mut().zip(&scene.load[self.joint]) {
            *shift -= load / self.stiffness;
        }
    }

    fn inject(&self, injection: &mut Injection) {
        let (stiffness, damping) = (self.stiffness, self.damping);
        injection.transmissions.push((self.joint, Transmission { stiffness, damping, gap: 0.0 }));
    }
}
