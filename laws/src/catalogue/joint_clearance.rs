//! Radial play of a revolute joint: the journal moves in its bearing across the axis.
//!
//! Law: contact by Lankarani & Nikravesh in the plane across the axis, see [`Clearance`]. In a recording the journal rests where
//! the force b that the bearing carries presses it: d = (c + (|b|/K)^(2/3)) n, n along −b, and the tool is off by J d. Impacts and free
//! flight are left to the plant.
//! Source: Erkaya 2018, Eqs. 1–7; Flores et al. 2006, Mech. Mach. Theory 41:247.

use freeplay_arm::{Workspace, jacobian, rnea};
use nalgebra::{DMatrix, Vector3};

use crate::effect::{Effect, Kind, Parameter, Range, Role, Seen, Site};
use crate::injection::Injection;
use crate::scene::Scene;
use crate::{ArmWithPlay, Clearance, ClearanceTable};

/// The entry.
pub static KIND: Kind = Kind {
    name: Clearance::KIND,
    title: "radial play of the joint",
    site: Site::Revolute,
    parameters: &[
        number("clearance", "radial clearance c", "m", 0.0, 0.01, None, Role::Linear),
        number("stiffness", "contact stiffness K", "N/m^1.5", 1e3, 1e15, Some(f64::NAN), Role::Given),
        number("restitution", "coefficient of restitution", "1", 0.0, 1.0, Some(0.9), Role::Given),
        number("friction", "coefficient of friction", "1", 0.0, 1.0, Some(0.01), Role::Given),
    ],
    seen: Seen { torque: false, pose: true },
    rough: false,
    equation: "d = (c + (|b|/K)^(2/3)) n, n along the pin force −b across the axis; the tool moves by J d",
    source: "Erkaya 2018, Eqs. 1–7; Lankarani & Nikravesh 1990",
    signature: "the tool is off by up to c and follows the direction of the reaction force in the joint's plane",
    confounders: &[
        ("backlash", "has one dimension and follows the transmitted torque"),
        ("joint_elasticity", "grows with the load"),
    ],
    build: |values| {
        let table: ClearanceTable = values.table()?;
        Ok(Box::new(JointClearance { joint: values.joint()?, clearance: Clearance::new(&table)? }))
    },
};

const fn number(
    name: &'static str,
    meaning: &'static str,
    unit: &'static str,
    least: f64,
    most: f64,
    default: Option<f64>,
    role: Role,
) -> Parameter {
    Parameter {
        name,
        meaning,
        range: Range::Number { unit, prismatic_unit: unit, least, most, default, role },
    }
}

#[derive(Clone, Copy, Debug)]
struct JointClearance {
    joint: usize,
    clearance: Clearance,
}

impl Effect for JointClearance {
    fn displace(&self, scene: &Scene, tool: &mut [Vec<f64>; 3]) {
        let Ok(play) = ArmWithPlay::new(scene.arm, &[(self.joint, self.clearance)]) else { return };
        let arm = play.arm();
        let (mut ws, n) = (Workspace::new(arm), arm.dof());
        let mut nominal = [vec![0.0; n - 2], vec![0.0; n - 2], vec![0.0; n - 2]];
        let mut spread = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
        let (mut tau, mut columns) = (vec![0.0; n], DMatrix::zeros(6, n));
        let slides = play.plays()[0].slides;
        for point in 0..scene.motion.len() {
            let [q, v, a] = &mut nominal;
            scene.motion.at(point, q, v, a);
            for (spread, nominal) in spread.iter_mut().zip(&nominal) {
                play.spread(nominal, spread);
            }
            rnea(arm, &mut ws, &spread[0], &spread[1], &spread[2], &mut tau);
            let force = tau[slides[0]].hypot(tau[slides[1]]);
            if force <= 0.0 {
                continue;
            }
            let reach = self.clearance.clearance + self.clearance.normal.static_penetration(force);
            jacobian(arm, &mut ws, &spread[0], &mut columns);
            let moved: Vector3<f64> = slides
                .into_iter()
                .map(|slide| columns.fixed_view::<3, 1>(0, slide) * (-reach * tau[slide] / force))
                .sum();
            tool.iter_mut().zip(moved.iter()).for_each(|(tool, moved)| tool[point] += moved);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.clearances.push((self.joint, self.clearance));
    }
}
