//! The tree of URDF links → the chain of the arm, with everything else lumped into it.

use nalgebra::{Isometry3, Unit, Vector3};

use super::ArmFile;
use super::error::ModelError;
use super::urdf::{Joint, Motion, Robot};
use crate::arm::{Arm, ArmError, MAX_DOF};
use crate::joint::{Inertia, Joint as ArmJoint, JointKind};

/// Standard gravity of the model's files, m/s².
pub(super) const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// The name of the tool frame (REP-199 calls it so).
const TOOL: &str = "tool0";

/// The links in an order in which parents come before children.
struct Tree {
    /// Link indices, root first.
    order: Vec<usize>,
    /// Joint that each link hangs on, `None` for the root.
    parent_joint: Vec<Option<usize>>,
}

/// Where a link rides: on which joint of the chain (`None`: the base), and at which pose in that link's frame.
#[derive(Clone)]
struct Seat {
    on: Option<usize>,
    pose: Isometry3<f64>,
}

/// The arm of a robot.
pub(super) fn arm(mut robot: Robot<'_>) -> Result<ArmFile, ModelError> {
    let tree = tree(&robot)?;
    let end = end_link(&robot, &tree);
    let chain = chain(&robot, &tree, end);
    if chain.len() > MAX_DOF {
        return Err(arm_error(&robot, ArmError::TooManyJoints { count: chain.len() }));
    }
    let seats = seats(&robot, &tree, &chain);
    note_what_is_left_off(&mut robot, &tree, &chain, &seats);

    let joints = chain_joints(&robot, &tree, &chain, &seats);
    let tool = match seats[end].on {
        Some(_) => seats[end].pose,
        None => Isometry3::identity(),
    };
    let arm = Arm::new(&robot.name, joints, tool, GRAVITY).map_err(|source| arm_error(&robot, source))?;
    Ok(ArmFile { arm, effects: Vec::new(), ignored: robot.notes })
}

/// Checks that the links make up one tree.
fn tree(robot: &Robot<'_>) -> Result<Tree, ModelError> {
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
    let roots: Vec<usize> = (0..robot.links.len()).filter(|&link| parent_joint[link].is_none()).collect();
    let mut order = roots.clone();
    let mut next = 0;
    while let Some(&link) = order.get(next) {
        order.extend(&children[link]);
        next += 1;
    }
    if order.len() < robot.links.len() {
        let reached: std::collections::HashSet<usize> = order.into_iter().collect();
        let joint = robot.joints.iter().find(|joint| !reached.contains(&joint.child));
        let joint = joint.expect("a link that is not reached hangs on a joint");
        return Err(ModelError::Loop { at: robot.source.place(joint.at), joint: joint.name.clone() });
    }
    match roots.as_slice() {
        [] => Err(ModelError::Missing {
            at: robot.source.place(0),
            what: "every <link>".to_owned(),
            remedy: "a robot needs links and joints".to_owned(),
        }),
        [_] => Ok(Tree { order, parent_joint }),
        [_, second, ..] => {
            let names: Vec<_> =
                roots.iter().take(4).map(|&link| format!("`{}`", robot.links[link].name)).collect();
            let more = if roots.len() > 4 { ", …" } else { "" };
            Err(ModelError::SeveralRoots {
                at: robot.source.place(robot.links[*second].at),
                count: roots.len(),
                names: names.join(", ") + more,
            })
        }
    }
}

/// The link at the end of the chain: `tool0` if it moves, else the link with most moving joints before it.
fn end_link(robot: &Robot<'_>, tree: &Tree) -> usize {
    let mut moving = vec![0_usize; robot.links.len()];
    for &link in &tree.order {
        if let Some(joint) = tree.parent_joint[link].map(|j| &robot.joints[j]) {
            moving[link] = moving[joint.parent] + usize::from(matches!(joint.motion, Motion::Moving(_)));
        }
    }
    let link = robot.links.iter().position(|link| link.name == TOOL);
    let joint = robot.joints.iter().find(|joint| joint.name == TOOL && joint.motion == Motion::Fixed);
    let tool = link.or(joint.map(|joint| joint.child)).filter(|&link| moving[link] > 0);
    tool.unwrap_or_else(|| {
        // The first of the farthest in tree order is the child of a moving joint, not something fixed behind it.
        let most = moving.iter().copied().max().unwrap_or(0);
        tree.order.iter().copied().find(|&link| moving[link] == most).unwrap_or(0)
    })
}

/// The moving joints from the base to `end`.
fn chain(robot: &Robot<'_>, tree: &Tree, end: usize) -> Vec<usize> {
    let mut chain = Vec::new();
    let mut link = end;
    while let Some(joint) = tree.parent_joint[link] {
        if matches!(robot.joints[joint].motion, Motion::Moving(_)) {
            chain.push(joint);
        }
        link = robot.joints[joint].parent;
    }
    chain.reverse();
    chain
}

/// Where every link rides when all joints off the chain stay at zero.
fn seats(robot: &Robot<'_>, tree: &Tree, chain: &[usize]) -> Vec<Seat> {
    let mut seats = vec![Seat { on: None, pose: Isometry3::identity() }; robot.links.len()];
    for &link in &tree.order {
        let Some(index) = tree.parent_joint[link] else { continue };
        let joint = &robot.joints[index];
        seats[link] = match chain.iter().position(|&j| j == index) {
            Some(position) => Seat { on: Some(position), pose: Isometry3::identity() },
            None => {
                let parent = &seats[joint.parent];
                Seat { on: parent.on, pose: parent.pose * joint.placement }
            }
        };
    }
    seats
}

/// The joints of the chain, each with the inertia of all links that ride on it.
fn chain_joints(robot: &Robot<'_>, tree: &Tree, chain: &[usize], seats: &[Seat]) -> Vec<ArmJoint> {
    let mut joints: Vec<ArmJoint> = chain
        .iter()
        .map(|&index| {
            let Joint { name, motion, parent, placement, axis, limits, friction, .. } = &robot.joints[index];
            let kind = if *motion == Motion::Moving(JointKind::Prismatic) {
                JointKind::Prismatic
            } else {
                JointKind::Revolute
            };
            ArmJoint {
                name: name.clone(),
                kind,
                axis: Unit::new_unchecked(axis.into_inner()),
                placement: seats[*parent].pose * placement,
                limits: *limits,
                friction: *friction,
                rotor_inertia: 0.0,
                inertia: Inertia::zero(),
            }
        })
        .collect();
    for &link in &tree.order {
        if let (Some(joint), Some(inertia)) = (seats[link].on, &robot.links[link].inertia) {
            joints[joint].inertia = joints[joint].inertia.joined_with(inertia, &seats[link].pose);
        }
    }
    joints
}

fn note_what_is_left_off(robot: &mut Robot<'_>, tree: &Tree, chain: &[usize], seats: &[Seat]) {
    let mut notes = Vec::new();
    for (index, joint) in robot.joints.iter().enumerate() {
        let name = &joint.name;
        match joint.motion {
            Motion::Mimic => notes.push(format!("joint `{name}` mimics another joint: locked at 0")),
            Motion::Moving(_) if !chain.contains(&index) => {
                notes.push(format!(
                    "joint `{name}` is not on the chain of the arm: locked at 0, its mass is carried along"
                ));
            }
            Motion::Moving(_) | Motion::Fixed => {}
        }
    }
    for &link in &tree.order {
        if seats[link].on.is_some() && robot.links[link].inertia.is_none() {
            notes.push(format!("link `{}` has no <inertial>: counted as massless", robot.links[link].name));
        }
    }
    robot.notes.append(&mut notes);
}

/// The place of the joint that an arm's error names.
fn arm_error(robot: &Robot<'_>, source: ArmError) -> ModelError {
    let joint = source.joint().and_then(|name| robot.joints.iter().find(|joint| joint.name == name));
    let at = robot.source.place(joint.map_or(0, |joint| joint.at));
    ModelError::Arm { at, source: Box::new(source) }
}
