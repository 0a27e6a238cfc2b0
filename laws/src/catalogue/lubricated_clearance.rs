//! Radial play of a revolute joint whose bearing is full of oil.
//!
//! Law: the oil film ([`Film`]) carries the force b of the bearing. The journal drifts without inertia, with ė such that the film's force
//! equals b, and displaces the tool by J e. Compared with a dry joint the offset is smooth and shrinks with the speed; at rest the journal
//! sinks to the wall.
//! Source: Pinkus & Sternlicht 1961; Flores et al. 2006, Mech. Mach. Theory 41:247. For a fixed C = μ L R³/c² the offset is proportional to
//! c: c is the term, and C the shape. Departure: a film damps the journal so strongly that its inertia is negligible. In the plant, too,
//! the journal drifts and displaces the tool by the offset. At the wall the journal slides without friction.

use freeplay_arm::Arm;
use nalgebra::Vector3;
use toml::Table;

use super::joint_clearance::{dry_courses, follow};
use crate::archive::Archive;
use crate::basis::{Term, with};
use crate::bearing_load::BearingLoad;
use crate::columns::Columns;
use crate::effect::{Effect, Start};
use crate::injection::{Injection, Readings, SensorLaw};
use crate::kind::{Kind, Occurrence, START, Seen, Terms};
use crate::lubrication::Film;
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};
use crate::play::across;
use crate::scene::Scene;
use crate::{Clearance, ClearanceTable};

/// Default bearing, m.
const RADIUS: f64 = 0.010;
const LENGTH: f64 = 0.040;
/// Name of the shape: C, N·s.
const RESISTANCE: &str = "resistance";
/// Assumed time of the journal under the first load, from the centre on, if no initial position is given, s.
const BEFORE: f64 = 10.0;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "lubricated_clearance",
    title: "radial play with a film of oil",
    words: "radial play of {clearance} filled with oil of {viscosity}",
    site: Site::Revolute,
    parameters: &[
        Parameter::number("clearance", "radial clearance c", "m", [1e-6, 0.01]),
        Parameter::number("viscosity", "dynamic viscosity of the oil", "Pa*s", [1e-9, 1e9]).shape(),
        Parameter::number("bearing_radius", "radius of the bearing", "m", [1e-4, 10.0]).or(RADIUS).given(),
        Parameter::number("bearing_length", "length of the bearing", "m", [1e-4, 10.0]).or(LENGTH).given(),
        Parameter::vector(
            START,
            "position of the journal at the start of a motion, joint frame, as a share of the clearance",
            "1",
        )
        .or_else(
            "the position that the first load reaches from the middle in 10 s, or the one that the tool of a recording shows",
        )
        .given(),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::POSE,
    rough: false,
    shakes: true,
    equation: "film force(e, ė, q̇) = b (long bearing, half Sommerfeld); the tool moves by J e",
    source: "Pinkus & Sternlicht 1961; Flores et al. 2006",
    signature: "the tool moves as with radial play, but smoothly, later than the force and less at speed",
    confounders: &[
        (
            "joint_clearance",
            "follows the direction of the force at once, and is the case of low viscosity",
        ),
        ("joint_elasticity", "grows with the load"),
        ("viscous_friction", "shows in the torque, not in the tool"),
    ],
    contains: &[("joint_clearance", "viscosity → 0")],
    needs: &[Need::Tool],
    terms: Terms {
        list: |kind, _, shape| {
            /// Every clearance has the same effect per metre.
            const STEP: f64 = 1e-4;
            vec![
                Term::new("clearance", "m", [1e-6, 0.01], (kind.terms.compose)(kind, shape, &[STEP]))
                    .stepped(STEP),
            ]
        },
        compose: |_, shape, coefficients| {
            let (clearance, resistance) =
                (coefficients[0], shape.get(RESISTANCE).and_then(toml::Value::as_float).unwrap_or(0.0));
            let viscosity = resistance * clearance.powi(2) / (LENGTH * RADIUS.powi(3));
            let start = shape.get(START).map(|start| (START.to_owned(), start.clone()));
            with(&start.into_iter().collect(), [("clearance", clearance), ("viscosity", viscosity)])
        },
    },
    shapes: resistances,
    build: |values| {
        let (clearance, radius) = (values.number("clearance")?, values.number("bearing_radius")?);
        let film =
            Film::new(values.number("viscosity")?, values.number("bearing_length")?, radius, clearance);
        let dry = ClearanceTable { bearing_radius: radius, ..ClearanceTable::new(clearance) };
        let dry = Clearance::new(&dry).map_err(|error| error.at(values.line()))?;
        let joint = values.joint()?;
        let [first, second] = across(&values.arm().joints()[joint].axis);
        let start = values.optional_vector(START)?.map(Vector3::from);
        if let Some([x, y, z]) = start.filter(|start| start.norm() > 1.0).map(<[f64; 3]>::from) {
            let message = format!(
                "`{START}` = [{x}, {y}, {z}] must be at most 1 long: the journal is inside its bearing"
            );
            return Err(values.unreadable(message));
        }
        let start = start.map(|start| [start.dot(&first), start.dot(&second)]);
        Ok(Box::new(LubricatedClearance { arm: values.arm().clone(), joint, film, dry, start }))
    },
};

/// C for which the weight beyond the joint squeezes the film in a fiftieth of a second to 50 s.
fn resistances(place: &Place) -> Vec<Table> {
    let arm = &place.scene.arm;
    let beyond = &arm.joints()[place.joint.unwrap_or(0)..];
    let weight = beyond.iter().map(|joint| joint.inertia.mass).sum::<f64>() * arm.gravity().norm();
    let per_time = weight.max(1.0) / (12.0 * std::f64::consts::PI);
    [0.02, 0.1, 0.5, 2.0, 10.0, 50.0].map(|time| with(&Table::new(), [(RESISTANCE, per_time * time)])).into()
}

#[derive(Clone, Debug)]
struct LubricatedClearance {
    arm: Arm,
    joint: usize,
    film: Film,
    /// The same bearing without oil, for the arm with play.
    dry: Clearance,
    /// Initial position of the journal, along the two slides, as a share of the clearance; `None`: settled.
    start: Option<[f64; 2]>,
}

impl LubricatedClearance {
    /// Initial position of the journal under its first `force` while turning at `turning`, m.
    fn first(&self, force: [f64; 2], turning: f64) -> [f64; 2] {
        let settled = || self.film.carried([0.0; 2], force, turning, BEFORE);
        self.start.map_or_else(settled, |start| start.map(|share| share * self.film.clearance))
    }
}

impl Effect for LubricatedClearance {
    fn displace(&self, scene: &Scene, tool: &mut Columns) {
        let mut offset = [0.0; 2];
        follow(scene, self.joint, |bearing, at| {
            // Across missing samples the journal has moved on by an unknown distance.
            offset = match (at.point, at.begins) {
                (0, _) => self.first(at.force, at.turning),
                (_, true) => offset,
                (_, false) => self.film.carried(offset, at.force, at.turning, at.step),
            };
            bearing.carry(at.point, offset, tool);
        });
    }

    fn with_initial_state(&self, start: Start) -> Option<Box<dyn Effect>> {
        let Start::Within(start) = start else { return None };
        let begun = || -> Box<dyn Effect> { Box::new(Self { start: Some(start), ..self.clone() }) };
        self.start.is_none().then(begun)
    }

    /// Forces missing from the recorded motion squeeze a thin film out. The journal then moves as in a dry bearing.
    fn courses(&self) -> Vec<Box<dyn Effect>> {
        dry_courses(self.joint, self.dry)
    }

    fn inject(&self, injection: &mut Injection) {
        if let Ok(bearing) = BearingLoad::new(&self.arm, self.joint, self.dry) {
            injection.films.push(self.joint);
            injection.tool.push(Box::new(Afloat { law: self.clone(), bearing, place: None }));
        }
    }
}

/// The journal in the film of a plant.
#[derive(Clone, Debug)]
struct Afloat {
    law: LubricatedClearance,
    bearing: BearingLoad,
    /// The journal's position, after the first reading.
    place: Option<[f64; 2]>,
}

impl SensorLaw for Afloat {
    fn read(&mut self, readings: &mut Readings) {
        let [q, v, a] = &mut self.bearing.motion;
        for (joint, now) in readings.v.iter().enumerate() {
            a[joint] = if self.place.is_some() { (now - v[joint]) / readings.period } else { 0.0 };
        }
        q.copy_from_slice(readings.q);
        v.copy_from_slice(readings.v);
        let (force, turning) = (self.bearing.force(), self.bearing.turning());
        let place = match self.place {
            Some(place) => self.law.film.carried(place, force, turning, readings.period),
            None => self.law.first(force, turning),
        };
        self.place = Some(place);
        let moved = self.bearing.moved(place);
        readings.tool.iter_mut().zip(moved.iter()).for_each(|(tool, moved)| *tool += moved);
    }

    fn restart(&mut self) {
        self.place = None;
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        let (mut begun, mut place) = (self.place.is_some(), self.place.unwrap_or_default());
        archive.flag(&mut begun);
        archive.reals(&mut place);
        self.place = begun.then_some(place);
        let [_, velocity, _] = &mut self.bearing.motion;
        archive.reals(velocity);
    }
}
