//! The values of one `[[effect]]` table, checked against its kind.

use freeplay_arm::{Arm, EffectTable};
use serde::de::DeserializeOwned;

use crate::LawError;
use crate::effect::{Kind, Range, Site};

/// The values of an effect's parameters, at its place in an arm; every value is in its range.
#[derive(Clone, Debug)]
pub struct Values {
    kind: &'static Kind,
    joint: Option<usize>,
    joints: Vec<String>,
    table: EffectTable,
}

impl Values {
    /// Checks `table` against `kind` and the joints of `arm`.
    ///
    /// # Errors
    /// [`LawError`] with the line of the table: a joint that is not there or cannot have the effect; a parameter that is unknown,
    /// missing, of the wrong type or out of its range.
    pub fn of(kind: &'static Kind, table: &EffectTable, arm: &Arm) -> Result<Values, LawError> {
        let joints: Vec<String> = arm.joints().iter().map(|joint| joint.name.clone()).collect();
        let unknown_joint = |name: &str| LawError::UnknownJoint {
            kind: kind.name.to_owned(),
            line: table.line,
            joint: name.to_owned(),
            joints: joints.join(", "),
        };
        let joint = match (kind.site, &table.joint) {
            (Site::Arm, None) => None,
            (Site::Arm, Some(name)) => {
                return Err(LawError::Unreadable {
                    kind: kind.name.to_owned(),
                    line: table.line,
                    message: format!("it belongs to the whole arm, not to joint {name}: remove `joint`"),
                });
            }
            (_, name) => {
                let name = name.clone().unwrap_or_default();
                Some(arm.joint_index(&name).ok_or_else(|| unknown_joint(&name))?)
            }
        };
        if let (Site::Revolute, Some(at)) = (kind.site, joint)
            && arm.joints()[at].kind != freeplay_arm::JointKind::Revolute
        {
            return Err(LawError::WrongJoint { kind: kind.name.to_owned(), joint: joints[at].clone() });
        }
        let values = Values { kind, joint, joints, table: table.clone() };
        for parameter in kind.parameters {
            values.check(parameter.name, parameter.range)?;
        }
        Ok(values)
    }

    /// Index of the joint at which the effect sits.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] for an effect of the whole arm.
    pub fn joint(&self) -> Result<usize, LawError> {
        self.joint.ok_or_else(|| self.unreadable("it needs a joint".to_owned()))
    }

    /// The number called `name`, or its default.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if it is missing or not a number.
    pub fn number(&self, name: &str) -> Result<f64, LawError> {
        let default = self.kind.parameters.iter().find(|parameter| parameter.name == name);
        match (self.table.parameters.get(name), default.map(|parameter| parameter.range)) {
            (Some(value), _) => value
                .as_float()
                .or_else(|| value.as_integer().map(|whole| whole as f64))
                .ok_or_else(|| self.unreadable(format!("`{name}` must be a number"))),
            (None, Some(Range::Number { default: Some(default), .. })) => Ok(default),
            (None, _) => Err(self.unreadable(format!("`{name}` is missing"))),
        }
    }

    /// The vector called `name`, or its default.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if it is missing or not three numbers.
    pub fn vector(&self, name: &str) -> Result<[f64; 3], LawError> {
        let default = self.kind.parameters.iter().find(|parameter| parameter.name == name);
        match (self.table.parameters.get(name), default.map(|parameter| parameter.range)) {
            (Some(value), _) => {
                let numbers: Result<[f64; 3], _> = value.clone().try_into();
                numbers.map_err(|_| {
                    self.unreadable(format!("`{name}` must be three numbers with a decimal point"))
                })
            }
            (None, Some(Range::Vector { default: Some(default), .. })) => Ok(default),
            (None, _) => Err(self.unreadable(format!("`{name}` is missing"))),
        }
    }

    /// Index of the other joint called by the parameter `name`.
    ///
    /// # Errors
    /// [`LawError::UnknownJoint`] if there is none.
    pub fn other_joint(&self, name: &str) -> Result<usize, LawError> {
        let other = self.table.parameters.get(name).and_then(|value| value.as_str()).unwrap_or_default();
        let found = self.joints.iter().position(|joint| joint == other);
        found.filter(|&found| Some(found) != self.joint).ok_or_else(|| LawError::UnknownJoint {
            kind: self.kind.name.to_owned(),
            line: self.table.line,
            joint: other.to_owned(),
            joints: self.joints.join(", "),
        })
    }

    /// The word called `name`, or the first that is allowed.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] if it is none of those allowed.
    pub fn word(&self, name: &str) -> Result<&'static str, LawError> {
        let parameter = self.kind.parameters.iter().find(|parameter| parameter.name == name);
        let Some(Range::Word(words)) = parameter.map(|parameter| parameter.range) else {
            return Err(self.unreadable(format!("`{name}` is not a word")));
        };
        let Some(value) = self.table.parameters.get(name) else { return Ok(words[0]) };
        let found = words.iter().copied().find(|word| value.as_str() == Some(word));
        found.ok_or_else(|| self.unreadable(format!("`{name}` must be one of {}", words.join(", "))))
    }

    /// All parameters as a table of the effect's own.
    ///
    /// # Errors
    /// [`LawError::Unreadable`] for unknown or missing parameters.
    pub fn table<T: DeserializeOwned>(&self) -> Result<T, LawError> {
        let table = self.table.parameters.clone();
        table.try_into().map_err(|error: toml::de::Error| self.unreadable(error.message().to_owned()))
    }

    /// The line of the table in its file, from 1; 0 if it does not come from a file.
    pub fn line(&self) -> usize {
        self.table.line
    }

    fn check(&self, name: &'static str, range: Range) -> Result<(), LawError> {
        match range {
            Range::Number { least, most, .. } => {
                let given = self.table.parameters.contains_key(name);
                let value = self.number(name)?;
                if given && !(value >= least && value <= most) {
                    return Err(self.unreadable(format!("`{name}` = {value} must be {least:e} to {most:e}")));
                }
            }
            Range::Vector { .. } => {
                let value = self.vector(name)?;
                if !value.iter().all(|x| x.is_finite()) {
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

    fn unreadable(&self, message: String) -> LawError {
        LawError::Unreadable { kind: self.kind.name.to_owned(), line: self.table.line, message }
    }
}
