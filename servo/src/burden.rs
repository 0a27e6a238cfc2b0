//! The burden of an arm in addition to its file: a payload on its last link, links of other masses, a tilted base, zeros of encoders, gaps
//! of gears. The laws are those of the catalogue.

use freeplay_arm::{Arm, JointKind};
use freeplay_laws::{ArmParts, Effects, LawError};
use freeplay_model::{ArmFile, EffectTable};
use nalgebra::{Isometry3, Translation3};
use toml::{Table, Value};

use crate::model_parameter::ModelParameter;

/// The burden of an arm.
#[derive(Clone, Debug)]
pub struct Burden {
    bare: Arm,
    /// The parameters of each joint, in the order of [`ModelParameter::OF_ARM_AT_JOINT`].
    joints: Vec<[f64; ModelParameter::OF_ARM_AT_JOINT.len()]>,
    /// The parameters of the whole arm, in the order of [`ModelParameter::OF_WHOLE_ARM`].
    whole: [f64; ModelParameter::OF_WHOLE_ARM.len()],
}

impl Burden {
    /// A zero burden of `arm`.
    pub fn none(arm: &Arm) -> Burden {
        Burden {
            bare: arm.clone(),
            joints: vec![Default::default(); arm.dof()],
            whole: [0.0; ModelParameter::OF_WHOLE_ARM.len()],
        }
    }

    /// The value of `parameter` for `joint`, or for the whole arm; zero for a parameter of a servo.
    pub fn of(&self, joint: usize, parameter: ModelParameter) -> f64 {
        let place = |all: &[ModelParameter]| all.iter().position(|one| *one == parameter);
        let of_joint = place(&ModelParameter::OF_ARM_AT_JOINT).map(|at| self.joints[joint][at]);
        of_joint.or(place(&ModelParameter::OF_WHOLE_ARM).map(|at| self.whole[at])).unwrap_or(0.0)
    }

    /// Sets that value to `x`.
    pub fn set(&mut self, joint: usize, parameter: ModelParameter, x: f64) {
        let own = ModelParameter::OF_ARM_AT_JOINT.iter().zip(&mut self.joints[joint]);
        let whole = ModelParameter::OF_WHOLE_ARM.iter().zip(&mut self.whole);
        own.chain(whole).filter(|(one, _)| **one == parameter).for_each(|(_, number)| *number = x);
    }

    /// The burden as effects of an arm file.
    pub fn tables(&self) -> Vec<EffectTable> {
        let table = |kind: &str, joint: Option<String>, parameters: Table| EffectTable {
            kind: kind.to_owned(),
            joint,
            parameters,
            line: 0,
        };
        let mut tables = Vec::new();
        let [payload, x, y, z, roll, pitch] = self.whole;
        for (joint, [log, zero, gap]) in self.bare.joints().iter().zip(&self.joints) {
            let mut add = |kind: &str, x: f64, parameters: &[(&str, Value)]| {
                let parameters = parameters.iter().map(|(name, value)| ((*name).to_owned(), value.clone()));
                if x != 0.0 {
                    tables.push(table(kind, Some(joint.name.clone()), parameters.collect()));
                }
            };
            add("link_mass", *log, &[("scale", Value::Float(log.exp()))]);
            add("encoder_offset", *zero, &[("offset", Value::Float(*zero))]);
            // The link lies on the flank to which its load presses it.
            add("backlash", *gap, &[("gap", Value::Float(*gap)), ("course", Value::from("rest"))]);
        }
        if payload != 0.0 {
            let place = self.bare.tool().translation.vector;
            let com = place.iter().zip([x, y, z]).map(|(tool, off)| Value::Float(tool + off)).collect();
            let mass = ("mass".to_owned(), Value::Float(payload));
            tables.push(table(
                "payload",
                None,
                Table::from_iter([mass, ("com".to_owned(), Value::Array(com))]),
            ));
        }
        if [roll, pitch] != [0.0; 2] {
            let turn = ["roll", "pitch"].into_iter().zip([roll, pitch]);
            let turn = turn.map(|(name, angle)| (name.to_owned(), Value::Float(angle)));
            tables.push(table("base_tilt", None, turn.collect()));
        }
        tables
    }

    /// The arm with this burden; `None` if it is impossible.
    pub fn arm(&self) -> Option<Arm> {
        let file = ArmFile { arm: self.bare.clone(), effects: self.tables(), ignored: Vec::new() };
        let arm = Effects::of(&file).ok()?.changed(&self.bare).ok()?;
        let zeros: Vec<f64> = (0..arm.dof()).map(|joint| self.of(joint, ModelParameter::Zero)).collect();
        with_zeros(&arm, &zeros).ok()
    }
}

/// `arm` in encoder coordinates; the encoders read `zeros`, rad (m), at the zeros of its joints.
///
/// # Errors
/// [`LawError::Changed`] if the result is impossible.
pub(crate) fn with_zeros(arm: &Arm, zeros: &[f64]) -> Result<Arm, LawError> {
    if zeros.iter().all(|zero| *zero == 0.0) {
        return Ok(arm.clone());
    }
    let mut parts = ArmParts::of(arm);
    for (joint, zero) in parts.joints.iter_mut().zip(zeros) {
        let back = match joint.kind {
            JointKind::Revolute => Isometry3::rotation(-*zero * joint.axis.into_inner()),
            JointKind::Prismatic => Isometry3::from(Translation3::from(-*zero * joint.axis.into_inner())),
        };
        joint.placement *= back;
    }
    parts.into_arm(arm.name())
}
