//! `<actuator>`: the greatest torque of each joint's drive.

use roxmltree::Node;

use super::Model;
use crate::error::ModelError;
use crate::urdf_xml::children;

impl<'d, 'i> Model<'_, 'd, 'i> {
    /// Reads the force ranges of actuators on a single joint.
    pub(super) fn actuators(&mut self, root: Node<'d, 'i>) -> Result<(), ModelError> {
        let actuators =
            children(root, "actuator").flat_map(|section| section.children().filter(Node::is_element));
        for node in actuators {
            let Some(name) = node.attribute("joint") else { continue };
            let Some(most) = self.force(node)? else { continue };
            let joint = self.joints.iter_mut().find(|joint| joint.motion.is_own() && joint.name == name);
            if let Some(Ok(details)) = joint.map(|joint| &mut joint.details) {
                details.limits.effort = details.limits.effort.min(most);
            }
        }
        Ok(())
    }

    /// The greatest torque of the actuator `node` at its joint; `None` without a limit.
    fn force(&self, node: Node<'d, 'i>) -> Result<Option<f64>, ModelError> {
        let owner = format!("actuator `{}`", node.attribute("name").unwrap_or_default());
        // A motor's control is its force.
        let ranges: &[[&str; 2]] = match node.tag_name().name() {
            "motor" => &[["forcerange", "forcelimited"], ["ctrlrange", "ctrllimited"]],
            _ => &[["forcerange", "forcelimited"]],
        };
        let gear = self.defaults.attribute(node, None, "gear").and_then(|gear| {
            gear.value().split_whitespace().next().and_then(|first| first.parse::<f64>().ok())
        });
        let mut most = f64::INFINITY;
        for [name, limited] in ranges {
            let limited = self.defaults.attribute(node, None, limited).map_or("auto", |said| said.value());
            let Some(said) = self.defaults.holder(node, None, name) else { continue };
            let Some([lower, upper]) = self.reader.numbers(said, name, &owner)? else { continue };
            if limited == "true" || limited == "auto" && self.compiler.autolimits {
                most = most.min(upper.min(-lower));
            }
        }
        let most = most * gear.unwrap_or(1.0).abs();
        Ok(Some(most).filter(|most| most.is_finite() && *most > 0.0))
    }
}
