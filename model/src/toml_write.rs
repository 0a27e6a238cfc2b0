//! Arm and effects → the text of a TOML arm file.

use std::fmt::Write;

use nalgebra::Isometry3;

use crate::arm_file::{ArmFile, EffectTable};
use crate::numbers::rotation;
use freeplay_arm::{Joint, JointKind, Limits};

/// The text of an arm file from which [`crate::load`] reads the same arm, bit by bit, and the same effects. All joints are inline, whatever
/// their original file; comments at the top list the ignored parts.
pub fn to_toml(file: &ArmFile) -> String {
    let mut text = String::new();
    for note in &file.ignored {
        line(&mut text, format_args!("# {}", note.replace(char::is_control, " ")));
    }
    let arm = &file.arm;
    line(&mut text, format_args!("name = {}", quoted(arm.name())));
    line(&mut text, format_args!("gravity = {:?}", arm.gravity().as_slice()));
    for joint in arm.joints() {
        write_joint(&mut text, joint);
    }
    if *arm.tool() != Isometry3::identity() {
        line(&mut text, format_args!("\n[tool]"));
        for entry in frame_entries(arm.tool()) {
            line(&mut text, format_args!("{entry}"));
        }
    }
    for effect in &file.effects {
        write_effect(&mut text, effect);
    }
    text
}

fn line(text: &mut String, content: std::fmt::Arguments<'_>) {
    writeln!(text, "{content}").expect("writing to a string cannot fail");
}

fn quoted(name: &str) -> String {
    toml::Value::String(name.to_owned()).to_string()
}

fn write_joint(text: &mut String, joint: &Joint) {
    let kind = match joint.kind {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    };
    line(text, format_args!("\n[[joint]]\nname = {}\ntype = \"{kind}\"", quoted(&joint.name)));
    line(text, format_args!("axis = {:?}", joint.axis.as_slice()));
    if joint.placement != Isometry3::identity() {
        line(text, format_args!("origin = {{ {} }}", frame_entries(&joint.placement).join(", ")));
    }
    write_limits(text, &joint.limits);
    for (key, value) in [
        ("damping", joint.friction.viscous),
        ("friction", joint.friction.coulomb),
        ("rotor_inertia", joint.rotor_inertia),
    ] {
        if value != 0.0 {
            line(text, format_args!("{key} = {value:?}"));
        }
    }
    let inertia = &joint.inertia;
    line(text, format_args!("mass = {:?}\ncom = {:?}", inertia.mass, inertia.com.as_slice()));
    let m = &inertia.about_com;
    line(
        text,
        format_args!(
            "inertia = {{ ixx = {:?}, iyy = {:?}, izz = {:?}, ixy = {:?}, ixz = {:?}, iyz = {:?} }}",
            m.m11, m.m22, m.m33, m.m12, m.m13, m.m23
        ),
    );
}

/// The finite limits; a missing one reads back as infinite.
fn write_limits(text: &mut String, limits: &Limits) {
    let entries: Vec<String> = [
        ("lower", limits.lower),
        ("upper", limits.upper),
        ("velocity", limits.velocity),
        ("acceleration", limits.acceleration),
        ("effort", limits.effort),
    ]
    .iter()
    .filter(|(_, value)| value.is_finite())
    .map(|(key, value)| format!("{key} = {value:?}"))
    .collect();
    if !entries.is_empty() {
        line(text, format_args!("limits = {{ {} }}", entries.join(", ")));
    }
}

/// Position and rotation; the rotation as roll, pitch, yaw if these read back to the same bits, else as a quaternion.
fn frame_entries(frame: &Isometry3<f64>) -> Vec<String> {
    let mut entries = vec![format!("xyz = {:?}", frame.translation.vector.as_slice())];
    let (roll, pitch, yaw) = frame.rotation.euler_angles();
    let bits = |r: &nalgebra::UnitQuaternion<f64>| r.coords.map(f64::to_bits);
    if bits(&rotation([roll, pitch, yaw])) != bits(&frame.rotation) {
        entries.push(format!("quaternion = {:?}", frame.rotation.coords.as_slice()));
    } else if [roll, pitch, yaw] != [0.0; 3] {
        entries.push(format!("rpy = {:?}", [roll, pitch, yaw]));
    }
    entries
}

fn write_effect(text: &mut String, effect: &EffectTable) {
    let mut table = toml::Table::new();
    table.insert("kind".to_owned(), effect.kind.clone().into());
    if let Some(joint) = &effect.joint {
        table.insert("joint".to_owned(), joint.clone().into());
    }
    table.extend(effect.parameters.clone());
    let document = toml::Table::from_iter([("effect".to_owned(), toml::Value::Array(vec![table.into()]))]);
    line(
        text,
        format_args!(
            "\n{}",
            toml::to_string(&document).expect("a table of TOML values can be written").trim_end()
        ),
    );
}
