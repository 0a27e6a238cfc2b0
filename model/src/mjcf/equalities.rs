//! `<equality>`: joints that follow others, like the second finger of a gripper.

use roxmltree::Node;

use super::Model;
use crate::error::ModelError;
use crate::urdf_joint::{Follows, Motion};
use crate::urdf_xml::children;

impl<'d, 'i> Model<'_, 'd, 'i> {
    /// Marks the joints that an equality defines as copies of another joint: joint1 = c0 + c1·joint2.
    pub(super) fn equalities(&mut self, root: Node<'d, 'i>) -> Result<(), ModelError> {
        let equalities = children(root, "equality").flat_map(|section| children(section, "joint"));
        for node in equalities.filter(|node| node.attribute("active") != Some("false")) {
            let (Some(follower), Some(leader)) = (node.attribute("joint1"), node.attribute("joint2")) else {
                continue;
            };
            let words = node.attribute("polycoef").unwrap_or("0 1").split_whitespace();
            let factors: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
            let [offset, multiplier] =
                [0, 1].map(|place| factors.get(place).copied().unwrap_or(place as f64));
            let Some(joint) = self.joints.iter_mut().find(|joint| joint.name == follower) else {
                return Err(ModelError::Value {
                    at: self.reader.place(node),
                    what: "<equality>: joint1".to_owned(),
                    value: follower.to_owned(),
                    remedy: "the file has no joint of that name".to_owned(),
                });
            };
            if let (Motion::Moving(kind), Ok(details)) = (joint.motion, &mut joint.details) {
                joint.motion = Motion::Mimic(kind);
                details.follows = Some(Follows { leader: leader.to_owned(), multiplier, offset });
            }
        }
        Ok(())
    }
}
