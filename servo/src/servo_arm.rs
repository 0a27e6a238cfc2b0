//! An arm on position servos.

use freeplay_arm::Arm;

use crate::burden::Burden;
use crate::joint::JointServo;
use crate::model_parameter::ModelParameter;

/// An arm and the servo of each of its joints.
#[derive(Clone, Debug)]
pub struct ServoArm {
    /// The rigid arm with its burden.
    pub arm: Arm,
    /// One servo per joint.
    pub joints: Vec<JointServo>,
    /// Full gap between the flanks of each joint's gear, behind its encoder, rad (m). The link lies on the flank to which its load presses
    /// it.
    pub gaps: Vec<f64>,
    /// The burden in addition to the arm file; `None` before the first parameter of it is set.
    pub burden: Option<Box<Burden>>,
}

impl ServoArm {
    /// An arm with the servo of each of its joints.
    pub fn new(arm: Arm, joints: Vec<JointServo>) -> ServoArm {
        let gaps = vec![0.0; joints.len()];
        ServoArm { arm, joints, gaps, burden: None }
    }

    /// Sets the burden's `parameter` of `joint`, or of the whole arm, to `x`. The arm stays unchanged if the result would be impossible.
    pub(crate) fn set_burden(&mut self, joint: usize, parameter: ModelParameter, x: f64) {
        let mut burden = self.burden.take().unwrap_or_else(|| Box::new(Burden::none(&self.arm)));
        let before = burden.of(joint, parameter);
        if x != before {
            burden.set(joint, parameter, x);
            match parameter {
                ModelParameter::Gap => self.gaps[joint] = x,
                _ => match burden.arm() {
                    Some(arm) => self.arm = arm,
                    None => burden.set(joint, parameter, before),
                },
            }
        }
        self.burden = Some(burden);
    }
}
