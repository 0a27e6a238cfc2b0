//! The parameters of an effect: names, units, ranges, and their treatment in a diagnosis.

/// One parameter of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its name in arm files and in `diagnosis.json`.
    pub name: &'static str,
    /// Its meaning, in a few words.
    pub meaning: &'static str,
    /// Its type and range.
    pub range: Range,
}

/// Type and range of a parameter.
#[derive(Clone, Copy, Debug)]
pub enum Range {
    /// A number.
    Number {
        /// Unit for a revolute joint, and for the arm as a whole.
        unit: &'static str,
        /// Unit for a prismatic joint.
        prismatic_unit: &'static str,
        /// Least value.
        least: f64,
        /// Greatest value.
        most: f64,
        /// Default where the file gives no value.
        absent: Absent<f64>,
        /// Dependence of the effect on it.
        role: Role,
    },
    /// Three numbers: a vector in the frame that the meaning names.
    Vector {
        /// Unit.
        unit: &'static str,
        /// Default where the file gives no value.
        absent: Absent<[f64; 3]>,
        /// Dependence of the effect on it.
        role: Role,
    },
    /// The name of another joint.
    OtherJoint,
    /// One of these words; the first is the default.
    Word(&'static [&'static str]),
    /// A table that the effect reads itself.
    Table,
}

/// Default of a parameter that a file does not give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Absent<T> {
    /// No default: the file must give the value.
    Refused,
    /// This value.
    Is(T),
    /// The meaning in these words, such as `from the material`.
    Means(&'static str),
}

/// Dependence of the prediction on a parameter, which determines its treatment in a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// For a fixed shape, the prediction is a sum of terms in the parameters of this role; see [`crate::Term`].
    Linear,
    /// It shapes the effect; the search tries a grid and refines it.
    Shape,
    /// It shapes the effect by one of a few discrete values.
    Choice,
    /// The measured motion hardly depends on it (a contact's stiffness); the material gives it, and the diagnosis does not identify it.
    Given,
}

impl Parameter {
    /// A required number from `least` to `most`, of [`Role::Linear`], in the same `unit` for all joints.
    pub const fn number(
        name: &'static str,
        meaning: &'static str,
        unit: &'static str,
        [least, most]: [f64; 2],
    ) -> Parameter {
        let range = Range::Number {
            unit,
            prismatic_unit: unit,
            least,
            most,
            absent: Absent::Refused,
            role: Role::Linear,
        };
        Parameter { name, meaning, range }
    }

    /// A required vector of [`Role::Linear`].
    pub const fn vector(name: &'static str, meaning: &'static str, unit: &'static str) -> Parameter {
        Parameter {
            name,
            meaning,
            range: Range::Vector { unit, absent: Absent::Refused, role: Role::Linear },
        }
    }

    /// The same in `unit` for prismatic joints.
    pub const fn prismatic(mut self, unit: &'static str) -> Parameter {
        if let Range::Number { prismatic_unit, .. } = &mut self.range {
            *prismatic_unit = unit;
        }
        self
    }

    /// The same with the default `value`.
    pub const fn or(mut self, value: f64) -> Parameter {
        if let Range::Number { absent, .. } = &mut self.range {
            *absent = Absent::Is(value);
        }
        self
    }

    /// The same, but optional; `what` describes the meaning of a missing value.
    pub const fn or_else(mut self, what: &'static str) -> Parameter {
        match &mut self.range {
            Range::Number { absent, .. } => *absent = Absent::Means(what),
            Range::Vector { absent, .. } => *absent = Absent::Means(what),
            Range::OtherJoint | Range::Word(_) | Range::Table => {}
        }
        self
    }

    /// The same vector with the default zero.
    pub const fn or_zero(mut self) -> Parameter {
        if let Range::Vector { absent, .. } = &mut self.range {
            *absent = Absent::Is([0.0; 3]);
        }
        self
    }

    /// The same with [`Role::Shape`].
    pub const fn shape(self) -> Parameter {
        self.role(Role::Shape)
    }

    /// The same with [`Role::Choice`].
    pub const fn choice(self) -> Parameter {
        self.role(Role::Choice)
    }

    /// The same with [`Role::Given`].
    pub const fn given(self) -> Parameter {
        self.role(Role::Given)
    }

    const fn role(mut self, new: Role) -> Parameter {
        if let Range::Number { role, .. } | Range::Vector { role, .. } = &mut self.range {
            *role = new;
        }
        self
    }
}
