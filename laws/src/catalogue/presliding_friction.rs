//! Friction that builds up elastically after a reversal instead of jumping.
//!
//! Law: bristles of deflection z \[rad\] with the stiffness σ₀ \[N·m/rad\] and the damping σ₁ \[N·m·s/rad\] carry the level
//! F = s F_n + F_c: ż = v − σ₀ |v| z/F, τ = σ₀ z + σ₁ ż. s \[1\] is the share of the joint's nominal Coulomb friction F_n with this law
//! (the rest jumps), F_c \[N·m\] is extra, F ≥ 0. The drive spends σ₀ z + σ₁ ż − s F_n sign(v) beyond the nominal friction. After a
//! reversal z follows ±(F/σ₀)(1 − 2 e^{−x/δ}) over the travel x, δ = F/σ₀: exactly integrated for any step.
//! Source: Canudas de Wit, Olsson, Åström & Lischinsky 1995, IEEE Trans. Autom. Control 40:419, Eqs. 1–3. Departure: the level does not
//! depend on the speed (Dahl 1968); the Stribeck bump is an effect of its own.

use freeplay_model::export::Element;
use toml::Table;

use crate::DriveFriction;
use crate::archive::Archive;
use crate::basis::{Term, with};
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage, Start};
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::kind::{Kind, NOMINAL, Occurrence, START, Seen, Terms, Tolerance};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "presliding_friction",
    title: "presliding friction",
    words: "friction that builds up over a small travel",
    site: Site::Joint,
    parameters: &[
        Parameter::number("stiffness", "torque per deflection of the bristles", "N*m/rad", [1e-6, 1e12])
            .prismatic("N/m")
            .shape(),
        Parameter::number("share", "share of the nominal Coulomb friction that builds up", "1", [0.0, 1.0])
            .or(1.0),
        Parameter::number("coulomb", "friction of this kind, extra to that share", "N*m", [-1e6, 1e6])
            .prismatic("N")
            .or(0.0),
        Parameter::number("damping", "torque per speed of the bristles", "N*m*s/rad", [0.0, 1e9])
            .prismatic("N*s/m")
            .or(0.0)
            .given(),
        Parameter::number(
            START,
            "deflection of the bristles at the start of a motion, as a share of their greatest one: −1 back, 1 forward",
            "1",
            [-1.0, 1.0],
        )
        .or_else("straight, or the deflection that the torque of a recording shows")
        .given(),
    ],
    occurs: Occurrence::Occasional,
    tolerance: Some(Tolerance::Friction),
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "ż = q̇ − σ₀ |q̇| z/F, τ = σ₀ z + σ₁ ż",
    source: "Canudas de Wit, Olsson, Åström & Lischinsky 1995, Eqs. 1–3; Dahl 1968",
    signature: "torque over position forms loops: after a reversal, the friction builds up over a travel",
    confounders: &[
        ("stribeck_friction", "depends on the speed, not on the travel since the reversal"),
        ("backlash", "is free of force over the gap, then jumps"),
        ("coulomb_friction", "jumps at once"),
        ("joint_spring", "does not start anew after a reversal"),
    ],
    contains: &[("coulomb_friction", "stiffness → ∞, extra friction alone")],
    needs: &[Need::Torque, Need::Motion, Need::Reversals(2)],
    terms: Terms { list: terms, compose },
    shapes: displacements,
    build: |values| {
        let nominal = DriveFriction::nominal(values.nominal_friction());
        let (stiffness, share) = (values.number("stiffness")?, values.number("share")?);
        let level = share * nominal.coulomb + values.number("coulomb")?;
        if level < -1e-9 {
            let message =
                format!("`coulomb` makes the friction of the bristles negative ({level:.3}); raise it");
            return Err(values.unreadable(message));
        }
        let bristles =
            Bristles { stiffness, damping: values.number("damping")?, level: level.max(0.0), z: 0.0 };
        let replaced = DriveFriction { viscous: 0.0, coulomb: share * nominal.coulomb };
        let start = values.optional(START)?;
        Ok(Box::new(Presliding { joint: values.joint()?, bristles, replaced, start }))
    },
};

/// Name of a shape's entry: the travel δ over which friction builds up.
const DISPLACEMENT: &str = "displacement";

/// With a displacement beyond this share of the travel, the initial deflection of the bristles affects much of the motion.
const LONG: f64 = 0.02;

/// Displacements δ from the least that half a dozen samples around a reversal resolve to half of the travel.
fn displacements(place: &Place) -> Vec<Table> {
    let (Some(joint), motion) = (place.joint, place.scene.motion) else { return Vec::new() };
    let (least, most) = motion.q[joint].iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
    let way = most - least;
    if way.is_nan() || way <= 1e-6 {
        return Vec::new();
    }
    let nominal = place.joint().map_or(0.0, |joint| joint.friction.coulomb);
    let ways = std::iter::successors(Some(way / 3000.0), |way| Some(2.0 * way)).take_while(|x| 2.0 * x < way);
    let shape = |x: f64| {
        let shape = with(&Table::new(), [(DISPLACEMENT, x), (NOMINAL, nominal)]);
        if x > LONG * way { with(&shape, [(START, 0.0)]) } else { shape }
    };
    ways.map(shape).collect()
}

fn number(shape: &Table, name: &str) -> f64 {
    shape.get(name).and_then(toml::Value::as_float).unwrap_or(0.0)
}

/// Greatest share of the arm file's friction: the friction of a machine differs from its file by a few per cent.
const MOST_SHARE: f64 = 1.1;

/// The share of the nominal friction, if there is any, and the extra friction; both with the same displacement.
fn terms(kind: &Kind, place: &Place, shape: &Table) -> Vec<Term> {
    let unit = kind.unit("coulomb", place.joint());
    let extra = |share, coulomb| compose(kind, shape, &[share, coulomb]);
    let coulomb = Term::new("coulomb", unit, [-number(shape, NOMINAL), 1e6], {
        if number(shape, NOMINAL) > 0.0 { extra(0.0, 1.0) } else { compose(kind, shape, &[1.0]) }
    });
    if number(shape, NOMINAL) > 0.0 {
        vec![Term::new("share", "1", [0.0, MOST_SHARE], extra(1.0, 0.0)).clamped(), coulomb]
    } else {
        vec![coulomb]
    }
}

fn compose(_: &Kind, shape: &Table, coefficients: &[f64]) -> Table {
    let nominal = number(shape, NOMINAL);
    let (share, coulomb) = match coefficients {
        [share, coulomb] if nominal > 0.0 => (*share, *coulomb),
        _ => (0.0, coefficients.first().copied().unwrap_or(0.0)),
    };
    // Friction beyond that of the arm file is extra friction.
    let beyond = (share - 1.0).max(0.0);
    let (share, coulomb) = (share - beyond, coulomb + beyond * nominal);
    let level = share * nominal + coulomb;
    let stiffness = (level / number(shape, DISPLACEMENT)).clamp(1e-6, 1e12);
    let table = with(&Table::new(), [("stiffness", stiffness), ("share", share), ("coulomb", coulomb)]);
    match number(shape, START) {
        0.0 => table,
        start => with(&table, [(START, start)]),
    }
}

/// Bristles with a deflection.
#[derive(Clone, Copy, Debug)]
struct Bristles {
    stiffness: f64,
    damping: f64,
    level: f64,
    /// Deflection, rad.
    z: f64,
}

impl Bristles {
    /// The torque after the joint has `moved`, at velocity `v`. For a constant direction s the deflection is
    /// s δ + (z − s δ) e^{−|moved|/δ}.
    fn after(&mut self, moved: f64, v: f64) -> f64 {
        if self.level <= 0.0 {
            return 0.0;
        }
        let displacement = self.level / self.stiffness;
        let full = displacement * moved.signum();
        if moved != 0.0 {
            self.z = full + (self.z - full) * (-moved.abs() / displacement).exp();
        }
        let rate = v - v.abs() * self.z / displacement;
        self.stiffness * self.z + self.damping * rate
    }
}

#[derive(Clone, Copy, Debug)]
struct Presliding {
    joint: usize,
    bristles: Bristles,
    /// The part of the nominal friction that no longer jumps.
    replaced: DriveFriction,
    /// Initial deflection of the bristles, −1 to 1; `None` if the file gives none.
    start: Option<f64>,
}

impl Presliding {
    /// The bristles at the start of a motion.
    fn first(&self) -> Bristles {
        let bend = self.start.unwrap_or(0.0) * self.bristles.level / self.bristles.stiffness;
        Bristles { z: bend, ..self.bristles }
    }
}

impl Effect for Presliding {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let (q, v) = (&scene.motion.q[self.joint], &scene.motion.v[self.joint]);
        for stretch in &scene.motion.stretches {
            // The past is unknown.
            let mut bristles = self.first();
            for point in stretch.clone() {
                let moved = if point > stretch.start { q[point] - q[point - 1] } else { 0.0 };
                torque[self.joint][point] +=
                    bristles.after(moved, v[point]) - self.replaced.resisting(v[point]);
            }
        }
    }

    fn with_initial_state(&self, start: Start) -> Option<Box<dyn Effect>> {
        let Start::Between(start) = start else { return None };
        let begun = || -> Box<dyn Effect> { Box::new(Presliding { start: Some(start), ..*self }) };
        (self.bristles.level > 0.0 && self.start.is_none()).then(begun)
    }

    fn inject(&self, injection: &mut Injection) {
        injection.drives.push(Box::new(Presliding { bristles: self.first(), ..*self }));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        let level = self.bristles.level - self.replaced.coulomb;
        elements.push(Element::DryFriction { joint: self.joint, level });
        ExportCoverage::But(
            "the travel over which the friction builds up after a reversal (in the file, it acts at once)",
        )
    }
}

impl DriveLaw for Presliding {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        let (v, sign) = (now.v[self.joint], now.sign[self.joint]);
        torque[self.joint] -= self.bristles.after(v * now.step, v) - self.replaced.resisting_towards(sign, v);
    }

    fn restart(&mut self) {
        self.bristles = self.first();
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        archive.real(&mut self.bristles.z);
    }
}
