//! A link that bends under its load.
//!
//! Law: a cantilever of length L \[m\] from its joint to the next one (from the last joint: to the tool) with the stiffness k \[N/m\]: force
//! over deflection at its far end, k = 3EI/L³. e is the direction of the link. F and M are the force and moment of the links and loads at
//! the far end, W is the weight and inertia force of the link itself at the share σ of its length, all perpendicular to e:
//! δ = (F + W σ²(3 − σ)/2)/k + (3/(2kL)) M × e, θ = (3/(2kL)) e × (F + W σ²) + (3/(kL²)) M; the tool moves by δ + θ × (tool − end).
//! The drives hold all links beyond by the displaced levers, and the link itself by its own deflection
//! F σ²(3 − σ)/(2k) + (3σ²/(2kL)) M × e + W σ³/k. This is the form `beam`. In the form `tip_force` only F bends the link, as in the textbook's
//! cantilever: δ = F/k, θ = (3/(2kL)) e × F; in the form `tip_shift` the far end shifts by F/k without a slope.
//! Source: Timoshenko 1955, Strength of Materials I, §39 (Euler–Bernoulli). The term is 1/k. Departure: the law neglects torsion and
//! oscillation: the link follows the load at once.

use freeplay_arm::{Arm, Workspace};
use nalgebra::Vector3;
use toml::Value;

use crate::basis::{Term, with};
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::Site;
use crate::sag::{Sag, SagLaw, Sagging, pressure};

/// Shorter links do not bend, m.
const SHORTEST: f64 = 1e-3;
/// A smaller compliance counts as this, m/N.
const LEAST: f64 = 1e-15;

/// The forms of the law.
const FORMS: &[&str] = &["beam", "tip_force", "tip_shift"];

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "link_flexure",
    title: "bending of the link",
    words: "an elastic link with a stiffness of {stiffness}",
    site: Site::Joint,
    parameters: &[
        Parameter::number("stiffness", "force over deflection at the far end", "N/m", [1.0, 1.0 / LEAST]),
        Parameter {
            name: "form",
            meaning: "load that bends the link: force and moment at the far end and its own weight; the force alone; or the force, which only shifts the end",
            range: Range::Word(FORMS),
        },
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::BOTH,
    rough: false,
    shakes: false,
    equation: "δ = F L³/(3EI) = F/k, and the slope 3F/(2kL)",
    source: "Timoshenko 1955, §39",
    signature: "the tool sags with the load, with the lever of the link and of the links beyond it",
    confounders: &[
        ("joint_elasticity", "turns about the joint, and shows on its link encoder"),
        ("link_length", "does not change with the load"),
        ("base_tilt", "does not change with the pose of the links beyond"),
    ],
    contains: &[],
    needs: &[Need::Tool],
    terms: Terms {
        list: |_, _, shape| {
            const STEP: f64 = 1e-8;
            vec![
                Term::new("compliance", "m/N", [0.0, 1.0], with(shape, [("stiffness", 1.0 / STEP)]))
                    .stepped(STEP),
            ]
        },
        compose: |_, shape, coefficients| with(shape, [("stiffness", 1.0 / coefficients[0].max(LEAST))]),
    },
    shapes: |_| {
        FORMS.iter().map(|form| [("form".to_owned(), Value::from(*form))].into_iter().collect()).collect()
    },
    build: |values| {
        let (stiffness, form) = (values.number("stiffness")?, values.word("form")?);
        let law = LinkFlexure { joint: values.joint()?, stiffness, form };
        Ok(Box::new(Sagging { law, arm: values.arm().clone() }))
    },
};

#[derive(Clone, Copy, Debug)]
struct LinkFlexure {
    joint: usize,
    stiffness: f64,
    form: &'static str,
}

impl SagLaw for LinkFlexure {
    fn sag(&self, arm: &Arm, ws: &Workspace) -> Sag {
        let here = ws.link_pose(self.joint);
        let next = (self.joint + 1 < arm.dof()).then(|| ws.link_pose(self.joint + 1));
        let end = next.unwrap_or_else(|| here * arm.tool()).translation.vector;
        let way = end - here.translation.vector;
        let length = way.norm();
        let still = Sag { from: self.joint + 1, about: end, ..Sag::default() };
        if length < SHORTEST {
            return still;
        }
        let along = way / length;
        let across = |x: Vector3<f64>| x - along * along.dot(&x);
        let (force, moment) = next.map_or_else(Default::default, |_| pressure(ws, self.joint + 1));
        let force = across(force);
        let k = self.stiffness;
        if self.form == "tip_shift" {
            return Sag { shift: force / k, ..still };
        }
        let is_beam = self.form == "beam";
        let moment = if is_beam { across(moment) } else { Vector3::zeros() };
        let own = if is_beam { across(pressure(ws, self.joint).0) - force } else { Vector3::zeros() };
        let centre = here.rotation * arm.joints()[self.joint].inertia.com;
        let share = (centre.dot(&along) / length).clamp(0.0, 1.0);
        let squared = share * share;
        // Deflection of the end by a unit force at the link's own centre of mass, times k; by reciprocity the same with the points
        // exchanged.
        let between = squared * (3.0 - share) / 2.0;
        let lever = moment.cross(&along) * (1.5 / (k * length));
        Sag {
            shift: (force + own * between) / k + lever,
            turn: along.cross(&(force + own * squared)) * (1.5 / (k * length))
                + moment * (3.0 / (k * length * length)),
            before: (force * between + own * (squared * share)) / k + lever * squared,
            ..still
        }
    }
}
