//! An arm on position servos.

use freeplay_arm::Arm;

use crate::burden::Burden;
use crate::joint::JointServo;
use crate::model_parameter::ModelParameter;

/// An arm and the servo of each of its joints.
#[derive(Clone, Debug)]
pub struct ServoArm {
    /// The rigid arm, under its burden.
    pub arm: Arm,
    /// One servo a joint.
    pub joints: Vec<JointServo>,
    /// Whole angle between the flanks of each joint's gear, behind its encoder, rad (m). The link lies on the flank that its load presses on.
    pub gaps: Vec<f64>,
    /// What the arm carries beside what its file says; `None` where that was never asked.
    pub burden: Option<Box<Burden>>,
}

impl ServoArm {
    /// An arm with the servo of each of its joints, as its file has it.
    pub fn new(arm: Arm, joints: Vec<JointServo>) -> ServoArm {
        let gaps = vec![0.0; joints.len()];
        ServoArm { arm, joints, gaps, burden: None }
    }

    /// Gives the burden's number `parameter` of `joint`, or of the whole arm, the value `x`. The arm stays as it is where there can be none under that.
    pub(crate) fn bear(&mut self, joint: usize, parameter: ModelParameter, x: f64) {
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
