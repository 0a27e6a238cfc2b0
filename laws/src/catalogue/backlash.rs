//! Backlash: the gap between the flanks of a gear.
//!
//! Law: motor and link move relative to each other within the gap j \[rad\]; where the flanks touch, the stiffness k \[N·m/rad\] carries
//! the transmitted torque τ_L \[N·m\]. In a recording the link rests on the flank to which the load presses it, and flies to the other when
//! the load changes sign: q_link = q − τ_L/k − p, with τ_L from the *model* and −j/2 ≤ p ≤ j/2 from [`Flight`], which also gives the torque
//! missing during the flight. A file without stiffness means rigid flanks. Flanks that bounce, as in fast shaking, may not follow this
//! course: with `course = "rest"` the link changes flanks at once. Terms, at rest or for the flight through a given gap: j, 1/k.
//!
//! Friction F \[N·m\] *behind* the gap holds the link while the motor crosses it. The drive then spends F p: p is 0 while the motor has
//! moved less than j since the reversal, then grows over the elastic deflection F/k of the flanks, and is ±1 beyond (Prandtl 1928; with
//! rigid flanks it jumps). This holds where F is greater than the load behind it; the link lags by the crossing. Friction and flanks may
//! differ by direction: F₊, k₊ and F₋, k₋. Terms for a given gap and deflections F₊/k₊, F₋/k₋: F₊, F₋.
//! The motion does not determine the initial position of the motor between its stops: it is a state, not a property. The parameter `start`
//! takes it from the measured torque, until the motor first crosses the whole gap.
//! Source: Nordin & Gutman 2002, Automatica 38:1633 (dead zone); Tao & Kokotović 1996, Adaptive Control of Systems with Actuator and
//! Sensor Nonlinearities, §2.3 (play). Departure: only the plant simulates the bouncing of flanks.

use std::f64::consts::TAU;

use freeplay_arm::{Arm, Workspace, crba};
use freeplay_model::export::Element;
use nalgebra::DMatrix;
use toml::{Table, Value};

use crate::archive::Archive;
use crate::basis::{Term, with};
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage, Start};
use crate::flight::Flight;
use crate::injection::{DriveLaw, DriveState, Injection, Transmission};
use crate::kind::{Kind, Occurrence, START, Seen, Terms};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::{Place, Site};
use crate::prediction::Change;
use crate::scene::Scene;

/// Frequency of a link on flanks that the plant treats as rigid, Hz: above every motion of an arm, and slow enough for the sub-steps.
const RIGID_HZ: f64 = 100.0;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "backlash",
    title: "backlash of the gear",
    words: "a gap of {gap} in the gear",
    site: Site::Joint,
    parameters: &[
        Parameter::number("gap", "whole angle between the flanks", "rad", [0.0, 1.0]).prismatic("m"),
        Parameter::number("stiffness", "torque per angle with the flanks in touch", "N*m/rad", [1.0, 1e12])
            .prismatic("N/m")
            .or_else("rigid flanks"),
        Parameter::number("damping", "torque per speed with the flanks in touch", "N*m*s/rad", [0.0, 1e9])
            .prismatic("N*s/m")
            .or(0.0)
            .given(),
        Parameter::number(
            "friction",
            "Coulomb friction behind the gap, extra to the nominal",
            "N*m",
            [0.0, 1e6],
        )
        .prismatic("N")
        .or(0.0),
        Parameter::number("friction_negative", "Coulomb friction behind the gap for negative velocity", "N*m", [0.0, 1e6])
            .prismatic("N")
            .or_else("the value for positive velocity"),
        Parameter::number(
            "stiffness_negative",
            "stiffness of the flank that carries negative torque, with friction behind the gap",
            "N*m/rad",
            [1.0, 1e12],
        )
        .prismatic("N/m")
        .or_else("the value of the other flank"),
        Parameter::number(
            START,
            "position of the motor between its stops at the start of a motion, with friction behind the gap: −1 back, 1 forward",
            "1",
            [-1.0, 1.0],
        )
        .or_else("the middle, or the position that the torque of a recording shows")
        .given(),
        Parameter {
            name: COURSE,
            meaning: "transition of a recording's link from flank to flank without friction behind the gap; in the plant, the link flies",
            range: Range::Word(&["flight", "rest"]),
        },
    ],
    occurs: Occurrence::Occasional,
    tolerance: None,
    seen: Seen::BOTH,
    rough: true,
    shakes: true,
    equation: "q_link = q − τ_L/k − p, p = (j/2) sign(τ_L) at rest, M p'' = τ_L between the flanks; friction behind the gap: τ = F p, p = 0 while the motor crosses it",
    source: "Nordin & Gutman 2002; Tao & Kokotović 1996, §2.3",
    signature: "the link crosses the gap where the transmitted torque changes its sign; torque is missing during the crossing, or after each reversal",
    confounders: &[
        ("joint_elasticity", "is proportional to the load, and is the case without a gap: test the gap nested"),
        ("joint_clearance", "moves across the axis, in two dimensions"),
        ("coulomb_friction", "flips with the velocity at once, not after a travel"),
        ("presliding_friction", "builds up over the travel without a force-free part"),
    ],
    contains: &[
        ("joint_elasticity", "gap = 0"),
        ("coulomb_friction", "gap = 0, with friction behind it"),
        ("asymmetric_friction", "gap = 0, with friction behind it that differs by direction"),
    ],
    needs: &[Need::TorqueOrPose, Need::Motion, Need::Reversals(1)],
    terms: Terms { list: terms, compose },
    shapes,
    build: |values| {
        let (joint, stiffness) = (values.joint()?, values.optional("stiffness")?);
        let negative = values.optional("stiffness_negative")?.or(stiffness);
        let start = values.optional(START)?;
        Ok(Box::new(Backlash {
            joint,
            gap: values.number("gap")?,
            compliance: [negative, stiffness].map(|stiffness| stiffness.map_or(0.0, |stiffness| 1.0 / stiffness)),
            start: start.unwrap_or(0.0),
            is_begun: start.is_some(),
            plant_stiffness: stiffness.unwrap_or_else(|| rigid(values.arm(), joint)),
            damping: values.number("damping")?,
            flies: values.word(COURSE)? == "flight",
            friction: [
                values.optional("friction_negative")?.unwrap_or(values.number("friction")?),
                values.number("friction")?,
            ],
        }))
    },
};

/// Names of a shape's entries: the elastic deflections of the flanks under the friction.
const YIELD: &str = "yield";
const YIELD_NEGATIVE: &str = "yield_negative";

/// The parameter that selects the course of a link from flank to flank.
const COURSE: &str = "course";
/// Name of another shape's entry: the gap through which the link flies.
const FLIGHT: &str = "flight";

/// A gap wider than this, rad (m), is no play of a gear.
const WIDEST: f64 = 0.1;
/// The narrowest gap of the search, rad (m), and the factor from one gap to the next.
const NARROWEST: f64 = 2e-5;
const WIDER: f64 = 2.0;

/// Gaps with friction behind them, from 1/200 to a third of the joint's travel, with rigid and with soft flanks; gaps with a flight; and
/// one with rest on either side.
fn shapes(place: &Place) -> Vec<Table> {
    let (Some(joint), motion) = (place.joint, place.scene.motion) else { return Vec::new() };
    let (least, most) = motion.q[joint].iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
    let way = (most - least).max(0.0);
    let gaps = std::iter::successors(Some(way / 200.0), |gap| Some(1.4 * gap))
        .take_while(|gap| 3.0 * gap < way && *gap < WIDEST);
    let mut shapes = Vec::new();
    if way > 0.0 {
        let soft = |gap: f64| {
            [0.0, 0.3, 0.7, 1.5].map(|share| {
                let give = share * gap;
                with(&Table::new(), [("gap", gap), (YIELD, give), (YIELD_NEGATIVE, give), (START, 0.0)])
            })
        };
        shapes.extend(gaps.flat_map(soft));
    }
    let flights =
        std::iter::successors(Some(NARROWEST), |gap| Some(WIDER * gap)).take_while(|gap| *gap < WIDEST);
    shapes.extend(flights.map(|gap| with(&Table::new(), [(FLIGHT, gap)])));
    shapes.push(Table::from_iter([(COURSE.to_owned(), Value::from("rest"))]));
    shapes
}

fn terms(kind: &Kind, place: &Place, shape: &Table) -> Vec<Term> {
    let unit = |name| kind.unit(name, place.joint());
    if shape.contains_key("gap") {
        /// Half of that acts in both directions in either case and cancels, so that both cases have friction.
        const STEP: f64 = 100.0;
        // A wider gap or softer flanks do not belong to a gear.
        let is_wide = |name: &str| shape.get(name).and_then(Value::as_float).is_some_and(|way| way > WIDEST);
        if ["gap", YIELD, YIELD_NEGATIVE].into_iter().any(is_wide) {
            return Vec::new();
        }
        let of = |[positive, negative]: [f64; 2]| sliding(shape, positive * STEP, negative * STEP);
        let term = |(name, plus): (&'static str, [f64; 2])| {
            Term::new(name, unit(name), [0.0, 1e6], of(plus)).less(of([1.0; 2])).stepped(STEP)
        };
        return [("friction", [2.0, 1.0]), ("friction_negative", [1.0, 2.0])].map(term).into();
    }
    /// Small enough for angles to act linearly.
    const STEP: f64 = 1e-5;
    let compliance = format!("1/({})", unit("stiffness"));
    let soft = with(&Table::new(), [("gap", 0.0), ("stiffness", 1.0 / COMPLIANCE)]);
    let flight = shape.get(FLIGHT).and_then(Value::as_float);
    // A flight through another gap follows another course.
    let range = flight.map_or([0.0, WIDEST], |gap| [gap / WIDER, gap * WIDER]);
    let gap = flight.unwrap_or(STEP);
    vec![
        Term::new("gap", unit("gap"), range, gap_of(shape, gap)).stepped(gap),
        Term::new("compliance", compliance, [0.0, 1.0], soft).stepped(COMPLIANCE).clamped(),
    ]
}

/// A compliance whose deflection is small, rad/(N·m).
const COMPLIANCE: f64 = 1e-8;

fn compose(_: &Kind, shape: &Table, coefficients: &[f64]) -> Table {
    if shape.contains_key("gap") {
        return sliding(shape, coefficients[0], coefficients[1]);
    }
    let mut table = gap_of(shape, coefficients[0]);
    if coefficients[1] > 1e-12 {
        table.insert("stiffness".to_owned(), Value::Float(1.0 / coefficients[1]));
    }
    table
}

/// A gap without friction behind it, with the course of `shape`.
fn gap_of(shape: &Table, gap: f64) -> Table {
    let course = shape.get_key_value(COURSE).map(|(name, course)| (name.clone(), course.clone()));
    with(&Table::from_iter(course), [("gap", gap)])
}

/// Friction behind the gap of `shape`; the deflections in `shape` give the stiffness of the flanks.
fn sliding(shape: &Table, positive: f64, negative: f64) -> Table {
    let number = |name: &str| shape.get(name).and_then(Value::as_float).unwrap_or(0.0);
    let mut table = with(
        &Table::new(),
        [("gap", number("gap")), ("friction", positive), ("friction_negative", negative)],
    );
    let flanks = [("stiffness", positive, YIELD), ("stiffness_negative", negative, YIELD_NEGATIVE)];
    for (name, friction, give) in flanks.map(|(name, friction, give)| (name, friction, number(give))) {
        if give > 0.0 {
            table.insert(name.to_owned(), Value::Float((friction / give).clamp(1.0, 1e12)));
        }
    }
    if number(START) != 0.0 {
        table.insert(START.to_owned(), Value::Float(number(START)));
    }
    table
}

#[derive(Clone, Copy, Debug)]
struct Backlash {
    joint: usize,
    gap: f64,
    /// Compliance of the flank for negative and of the flank for positive torque, rad/(N·m).
    compliance: [f64; 2],
    damping: f64,
    /// Initial position, −1 to 1, and whether a file gives it.
    start: f64,
    is_begun: bool,
    /// True if the link takes time from flank to flank.
    flies: bool,
    /// Friction behind the gap for negative and for positive velocity.
    friction: [f64; 2],
    /// Stiffness in the plant, N·m/rad.
    plant_stiffness: f64,
}

/// The stiffness on which the inertia beyond `joint`, at the largest of a few poses, oscillates at [`RIGID_HZ`].
fn rigid(arm: &Arm, joint: usize) -> f64 {
    let (mut ws, mut mass) = (Workspace::new(arm), DMatrix::zeros(arm.dof(), arm.dof()));
    let inertia = (0..3).fold(0.0_f64, |most, pose| {
        let q: Vec<f64> = (0..arm.dof()).map(|i| (1.3 * (i * pose) as f64).sin()).collect();
        crba(arm, &mut ws, &q, &mut mass);
        most.max(mass[(joint, joint)])
    });
    inertia * (TAU * RIGID_HZ).powi(2)
}

impl Backlash {
    /// The play at the start of a motion.
    fn play(&self) -> Play {
        let give = [0, 1].map(|side| self.friction[side] * self.compliance[side]);
        let mut play = Play { gap: self.gap, give, place: 0.0 };
        play.place = self.start * play.reach(self.start);
        play
    }

    /// The deflection of the flanks under `load`, rad.
    fn give(&self, load: f64) -> f64 {
        load * self.compliance[usize::from(load > 0.0)]
    }

    /// True if there is friction behind the gap.
    fn slides(&self) -> bool {
        self.friction.iter().any(|friction| *friction > 0.0)
    }

    /// Calls `tell` for each point of the motion with its number, the flight there, and the mean torque beyond the load since the previous
    /// point.
    fn fly(&self, scene: &Scene, mut tell: impl FnMut(usize, &Flight, f64)) {
        if self.gap == 0.0 {
            return;
        }
        let (loads, inertia) = (&scene.load[self.joint], &scene.inertia()[self.joint]);
        for stretch in &scene.motion.stretches {
            let step = scene.motion.step(stretch);
            let mut flight = Flight::resting(self.gap, loads[stretch.start]);
            for point in stretch.clone() {
                let extra = match point > stretch.start {
                    true => flight.advance([loads[point - 1], loads[point]], inertia[point], step),
                    false => 0.0,
                };
                tell(point, &flight, extra);
            }
        }
    }

    /// Shifts the link by the motor's `places` in the gap, and by the deflection of the flanks under the load.
    fn shift_to(&self, scene: &Scene, places: &[f64], shift: &mut Columns) {
        let loads = &scene.load[self.joint];
        for ((shift, load), place) in shift[self.joint].iter_mut().zip(loads).zip(places) {
            // The place behind friction includes the deflection by that friction.
            *shift -= self.give(*load) + place;
        }
    }

    /// Adds the friction behind the gap that the flanks carry at the motor's `places`.
    fn slide_through(&self, scene: &Scene, places: &[f64], torque: &mut Columns) {
        let play = self.play();
        let v = &scene.motion.v[self.joint];
        for ((torque, place), v) in torque[self.joint].iter_mut().zip(places).zip(v) {
            *torque += of_friction(self.friction, play.flank(*place, *v));
        }
    }

    /// Position of the motor in the gap at each point if friction holds the link.
    fn crossings(&self, scene: &Scene) -> Vec<f64> {
        let q = &scene.motion.q[self.joint];
        let mut places = vec![0.0; q.len()];
        for stretch in &scene.motion.stretches {
            // The past is unknown; the first crossing of the gap removes its effect.
            let mut play = self.play();
            for point in stretch.clone() {
                let moved = if point > stretch.start { q[point] - q[point - 1] } else { 0.0 };
                places[point] = play.cross(moved);
            }
        }
        places
    }
}

/// The play operator.
#[derive(Clone, Copy, Debug)]
struct Play {
    gap: f64,
    /// Deflection of the rear and of the front flank until the link slides, rad.
    give: [f64; 2],
    /// Motor minus link, rad.
    place: f64,
}

impl Play {
    /// Greatest distance between motor and link towards `side`.
    fn reach(&self, side: f64) -> f64 {
        0.5 * self.gap + self.give[usize::from(side > 0.0)]
    }

    /// Moves the motor; returns its new position in the gap.
    fn cross(&mut self, moved: f64) -> f64 {
        self.place = (self.place + moved).clamp(-self.reach(-1.0), self.reach(1.0));
        self.place
    }

    /// Share of the friction that the touching flank at `place` carries, −1 to 1.
    fn flank(&self, place: f64, v: f64) -> f64 {
        if self.reach(v) <= 0.0 {
            return if v == 0.0 { 0.0 } else { v.signum() };
        }
        let (pressed, give) = (place.abs() - 0.5 * self.gap, self.give[usize::from(place > 0.0)]);
        if give > 0.0 {
            return place.signum() * (pressed / give).clamp(0.0, 1.0);
        }
        if pressed < -1e-9 * self.gap { 0.0 } else { place.signum() }
    }
}

/// The friction for the `share`, −1 to 1.
fn of_friction(friction: [f64; 2], share: f64) -> f64 {
    share * if share < 0.0 { friction[0] } else { friction[1] }
}

impl Effect for Backlash {
    fn shift(&self, scene: &Scene, shift: &mut Columns) {
        let loads = &scene.load[self.joint];
        let places = if self.slides() {
            self.crossings(scene)
        } else if self.flies {
            let mut places = vec![0.0; loads.len()];
            self.fly(scene, |point, flight, _| places[point] = flight.place());
            places
        } else {
            loads.iter().map(|&load| Flight::resting(self.gap, load).place()).collect()
        };
        self.shift_to(scene, &places, shift);
    }

    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        if self.slides() {
            self.slide_through(scene, &self.crossings(scene), torque);
        } else if self.flies {
            let torque = &mut torque[self.joint];
            self.fly(scene, |point, _, extra| torque[point] += extra);
        }
    }

    fn apply(&self, scene: &Scene, change: &mut Change) {
        if self.slides() {
            let places = self.crossings(scene);
            self.shift_to(scene, &places, &mut change.link);
            return self.slide_through(scene, &places, &mut change.torque);
        }
        if !self.flies {
            return self.shift(scene, &mut change.link);
        }
        let (shift, torque) = (&mut change.link[self.joint], &mut change.torque[self.joint]);
        shift.iter_mut().zip(&scene.load[self.joint]).for_each(|(shift, load)| *shift -= self.give(*load));
        self.fly(scene, |point, flight, extra| {
            shift[point] -= flight.place();
            torque[point] += extra;
        });
    }

    fn with_initial_state(&self, start: Start) -> Option<Box<dyn Effect>> {
        let Start::Between(start) = start else { return None };
        let begun = || -> Box<dyn Effect> { Box::new(Backlash { start, ..*self }) };
        (self.slides() && !self.is_begun).then(begun)
    }

    fn inject(&self, injection: &mut Injection) {
        let (stiffness, damping, gap) = (self.plant_stiffness, self.damping, self.gap);
        injection.transmissions.push((self.joint, Transmission { stiffness, damping, gap }));
        if self.slides() {
            let play = self.play();
            injection.drives.push(Box::new(FrictionBehind {
                joint: self.joint,
                friction: self.friction,
                play,
                start: play.place,
            }));
        }
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        let friction = 0.5 * (self.friction[0] + self.friction[1]);
        let joint = self.joint;
        // The export uses the mean compliance of the two flanks.
        let compliance = 0.5 * (self.compliance[0] + self.compliance[1]);
        if self.gap == 0.0 && compliance == 0.0 {
            elements.push(Element::DryFriction { joint, level: friction });
        } else {
            let stiffness = (compliance > 0.0).then(|| 1.0 / compliance);
            elements.push(Element::Gear { joint, stiffness, damping: self.damping, gap: self.gap, friction });
        }
        let differ = |pair: [f64; 2]| pair[0] != pair[1];
        match differ(self.friction) || differ(self.compliance) {
            true => ExportCoverage::But(
                "the difference of friction or stiffness between the directions (the file contains their mean)",
            ),
            false => ExportCoverage::Whole,
        }
    }
}

/// The friction behind the gap, on the motor's side.
#[derive(Clone, Copy, Debug)]
struct FrictionBehind {
    joint: usize,
    friction: [f64; 2],
    play: Play,
    /// Initial position of the play, rad.
    start: f64,
}

impl DriveLaw for FrictionBehind {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        let place = self.play.cross(now.v[self.joint] * now.step);
        torque[self.joint] -= of_friction(self.friction, self.play.flank(place, now.v[self.joint]));
    }

    fn restart(&mut self) {
        self.play.place = self.start;
    }

    fn transfer_state(&mut self, archive: &mut Archive) {
        archive.real(&mut self.play.place);
    }
}
