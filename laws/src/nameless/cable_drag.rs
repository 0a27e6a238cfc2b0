//! A cable between a hook and the tool: its weight loads the tool, and its tension grows with the distance.
//!
//! Law: the tool receives the force F = ½ m g + k (|r| − l)⁺ r/|r| \[N\], r = hook − tool \[m\]. m \[kg\] is the cable's mass, of which the
//! tool carries half, l \[m\] the length beyond which it is taut, and k \[N/m\] its stiffness. The drives spend τ = −Jᵀ F.
//! Source: Irvine 1981, Cable Structures, §2.3 (half the weight at each end of a shallow sag). Departure: the horizontal tension of the sag
//! is replaced by the taut spring beyond one length; the law neglects moments on the tool.

use freeplay_arm::{Arm, Workspace, forward_kinematics, jacobian};
use nalgebra::{DMatrix, Vector3};

use crate::archive::Archive;
use crate::columns::Columns;
use crate::effect::Effect;
use crate::injection::{DriveLaw, DriveState, Injection};
use crate::kind::{Kind, Occurrence, Seen, Terms, one_shape};
use crate::needs::Need;
use crate::parameter::Parameter;
use crate::place::Site;
use crate::scene::Scene;

/// The catalogue entry.
pub static KIND: Kind = Kind {
    name: "cable_drag",
    title: "a cable on the tool",
    words: "a cable of {mass} from {hook}, taut beyond {length} with {stiffness}",
    site: Site::Arm,
    parameters: &[
        Parameter::vector("hook", "position of the cable's other end, base frame", "m"),
        Parameter::number("mass", "mass of the cable", "kg", [0.0, 1e4]),
        Parameter::number("length", "distance beyond which the cable is taut", "m", [0.0, 1e3]),
        Parameter::number("stiffness", "stiffness of the taut cable", "N/m", [0.0, 1e9]),
    ],
    occurs: Occurrence::Rare,
    tolerance: None,
    seen: Seen::TORQUE,
    rough: false,
    shakes: false,
    equation: "F = ½ m g + k (|r| − l)⁺ r/|r|, τ = −Jᵀ F",
    source: "Irvine 1981, §2.3",
    signature: "all torques deviate in the pattern Jᵀ F of a force that depends on the tool's position",
    confounders: &[("payload", "shows inertia and no pull"), ("external_force", "keeps its size")],
    contains: &[],
    needs: &[Need::Torque],
    terms: Terms::LINEAR,
    shapes: one_shape,
    build: |values| {
        Ok(Box::new(CableDrag {
            hook: values.vector("hook")?.into(),
            mass: values.number("mass")?,
            length: values.number("length")?,
            stiffness: values.number("stiffness")?,
            arm: values.arm().clone(),
        }))
    },
};

#[derive(Clone, Debug)]
struct CableDrag {
    hook: Vector3<f64>,
    mass: f64,
    length: f64,
    stiffness: f64,
    arm: Arm,
}

impl CableDrag {
    /// F on a tool at `tool`, N.
    fn force(&self, tool: Vector3<f64>) -> Vector3<f64> {
        let way = self.hook - tool;
        let distance = way.norm();
        let taut = (distance - self.length).max(0.0);
        let pull = if taut > 0.0 { way * (self.stiffness * taut / distance) } else { Vector3::zeros() };
        pull + self.arm.gravity() * (0.5 * self.mass)
    }
}

impl Effect for CableDrag {
    fn torque(&self, scene: &Scene, torque: &mut Columns) {
        let mut pull = Pull::of(self);
        let mut q = vec![0.0; self.arm.dof()];
        for point in 0..scene.motion.len() {
            q.iter_mut().zip(&scene.motion.q).for_each(|(q, column)| *q = column[point]);
            pull.find(&q);
            pull.torque.iter().enumerate().for_each(|(joint, pulled)| torque[joint][point] -= pulled);
        }
    }

    fn inject(&self, injection: &mut Injection) {
        injection.drives.push(Box::new(Pull::of(self)));
    }
}

/// The load of the cable on the drives.
#[derive(Clone, Debug)]
struct Pull {
    of: CableDrag,
    workspace: Workspace,
    columns: DMatrix<f64>,
    /// Jᵀ F, N·m (N).
    torque: Vec<f64>,
}

impl Pull {
    fn of(law: &CableDrag) -> Pull {
        let dof = law.arm.dof();
        Pull {
            workspace: Workspace::new(&law.arm),
            columns: DMatrix::zeros(6, dof),
            torque: vec![0.0; dof],
            of: law.clone(),
        }
    }

    fn find(&mut self, q: &[f64]) {
        let arm = &self.of.arm;
        let tool = forward_kinematics(arm, &mut self.workspace, q).translation.vector;
        let force = self.of.force(tool);
        jacobian(arm, &mut self.workspace, q, &mut self.columns);
        for (joint, torque) in self.torque.iter_mut().enumerate() {
            *torque = self.columns.fixed_view::<3, 1>(0, joint).dot(&force);
        }
    }
}

impl DriveLaw for Pull {
    fn act(&mut self, now: &DriveState, torque: &mut [f64]) {
        self.find(now.q);
        torque.iter_mut().zip(&self.torque).for_each(|(torque, pulled)| *torque += pulled);
    }

    fn transfer_state(&mut self, _: &mut Archive) {}
}

#[cfg(test)]
mod tests {
    use super::CableDrag;
    use freeplay_model::paper_arm;
    use nalgebra::Vector3;

    #[test]
    fn a_slack_cable_weighs_and_a_taut_one_pulls_to_its_hook() {
        let arm = paper_arm().arm;
        let hook = Vector3::new(0.0, 0.0, 2.0);
        let law = CableDrag { hook, mass: 3.0, length: 1.0, stiffness: 50.0, arm: arm.clone() };
        let weight = arm.gravity() * 1.5;
        assert!((law.force(Vector3::new(0.0, 0.0, 1.5)) - weight).norm() < 1e-12);
        let taut = law.force(Vector3::new(0.0, 0.0, 0.5)) - weight;
        assert!((taut - Vector3::new(0.0, 0.0, 25.0)).norm() < 1e-12, "{taut}");
    }
}
