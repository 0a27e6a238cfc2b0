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

/// Distance of a link's centre of mass from its end, as a share of the length, below which it bends as if the centre were there: its own weight W then deflects
/// the end by less than 0.015 W/k, and the hinges of the short part would be so stiff that the simulation would need thousands of steps for them.
const NEAR_END: f64 = 0.1;

/// Positions of the hinges of a bending link whose centre of mass is at the share `centre` of its length, and their shares of the beam's L/EI: the points and
/// weights of Gauss–Radau quadrature from the centre of mass to each end. Deflections are integrals over the two parts of products of two linear functions, so
/// that a force and a moment at the end and the link's own weight deflect these hinges like a uniform beam (Abramowitz & Stegun 1964, 25.4.31). A centre near
/// an end is at that end.
fn hinges_of(centre: f64) -> [(f64, f64); 3] {
    let centre = match centre {
        near if near < NEAR_END => 0.0,
        far if far > 1.0 - NEAR_END => 1.0,
        between => between,
    };
    let beyond = 1.0 - centre;
    [(centre / 3.0, 0.75 * centre), (centre, 0.25), (1.0 - beyond / 3.0, 0.75 * beyond)]
}

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

/// Inserts a bending link, as hinges about both axes across it at the points of [`hinges_of`].
fn insert_hinges(chain: &mut Chain, effect: &Effect, joint: usize, stiffness: f64) -> Result<(), PlanError> {
    let at = chain.place(joint);
    let why = "no link of some length with a joint beyond it moves with it";
    let seat = || PlanError::Seat { kind: effect.physics.kind(), joint: effect.joint, why };
    let next = &mut chain.links.get_mut(at + 1).ok_or_else(seat)?.0;
    let way = next.placement.translation.vector;
    let direction = way.try_normalize(0.02).ok_or_else(seat)?;
    let own = std::mem::replace(&mut chain.links[at].0.inertia, Inertia::zero());
    let centre = (own.com.dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
    let first = across(&direction);
    let axes = [first, direction.cross(&first)];
    let (mut parts, mut last) = (vec![(chain.links[at].0.clone(), chain.links[at].1, 0.0)], 0.0);
    for (along, share) in hinges_of(centre).into_iter().filter(|(_, share)| *share > 0.0) {
        // k = 3EI/L³.
        let turning = stiffness * way.norm_squared() / (3.0 * share);
        // A twentieth of critical damping for a mass of 5 kg at the end.
        let damping = 0.1 * turning * (5.0 / stiffness).sqrt();
        for axis in axes {
            let root =
                Isometry3::from_parts(Translation3::from(way * (along - last)), UnitQuaternion::identity());
            let name = format!("bend {} {joint}", parts.len());
            parts.push((
                massless_joint(name, JointKind::Revolute, axis, root),
                Role::Spring { stiffness: turning, damping },
                along,
            ));
            last = along;
        }
    }
    // The mass of the link is before the hinge at its centre.
    if let Some((bearer, _, along)) =
        parts.iter_mut().rev().find(|(_, _, along)| *along < centre || *along == 0.0)
    {
        bearer.inertia = Inertia { com: own.com - way * *along, ..own };
    }
    chain.links[at + 1].0.placement.translation.vector = way * (1.0 - last);
    chain.links.splice(at..=at, parts.into_iter().map(|(part, role, _)| (part, role)));
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

    /// Deflection and slope of the link's end under a force, under a moment and under its own weight are those of a uniform cantilever with k = 3EI/L³, about
    /// both axes across it: 1/k, 3/2kL and 3/kL² (Timoshenko 1955, §39).
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
        assert_eq!(hinges.len(), 6);
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
        // The link's own weight W at the share σ of its length: σ²(3 − σ)/2 · W/k at the end, σ³ · W/k at its centre.
        let bearer = chain.links.iter().position(|(joint, _)| joint.inertia.mass > 0.0).expect("a mass");
        let way = arm.joints()[1].placement.translation.vector;
        let own = arm.joints()[0].inertia.com.dot(&way) / (length * length);
        let near = |place: usize| to_end(place) / length - (1.0 - own);
        let before = |lever: &dyn Fn(f64) -> f64| -> f64 {
            let about = (0..=bearer).filter_map(|place| match chain.links[place].1 {
                Role::Spring { stiffness, .. } => Some(near(place) * length * lever(near(place)) / stiffness),
                _ => None,
            });
            0.5 * about.sum::<f64>()
        };
        let exact = [own * own * (3.0 - own) / (2.0 * stiffness), own.powi(3) / stiffness];
        let levers: [&dyn Fn(f64) -> f64; 2] = [&|near| (near + 1.0 - own) * length, &|near| near * length];
        for (lever, exact) in levers.into_iter().zip(exact) {
            println!("own weight at {own:.3}: off by {:.1e}", before(lever) / exact - 1.0);
            assert!((before(lever) / exact - 1.0).abs() < 1e-12);
        }
        // The total mass and the length of the arm are unchanged.
        let mass = |links: &mut dyn Iterator<Item = f64>| links.sum::<f64>();
        let before = mass(&mut arm.joints().iter().map(|joint| joint.inertia.mass));
        let after = mass(&mut chain.links.iter().map(|(joint, _)| joint.inertia.mass));
        assert!((after / before - 1.0).abs() < 1e-12 && (to_end(0) / length - 1.0).abs() < 1e-12);
    }
}
