//! The chain of a machine: the true arm with the changes and the further coordinates of its effects.

use freeplay_arm::{Arm, Inertia, Joint, JointFriction, JointKind, Limits, Workspace, forward_kinematics};
use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};

use super::plan::{PlanError, Spring};
use crate::arms::Load;
use crate::data_sheet_deviations::lengthen;
use crate::physics::{Effect, Physics};

/// Role of a coordinate of the extended arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    Joint(usize),
    /// First of the two slides before joint `.0`; the second follows.
    Slide(usize),
    Spring {
        stiffness: f64,
        damping: f64,
    },
    Free,
}

/// The chain while it is being built: joints with their roles, in order from the base.
pub(super) struct Chain {
    pub links: Vec<(Joint, Role)>,
    pub tool: Isometry3<f64>,
    pub gravity: Vector3<f64>,
    /// Link and mass of a load that drops at some time.
    pub drop: Option<(Inertia, f64)>,
}

impl Chain {
    /// The coordinate of `joint`.
    pub fn place(&self, joint: usize) -> usize {
        self.links.iter().position(|(_, role)| *role == Role::Joint(joint)).unwrap_or(0)
    }

    /// The springs of coordinates that are not joints.
    pub fn springs(&self) -> Vec<Spring> {
        let spring = |(coordinate, (_, role)): (usize, &(Joint, Role))| match *role {
            Role::Spring { stiffness, damping } => Some(Spring { coordinate, stiffness, damping, rest: 0.0 }),
            _ => None,
        };
        self.links.iter().enumerate().filter_map(spring).collect()
    }
}

/// Positions of the hinges of a bending link, as shares of its length: the points of two-point Gauss quadrature. Hinges there, each with half of the beam's
/// L/EI, deflect under a force and a moment at the end like a uniform beam, since that deflection is an integral of squares.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// A joint without inertia.
fn massless_joint(name: String, kind: JointKind, axis: Vector3<f64>, placement: Isometry3<f64>) -> Joint {
    let axis = Unit::new_normalize(axis);
    let (limits, friction, inertia) = (Limits::NONE, JointFriction::default(), Inertia::zero());
    Joint { name, kind, axis, placement, limits, friction, rotor_inertia: 0.0, inertia }
}

/// Inertia of a point mass.
fn point(mass: f64, com: Vector3<f64>) -> Inertia {
    Inertia { mass, com, about_com: Matrix3::zeros() }
}

/// The true arm: `arm` with the changes and additions of its `effects`; `poses` are its working poses, the central one first.
pub(super) fn chain_of(
    arm: &Arm,
    load: &Load,
    effects: &[Effect],
    poses: &[Vec<f64>],
) -> Result<Chain, PlanError> {
    let links = arm.joints().iter().cloned().enumerate().map(|(i, joint)| (joint, Role::Joint(i))).collect();
    let mut chain = Chain { links, tool: *arm.tool(), gravity: *arm.gravity(), drop: None };
    for effect in effects {
        reshape(&mut chain, effect, load);
    }
    for effect in effects {
        insert(&mut chain, effect, arm, load, poses)?;
    }
    Ok(chain)
}

/// Applies effects that change existing parts.
fn reshape(chain: &mut Chain, effect: &Effect, load: &Load) {
    let last = chain.links.len() - 1;
    match (&effect.physics, effect.joint) {
        (Physics::Payload { mass, com }, _) => {
            let link = &mut chain.links[last].0.inertia;
            *link = link.joined_with(&point(*mass, Vector3::from(*com)), &Isometry3::identity());
        }
        (Physics::LinkMass { scale }, Some(joint)) => {
            let link = &mut chain.links[joint].0.inertia;
            link.mass *= scale;
            link.about_com *= *scale;
        }
        (Physics::BaseTilt { roll, pitch }, _) => {
            let turn = UnitQuaternion::from_euler_angles(*roll, *pitch, 0.0);
            chain.gravity = turn.inverse() * chain.gravity;
        }
        (Physics::LinkLength { offset }, Some(joint)) => {
            let way = match chain.links.get_mut(joint + 1) {
                Some((next, _)) => &mut next.placement.translation.vector,
                None => &mut chain.tool.translation.vector,
            };
            lengthen(way, *offset);
        }
        (Physics::LoadDrop { mass, at }, _) => {
            let link = chain.links[last].0.inertia;
            let gone = point(-mass, load.place);
            chain.drop = Some((link.joined_with(&gone, &Isometry3::identity()), *at));
        }
        (Physics::SloshingLoad { mass, .. }, _) => {
            let link = &mut chain.links[last].0.inertia;
            *link = link.joined_with(&point(-mass, load.place), &Isometry3::identity());
        }
        _ => {}
    }
}

/// Applies effects that add coordinates.
fn insert(
    chain: &mut Chain,
    effect: &Effect,
    arm: &Arm,
    load: &Load,
    poses: &[Vec<f64>],
) -> Result<(), PlanError> {
    match (&effect.physics, effect.joint) {
        (Physics::JointClearance { .. } | Physics::LubricatedClearance { .. }, Some(joint)) => {
            insert_slides(chain, effect, joint)
        }
        (Physics::LinkFlexure { stiffness }, Some(joint)) => insert_hinges(chain, effect, joint, *stiffness),
        (Physics::MountResonance { frequency, damping }, _) => {
            insert_mount(chain, arm, poses, *frequency, *damping);
            Ok(())
        }
        (Physics::SloshingLoad { mass, length, .. }, _) => {
            append_pendulum(chain, arm, load, poses, *mass, *length);
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Inserts two slides across the axis, before the joint.
fn insert_slides(chain: &mut Chain, effect: &Effect, joint: usize) -> Result<(), PlanError> {
    let at = chain.place(joint);
    let next = &mut chain.links[at].0;
    if next.kind != JointKind::Revolute {
        let why = "a clearance needs a revolute joint";
        return Err(PlanError::Seat { kind: effect.physics.kind(), joint: effect.joint, why });
    }
    let placement = std::mem::replace(&mut next.placement, Isometry3::identity());
    let axis = next.axis.into_inner();
    let name = next.name.clone();
    let first = across(&axis);
    let slide = |name, direction, placement| massless_joint(name, JointKind::Prismatic, direction, placement);
    chain
        .links
        .insert(at, (slide(format!("{name} play 2"), axis.cross(&first), Isometry3::identity()), Role::Free));
    chain.links.insert(at, (slide(format!("{name} play 1"), first, placement), Role::Slide(joint)));
    Ok(())
}

/// Inserts a bending link, as hinges about both axes across it at the two points of [`GAUSS`].
fn insert_hinges(chain: &mut Chain, effect: &Effect, joint: usize, stiffness: f64) -> Result<(), PlanError> {
    let at = chain.place(joint);
    let why = "no link of some length with a joint beyond it moves with it";
    let seat = || PlanError::Seat { kind: effect.physics.kind(), joint: effect.joint, why };
    let next = &mut chain.links.get_mut(at + 1).ok_or_else(seat)?.0;
    let way = next.placement.translation.vector;
    let direction = way.try_normalize(0.02).ok_or_else(seat)?;
    let [near, far] = GAUSS;
    next.placement.translation.vector = way * (1.0 - far);
    let own = std::mem::replace(&mut chain.links[at].0.inertia, Inertia::zero());
    // k = 3EI/L³, and each of the hinges has half of L/EI.
    let turning = 2.0 / 3.0 * stiffness * way.norm_squared();
    // A twentieth of critical damping for a mass of 5 kg at the end.
    let damping = 0.1 * turning * (5.0 / stiffness).sqrt();
    let first = across(&direction);
    let second = direction.cross(&first);
    let hinge = |name: &str, axis, along: f64| {
        let root = Isometry3::from_parts(Translation3::from(way * along), UnitQuaternion::identity());
        let joint = massless_joint(format!("bend {name} {joint}"), JointKind::Revolute, axis, root);
        (joint, Role::Spring { stiffness: turning, damping })
    };
    let mut hinges = [
        hinge("1", first, near),
        hinge("2", second, 0.0),
        hinge("3", first, far - near),
        hinge("4", second, 0.0),
    ];
    // The mass of the link is between the two hinges.
    hinges[1].0.inertia = Inertia { com: own.com - way * near, ..own };
    chain.links.splice(at + 1..at + 1, hinges);
    Ok(())
}

/// Inserts a base that rocks on springs about its x and y axes at `frequency` Hz with the arm in the middle of its poses.
fn insert_mount(chain: &mut Chain, arm: &Arm, poses: &[Vec<f64>], frequency: f64, damping: f64) {
    let mut inertia = 0.0;
    let mut ws = Workspace::new(arm);
    if let Some(pose) = poses.first() {
        forward_kinematics(arm, &mut ws, pose);
        for (i, joint) in arm.joints().iter().enumerate() {
            let place = (ws.link_pose(i) * nalgebra::Point3::from(joint.inertia.com)).coords;
            inertia +=
                joint.inertia.mass * (place.x * place.x * 0.5 + place.y * place.y * 0.5 + place.z * place.z);
        }
    }
    let omega = std::f64::consts::TAU * frequency;
    let role = Role::Spring { stiffness: inertia * omega * omega, damping: 2.0 * damping * inertia * omega };
    let rock = |name: &str, axis| {
        massless_joint(format!("mount {name}"), JointKind::Revolute, axis, Isometry3::identity())
    };
    chain.links.insert(0, (rock("y", Vector3::y()), role));
    chain.links.insert(0, (rock("x", Vector3::x()), role));
}

/// Makes the load a pendulum; its rest position, in the first pose, is the load's position on the data sheet.
fn append_pendulum(chain: &mut Chain, arm: &Arm, load: &Load, poses: &[Vec<f64>], mass: f64, length: f64) {
    let mut ws = Workspace::new(arm);
    let Some(pose) = poses.first() else { return };
    forward_kinematics(arm, &mut ws, pose);
    let turn = ws.link_pose(arm.dof() - 1).rotation.inverse();
    let down = turn * arm.gravity().normalize();
    let axis = turn * Vector3::x();
    let hook =
        Isometry3::from_parts(Translation3::from(load.place - down * length), UnitQuaternion::identity());
    let mut swing = massless_joint("load".to_owned(), JointKind::Revolute, axis, hook);
    swing.inertia = point(mass, down * length);
    swing.inertia.about_com = Matrix3::identity() * (1e-3 * mass * length * length);
    let damping = 0.05 * mass * length * (length * 9.81).sqrt();
    chain.links.push((swing, Role::Spring { stiffness: 0.0, damping }));
}

/// A direction perpendicular to `axis`.
fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    let helper = if axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::z() };
    axis.cross(&helper).normalize()
}

#[cfg(test)]
mod tests {
    use super::{Role, chain_of};
    use crate::Machine;
    use crate::physics::{Effect, Physics};

    /// Deflection and slope of the link's end under a force and under a moment are those of a uniform cantilever with k = 3EI/L³, about both
    /// axes across it: 1/k, 3/2kL and 3/kL² (Timoshenko 1955, §39).
    #[test]
    fn a_link_bends_as_a_cantilever() {
        let (arm, load) = Machine::Two.loaded(1.0).expect("an arm");
        let stiffness = 4e4;
        let effect = Effect { joint: Some(0), physics: Physics::LinkFlexure { stiffness } };
        let poses = [Machine::Two.home().to_vec()];
        let chain = chain_of(&arm, &load, &[effect], &poses).expect("a chain");
        let length = arm.joints()[1].placement.translation.vector.norm();
        let end = chain.place(1);
        let to_end = |from: usize| -> f64 {
            chain.links[from + 1..=end]
                .iter()
                .map(|(joint, _)| joint.placement.translation.vector.norm())
                .sum()
        };
        let hinges: Vec<(f64, f64, nalgebra::Vector3<f64>)> = (0..end)
            .filter_map(|place| match chain.links[place].1 {
                Role::Spring { stiffness, .. } => {
                    Some((to_end(place), stiffness, chain.links[place].0.axis.into_inner()))
                }
                _ => None,
            })
            .collect();
        assert_eq!(hinges.len(), 4);
        for axis in [hinges[0].2, hinges[1].2] {
            let sum = |power: i32| -> f64 {
                let about = hinges.iter().filter(|(_, _, other)| other.cross(&axis).norm() < 1e-12);
                about.map(|(lever, turning, _)| lever.powi(power) / turning).sum()
            };
            let exact = [1.0 / stiffness, 1.5 / (stiffness * length), 3.0 / (stiffness * length * length)];
            for (power, exact) in [2, 1, 0].into_iter().zip(exact) {
                println!("lever to the {power}: off by {:.1e}", sum(power) / exact - 1.0);
                assert!((sum(power) / exact - 1.0).abs() < 1e-12);
            }
        }
        // The total mass and the length of the arm are unchanged.
        let mass = |links: &mut dyn Iterator<Item = f64>| links.sum::<f64>();
        let before = mass(&mut arm.joints().iter().map(|joint| joint.inertia.mass));
        let after = mass(&mut chain.links.iter().map(|(joint, _)| joint.inertia.mass));
        assert!((after / before - 1.0).abs() < 1e-12 && (to_end(0) / length - 1.0).abs() < 1e-12);
    }
}
