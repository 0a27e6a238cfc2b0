//! An elastic mount: the whole arm rocks with its base.
//!
//! Law: the base turns about its x and y axes by θ = (c_x M_x, c_y M_y) \[rad\]. M \[N·m\] is the moment of the arm's weight and inertia
//! forces about the origin of the base frame, and c \[rad/(N·m)\] are the compliances. The tool moves by θ × p, p \[m\] being its position,
//! and gravity and inertia forces on the joints rotate by −θ. The terms are the compliances. Departure: the mount follows the load at once,
//! so that the law neglects its own oscillation.
//! Source: Abele, Weigold & Rothenbücher 2007, CIRP Annals 56(1):387 (compliance of industrial robots, base included).

use freeplay_arm::{Arm, Workspace};
use nalgebra::Vector3;

use crate::kind::{Kind, Occurrence, Seen, Terms, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::sag::{Sag, SagLaw, Sagging, pressure};

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "mount_compliance",
    title: "compliance of the mount",
    words: "a mount with a compliance of {compliance_x} about x and {compliance_y} about y",
    site: Site::Arm,
    parameters: &[
        Parameter::number(
            "compliance_x",
            "angle over moment about the base's x axis",
            "rad/(N*m)",
            [0.0, 1.0],
        ),
        Parameter::number(
            "compliance_y",
            "angle over moment about the base's y axis",
            "rad/(N*m)",
            [0.0, 1.0],
        ),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::BOTH,
    rough: false,
    shakes: false,
    equation: "θ = c M, and the tool moves by θ × p",
    source: "Abele, Weigold & Rothenbücher 2007",
    signature: "the tool moves with the overturning moment of the whole arm, in proportion to its distance from the base",
    confounders: &[
        ("link_flexure", "bends the first link by the load on its end alone"),
        ("joint_elasticity", "turns about one joint, and shows on its link encoder"),
        ("base_tilt", "does not change with the pose"),
    ],
    contains: &[],
    needs: &[Need::Tool],
    terms: Terms::NON_NEGATIVE,
    shapes: one_shape,
    build: |values| {
        let compliance = [values.number("compliance_x")?, values.number("compliance_y")?];
        Ok(Box::new(Sagging { law: Mount { compliance }, arm: values.arm().clone() }))
    },
};

#[derive(Clone, Copy, Debug)]
struct Mount {
    compliance: [f64; 2],
}

impl SagLaw for Mount {
    fn sag(&self, _: &Arm, ws: &Workspace) -> Sag {
        let (force, moment) = pressure(ws, 0);
        let about_base = moment + ws.link_pose(0).translation.vector.cross(&force);
        let turn = Vector3::new(self.compliance[0] * about_base.x, self.compliance[1] * about_base.y, 0.0);
        Sag { turn, ..Sag::default() }
    }
}
