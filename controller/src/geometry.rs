//! Tool deviation by a geometry that differs from the nominal one, such as a longer link or a tilted base.
//!
//! The deviation of the tool is relative to the nominal arm at the desired joint positions. Effects that change the arm displace
//! the tool by the difference of the two forward kinematics, which needs no dynamics.

use freeplay_arm::{Arm, Workspace, forward_kinematics};
use nalgebra::Vector3;

/// The nominal arm and the arm changed by its effects.
pub struct Geometry {
    arms: [Arm; 2],
    workspaces: [Workspace; 2],
}

impl Geometry {
    /// Compares the `nominal` arm with the `changed` one; returns `None` if both have the same geometry.
    pub fn between(nominal: &Arm, changed: &Arm) -> Option<Geometry> {
        let pairs = nominal.joints().iter().zip(changed.joints());
        let is_same = nominal.tool() == changed.tool()
            && pairs.clone().all(|(a, b)| a.placement == b.placement && a.axis == b.axis);
        (!is_same).then(|| Geometry {
            arms: [nominal.clone(), changed.clone()],
            workspaces: [Workspace::new(nominal), Workspace::new(changed)],
        })
    }

    /// Tool position of the changed arm minus that of the nominal arm with the joints at `q`, base frame, m.
    pub fn deviation(&mut self, q: &[f64]) -> Vector3<f64> {
        let [nominal, changed] = [0, 1]
            .map(|arm| forward_kinematics(&self.arms[arm], &mut self.workspaces[arm], q).translation.vector);
        changed - nominal
    }
}

#[cfg(test)]
mod tests {
    use super::Geometry;
    use freeplay_laws::Effects;
    use freeplay_model::{EffectTable, paper_arm};

    /// A first link that is 1 mm longer along z lifts the tool by 1 mm in every posture; a payload does not displace it.
    #[test]
    fn a_longer_link_moves_the_tool_and_a_payload_does_not() {
        let changed = |kind: &str, joint: Option<&str>, parameters: &str| {
            let mut file = paper_arm();
            let (joint, parameters) = (joint.map(str::to_owned), parameters.parse().expect("a table"));
            file.effects.push(EffectTable { kind: kind.to_owned(), joint, parameters, line: 0 });
            Effects::of(&file).expect("effects").changed(&file.arm).expect("an arm")
        };
        let arm = paper_arm().arm;
        let longer = changed("link_length", Some("joint_1"), "offset = 1e-3\nalong = 'z'");
        let mut geometry = Geometry::between(&arm, &longer).expect("another geometry");
        for q in [[0.0; 6], [0.4, 0.3, -0.2, 0.1, 0.9, 0.2]] {
            let off = geometry.deviation(&q);
            println!("{off:?}");
            assert!(off.x.abs() < 1e-12 && off.y.abs() < 1e-12 && (off.z - 1e-3).abs() < 1e-12);
        }
        assert!(Geometry::between(&arm, &changed("payload", None, "mass = 4.0")).is_none());
    }
}
