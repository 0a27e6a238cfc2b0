//! The controllers that come with the project, by name.

use freeplay_controller_sdk::Controller;

use crate::computed_torque::{COMPUTED_TORQUE, ComputedTorque};
use crate::narx_qp::{NARX_QP, NarxQp};
use crate::quasi_static::{QUASI_STATIC, QuasiStaticControl};

/// The names accepted by [`built_in()`].
pub const BUILT_IN: [&str; 3] = [COMPUTED_TORQUE, QUASI_STATIC, NARX_QP];

/// The built-in controller `name`, if there is one.
pub fn built_in(name: &str) -> Option<Box<dyn Controller>> {
    match name {
        COMPUTED_TORQUE => Some(Box::new(ComputedTorque::default())),
        QUASI_STATIC => Some(Box::new(QuasiStaticControl::default())),
        NARX_QP => Some(Box::new(NarxQp::default())),
        _ => None,
    }
}
