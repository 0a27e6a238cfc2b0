//! Selects the chain of a tree of links that is the arm.
//!
//! The structure distinguishes fingers from the arm, not their names. Fingers branch from one link, in a pair of equals or three and more;
//! each has no more joints and a shorter reach than the chain that carries them. The arms of a torso branch from it, too, but reach farther
//! than the torso. The wheels, legs and rotors of a base branch from it before any joint. Joints at the end of a chain that only follow
//! others (`<mimic>`) are fingers as well; joints that follow one before them are rods of the arm itself. A gripper with a single moving
//! jaw has a frame between the jaws: the link before the jaw carries this frame, beyond the jaw. Only without such a frame does the name
//! decide.

use std::collections::HashSet;

use crate::arm_file::Selection;
use crate::error::ModelError;
use crate::names::{listed, match_joints};
use crate::robot::{Joint, Robot, Tree};
use crate::urdf_joint::Motion;
use freeplay_arm::{JointKind, Place};

/// The name of the tool frame in REP-199; in robots of several arms the name ends with it.
const TOOL: &str = "tool0";

/// Words that end the names of jaws. They may also name a part that turns as a whole (`gripper_roll`), or one behind a wrist
/// (`wrist_to_gripper`).
const JAWS: [&str; 4] = ["gripper", "jaw", "finger", "claw"];

/// Least number of joints before a jaw: no arm with a gripper has fewer.
const FEWEST: usize = 3;

/// True if the last significant word of `name` is the name of a jaw.
fn is_called_jaw(name: &str) -> bool {
    let lower = name.to_lowercase();
    let words: Vec<&str> =
        lower.split(|c: char| !c.is_ascii_alphabetic()).filter(|word| !word.is_empty()).collect();
    let last =
        words.iter().rev().find(|word| !matches!(**word, "joint" | "link" | "l" | "r" | "left" | "right"));
    !words.contains(&"to") && last.is_some_and(|word| JAWS.contains(word))
}

/// The arm in the tree.
pub(super) struct Chain {
    /// The link whose frame is the tool frame.
    pub end: usize,
    /// The joints from the base outwards, by index.
    pub joints: Vec<usize>,
    /// Ends of other chains that are equally good.
    pub equals: Vec<usize>,
}

/// Properties of every link along its path from the root.
struct Ways<'a> {
    robot: &'a Robot<'a>,
    tree: &'a Tree,
    /// Number of own joints (not mimicking) before a link.
    moving: Vec<usize>,
    /// Length of the path since the first of them, m, with the strokes of prismatic joints.
    reach: Vec<f64>,
    /// Greatest of both among a link and those behind it.
    most_moving: Vec<usize>,
    most_reach: Vec<f64>,
    /// The first link of the rigid body to which a link belongs.
    body: Vec<usize>,
    /// Moving joints that branch from a body, by the body's first link.
    branches: Vec<Vec<usize>>,
    /// For a link of a finger, the link from which the fingers branch.
    finger_of: Vec<Option<usize>>,
}

/// The arm of `robot` that `selection` names.
pub(super) fn choose(robot: &Robot<'_>, tree: &Tree, selection: &Selection) -> Result<Chain, ModelError> {
    let ways = Ways::new(robot, tree);
    if let Some(tip) = &selection.tip {
        return ways.to_tip(tip);
    }
    if let Some(chain) = ways.named(&selection.joints) {
        return Ok(chain);
    }
    let link = robot.links.iter().position(|link| link.name == TOOL);
    let joint = robot.joints.iter().find(|joint| joint.name == TOOL && joint.motion == Motion::Fixed);
    let tool = link.or(joint.map(|joint| joint.child)).filter(|&link| ways.moving[link] > 0);
    Ok(tool
        .map_or_else(|| ways.longest(), |end| Chain { end, joints: ways.joints_to(end), equals: Vec::new() }))
}

fn stroke(joint: &Joint) -> f64 {
    let Ok(details) = &joint.details else { return 0.0 };
    let range = details.limits.upper - details.limits.lower;
    if joint.motion.kind() == Some(JointKind::Prismatic) && range.is_finite() { range } else { 0.0 }
}

impl<'a> Ways<'a> {
    fn new(robot: &'a Robot<'a>, tree: &'a Tree) -> Self {
        let links = robot.links.len();
        let mut ways = Ways {
            robot,
            tree,
            moving: vec![0; links],
            reach: vec![0.0; links],
            most_moving: vec![0; links],
            most_reach: vec![0.0; links],
            body: (0..links).collect(),
            branches: vec![Vec::new(); links],
            finger_of: vec![None; links],
        };
        ways.outwards();
        ways.inwards();
        ways.find_fingers();
        ways
    }

    /// The parent joint of a link.
    fn before(&self, link: usize) -> Option<(usize, &'a Joint)> {
        self.tree.parent_joint[link].map(|index| (index, &self.robot.joints[index]))
    }

    fn outwards(&mut self) {
        for &link in &self.tree.order {
            let Some((index, joint)) = self.before(link) else { continue };
            let parent = joint.parent;
            self.moving[link] = self.moving[parent] + usize::from(joint.motion.is_own());
            let offset = joint.placement.as_ref().map_or(0.0, |pose| pose.translation.vector.norm());
            // The position of the first joint belongs to the base.
            let offset = if self.moving[parent] > 0 { offset } else { 0.0 };
            self.reach[link] = self.reach[parent] + offset + stroke(joint);
            if joint.motion.kind().is_some() {
                self.branches[self.body[parent]].push(index);
            } else {
                self.body[link] = self.body[parent];
            }
        }
    }

    fn inwards(&mut self) {
        self.most_moving.clone_from(&self.moving);
        self.most_reach.clone_from(&self.reach);
        for &link in self.tree.order.iter().rev() {
            let Some((_, joint)) = self.before(link) else { continue };
            self.most_moving[joint.parent] = self.most_moving[joint.parent].max(self.most_moving[link]);
            self.most_reach[joint.parent] = self.most_reach[joint.parent].max(self.most_reach[link]);
        }
    }

    fn find_fingers(&mut self) {
        for &link in &self.tree.order {
            let Some((_, joint)) = self.before(link) else { continue };
            let own = joint.motion.kind().is_some() && self.is_finger(joint);
            self.finger_of[link] = self.finger_of[joint.parent].or(own.then_some(joint.parent));
        }
    }

    fn is_finger(&self, joint: &Joint) -> bool {
        let before = self.moving[joint.parent];
        if before == 0 {
            return false;
        }
        let follows = matches!(joint.motion, Motion::Mimic(_));
        if follows && self.most_moving[joint.child] == before && !self.is_rod(joint) {
            return true;
        }
        let branches: Vec<&Joint> = self.branches[self.body[joint.parent]]
            .iter()
            .map(|&index| &self.robot.joints[index])
            .filter(|branch| !self.is_rod(branch))
            .collect();
        let joints = |branch: &&Joint| self.most_moving[branch.child] - before;
        let reach = |branch: &&Joint| self.most_reach[branch.child] - self.reach[branch.parent];
        let own = |branch: &&&Joint| joints(branch) > 0;
        let alike = match branches.iter().filter(own).count() {
            // One moving joint, and one that follows it.
            1 => branches.len() > 1 && joints(&joint) <= 1,
            2 => branches.iter().filter(own).all(|branch| joints(branch) == joints(&joint)),
            _ => true,
        };
        self.is_jaw(joint)
            || branches.len() > 1
                && alike
                && branches.iter().all(|b| joints(b) <= before && reach(b) < self.reach[joint.parent])
    }

    /// True if `joint` is the moving jaw of a gripper whose other jaw is the link before it: the only joint that branches from that link
    /// and the last of its chain. In addition, either a bare frame of that link lies beyond it, the grasp between the jaws, or its name is
    /// that of a jaw.
    fn is_jaw(&self, joint: &Joint) -> bool {
        let before = self.moving[joint.parent];
        let body = self.body[joint.parent];
        let is_last = joint.motion.is_own() && self.most_moving[joint.child] == before + 1;
        if !is_last || before < FEWEST || self.branches[body].len() > 1 {
            return false;
        }
        let is_frame_of = |body: usize, link: usize| {
            self.body[link] == body
                && link != body
                && self.robot.links[link].inertial.is_none()
                && !self.robot.joints.iter().any(|other| other.parent == link)
        };
        // A jaw carries nothing, not even a frame; the link behind a wrist carries one.
        if self.tree.order.iter().any(|&link| is_frame_of(joint.child, link)) {
            return false;
        }
        let is_beyond =
            |link: &usize| is_frame_of(body, *link) && self.reach[*link] > self.reach[joint.child];
        let names = [&joint.name, &self.robot.links[joint.child].name];
        self.tree.order.iter().any(is_beyond) || names.into_iter().any(|name| is_called_jaw(name))
    }

    /// True if `joint` mimics a joint that carries it, as the rods of a parallelogram do.
    fn is_rod(&self, joint: &Joint) -> bool {
        let Ok(details) = &joint.details else { return false };
        let Some(follows) = &details.follows else { return false };
        self.path(joint.parent).any(|index| self.robot.joints[index].name == follows.leader)
    }

    /// The joints between a link and the root, from the link on.
    fn path(&self, link: usize) -> impl Iterator<Item = usize> + '_ {
        let mut link = link;
        std::iter::from_fn(move || {
            let (index, joint) = self.before(link)?;
            link = joint.parent;
            Some(index)
        })
    }

    /// The own joints (not mimicking) before a link, from the root outwards.
    fn joints_to(&self, end: usize) -> Vec<usize> {
        let mut joints: Vec<usize> =
            self.path(end).filter(|&index| self.robot.joints[index].motion.is_own()).collect();
        joints.reverse();
        joints
    }

    /// The chain to the link called `tip`.
    fn to_tip(&self, tip: &str) -> Result<Chain, ModelError> {
        let end = self.robot.links.iter().position(|link| link.name == tip);
        let problem = match end {
            Some(end) if self.moving[end] > 0 => {
                return Ok(Chain { end, joints: self.joints_to(end), equals: Vec::new() });
            }
            Some(_) => "no joint moves this link",
            None => "there is no link of this name",
        };
        let known = self.ends().map(|link| self.robot.links[link].name.as_str());
        Err(ModelError::Tip {
            at: Place::start(self.robot.source.origin),
            tip: tip.to_owned(),
            problem,
            known: listed(known),
        })
    }

    /// The tool frames at the ends of all chains; fingers do not count as ends.
    fn ends(&self) -> impl Iterator<Item = usize> + '_ {
        let is_last = |&link: &usize| {
            let moved = self.before(link).is_some_and(|(_, joint)| joint.motion.is_own());
            let behind = self.branches[link].iter().map(|&index| self.robot.joints[index].child);
            moved
                && self.finger_of[link].is_none()
                && behind
                    .filter(|&child| self.most_moving[child] > self.moving[link])
                    .all(|child| self.finger_of[child].is_some())
        };
        self.tree.order.iter().copied().filter(is_last).map(|link| self.tool_of(link))
    }

    /// The tool frame of the body that begins with the link `moved`: a tool frame by its name, else the link from which fingers branch,
    /// else the link itself.
    fn tool_of(&self, moved: usize) -> usize {
        let mut rigid = self.tree.order.iter().copied().filter(|&link| self.body[link] == moved);
        let named = rigid.clone().find(|&link| self.robot.links[link].name.ends_with(TOOL));
        let parting = rigid.find(|&link| self.finger_of.contains(&Some(link)));
        named.or(parting).unwrap_or(moved)
    }

    /// The chain with the most joints without its fingers; the first of equals.
    fn longest(&self) -> Chain {
        let most = self.ends().map(|end| self.moving[end]).max();
        let mut best = self.ends().filter(|&end| Some(self.moving[end]) == most);
        let end = best.next().unwrap_or(self.tree.order[0]);
        Chain { end, joints: self.joints_to(end), equals: best.collect() }
    }

    /// The chain with the most joints whose names match `names`. Joints before the first of them stand still.
    fn named(&self, names: &[String]) -> Option<Chain> {
        let joints = self.robot.joints.iter().map(|joint| joint.name.as_str());
        let named: HashSet<usize> = match_joints(names, joints).into_iter().flatten().collect();
        let is_named = |index: &usize| named.contains(index);
        let mut best: Option<Chain> = None;
        for moved in self.tree.order.iter().copied().filter(|&link| self.finger_of[link].is_none()) {
            let Some((index, _)) = self.before(moved).filter(|(_, joint)| joint.motion.is_own()) else {
                continue;
            };
            let path = self.joints_to(moved);
            let joints: Vec<usize> = path.iter().copied().skip_while(|index| !is_named(index)).collect();
            let longer = best.as_ref().is_none_or(|best| joints.len() > best.joints.len());
            if is_named(&index) && joints.iter().all(is_named) && longer {
                best = Some(Chain { end: self.tool_of(moved), joints, equals: Vec::new() });
            }
        }
        best
    }
}
