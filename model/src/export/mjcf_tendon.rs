//! Tendons of MJCF: friction behind a gap, radial play, shafts shared by two joints.

use super::mjcf_writer::{Marks, Writer};
use super::xml::{number, numbers};

/// Writes all tendons.
pub(super) fn write(writer: &mut Writer, marks: &Marks) {
    let parts = writer.parts;
    writer.xml.start("tendon", &[]);
    for (&joint, gear_joint) in &marks.gears {
        let (motor, Some(gear)) = (&parts.joints[joint].joint.name, parts.joints[joint].gear) else {
            continue;
        };
        if gear.friction > 0.0 {
            let friction = [("frictionloss", number(gear.friction))];
            fixed(writer, &format!("{motor}_link_friction"), &friction, &[(motor, 1.0), (gear_joint, 1.0)]);
        }
    }
    for shaft in &parts.shafts {
        let [first, second] = shaft.joints.map(|joint| parts.joints[joint].joint.name.as_str());
        let numbers =
            [("armature", shaft.inertia), ("damping", shaft.viscous), ("frictionloss", shaft.coulomb)];
        let numbers = numbers.map(|(name, value)| (name, number(value)));
        fixed(writer, &format!("{first}_{second}_shaft"), &numbers, &[(first, 1.0), (second, shaft.ratio)]);
    }
    for (joint, parts) in parts.joints.iter().enumerate() {
        let (Some(clearance), Some(bearing), Some(journal)) =
            (parts.play, marks.bearings.get(&joint), marks.journals.get(&joint))
        else {
            continue;
        };
        let name = writer.names.take(&format!("{}_play", parts.joint.name));
        let range = [0.0, clearance];
        writer.xml.start("spatial", &[("name", name), ("range", numbers(&range)), ("width", number(1e-4))]);
        writer.xml.empty("site", &[("site", bearing.clone())]);
        writer.xml.empty("site", &[("site", journal.clone())]);
        writer.xml.end();
    }
    writer.xml.end();
}

/// A tendon whose length is a weighted sum of joint positions.
fn fixed(writer: &mut Writer, name: &str, attributes: &[(&'static str, String)], joints: &[(&str, f64)]) {
    let mut named = vec![("name", writer.names.take(name))];
    named.extend_from_slice(attributes);
    writer.xml.start("fixed", &named);
    for (joint, factor) in joints {
        writer.xml.empty("joint", &[("joint", (*joint).to_owned()), ("coef", number(*factor))]);
    }
    writer.xml.end();
}
