//! The values of one `[[effect]]` table, checked against its kind.

use freeplay_arm::{Arm, JointFriction};
use freeplay_model::EffectTable;
use serde::de::DeserializeOwned;

use crate::law_error::LawError;
use crate::parameter::{Absent, Parameter, Range};
use crate::place::Site;

/// The values of an effect's parameters, at its place in an arm; every value is in its range.
#[derive(Clone, Debug)]
pub struct Values {
    kind: &'static str,
    parameters: &'static [Parameter],
    joint: Option<usize>,
    arm: Arm,
    table: EffectTable,
}

impl Values {
    /// Checks `table` against the `parameters` and the `site` of the kind called `kind` and the joints of `arm`.
    pub(crate) fn new(
        kind: &'static str,
        site: Site,
        parameters: &'static [Parameter],
        table: &EffectTable,
        arm: &Arm,
    ) -> Result<Values, LawError> {
        let joints = names(arm);
        let unknown_joint = |name: &str| LawError::UnknownJoint {
            kind: kind.to_owned(),
            line: table.line,
            joint: name.to_owned(),
            joints: joints.join(", "),
        };
        let joint = match (site, &table.joint) {
            (Site::Arm, None) => None,
            (Site::Arm, Some(name)) => {
                return Err(LawError::Unreadable {
                    kind: kind.to_owned(),
                    line: table.line,
                    message: format!(
                        "the effect belongs to the whole arm, not to joint {name}: remove `joint`"
                    ),
                });
            }
            (_, name) => {
                let name = name.clone().unwrap_or_default();
                Some(arm.joint_index(&name).ok_or_else(|| unknown_joint(&name))?)
            }
        };
        if let (Site::Revolute, Some(at)) = (site, joint)
            && arm.joints()[at].kind != freeplay_arm::JointKind::Revolute
        {
            let (kind, joint) = (kind.to_owned(), joints[at].to_owned());
            return Err(LawError::WrongJoint { kind, line: table.line, joint });
        }
        let values = Values { kind, parameters, joint, arm: arm.clone(), table: table.clone() };
        values.check_names()?;
        for parameter in parameters {
            values.check(parameter.name, parameter.range)?;
        }
        Ok(values)
    }

    /// Index of the joint of the effect.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] for an effect of the whole arm.
    pub fn joint(&self) -> Result<usize, LawError> {
        self.joint.ok_or_else(|| self.unreadable("the effect needs a joint".to_owned()))
    }

    /// The arm of the arm file.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// The joint's friction in the arm file; zero for an effect of the whole arm.
    pub fn nominal_friction(&self) -> JointFriction {
        self.joint.map(|joint| self.arm.joints()[joint].friction).unwrap_or_default()
    }

    /// The number called `name`, or its default.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if it is missing or not a number.
    pub fn number(&self, name: &str) -> Result<f64, LawError> {
        self.optional(name)?.ok_or_else(|| self.unreadable(format!("`{name}` is missing")))
    }

    /// The number called `name`, or its default; `None` if the file gives no value and this has a meaning of its own.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if it is required and missing, or is not a number.
    pub fn optional(&self, name: &str) -> Result<Option<f64>, LawError> {
        let range = self.parameter(name).map(|parameter| parameter.range);
        match (self.table.parameters.get(name), range) {
            (Some(value), _) => {
                let number = value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
                number
                    .map(Some)
                    .ok_or_else(|| self.unreadable(format!("`{name}` = {value} must be a number")))
            }
            (None, Some(Range::Number { absent: Absent::Is(default), .. })) => Ok(Some(default)),
            (None, Some(Range::Number { absent: Absent::Means(_), .. })) => Ok(None),
            (None, _) => Err(self.unreadable(format!("`{name}` is missing"))),
        }
    }

    /// The vector called `name`, or its default.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if it is missing or not three numbers.
    pub fn vector(&self, name: &str) -> Result<[f64; 3], LawError> {
        self.optional_vector(name)?.ok_or_else(|| self.unreadable(format!("`{name}` is missing")))
    }

    /// The vector called `name`, or its default; `None` if the file gives no value and this has a meaning of its own.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if it is required and missing, or is not three numbers.
    pub fn optional_vector(&self, name: &str) -> Result<Option<[f64; 3]>, LawError> {
        let range = self.parameter(name).map(|parameter| parameter.range);
        match (self.table.parameters.get(name), range) {
            (Some(value), _) => {
                let numbers: Result<[f64; 3], _> = value.clone().try_into();
                numbers.map(Some).map_err(|_| {
                    self.unreadable(format!("`{name}` must be three numbers with a decimal point"))
                })
            }
            (None, Some(Range::Vector { absent: Absent::Is(default), .. })) => Ok(Some(default)),
            (None, Some(Range::Vector { absent: Absent::Means(_), .. })) => Ok(None),
            (None, _) => Err(self.unreadable(format!("`{name}` is missing"))),
        }
    }

    /// Index of the other joint that the parameter `name` refers to.
    ///
    /// # Errors
    /// [`LawError::UnknownJoint`] if there is no such joint.
    pub fn other_joint(&self, name: &str) -> Result<usize, LawError> {
        let other = self.table.parameters.get(name).and_then(|value| value.as_str()).unwrap_or_default();
        let found = self.arm.joint_index(other).filter(|&found| Some(found) != self.joint);
        found.ok_or_else(|| LawError::UnknownJoint {
            kind: self.kind.to_owned(),
            line: self.table.line,
            joint: other.to_owned(),
            joints: names(&self.arm).join(", "),
        })
    }

    /// The word called `name`, or the first allowed word.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if the word is not allowed.
    pub fn word(&self, name: &str) -> Result<&'static str, LawError> {
        let Some(Range::Word(words)) = self.parameter(name).map(|parameter| parameter.range) else {
            return Err(self.unreadable(format!("`{name}` is not a word")));
        };
        let Some(value) = self.table.parameters.get(name) else { return Ok(words[0]) };
        let found = words.iter().copied().find(|word| value.as_str() == Some(word));
        found.ok_or_else(|| self.unreadable(format!("`{name}` must be one of {}", words.join(", "))))
    }

    /// All parameters except the one called `name`, as a table of the effect's own.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] for unknown or missing parameters.
    pub fn table_but<T: DeserializeOwned>(&self, name: &str) -> Result<T, LawError> {
        self.table.read(Some(name)).map_err(|message| self.unreadable(message))
    }

    /// The line of the table in its file, from 1; 0 if it does not come from a file.
    pub fn line(&self) -> usize {
        self.table.line
    }

    fn parameter(&self, name: &str) -> Option<&'static Parameter> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// Refuses parameters that the kind does not have.
    fn check_names(&self) -> Result<(), LawError> {
        match self.table.parameters.keys().find(|name| self.parameter(name).is_none()) {
            None => Ok(()),
            Some(unknown) => {
                let known: Vec<String> =
                    self.parameters.iter().map(|parameter| format!("`{}`", parameter.name)).collect();
                Err(self
                    .unreadable(format!("unknown field `{unknown}`, expected one of {}", known.join(", "))))
            }
        }
    }

    fn check(&self, name: &'static str, range: Range) -> Result<(), LawError> {
        match range {
            Range::Table => {}
            Range::Number { least, most, .. } => {
                let given = self.table.parameters.contains_key(name);
                if let Some(value) = self.optional(name)?
                    && given
                    && !(value >= least && value <= most)
                {
                    return Err(self.unreadable(format!("`{name}` = {value} must be {least:e} to {most:e}")));
                }
            }
            Range::Vector { .. } => {
                if let Some(value) = self.optional_vector(name)?
                    && !value.iter().all(|x| x.is_finite())
                {
                    return Err(self.unreadable(format!("`{name}` = {value:?} must be finite")));
                }
            }
            Range::OtherJoint => {
                self.other_joint(name)?;
            }
            Range::Word(_) => {
                self.word(name)?;
            }
        }
        Ok(())
    }

    /// An error that the table is invalid because of `message`.
    pub(crate) fn unreadable(&self, message: String) -> LawError {
        LawError::Unreadable { kind: self.kind.to_owned(), line: self.table.line, message }
    }
}

fn names(arm: &Arm) -> Vec<&str> {
    arm.joints().iter().map(|joint| joint.name.as_str()).collect()
}
