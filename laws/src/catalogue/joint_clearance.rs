//! Radial play of a revolute joint: the journal moves in its bearing perpendicular to the axis.
//!
//! Law: contact by Lankarani & Nikravesh in the plane perpendicular to the axis, see [`Clearance`]. In a recording the bearing force b
//! presses the journal to a rest position, turned by its friction, see [`crate::settle`]: about d = (c + (|b|/K)^(2/3)) n with n along −b.
//! The tool is displaced by J d, and the drives carry an arm displaced by d. Journal displacements are tiny against the arm, so that those
//! of several joints add. Where the force reverses, as it does across vertical axes, a journal needs time to reach the other side: `course
//! = "flight"` simulates this, see [`JournalFlight`]. Only the plant simulates bounces, the drives' reaction to them, and the moment of
//! friction (μ R_j |b|, some mN·m).
//! Terms, at rest or for the flight through a given clearance: c.
//! Source: Erkaya 2018, Eqs. 1–7; Flores et al. 2006, Mech. Mach. Theory 41:247.

use freeplay_model::export::Element;
use toml::{Table, Value};

use crate::basis::{Term, with};
use crate::bearing_course::BearingCourse;
use crate::columns::Columns;
use crate::effect::{Effect, ExportCoverage};
use crate::injection::Injection;
use crate::journal_flight::JournalFlight;
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::place::{Place, Site};
use crate::prediction::Change;
use crate::scene::Scene;
use crate::{Clearance, ClearanceTable, Rest, settle};

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: Clearance::KIND,
    title: "radial play",
    words: "radial play of {clearance}",
    site: Site::Revolute,
    parameters: &[
        Parameter::number("clearance", "radial clearance c, less than the bearing radius", "m", [0.0, 1.0]),
        Parameter::number("stiffness", "contact stiffness K", "N/m^1.5", [1e3, 1e15])
            .or_else("by Hertz, from radii and material")
            .given(),
        Parameter::number("restitution", "coefficient of restitution", "1", [1e-3, 1.0]).or(0.9).given(),
        Parameter::number("friction", "dynamic coefficient of friction", "1", [0.0, 1.0]).or(0.01).given(),
        Parameter::number("static_friction", "static coefficient of friction", "1", [0.0, 1.0])
            .or_else("the dynamic coefficient")
            .given(),
        Parameter::number("static_speed", "sliding speed of the static friction", "m/s", [1e-9, 1e3])
            .or(1e-3)
            .given(),
        Parameter::number("dynamic_speed", "sliding speed of the dynamic friction", "m/s", [1e-9, 1e3])
            .or(1e-2)
            .given(),
        Parameter::number("impact_speed_floor", "least impact speed of the contact law", "m/s", [1e-12, 1e3])
            .or(1e-3)
            .given(),
        Parameter::number("bearing_radius", "radius of the bearing", "m", [1e-6, 10.0]).or(0.010).given(),
        Parameter {
            name: "normal_law",
            meaning: "law of dissipation in the contact",
            range: Range::Word(&[
                "lankarani-nikravesh",
                "hunt-crossley",
                "hu-guo",
                "flores",
                "gonthier",
                "herbert-mcwhannell",
                "lee-wang",
            ]),
        },
        Parameter {
            name: "friction_law",
            meaning: "law of friction over the sliding speed",
            range: Range::Word(&["corrected", "ambrosio", "threlfall", "printed"]),
        },
        Parameter {
            name: COURSE,
            meaning: "motion of a recording's journal at a reversal of the force: at once, or in flight; in the plant, the journal flies and bounces",
            range: Range::Word(&["rest", "flight"]),
        },
        Parameter { name: "material", meaning: "Young's modulus and Poisson's ratio", range: Range::Table },
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::BOTH,
    rough: false,
    shakes: true,
    equation: "d = (c + (|b|/K)^(2/3)) n, n along the pin force −b across the axis; the tool moves by J d",
    source: "Erkaya 2018, Eqs. 1–7; Lankarani & Nikravesh 1990",
    signature: "the tool deviates by up to c, in the direction of the reaction force in the joint's plane",
    confounders: &[
        ("backlash", "has one dimension and follows the transmitted torque"),
        ("joint_elasticity", "grows with the load"),
        ("lubricated_clearance", "is smooth and depends on the speed"),
        ("link_length", "turns with the link, not with the force"),
    ],
    contains: &[],
    needs: &[Need::Tool],
    terms: Terms {
        list: |_, _, shape| {
            /// At these clearances the penetration, some µm that grow with the cube root of c, is nearly the same and cancels.
            const STEP: f64 = 2e-4;
            if let Some(clearance) = shape.get(FLIGHT).and_then(Value::as_float) {
                // A flight through another clearance follows another course.
                let range = [clearance / WIDER, (clearance * WIDER).min(WIDEST)];
                return vec![Term::new("clearance", "m", range, flying(clearance)).stepped(clearance)];
            }
            let at = |clearance| with(shape, [("clearance", clearance)]);
            vec![Term::new("clearance", "m", [0.0, WIDEST], at(2.0 * STEP)).less(at(STEP)).stepped(STEP)]
        },
        compose: |_, shape, coefficients| {
            if shape.contains_key(FLIGHT) {
                return flying(coefficients[0]);
            }
            with(shape, [("clearance", coefficients[0])])
        },
    },
    shapes,
    build: |values| {
        let table: ClearanceTable = values.table_but(COURSE)?;
        let clearance = Clearance::new(&table).map_err(|error| error.at(values.line()))?;
        let flies = values.word(COURSE)? == "flight";
        let bounce = flies.then_some(0.0);
        Ok(Box::new(JointClearance { joint: values.joint()?, clearance, bounce }))
    },
};

/// The parameter that selects the course of a journal where the force reverses.
const COURSE: &str = "course";
/// Name of a shape's entry: the clearance through which the journal flies.
const FLIGHT: &str = "flight";
/// The widest clearance of the search, m.
const WIDEST: f64 = 0.01;
/// The narrowest clearance of the search for a flight, m, and the factor from one to the next.
const NARROWEST: f64 = 5e-5;
const WIDER: f64 = 2.0;

/// Possible courses of the journal of `joint` in a bearing without oil: at rest, and in flight with restitutions from 0 to that of the
/// paper. A recorded motion does not predict when bouncing ends.
pub(super) fn dry_courses(joint: usize, clearance: Clearance) -> Vec<Box<dyn Effect>> {
    let all = [None, Some(0.0), Some(0.3), Some(0.6), Some(0.9)].into_iter();
    all.map(|bounce| -> Box<dyn Effect> { Box::new(JointClearance { joint, clearance, bounce }) }).collect()
}

/// A journal at rest, and journals that fly through their clearances.
fn shapes(_: &Place) -> Vec<Table> {
    let clearances = std::iter::successors(Some(NARROWEST), |c| Some(WIDER * c)).take_while(|c| *c < WIDEST);
    let flights = clearances.map(|clearance| with(&Table::new(), [(FLIGHT, clearance)]));
    std::iter::once(Table::new()).chain(flights).collect()
}

/// A journal that flies through `clearance`, m.
fn flying(clearance: f64) -> Table {
    let course = Table::from_iter([(COURSE.to_owned(), Value::from("flight"))]);
    with(&course, [("clearance", clearance)])
}

#[derive(Clone, Copy, Debug)]
struct JointClearance {
    joint: usize,
    clearance: Clearance,
    /// The restitution of a journal in flight at the wall; `None` for a journal that is always at its rest position.
    bounce: Option<f64>,
}

impl JointClearance {
    /// Calls `tell` with the journal's position at each point, m along the two slides.
    fn go(&self, scene: &Scene, mut tell: impl FnMut(&BearingCourse, usize, [f64; 2])) {
        let Some(bounce) = self.bounce else {
            let mut last = Rest::default();
            return follow(scene, self.joint, |bearing, at| {
                let before = if at.begins { Rest::default() } else { last };
                last = settle(&self.clearance, at.force, at.turning, &before, at.step);
                tell(bearing, at.point, last.displacement);
            });
        };
        let mut last: Option<(JournalFlight, [f64; 2])> = None;
        follow(scene, self.joint, |bearing, at| {
            let flight = match last {
                Some((mut flight, from)) if !at.begins => {
                    flight.advance([from, at.force], at.turning, at.step);
                    flight
                }
                _ => JournalFlight::resting(self.clearance, bearing.mass, at.force).bouncing(bounce),
            };
            last = Some((flight, at.force));
            tell(bearing, at.point, flight.place());
        });
    }
}

impl Effect for JointClearance {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        self.go(scene, |bearing, point, place| bearing.burden(point, place, torque));
    }

    fn displace(&self, scene: &Scene, tool: &mut Columns) {
        self.go(scene, |bearing, point, place| bearing.carry(point, place, tool));
    }

    fn apply(&self, scene: &Scene, change: &mut Change) {
        self.go(scene, |bearing, point, place| {
            bearing.burden(point, place, &mut change.torque);
            bearing.carry(point, place, &mut change.tool);
        });
    }

    fn courses(&self) -> Vec<Box<dyn Effect>> {
        dry_courses(self.joint, self.clearance)
    }

    fn inject(&self, injection: &mut Injection) {
        injection.clearances.push((self.joint, self.clearance));
    }

    fn export_elements(&self, elements: &mut Vec<Element>) -> ExportCoverage {
        elements.push(Element::RadialPlay { joint: self.joint, clearance: self.clearance.clearance });
        ExportCoverage::Whole
    }
}

/// The state of a journal at one point of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct AtPoint {
    /// The point.
    pub point: usize,
    /// True if a stretch begins here.
    pub begins: bool,
    /// Time since the point before, s.
    pub step: f64,
    /// Force b that the bearing must carry, along the two slides, N.
    pub force: [f64; 2],
    /// Speed of the joint, rad/s.
    pub turning: f64,
}

/// Calls `tell` with the state of the journal of `joint` at each point of the motion.
pub(super) fn follow(scene: &Scene, joint: usize, mut tell: impl FnMut(&BearingCourse, AtPoint)) {
    let Some(bearing) = scene.bearing(joint) else { return };
    for stretch in &scene.motion.stretches {
        let step = scene.motion.step(stretch);
        for point in stretch.clone() {
            let (force, turning) = (bearing.force[point], scene.motion.v[joint][point]);
            tell(bearing, AtPoint { point, begins: point == stretch.start, step, force, turning });
        }
    }
}
