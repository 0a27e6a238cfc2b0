//! A load that the arm drops, or picks up, during the motion.
//!
//! Law: from a time t₀ \[s\] on a point mass m \[kg\] at the tool's origin joins the last link, with its weight and inertia on all joints
//! before it; a lost load has negative mass. A load that the model lacks and that is lost at t₀ acts `before` it. Term: m. Shapes: t₀,
//! side. Source: Khalil & Dombre 2002, Modeling, Identification and Control of Robots, §9 (the torque is linear in m). Departure: the law
//! assumes the load's centre at the tool, and a change without impact.

use freeplay_arm::{Arm, Workspace, rnea};
use toml::{Table, Value};

use crate::archive::Archive;
use crate::basis::{Term, with};
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::{Place, Site};
use crate::scene::{Scene, loaded};

/// The side of the time on which the load acts.
const SIDES: &[&str] = &["after", "before"];

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "load_change",
    title: "a load that is lost or taken up",
    words: "a load of {mass} that acts {acts} {time}",
    site: Site::Arm,
    parameters: &[
        Parameter::number("mass", "mass added at the tool; negative: mass lost", "kg", [-1e4, 1e4]),
        Parameter::number("time", "time of the change", "s", [-1e12, 1e12]).shape(),
        Parameter {
            name: "acts",
            meaning: "side of that time on which the mass acts",
            range: Range::Word(SIDES),
        },
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "m at the tool for t ≥ t₀, or up to t₀: gravity and inertia on all joints before it",
    source: "Khalil & Dombre 2002, §9",
    signature: "from a certain time on, gravity and inertia of one body deviate on all joints",
    confounders: &[
        ("external_force", "keeps its direction while the tool moves, and ends"),
        ("payload", "acts from the beginning"),
        ("friction_drift", "changes slowly, and its sign follows the velocity"),
    ],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms { list: terms, compose: |_, shape, coefficients| with(shape, [("mass", coefficients[0])]) },
    shapes: times,
    build: |values| {
        let (mass, time, arm) = (values.number("mass")?, values.number("time")?, values.arm());
        let is_after = values.word("acts")? == SIDES[0];
        // The torque is linear in the mass: a possible arm represents a loss, too.
        Ok(Box::new(LoadChange { mass, time, is_after, arms: [arm.clone(), loaded(arm, 1.0)?] }))
    },
};

fn terms(_: &Kind, place: &Place, shape: &Table) -> Vec<Term> {
    let carried = place.scene.arm.joints().last().map_or(0.0, |joint| joint.inertia.mass);
    vec![Term::new("mass", "kg", [-carried, 1e4], with(shape, [("mass", 1.0)]))]
}

/// Every sixteenth of the recording without its ends, from then on and up to then.
fn times(place: &Place) -> Vec<Table> {
    const PARTS: u32 = 16;
    let t = &place.scene.motion.t;
    let (Some(first), Some(last)) = (t.first(), t.last()) else { return Vec::new() };
    let time = |part: u32| first + (last - first) * f64::from(part) / f64::from(PARTS);
    let shape = |part: u32, side: &str| {
        let mut shape = with(&Table::new(), [("time", time(part))]);
        shape.insert("acts".to_owned(), Value::from(side));
        shape
    };
    SIDES.iter().flat_map(|side| (1..PARTS).map(move |part| shape(part, side))).collect()
}

#[derive(Clone, Debug)]
struct LoadChange {
    mass: f64,
    time: f64,
    is_after: bool,
    /// Without the load, and with 1 kg.
    arms: [Arm; 2],
}

impl LoadChange {
    /// True if the load acts at the time `t`.
    fn acts(&self, t: f64) -> bool {
        (t >= self.time) == self.is_after
    }
}

impl Effect for LoadChange {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let Ok(carrying) = scene.carrying() else { return };
        let (start, end) =
            if self.is_after { (self.time, f64::INFINITY) } else { (f64::NEG_INFINITY, self.time) };
        let shares = scene.motion.acting(start, end);
        for (joint, carrying) in carrying.iter().enumerate() {
            for ((torque, carrying), share) in torque[joint].iter_mut().zip(carrying).zip(&shares) {
                *torque += self.mass * carrying * share;
            }
        }
    }

    fn inject(&self, injection: &mut Injection) {
        let side = |arm: &Arm| Side { workspace: Workspace::new(arm), torque: vec![0.0; arm.dof()] };
        injection
            .drives
            .push(Box::new(Carried { sides: [0, 1].map(|k| side(&self.arms[k])), of: self.clone() }));
    }
}

/// An arm's torques at an instant.
#[derive(Clone, Debug)]
struct Side {
    workspace: Workspace,
    torque: Vec<f64>,
}

/// The load on the drives.
#[derive(Clone, Debug)]
struct Carried {
    of: LoadChange,
    sides: [Side; 2],
}

impl DriveLaw for Carried {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        if !self.of.acts(now.t) {
            return;
        }
        for (side, arm) in self.sides.iter_mut().zip(&self.of.arms) {
            rnea(arm, &mut side.workspace, now.q, now.v, now.a, &mut side.torque);
        }
        let [without, with] = &self.sides;
        for (torque, (without, with)) in torque.iter_mut().zip(without.torque.iter().zip(&with.torque)) {
            *torque -= self.of.mass * (with - without);
        }
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}
