//! The kinds of effects, and the possible joints of each.

use freeplay_arm::{Arm, JointKind};

/// The kinds of the catalogue.
pub const CATALOGUE: [&str; 30] = [
    "joint_clearance",
    "backlash",
    "joint_elasticity",
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "asymmetric_friction",
    "torque_offset",
    "load_dependent_friction",
    "presliding_friction",
    "position_dependent_friction",
    "friction_drift",
    "quadratic_drag",
    "rotor_inertia",
    "payload",
    "link_mass",
    "base_tilt",
    "joint_spring",
    "torque_gain",
    "actuator_saturation",
    "torque_ripple",
    "joint_coupling",
    "encoder_offset",
    "encoder_eccentricity",
    "link_length",
    "link_flexure",
    "time_delay",
    "sensor_lowpass",
    "external_force",
    "lubricated_clearance",
];

/// Kinds outside the catalogue.
pub const OUTSIDE: [&str; 8] = [
    "magnetic_detent",
    "sloshing_load",
    "cable_stick_slip",
    "mount_resonance",
    "load_drop",
    "periodic_disturbance",
    "encoder_slip",
    "broken_tooth",
];

/// Place of an effect: a joint (from 0), or the whole arm.
pub type Seat = Option<usize>;

/// All possible places of `kind` in `arm`; empty for an unknown kind.
pub fn seats(kind: &str, arm: &Arm) -> Vec<Seat> {
    let n = arm.dof();
    let turns = |i: &usize| arm.joints()[*i].kind == JointKind::Revolute;
    let every = || (0..n).map(Some).collect();
    let turning = || (0..n).filter(turns).map(Some).collect::<Vec<Seat>>();
    let far = |i: &usize| match arm.joints().get(i + 1) {
        Some(next) => next.placement.translation.vector.norm() > 0.05,
        None => arm.tool().translation.vector.norm() > 0.05,
    };
    match kind {
        "payload" | "external_force" | "load_drop" => vec![None],
        // On a bench with one axis the delay of that axis equals that of all; a tilt of a slide is a constant force.
        "time_delay" => vec![None],
        "base_tilt" if n > 1 => vec![None],
        "mount_resonance" | "sloshing_load" if n > 1 => vec![None],
        "base_tilt" | "mount_resonance" | "sloshing_load" => Vec::new(),
        "joint_clearance"
        | "lubricated_clearance"
        | "encoder_eccentricity"
        | "position_dependent_friction"
        | "torque_ripple"
        | "broken_tooth" => turning(),
        "joint_coupling" if n > 1 => every(),
        "joint_coupling" => Vec::new(),
        "link_length" => (0..n).filter(far).map(Some).collect(),
        "link_flexure" => (0..n.saturating_sub(1)).filter(far).filter(turns).map(Some).collect(),
        "link_mass" => (0..n).filter(|&i| arm.joints()[i].inertia.mass > 0.3).map(Some).collect(),
        _ if CATALOGUE.contains(&kind) || OUTSIDE.contains(&kind) => every(),
        _ => Vec::new(),
    }
}

/// True if the strength of the effect counts in the tool alone: rattling and jumps shake the torques, but cannot be identified there.
pub(crate) fn shows_at_tool_only(kind: &str) -> bool {
    matches!(
        kind,
        "joint_clearance"
            | "lubricated_clearance"
            | "backlash"
            | "joint_elasticity"
            | "link_flexure"
            | "encoder_slip"
    )
}

/// True if the effect depends on time: then its strength counts over the whole motion.
pub(crate) fn depends_on_time(kind: &str) -> bool {
    matches!(kind, "friction_drift" | "external_force" | "load_drop" | "encoder_slip")
}
