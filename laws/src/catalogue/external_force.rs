//! A temporary force on the tool that the model lacks: a collision, a cable that catches, a process.
//!
//! Law: a force f \[N\] in the base frame acts *on* the tool from t = start to end \[s\]; the drives spend τ = −Jᵀ f. The law neglects
//! moments.
//! Source: De Luca & Mattone 2005, ICRA, Eq. 4 (collisions as generalised forces Jᵀ f).

use nalgebra::Vector3;
use toml::Table;

use crate::basis::{Term, along, vector, with};
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{Injection, ToolForce};
use crate::kind::{Kind, Occurrence, Seen, Terms};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::{Place, Site};
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "external_force",
    title: "force on the tool",
    words: "a force of {force} on the tool from {start} to {end}",
    site: Site::Arm,
    parameters: &[
        Parameter::vector("force", "force on the tool in the base frame", "N"),
        Parameter::number("start", "start of the force", "s", [-1e12, 1e12]).shape(),
        Parameter::number("end", "end of the force", "s", [-1e12, 1e12]).shape(),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: true,
    shakes: false,
    equation: "τ = −Jᵀ f for start ≤ t < end",
    source: "De Luca & Mattone 2005, Eq. 4",
    signature: "all torques deviate for a time, in the pattern Jᵀ f of one force",
    confounders: &[
        ("payload", "acts at all times, and moves with the tool"),
        ("actuator_saturation", "acts where the motion needs much torque, on one joint"),
        ("torque_offset", "acts at all times, on one joint"),
    ],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms {
        list: |_, _, shape| {
            let push = |axis: usize| table(shape, along(axis, 1.0));
            let names = ["force_x", "force_y", "force_z"];
            (0..3).map(|axis| Term::new(names[axis], "N", [-1e6, 1e6], push(axis))).collect()
        },
        compose: |_, shape, coefficients| table(shape, [coefficients[0], coefficients[1], coefficients[2]]),
    },
    shapes: windows,
    build: |values| {
        let (force, start, end) =
            (values.vector("force")?.into(), values.number("start")?, values.number("end")?);
        Ok(Box::new(ExternalForce(ToolForce { force, start, end })))
    },
};

fn table(shape: &Table, force: [f64; 3]) -> Table {
    let mut table = shape.clone();
    table.insert("force".to_owned(), vector(force));
    table
}

/// The first half, the middle and the second half of the motion; the diagnosis adds shorter windows where the data support them.
pub(super) fn windows(place: &Place) -> Vec<Table> {
    let t = &place.scene.motion.t;
    let (Some(first), Some(last)) = (t.first(), t.last()) else { return Vec::new() };
    let lasts = 0.5 * (last - first);
    let window = |half: f64| {
        let start = first + 0.5 * lasts * half;
        with(&Table::new(), [("start", start), ("end", start + lasts)])
    };
    [0.0, 1.0, 2.0].map(window).into()
}

#[derive(Clone, Copy, Debug)]
struct ExternalForce(ToolForce);

impl Effect for ExternalForce {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let ToolForce { force, start, end } = self.0;
        let shares = scene.motion.acting(start, end);
        for (joint, sensitivity) in scene.tool_sensitivity().iter().enumerate() {
            let [x, y, z] = sensitivity;
            for (point, torque) in
                torque[joint].iter_mut().enumerate().filter(|(point, _)| shares[*point] > 0.0)
            {
                *torque -= shares[point] * Vector3::new(x[point], y[point], z[point]).dot(&force);
            }
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.forces.push(self.0);
    }
}
