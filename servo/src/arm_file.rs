//! The servos of an arm file.

use freeplay_arm::ArmFile;
use freeplay_laws::{Effects, LawError, Values, kind};

use crate::joint::JointServo;
use crate::rollout::ServoArm;

/// Kinds of effects at a joint that a rollout knows; effects that change the arm itself act, too.
const AT_JOINTS: [&str; 7] = [
    "servo",
    "command_delay",
    "hard_stop",
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "rotor_inertia",
];

impl ServoArm {
    /// The arm of `file` with the servo of each joint; `None` if a joint has none.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn of(file: &ArmFile) -> Result<Option<ServoArm>, LawError> {
        let effects = Effects::of(file)?;
        let arm = effects.changed(&file.arm)?;
        let mut joints: Vec<Option<JointServo>> = vec![None; arm.dof()];
        for of_servos in [true, false] {
            for table in file.effects.iter().filter(|table| (table.kind == "servo") == of_servos) {
                let known = kind(&table.kind).filter(|kind| AT_JOINTS.contains(&kind.name));
                let Some(known) = known else { continue };
                let values = Values::of(known, table, &file.arm)?;
                let joint = &mut joints[values.joint()?];
                match joint {
                    None if of_servos => *joint = Some(servo(&values)?),
                    Some(joint) => add(joint, known.name, &values)?,
                    None => {}
                }
            }
        }
        let Some(mut joints) = joints.into_iter().collect::<Option<Vec<JointServo>>>() else {
            return Ok(None);
        };
        for (servo, joint) in joints.iter_mut().zip(arm.joints()) {
            servo.coulomb = (servo.coulomb + joint.friction.coulomb).max(0.0);
            servo.damping = (servo.damping + joint.friction.viscous).max(0.0);
        }
        Ok(Some(ServoArm { arm, joints }))
    }

    /// The effects of `file` that a rollout does not know, by kind.
    pub fn unused(file: &ArmFile) -> Vec<&str> {
        let is_known = |name: &str| AT_JOINTS.contains(&name) || CHANGES_ARM.contains(&name);
        let mut unused: Vec<&str> =
            file.effects.iter().map(|table| table.kind.as_str()).filter(|name| !is_known(name)).collect();
        unused.sort_unstable();
        unused.dedup();
        unused
    }
}

/// Kinds of effects that change the arm that is integrated.
const CHANGES_ARM: [&str; 4] = ["payload", "link_mass", "base_tilt", "link_length"];

fn servo(values: &Values) -> Result<JointServo, LawError> {
    Ok(JointServo {
        damping: values.number("damping")?,
        deadband: values.number("deadband")?,
        torque_limit: values.optional("torque_limit")?.unwrap_or(f64::INFINITY),
        speed_limit: values.optional("speed_limit")?.unwrap_or(f64::INFINITY),
        resolution: values.number("resolution")?,
        offset: values.number("offset")?,
        ..JointServo::stiff(values.number("stiffness")?)
    })
}

/// Adds an effect of the kind `name` to `joint`.
fn add(joint: &mut JointServo, name: &str, values: &Values) -> Result<(), LawError> {
    match name {
        "command_delay" => joint.delay += values.number("delay")?,
        "hard_stop" => {
            joint.stops = [
                values.optional("lower")?.unwrap_or(f64::NEG_INFINITY),
                values.optional("upper")?.unwrap_or(f64::INFINITY),
            ];
        }
        "coulomb_friction" => joint.coulomb += values.number("coulomb")?,
        "viscous_friction" => joint.damping += values.number("viscous")?,
        "rotor_inertia" => joint.rotor_inertia += values.number("inertia")?,
        _ => {
            joint.stiction += values.number("extra")?.max(0.0);
            joint.stribeck_velocity = values.number("velocity")?;
        }
    }
    Ok(())
}
