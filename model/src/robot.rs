//! The links and joints of a robot from its file, and their tree.

use std::collections::HashSet;

use nalgebra::Isometry3;

use crate::error::ModelError;
use crate::urdf_inertial::Inertial;
use crate::urdf_joint::{Details, Motion};
use crate::urdf_xml::Source;

/// A `<link>`.
pub(super) struct Link {
    pub name: String,
    /// The `<inertial>` of the link; `None` if the link has none. The reader reports an error in it only if the link moves.
    pub inertial: Option<Result<Inertial, ModelError>>,
    /// True if the link has a shape; a link without one is only a frame.
    pub has_shape: bool,
    /// Byte offset in the text.
    pub at: usize,
}

/// A `<joint>`, with its links by index.
pub(super) struct Joint {
    pub name: String,
    pub motion: Motion,
    pub parent: usize,
    pub child: usize,
    /// An error counts only if a part of the arm hangs on the joint.
    pub placement: Result<Isometry3<f64>, ModelError>,
    /// An error counts only if the joint belongs to the arm.
    pub details: Result<Details, ModelError>,
    /// Notes for the user, if the joint belongs to the arm.
    pub notes: Vec<String>,
    /// Byte offset in the text.
    pub at: usize,
}

/// The parts of a `<robot>` that an arm needs.
pub(super) struct Robot<'a> {
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
    pub notes: Vec<String>,
    pub source: Source<'a>,
}

/// The links in an order with parents before children.
pub(super) struct Tree {
    /// Link indices, roots first.
    pub order: Vec<usize>,
    /// Parent joint of each link, `None` for a root.
    pub parent_joint: Vec<Option<usize>>,
}

/// Checks that the links form trees.
pub(super) fn tree(robot: &Robot<'_>) -> Result<Tree, ModelError> {
    let mut parent_joint: Vec<Option<usize>> = vec![None; robot.links.len()];
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); robot.links.len()];
    for (index, joint) in robot.joints.iter().enumerate() {
        if let Some(first) = parent_joint[joint.child] {
            return Err(ModelError::TwoParents {
                at: robot.source.place(joint.at),
                link: robot.links[joint.child].name.clone(),
                first: robot.joints[first].name.clone(),
                second: joint.name.clone(),
            });
        }
        parent_joint[joint.child] = Some(index);
        children[joint.parent].push(joint.child);
    }
    let mut order: Vec<usize> = (0..robot.links.len()).filter(|&link| parent_joint[link].is_none()).collect();
    let mut next = 0;
    while let Some(&link) = order.get(next) {
        order.extend(&children[link]);
        next += 1;
    }
    if order.len() < robot.links.len() {
        let reached: HashSet<usize> = order.iter().copied().collect();
        if let Some(joint) = robot.joints.iter().find(|joint| !reached.contains(&joint.child)) {
            return Err(ModelError::Loop { at: robot.source.place(joint.at), joint: joint.name.clone() });
        }
    }
    if order.is_empty() {
        return Err(ModelError::Missing {
            at: robot.source.place(0),
            what: "every <link>".to_owned(),
            remedy: "a robot needs links and joints".to_owned(),
        });
    }
    Ok(Tree { order, parent_joint })
}
