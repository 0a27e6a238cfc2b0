//! The catalogue of effects: one file per effect, one line for it here.

use crate::kind::Kind;

mod actuator_saturation;
mod asymmetric_friction;
mod backlash;
mod base_tilt;
mod command_delay;
mod commanded;
mod contact;
mod coulomb_friction;
mod encoder_eccentricity;
mod encoder_offset;
mod external_force;
mod external_torque;
mod friction_drift;
mod hard_stop;
mod joint_clearance;
mod joint_coupling;
mod joint_elasticity;
mod joint_spring;
mod link_flexure;
mod link_length;
mod link_mass;
mod load_dependent_friction;
mod lubricated_clearance;
mod payload;
mod position_dependent_friction;
mod presliding_friction;
mod quadratic_drag;
mod rotor_inertia;
mod sensor_lowpass;
mod servo;
mod stribeck_friction;
mod time_delay;
mod torque_gain;
mod torque_offset;
mod torque_ripple;
mod viscous_friction;

pub use coulomb_friction::holding;
pub use encoder_offset::MOST_ENCODER_OFFSET;

/// Every kind of the catalogue, in the order of the documentation: joints with play, friction, masses, drives, sensors.
pub static CATALOGUE: &[&Kind] = &[
    &joint_clearance::KIND,
    &lubricated_clearance::KIND,
    &backlash::KIND,
    &joint_elasticity::KIND,
    &link_flexure::KIND,
    &coulomb_friction::KIND,
    &viscous_friction::KIND,
    &stribeck_friction::KIND,
    &asymmetric_friction::KIND,
    &load_dependent_friction::KIND,
    &position_dependent_friction::KIND,
    &presliding_friction::KIND,
    &friction_drift::KIND,
    &quadratic_drag::KIND,
    &rotor_inertia::KIND,
    &payload::KIND,
    &link_mass::KIND,
    &base_tilt::KIND,
    &link_length::KIND,
    &joint_spring::KIND,
    &joint_coupling::KIND,
    &external_force::KIND,
    &external_torque::KIND,
    &actuator_saturation::KIND,
    &torque_offset::KIND,
    &torque_gain::KIND,
    &torque_ripple::KIND,
    &encoder_offset::KIND,
    &encoder_eccentricity::KIND,
    &time_delay::KIND,
    &sensor_lowpass::KIND,
];

/// The kinds that appear only in commanded against measured positions: the servo, the delay before it, and the bounds of the joint.
pub static COMMANDED: &[&Kind] = &[&servo::KIND, &command_delay::KIND, &hard_stop::KIND, &contact::KIND];
