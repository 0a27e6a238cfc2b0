//! A mechanism → URDF.
//!
//! URDF has masses, placements, limits and `<dynamics damping friction>`, and nothing else beyond the rigid arm. Its gravity is 9.81 m/s²
//! along the world's −z: an arm with another direction of gravity gets a link `world` before its base. The zero of an encoder becomes part
//! of the placement of its joint.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::inertia::{LEAST_MASS, LEAST_MOMENT};
use super::names::Names;
use super::parts::{JointParts, Parts};
use super::rotation::roll_pitch_yaw;
use super::xml::{Xml, number, numbers};
use super::{Element, Exported, Mechanism};
use freeplay_arm::{Joint, JointKind, brief};

/// Gravity that tools assume for a URDF, m/s².
const GRAVITY: f64 = 9.81;

/// The value of a limit that tools require and the model lacks: beyond any machine, in rad, m, rad/s, N·m.
const NO_LIMIT: f64 = 1e9;

/// Names of the base link, of the link before it if gravity requires one, and of the tool frame.
const BASE: &str = "base_link";
const WORLD: &str = "world";
const TOOL: &str = "tool0";

/// The URDF of `mechanism`. Each link has its joint's name with the suffix `_link`; the tool frame is `tool0`.
pub fn to_urdf(mechanism: &Mechanism) -> Exported {
    let parts = Parts::of(mechanism, is_expressible);
    let mut not_expressed = mechanism.not_expressed.clone();
    not_expressed.extend(
        mechanism
            .elements
            .iter()
            .filter_map(|named| missing(&named.element).map(|why| format!("{}: {why}", named.name))),
    );
    not_expressed.extend(not_expressed_of_arm(mechanism));
    not_expressed.extend(parts.not_expressed.clone());
    not_expressed.extend(parts.joints.iter().flat_map(JointParts::below_zero));
    let mut xml = Xml::new();
    xml.comment(super::heading(&not_expressed).iter().map(String::as_str));
    xml.start("robot", &[("name", mechanism.arm.name().to_owned())]);
    let mut joints = Names::of(mechanism.arm.joints().iter().map(|joint| joint.name.as_str()));
    let mut links = Names::of([WORLD, BASE, TOOL]);
    write_base(&mut xml, &mut joints, mechanism.arm.gravity());
    let mut parent = BASE.to_owned();
    for joint in &parts.joints {
        let link = links.take(&format!("{}_link", joint.joint.name));
        write_joint(&mut xml, joint, [&parent, &link]);
        parent = link;
    }
    xml.empty("link", &[("name", TOOL.to_owned())]);
    fixed(&mut xml, &joints.take("tool0_fixed"), [&parent, TOOL], mechanism.arm.tool());
    Exported { text: xml.finish(), not_expressed }
}

/// True if URDF can express `element`.
fn is_expressible(element: &Element) -> bool {
    matches!(
        element,
        Element::Damping { .. }
            | Element::DryFriction { .. }
            | Element::TorqueLimit { .. }
            | Element::EncoderZero { .. }
            | Element::Stop { .. }
    )
}

/// The part of `element` that URDF cannot express; `None` if it can express all of it.
fn missing(element: &Element) -> Option<&'static str> {
    match element {
        Element::Damping { quadratic, .. } if *quadratic != 0.0 => {
            Some("URDF has no damping that grows with the square")
        }
        Element::Damping { .. }
        | Element::DryFriction { .. }
        | Element::TorqueLimit { .. }
        | Element::EncoderZero { .. }
        | Element::Stop { .. } => None,
        Element::RotorInertia { .. } => Some("URDF has no inertia of rotors"),
        Element::ConstantTorque { .. } => {
            Some("URDF has no constant torque; friction is the mean of both directions")
        }
        Element::Spring { .. } => Some("URDF has no springs"),
        Element::Gear { .. } => Some("URDF has no compliance, gap or friction between motor and link"),
        Element::RadialPlay { .. } => Some("URDF has no play across an axis"),
        Element::Shaft { .. } => Some("URDF has no shaft that two joints share"),
        Element::TorqueGain { .. } | Element::TorqueOffset { .. } => {
            Some("URDF has no gain or offset of torques")
        }
        Element::Servo { .. } => Some("URDF has no servos"),
        Element::Delay { .. } | Element::CommandDelay { .. } => Some("URDF has no delays"),
    }
}

/// Properties of the rigid arm that URDF cannot express.
fn not_expressed_of_arm(mechanism: &Mechanism) -> Vec<String> {
    let arm = &mechanism.arm;
    let rotors = arm.joints().iter().filter(|joint| joint.rotor_inertia != 0.0);
    let mut not_expressed: Vec<String> = rotors
        .map(|joint| {
            format!(
                "rotor inertia of {} ({} {}): URDF has none",
                joint.name,
                brief(joint.rotor_inertia),
                match joint.kind {
                    JointKind::Revolute => "kg*m^2",
                    JointKind::Prismatic => "kg",
                }
            )
        })
        .collect();
    let strength = arm.gravity().norm();
    if (strength - GRAVITY).abs() > 1e-9 {
        not_expressed.push(format!(
            "gravity of {} m/s^2: URDF has none of its own, set it in your tool",
            brief(strength)
        ));
    }
    not_expressed
}

/// Writes the base, and before it, if necessary, a link `world` in which gravity points along −z.
fn write_base(xml: &mut Xml, joints: &mut Names, gravity: &Vector3<f64>) {
    let down = -Vector3::z();
    if let Some(direction) = gravity.try_normalize(0.0).filter(|direction| (direction - down).norm() > 1e-15)
    {
        // The smallest rotation; for an inverted arm this is half a turn about x.
        let turn = Rotation3::rotation_between(&direction, &down)
            .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
        xml.empty("link", &[("name", WORLD.to_owned())]);
        let turn = Isometry3::from_parts(Default::default(), UnitQuaternion::from_rotation_matrix(&turn));
        fixed(xml, &joints.take("world_fixed"), [WORLD, BASE], &turn);
    }
    xml.empty("link", &[("name", BASE.to_owned())]);
}

fn fixed(xml: &mut Xml, name: &str, [parent, child]: [&str; 2], pose: &Isometry3<f64>) {
    xml.start("joint", &[("name", name.to_owned()), ("type", "fixed".to_owned())]);
    write_ends(xml, parent, child, pose);
    xml.end();
}

fn write_ends(xml: &mut Xml, parent: &str, child: &str, pose: &Isometry3<f64>) {
    xml.empty("parent", &[("link", parent.to_owned())]);
    xml.empty("child", &[("link", child.to_owned())]);
    let rpy = roll_pitch_yaw(&pose.rotation);
    xml.empty("origin", &[("xyz", numbers(pose.translation.vector.as_slice())), ("rpy", numbers(&rpy))]);
}

/// Writes the joint from the link `parent` to the link `link`, and that link.
fn write_joint(xml: &mut Xml, parts: &JointParts, [parent, link]: [&str; 2]) {
    let joint = &parts.joint;
    write_link(xml, joint, link);
    let is_endless = joint.limits.lower == f64::NEG_INFINITY && joint.limits.upper == f64::INFINITY;
    let kind = match joint.kind {
        JointKind::Revolute if is_endless => "continuous",
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    };
    xml.start("joint", &[("name", joint.name.clone()), ("type", kind.to_owned())]);
    write_ends(xml, parent, link, &joint.placement);
    xml.empty("axis", &[("xyz", numbers(joint.axis.as_slice()))]);
    write_limits(xml, parts, kind == "continuous");
    let (damping, friction) = (parts.damping[0].max(0.0), parts.friction.max(0.0));
    if damping != 0.0 || friction != 0.0 {
        xml.empty("dynamics", &[("damping", number(damping)), ("friction", number(friction))]);
    }
    xml.end();
}

/// Writes `<limit>`, which the format requires of all joints but endless ones.
fn write_limits(xml: &mut Xml, parts: &JointParts, is_endless: bool) {
    let limits = &parts.joint.limits;
    let effort = parts.torque[1].min(-parts.torque[0]);
    let named = [limits.velocity, limits.acceleration, effort].iter().any(|limit| limit.is_finite());
    if is_endless && !named {
        return;
    }
    let bounded = |value: f64| number(value.clamp(-NO_LIMIT, NO_LIMIT));
    let mut attributes = Vec::new();
    if !is_endless {
        attributes.extend([("lower", bounded(limits.lower)), ("upper", bounded(limits.upper))]);
    }
    attributes.extend([("effort", bounded(effort)), ("velocity", bounded(limits.velocity))]);
    if limits.acceleration.is_finite() {
        attributes.push(("acceleration", number(limits.acceleration)));
    }
    xml.empty("limit", &attributes);
}

fn write_link(xml: &mut Xml, joint: &Joint, name: &str) {
    // Simulators refuse a moving link without mass or with a moment of zero: the file has a value below all rounding instead.
    let mut inertia = joint.inertia;
    inertia.mass = inertia.mass.max(LEAST_MASS);
    if inertia.about_com.symmetric_eigenvalues().min().abs() < LEAST_MOMENT {
        inertia.about_com += Matrix3::identity() * LEAST_MOMENT;
    }
    xml.start("link", &[("name", name.to_owned())]);
    xml.start("inertial", &[]);
    xml.empty("origin", &[("xyz", numbers(inertia.com.as_slice())), ("rpy", "0 0 0".to_owned())]);
    xml.empty("mass", &[("value", number(inertia.mass))]);
    let m = &inertia.about_com;
    let tensor =
        [("ixx", m.m11), ("ixy", m.m12), ("ixz", m.m13), ("iyy", m.m22), ("iyz", m.m23), ("izz", m.m33)];
    xml.empty("inertia", &tensor.map(|(name, value)| (name, number(value))));
    xml.end();
    xml.end();
}
