//! Folds all links of a robot that are not joints of the arm into the links of the arm, as a load at rest.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion};

use crate::chain::Chain;
use crate::names::{counted, listed};
use crate::plausible::Body;
use crate::robot::{Joint, Robot, Tree};
use crate::urdf_joint::{Details, Motion};
use freeplay_arm::{Inertia, Joint as ArmJoint, JointFriction, JointKind, Limits};

/// Mounting of a link: the joint of the chain that carries it (`None`: the base), and the pose in that link's frame.
#[derive(Clone)]
pub(super) struct Seat {
    pub on: Option<usize>,
    pub pose: Isometry3<f64>,
}

/// The chain of the arm with the mountings of all links.
pub(super) struct Fold<'a> {
    tree: &'a Tree,
    chain: &'a Chain,
    pub seats: Vec<Seat>,
    pub notes: Vec<String>,
}

/// Position of a joint that does not belong to the arm: zero, or the middle of a range without zero, or the position that follows from its
/// leader.
fn held_at(robot: &Robot<'_>, chain: &Chain, joint: &Joint) -> f64 {
    let Ok(Details { limits, follows, .. }) = &joint.details else { return 0.0 };
    if let Some(follows) = follows {
        let leader = robot.joints.iter().position(|other| other.name == follows.leader);
        let leads = leader.filter(|index| !chain.joints.contains(index)).map(|index| &robot.joints[index]);
        // A joint whose leader itself follows another joint takes the leader's position as zero.
        let leads =
            leads.filter(|leader| leader.motion.is_own()).map_or(0.0, |leader| held_at(robot, chain, leader));
        return follows.multiplier * leads + follows.offset;
    }
    let Limits { lower, upper, .. } = *limits;
    if lower <= 0.0 && upper >= 0.0 {
        0.0
    } else if (upper - lower).is_finite() {
        0.5 * (lower + upper)
    } else {
        lower.max(0.0).min(upper)
    }
}

/// The displacement that a joint gives its child at the position `q`.
fn moved(joint: &Joint, q: f64) -> Isometry3<f64> {
    let (Some(kind), Ok(details)) = (joint.motion.kind(), &joint.details) else {
        return Isometry3::identity();
    };
    match kind {
        JointKind::Revolute if q != 0.0 => {
            Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&details.axis, q))
        }
        JointKind::Prismatic if q != 0.0 => {
            Isometry3::from(Translation3::from(details.axis.into_inner() * q))
        }
        _ => Isometry3::identity(),
    }
}

impl<'a> Fold<'a> {
    pub fn new(robot: &Robot<'_>, tree: &'a Tree, chain: &'a Chain) -> Self {
        let mut seats = vec![Seat { on: None, pose: Isometry3::identity() }; robot.links.len()];
        for &link in &tree.order {
            let Some(index) = tree.parent_joint[link] else { continue };
            let joint = &robot.joints[index];
            seats[link] = match chain.joints.iter().position(|&j| j == index) {
                Some(position) => Seat { on: Some(position), pose: Isometry3::identity() },
                None => {
                    let parent = &seats[joint.parent];
                    let placement =
                        joint.placement.as_ref().copied().unwrap_or_else(|_| Isometry3::identity());
                    let pose = parent.pose * placement;
                    let q = held_at(robot, chain, joint);
                    // A joint at zero leaves every digit unchanged.
                    Seat { on: parent.on, pose: if q == 0.0 { pose } else { pose * moved(joint, q) } }
                }
            };
        }
        let mut fold = Fold { tree, chain, seats, notes: Vec::new() };
        fold.note_missing(robot);
        fold
    }

    /// The joints of the chain, each with the inertia of all links that it carries.
    pub fn joints(&self, robot: &Robot<'_>) -> Vec<ArmJoint> {
        let mut joints: Vec<ArmJoint> =
            self.chain.joints.iter().map(|&index| self.joint(&robot.joints[index])).collect();
        for &link in &self.tree.order {
            if let (Some(joint), Some(Ok(inertial))) = (self.seats[link].on, &robot.links[link].inertial) {
                let inertia = &mut joints[joint].inertia;
                *inertia = inertia.joined_with(&inertial.inertia, &self.seats[link].pose);
            }
        }
        joints
    }

    fn joint(&self, joint: &Joint) -> ArmJoint {
        let none = Details::none();
        let details = joint.details.as_ref().unwrap_or(&none);
        let placement = joint.placement.as_ref().copied().unwrap_or_else(|_| Isometry3::identity());
        ArmJoint {
            name: joint.name.clone(),
            kind: joint.motion.kind().unwrap_or(JointKind::Revolute),
            axis: Unit::new_unchecked(details.axis.into_inner()),
            placement: self.seats[joint.parent].pose * placement,
            limits: details.limits,
            friction: JointFriction { ..details.friction },
            rotor_inertia: details.rotor_inertia,
            inertia: Inertia::zero(),
        }
    }

    /// The masses that the arm moves, with the values of the file.
    pub fn bodies(&self, robot: &Robot<'_>) -> Vec<Body> {
        let moved = robot.links.iter().zip(&self.seats).filter(|(_, seat)| seat.on.is_some());
        let body = moved.filter_map(|(link, _)| {
            let inertia = link.inertial.as_ref()?.as_ref().ok()?.inertia;
            let name = format!("link `{}` (line {})", link.name, robot.source.place(link.at).line);
            Some(Body { name, inertia })
        });
        body.collect()
    }

    /// The selected chain, and the treatment of the other links, in one line.
    pub fn selection_note(&self, robot: &Robot<'_>) -> String {
        let name = |link: usize| &robot.links[link].name;
        let mut root = self.chain.end;
        while let Some(index) = self.tree.parent_joint[root] {
            root = robot.joints[index].parent;
        }
        let count = counted(self.chain.joints.len(), "joint");
        let mut words = format!("arm: {} → {}, {count}", name(root), name(self.chain.end));
        let last = self.chain.joints.len().checked_sub(1);
        let still = robot
            .joints
            .iter()
            .enumerate()
            .filter(|(index, joint)| joint.motion.kind().is_some() && !self.chain.joints.contains(index));
        let (tool, others): (Vec<_>, Vec<_>) = still
            .map(|(_, joint)| joint)
            .partition(|joint| last.is_some() && self.seats[joint.parent].on == last);
        for (whose, joints) in [("the gripper's ", tool), ("", others)] {
            if !joints.is_empty() {
                let other = if whose.is_empty() { "other joint" } else { "joint" };
                let names = listed(joints.iter().map(|joint| joint.name.as_str()));
                words += &format!("; {whose}{} held still ({names})", counted(joints.len(), other));
            }
        }
        if !self.chain.equals.is_empty() {
            let names = listed(self.chain.equals.iter().map(|&link| name(link).as_str()));
            words += &format!("; the chains to {names} are equally long (--tip LINK selects one)");
        }
        words
    }

    fn note_missing(&mut self, robot: &Robot<'_>) {
        let roots = self.tree.order.iter().filter(|&&link| self.tree.parent_joint[link].is_none());
        let roots: Vec<&str> = roots.map(|&link| robot.links[link].name.as_str()).collect();
        if roots.len() > 1 {
            let count = roots.len();
            self.notes.push(format!(
                "{count} links have no parent joint ({}): only that of the arm is used",
                listed(roots)
            ));
        }
        let free = robot.joints.iter().filter(|joint| joint.motion == Motion::Free);
        let free: Vec<&str> = free.map(|joint| joint.name.as_str()).collect();
        if !free.is_empty() {
            self.notes.push(format!("joints of floating or planar type stand still: {}", listed(free)));
        }
        let mimics = self.followers_on_the_arm(robot);
        self.notes.extend(mimics.map(|joint| {
            format!(
                "joint `{}` on the arm follows another one: it is held still, so that the positions of the links behind it are wrong",
                joint.name
            )
        }));
        // A link without a shape that is fixed to another is a frame.
        let bare = self.tree.order.iter().filter(|&&link| {
            let is_moved =
                self.tree.parent_joint[link].is_some_and(|j| robot.joints[j].motion.kind().is_some());
            let link_of = &robot.links[link];
            self.seats[link].on.is_some() && link_of.inertial.is_none() && (is_moved || link_of.has_shape)
        });
        let bare: Vec<&str> = bare.map(|&link| robot.links[link].name.as_str()).collect();
        let masses = robot.links.iter().any(|link| link.inertial.is_some());
        if !bare.is_empty() && masses {
            self.notes.push(format!("without <inertial>, counted as massless: {}", listed(bare)));
        }
    }

    /// The following joints between the root and the end of the arm.
    fn followers_on_the_arm<'r>(&self, robot: &'r Robot<'_>) -> impl Iterator<Item = &'r Joint> + use<'r> {
        let mut found = Vec::new();
        let mut link = self.chain.end;
        while let Some(index) = self.tree.parent_joint[link] {
            let joint = &robot.joints[index];
            if matches!(joint.motion, Motion::Mimic(_)) {
                found.push(joint);
            }
            link = joint.parent;
        }
        found.into_iter()
    }
}
