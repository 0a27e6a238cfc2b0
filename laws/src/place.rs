//! The places where an effect may occur: a part of an arm, and a place in a scene.

use crate::scene::Scene;

/// The part of an arm on which an effect can occur.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// On any joint, or the link that it moves.
    Joint,
    /// On a revolute joint.
    Revolute,
    /// On the arm as a whole.
    Arm,
}

/// A place at which an effect may occur, in a scene.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// The arm, its motion and its load.
    pub scene: &'a Scene<'a>,
    /// Index of the joint; `None` for the arm as a whole.
    pub joint: Option<usize>,
}

impl Place<'_> {
    /// The joint there.
    pub fn joint(&self) -> Option<&freeplay_arm::Joint> {
        self.joint.map(|joint| &self.scene.arm.joints()[joint])
    }

    /// The speeds of the joint there, rad/s (m/s), ascending; empty for the arm as a whole.
    pub fn speeds(&self) -> Vec<f64> {
        let column = self.joint.map(|joint| self.scene.motion.v[joint].as_slice()).unwrap_or_default();
        let mut speeds: Vec<f64> = column.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        speeds
    }
}
