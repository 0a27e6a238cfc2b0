//! Identity of an arm: a hash of its dynamic parameters, so that weights learned on one arm are not used on another.

use std::fmt::Write as _;

use freeplay_arm::Arm;
use freeplay_model::ArmFile;
use sha2::{Digest, Sha256};

/// Numbers that differ by less than about this give the same hash, because reading and writing a model file rounds. SI units.
const GRID: f64 = 1e-6;

/// The first 16 hexadecimal digits of SHA-256 over the joints' kinds, axes, placements and links, and the tool of `arm`. Names,
/// limits, gravity, friction and play are not part of the identity.
pub fn identity(arm: &Arm) -> String {
    let mut hash = Sha256::new();
    let mut feed = |value: f64| hash.update(((value / GRID).round() as i64).to_le_bytes());
    for joint in arm.joints() {
        feed(f64::from(u8::from(joint.kind == freeplay_arm::JointKind::Prismatic)));
        joint.axis.iter().copied().for_each(&mut feed);
        joint.placement.to_homogeneous().iter().copied().for_each(&mut feed);
        feed(joint.rotor_inertia);
        feed(joint.inertia.mass);
        joint.inertia.com.iter().chain(joint.inertia.about_com.iter()).copied().for_each(&mut feed);
    }
    arm.tool().to_homogeneous().iter().copied().for_each(&mut feed);
    digits(hash)
}

/// The first 16 hexadecimal digits of SHA-256 over the arm of `file` and its effects, in any order: the identity of the model.
pub fn model_identity(file: &ArmFile) -> String {
    let of_effect = |effect: &freeplay_model::EffectTable| {
        let mut parameters: Vec<String> =
            effect.parameters.iter().map(|(name, value)| format!("{name}={value}")).collect();
        parameters.sort_unstable();
        format!("{} {:?} {}", effect.kind, effect.joint, parameters.join(" "))
    };
    let mut effects: Vec<String> = file.effects.iter().map(of_effect).collect();
    effects.sort_unstable();
    let mut hash = Sha256::new();
    hash.update(identity(&file.arm));
    effects.iter().for_each(|effect| hash.update(format!("\n{effect}")));
    digits(hash)
}

fn digits(hash: Sha256) -> String {
    let mut text = String::with_capacity(16);
    for byte in &hash.finalize()[..8] {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}
