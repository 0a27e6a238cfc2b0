//! Radial play of a revolute joint: the journal moves in its bearing across the axis.
//!
//! Law: contact by Lankarani & Nikravesh in the plane across the axis, see [`Clearance`]. In a recording the journal rests where
//! the force b that the bearing carries presses it, turned by its friction, see [`crate::settle`]: about d = (c + (|b|/K)^(2/3)) n with n
//! along −b, and the tool is off by J d. Journals are microns against the arm, so that those of several joints add. Impacts and free
//! flight, and the friction's moment on the drive (μ R_j |b|, some mN·m), are left to the plant.
//! Source: Erkaya 2018, Eqs. 1–7; Flores et al. 2006, Mech. Mach. Theory 41:247.

use crate::basis::{Term, Terms, with};
use crate::bearing_load::BearingLoad;
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::Injection;
use crate::kind::{Kind, Seen, Site, one_shape};
use crate::needs::Need;
use crate::parameter::{Parameter, Range};
use crate::scene::Scene;
use crate::{Clearance, ClearanceTable, Rest, settle};

/// The entry.
pub static KIND: Kind = Kind {
    name: Clearance::KIND,
    title: "radial play",
    site: Site::Revolute,
    parameters: &[
        Parameter::number("clearance", "radial clearance c, less than the bearing radius", "m", [0.0, 1.0]),
        Parameter::number("stiffness", "contact stiffness K", "N/m^1.5", [1e3, 1e15])
            .or_else("by Hertz, from radii and material")
            .given(),
        Parameter::number("restitution", "coefficient of restitution", "1", [1e-3, 1.0]).or(0.9).given(),
        Parameter::number("friction", "dynamic coefficient of friction", "1", [0.0, 1.0]).or(0.01).given(),
        Parameter::number("static_friction", "static coefficient of friction", "1", [0.0, 1.0])
            .or_else("the dynamic one")
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
            meaning: "how the contact dissipates",
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
            meaning: "how the friction depends on the sliding speed",
            range: Range::Word(&["corrected", "ambrosio", "threlfall", "printed"]),
        },
        Parameter { name: "material", meaning: "Young's modulus and Poisson's ratio", range: Range::Table },
    ],
    seen: Seen::POSE,
    rough: false,
    equation: "d = (c + (|b|/K)^(2/3)) n, n along the pin force −b across the axis; the tool moves by J d",
    source: "Erkaya 2018, Eqs. 1–7; Lankarani & Nikravesh 1990",
    signature: "the tool is off by up to c and follows the direction of the reaction force in the joint's plane",
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
            /// Clearances at which the penetration, some µm that grow with the cube root of c, is nearly the same and cancels.
            const STEP: f64 = 2e-4;
            let at = |clearance| with(shape, [("clearance", clearance)]);
            vec![Term::new("clearance", "m", [0.0, 0.01], at(2.0 * STEP)).less(at(STEP)).stepped(STEP)]
        },
        compose: |_, shape, coefficients| with(shape, [("clearance", coefficients[0])]),
    },
    shapes: one_shape,
    build: |values| {
        let table: ClearanceTable = values.table()?;
        let clearance = Clearance::new(&table).map_err(|error| error.at(values.line()))?;
        Ok(Box::new(JointClearance { joint: values.joint()?, clearance }))
    },
};

#[derive(Clone, Copy, Debug)]
struct JointClearance {
    joint: usize,
    clearance: Clearance,
}

impl Effect for JointClearance {
    fn displace(&self, scene: &Scene, tool: &mut Columns) {
        let mut last = Rest::default();
        follow(scene, self.joint, self.clearance, tool, |at| {
            let before = if at.begins { Rest::default() } else { last };
            last = settle(&self.clearance, at.force, at.turning, &before, at.step);
            last.displacement
        });
    }

    fn inject(&self, injection: &mut Injection) {
        injection.clearances.push((self.joint, self.clearance));
    }
}

/// What a journal feels at one point of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct AtPoint {
    /// Whether a stretch begins here.
    pub begins: bool,
    /// Time since the point before, s.
    pub step: f64,
    /// Force b that the bearing has to carry, along the two slides, N.
    pub force: [f64; 2],
    /// Speed of the joint, rad/s.
    pub turning: f64,
}

/// Moves the `tool` by what `displacement` says of the journal of `joint` at each point of the motion, along the two slides, m.
pub(super) fn follow(
    scene: &Scene,
    joint: usize,
    clearance: Clearance,
    tool: &mut Columns,
    mut displacement: impl FnMut(AtPoint) -> [f64; 2],
) {
    let Ok(mut bearing) = BearingLoad::new(&scene.arm, joint, clearance) else { return };
    for stretch in &scene.motion.stretches {
        let step = scene.motion.step(stretch);
        for point in stretch.clone() {
            let [q, v, a] = &mut bearing.motion;
            scene.motion.at(point, q, v, a);
            let (force, turning) = (bearing.force(), bearing.turning());
            let moved = displacement(AtPoint { begins: point == stretch.start, step, force, turning });
            let moved = bearing.moved(moved);
            moved.iter().enumerate().for_each(|(axis, moved)| tool[axis][point] += moved);
        }
    }
}
