//! The tree of URDF links → the arm: checks the tree, selects the arm and folds the other links into it.

use nalgebra::{Isometry3, Vector3};

use crate::arm_file::{ArmFile, Selection};
use crate::chain::{Chain, choose};
use crate::error::ModelError;
use crate::fold::Fold;
use crate::names::listed;
use crate::plausible;
use crate::robot::{Robot, Tree, tree};
use crate::urdf_joint::{Details, Motion};
use freeplay_arm::{Arm, ArmError, Fitness, JointSource, MAX_DOF, Purpose, Shortfall};

/// Standard gravity of the model's files, m/s².
pub(super) const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// The arm of a robot.
pub(super) fn arm(mut robot: Robot<'_>, selection: &Selection) -> Result<ArmFile, ModelError> {
    let tree = tree(&robot)?;
    let chain = choose(&robot, &tree, selection)?;
    if chain.joints.len() > MAX_DOF {
        return Err(arm_error(&robot, ArmError::TooManyJoints { count: chain.joints.len() }));
    }
    demand_joints(&mut robot, &tree, &chain)?;
    let mut fold = Fold::new(&robot, &tree, &chain);
    demand_links(&mut robot, &fold)?;
    let bodies = fold.bodies(&robot);
    let joints = fold.joints(&robot);
    let tool = match fold.seats[chain.end].on {
        Some(_) => fold.seats[chain.end].pose,
        None => Isometry3::identity(),
    };
    let shortfall = shortfall(&robot, &fold);
    let fitness = Fitness::of_file(sources(&robot, &chain), shortfall);
    let arm = Arm::derived(&robot.name, joints, tool, GRAVITY, &fitness)
        .map_err(|source| arm_error(&robot, source))?;
    let mut ignored = vec![fold.selection_note(&robot)];
    ignored.append(&mut robot.notes);
    ignored.append(&mut fold.notes);
    ignored.extend(lacking(&arm));
    ignored.extend(plausible::notes(&arm, &bodies, &sources(&robot, &chain)));
    Ok(ArmFile { arm, effects: Vec::new(), ignored })
}

/// The first use for which `arm` is not suitable, with the missing property, in words; `None` if it is suitable for all.
pub(super) fn lacking(arm: &Arm) -> Option<String> {
    let lacks = |purpose| arm.require(purpose).err();
    lacks(Purpose::Torque).or_else(|| lacks(Purpose::Simulation)).map(|shortfall| shortfall.to_string())
}

/// Returns the error in `slot`, and replaces it by `blank`.
fn demand<T>(slot: &mut Result<T, ModelError>, blank: T) -> Result<(), ModelError> {
    if slot.is_ok() {
        return Ok(());
    }
    std::mem::replace(slot, Ok(blank)).map(drop)
}

/// Returns the first error of the joints from the root to the end of `chain`, and ignores errors of others.
fn demand_joints(robot: &mut Robot<'_>, tree: &Tree, chain: &Chain) -> Result<(), ModelError> {
    let (mut link, mut path) = (chain.end, Vec::new());
    while let Some(index) = tree.parent_joint[link] {
        path.push(index);
        let joint = &mut robot.joints[index];
        demand(&mut joint.placement, Isometry3::identity())?;
        if chain.joints.contains(&index) || joint.motion == Motion::Unknown {
            demand(&mut joint.details, Details::none())?;
        }
        link = joint.parent;
    }
    for &index in path.iter().rev() {
        let mut notes = std::mem::take(&mut robot.joints[index].notes);
        robot.notes.append(&mut notes);
    }
    Ok(())
}

/// Returns the first error of the links that the arm moves; an error of another link becomes a note.
fn demand_links(robot: &mut Robot<'_>, fold: &Fold<'_>) -> Result<(), ModelError> {
    let mut unmoved = Vec::new();
    for (link, seat) in robot.links.iter_mut().zip(&fold.seats) {
        let Some(inertial) = &mut link.inertial else { continue };
        match inertial {
            Ok(inertial) if seat.on.is_some() => robot.notes.append(&mut inertial.notes),
            Ok(inertial) if inertial.impossible.is_some() => unmoved.push(link.name.as_str()),
            Ok(_) => {}
            Err(_) if seat.on.is_some() => {
                if let Some(Err(error)) = link.inertial.take() {
                    return Err(error);
                }
            }
            Err(error) => {
                robot
                    .notes
                    .push(format!("{error}; the arm does not move this link, so this inertia is not used"));
            }
        }
    }
    if !unmoved.is_empty() {
        let note =
            format!("impossible inertias that the arm does not move are not used: {}", listed(unmoved));
        robot.notes.push(note);
    }
    let mut riding = robot.joints.iter_mut().filter(|joint| fold.seats[joint.parent].on.is_some());
    riding.try_for_each(|joint| demand(&mut joint.placement, Isometry3::identity()))
}

/// Reason why torques of the arm cannot be computed.
fn shortfall(robot: &Robot<'_>, fold: &Fold<'_>) -> Option<Shortfall> {
    let moved = || {
        let links = robot.links.iter().zip(&fold.seats).filter(|(_, seat)| seat.on.is_some());
        links.filter_map(|(link, _)| link.inertial.as_ref()?.as_ref().ok())
    };
    if moved().all(|inertial| inertial.inertia.mass == 0.0 && inertial.impossible.is_none()) {
        return Some(Shortfall::NoMasses { at: robot.source.place(0) });
    }
    moved().find_map(|inertial| inertial.impossible.clone())
}

fn sources(robot: &Robot<'_>, chain: &Chain) -> Vec<JointSource> {
    let of = |&index: &usize| {
        let joint = &robot.joints[index];
        let link = robot.links[joint.child].name.clone();
        JointSource { joint: joint.name.clone(), link, at: robot.source.place(joint.at) }
    };
    chain.joints.iter().map(of).collect()
}

/// The place of the joint that an arm's error names.
fn arm_error(robot: &Robot<'_>, source: ArmError) -> ModelError {
    let joint = source.joint().and_then(|name| robot.joints.iter().find(|joint| joint.name == name));
    let at = robot.source.place(joint.map_or(0, |joint| joint.at));
    ModelError::Arm { at, source: Box::new(source) }
}
