//! The servos of an arm file.

use freeplay_laws::{Effects, LawError, Values, kind};
use freeplay_model::ArmFile;

use crate::burden::with_zeros;
use crate::joint::JointServo;
use crate::servo_arm::ServoArm;

/// Kinds of effects of a servo that a rollout includes; it also includes effects of the arm itself.
const AT_JOINTS: [&str; 9] = [
    "servo",
    "command_delay",
    "hard_stop",
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "asymmetric_friction",
    "presliding_friction",
    "rotor_inertia",
];
/// The kind of a delay in the recording of all joints.
const LATE: &str = "time_delay";

impl ServoArm {
    /// The arm of `file` with the servo of each joint; `None` if a joint has none.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn of(file: &ArmFile) -> Result<Option<ServoArm>, LawError> {
        let effects = Effects::of(file)?;
        let arm = effects.changed(&file.arm)?;
        let arm = with_zeros(&arm, &each(file, "encoder_offset", "offset")?)?;
        let mut joints: Vec<Option<JointServo>> = vec![None; arm.dof()];
        for of_servos in [true, false] {
            for table in file.effects.iter().filter(|table| (table.kind == "servo") == of_servos) {
                let known = kind(&table.kind).filter(|kind| AT_JOINTS.contains(&kind.name));
                let Some(known) = known else { continue };
                let values = known.values(table, &file.arm)?;
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
        // Delayed encoders delay the whole motion, as delayed commands do.
        let late = encoders_late(file)?;
        joints.iter_mut().for_each(|servo| servo.delay += late);
        Ok(Some(ServoArm { gaps: each(file, "backlash", "gap")?, ..ServoArm::new(arm, joints) }))
    }

    /// The effects of `file` that a rollout does not include, by kind.
    pub fn unused(file: &ArmFile) -> Vec<&str> {
        let is_known = |name: &str| AT_JOINTS.contains(&name) || CHANGES_ARM.contains(&name) || name == LATE;
        let mut unused: Vec<&str> =
            file.effects.iter().map(|table| table.kind.as_str()).filter(|name| !is_known(name)).collect();
        unused.sort_unstable();
        unused.dedup();
        unused
    }
}

/// Delay of the encoders of `file`, s.
fn encoders_late(file: &ArmFile) -> Result<f64, LawError> {
    let mut late = 0.0;
    for table in file.effects.iter().filter(|table| table.kind == LATE) {
        let Some(known) = kind(LATE) else { continue };
        let values = known.values(table, &file.arm)?;
        if values.word("channel")? == "position" {
            late += values.number("delay")?;
        }
    }
    Ok(late)
}

/// Kinds of effects that change the integrated arm.
const CHANGES_ARM: [&str; 6] =
    ["payload", "link_mass", "base_tilt", "link_length", "encoder_offset", "backlash"];

/// The number `name` of the effect of the kind `of` at each joint of `file`; zero without such an effect.
fn each(file: &ArmFile, of: &str, name: &str) -> Result<Vec<f64>, LawError> {
    let mut all = vec![0.0; file.arm.dof()];
    for table in file.effects.iter().filter(|table| table.kind == of) {
        let Some(known) = kind(of) else { continue };
        let values = known.values(table, &file.arm)?;
        all[values.joint()?] += values.number(name)?;
    }
    Ok(all)
}

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
        // Over the travel in which presliding friction builds up, a stiff servo does not distinguish it from a jump.
        "coulomb_friction" | "presliding_friction" => joint.coulomb += values.number("coulomb")?,
        "asymmetric_friction" => {
            // Friction that depends on direction equals its mean plus a constant torque, which moves the set-point.
            let (forwards, backwards) = (values.number("positive")?, values.number("negative")?);
            joint.coulomb += 0.5 * (forwards + backwards);
            joint.offset -= 0.5 * (forwards - backwards) / joint.stiffness;
        }
        "viscous_friction" => joint.damping += values.number("viscous")?,
        "rotor_inertia" => joint.rotor_inertia += values.number("inertia")?,
        _ => {
            joint.stiction += values.number("extra")?.max(0.0);
            joint.stribeck_velocity = values.number("velocity")?;
        }
    }
    Ok(())
}
