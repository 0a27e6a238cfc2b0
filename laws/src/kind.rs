//! An entry of the catalogue: one kind of effect, with everything that the documentation, the file readers and a diagnosis need.

use std::fmt::Debug;

use freeplay_arm::{Arm, Joint, JointKind};
use freeplay_model::EffectTable;
use toml::Table;

use crate::basis::{Term, with};
use crate::effect::Effect;
use crate::law_error::LawError;
use crate::needs::{Need, Recorded};
use crate::parameter::{Parameter, Range, Role};
use crate::place::{Place, Site};
use crate::values::Values;

/// A quantity of a data sheet with a tolerance: how far a machine may differ from its model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// Of the mass of a link, as a share.
    Mass,
    /// Of an inertia, as a share.
    Inertia,
    /// Of friction, as a share.
    Friction,
    /// Of the zero of an encoder, rad (m).
    Zero,
    /// Of a length, m.
    Length,
    /// Of the delay of a channel, s.
    Delay,
}

/// Frequency of an effect that machines have, at a given place, and their models lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occurrence {
    /// On every second joint: dry and viscous friction.
    Common,
    /// On one joint in twenty.
    Occasional,
    /// On one in four hundred: a bent disc of an encoder.
    Rare,
}

impl Occurrence {
    /// Prior odds of the effect at one place.
    pub fn odds(self) -> f64 {
        match self {
            Self::Common => 1.0 / 2.0,
            Self::Occasional => 1.0 / 20.0,
            Self::Rare => 1.0 / 400.0,
        }
    }
}

/// The channels in which an effect appears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// In the torques.
    pub torque: bool,
    /// In the tool's pose or the link encoders.
    pub pose: bool,
}

impl Seen {
    /// In the torques alone.
    pub const TORQUE: Seen = Seen { torque: true, pose: false };
    /// In the pose alone.
    pub const POSE: Seen = Seen { torque: false, pose: true };
    /// In both.
    pub const BOTH: Seen = Seen { torque: true, pose: true };
}

/// Name of the entry of a shape that holds an operating point: the coefficient at which the only term of an effect is evaluated. The term's
/// column is then the law with this coefficient, divided by it. For a non-linear law, such as a delay of more than a few samples, the
/// column is then accurate near that coefficient.
pub const OPERATING_POINT: &str = "about";

/// Name of a shape's entry and of a parameter: the initial state of a memory, a number from −1 to 1 between its stops or a vector in its
/// bearing, see [`crate::Start`]. It depends on the motion before the recording. It is therefore a state of each recording, not a property
/// of the machine.
pub const START: &str = "start";

/// Name of the entry of a shape that holds the arm file's own value of the effect.
pub(crate) const NOMINAL: &str = "nominal";

/// An entry of the catalogue: one kind of effect.
pub struct Kind {
    /// Name in arm files and in `diagnosis.json`.
    pub name: &'static str,
    /// The term of mechanical engineers.
    pub title: &'static str,
    /// The same with its numbers, as the object of "the model leaves out": names of parameters in braces represent their values. A part in
    /// brackets is omitted if one of its numbers is missing.
    pub words: &'static str,
    /// The places where it can occur.
    pub site: Site,
    /// Its parameters, in their usual order.
    pub parameters: &'static [Parameter],
    /// Frequency on machines whose models lack it: the prior odds of a diagnosis.
    pub occurs: Occurrence,
    /// The quantity of a data sheet whose tolerance covers this effect; `None` if none does.
    pub tolerance: Option<Tolerance>,
    /// The channels in which it appears.
    pub seen: Seen,
    /// True if its law jumps with the motion, or depends on its past. The prediction then evaluates the law at every point of the
    /// recording's grid, and applies the low-pass of the measurement to the result before the sensors.
    pub rough: bool,
    /// True if parts separate and touch again. The law does not include the effects of this on torques, by impacts and by the reaction of
    /// the control loop.
    pub shakes: bool,
    /// The law, in one line with its symbols.
    pub equation: &'static str,
    /// Author, year.
    pub source: &'static str,
    /// The feature by which an engineer recognises it.
    pub signature: &'static str,
    /// The kinds that look similar, and the differences.
    pub confounders: &'static [(&'static str, &'static str)],
    /// The kinds that are special cases of this one, each with its condition: a diagnosis tests them nested, not as alternatives.
    pub contains: &'static [(&'static str, &'static str)],
    /// Requirements on a recording that identifies the effect; see [`Kind::missing`].
    pub needs: &'static [Need],
    /// The terms that add up to the effect for a fixed shape, and the conversion of their coefficients to parameters.
    pub terms: Terms,
    /// The shapes that a search tries: tables for [`Kind::terms_at`]. Empty if the motion does not distinguish shapes.
    pub shapes: fn(&Place) -> Vec<toml::Table>,
    /// Builds the effect from checked values.
    pub build: fn(&Values) -> Result<Box<dyn Effect>, LawError>,
}

/// The decomposition of an effect into terms.
#[derive(Clone, Copy)]
pub struct Terms {
    /// The terms at a place for a shape.
    pub list: fn(&Kind, &Place, &Table) -> Vec<Term>,
    /// The parameters for a shape and the coefficients of the terms.
    pub compose: fn(&Kind, &Table, &[f64]) -> Table,
}

impl Debug for Kind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "Kind({})", self.name)
    }
}

/// The shapes of an effect with a single shape.
pub fn one_shape(_: &Place) -> Vec<toml::Table> {
    vec![toml::Table::new()]
}

/// `shape` for small coefficients of its only term, and with each of `coefficients` as [`OPERATING_POINT`], for a strongly non-linear law.
pub fn small_and_about(shape: toml::Table, coefficients: impl IntoIterator<Item = f64>) -> Vec<toml::Table> {
    let about = coefficients.into_iter().map(|about| with(&shape, [(OPERATING_POINT, about)]));
    std::iter::once(shape.clone()).chain(about).collect()
}

impl Kind {
    /// The parameter called `name`.
    pub fn parameter(&self, name: &str) -> Option<&'static Parameter> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }

    /// The unit of the parameter called `name` at `joint`; empty for words.
    pub fn unit(&self, name: &str, joint: Option<&Joint>) -> &'static str {
        match self.parameter(name).map(|parameter| parameter.range) {
            Some(Range::Number { prismatic_unit, .. })
                if joint.is_some_and(|joint| joint.kind == JointKind::Prismatic) =>
            {
                prismatic_unit
            }
            Some(Range::Number { unit, .. } | Range::Vector { unit, .. }) => unit,
            _ => "",
        }
    }

    /// Greatest value of the parameter called `name`; infinite if it is not a number.
    pub fn most(&self, name: &str) -> f64 {
        match self.parameter(name).map(|parameter| parameter.range) {
            Some(Range::Number { most, .. }) => most,
            _ => f64::INFINITY,
        }
    }

    /// True if the effect can occur at `joint` (`None`: on the arm as a whole).
    pub fn fits(&self, joint: Option<&Joint>) -> bool {
        match (self.site, joint) {
            (Site::Arm, None) | (Site::Joint, Some(_)) => true,
            (Site::Revolute, Some(joint)) => joint.kind == JointKind::Revolute,
            _ => false,
        }
    }

    /// True if the effect occurs at a time of the recording's clock, so that it need not occur in another recording.
    pub fn happens(&self) -> bool {
        let is_time = |range: &Range| matches!(range, Range::Number { unit: "s", least, role: Role::Shape, .. } if *least < 0.0);
        self.parameters.iter().any(|parameter| is_time(&parameter.range))
    }

    /// True if the number `name` of a shape has values between those that [`Kind::shapes`] lists.
    pub fn refines(&self, name: &str) -> bool {
        let is_choice = |range: &Range| matches!(range, Range::Number { role: Role::Choice, .. });
        let is_state = self.memory().is_some_and(|start| start.name == name);
        let is_chosen = self.parameter(name).is_some_and(|parameter| is_choice(&parameter.range));
        !(is_state || is_chosen || [OPERATING_POINT, NOMINAL].contains(&name))
    }

    /// The parameter with the initial state of its memory; `None` if it has none. The start time of a temporary effect has the same name
    /// but is no state.
    pub fn memory(&self) -> Option<&Parameter> {
        self.parameter(START).filter(|_| self.takes_as_given(START))
    }

    /// True if no recording determines the parameter `name`: it then has a usual value.
    pub fn takes_as_given(&self, name: &str) -> bool {
        self.parameter(name).is_some_and(|parameter| {
            matches!(
                parameter.range,
                Range::Number { role: Role::Given, .. } | Range::Vector { role: Role::Given, .. }
            )
        })
    }

    /// The terms of the effect at `place` with `shape`, one of [`Kind::shapes`], which may hold a coefficient as [`OPERATING_POINT`].
    pub fn terms_at(&self, place: &Place, shape: &toml::Table) -> Vec<Term> {
        let mut terms = (self.terms.list)(self, place, shape);
        if let (Some(about), [term]) =
            (shape.get(OPERATING_POINT).and_then(toml::Value::as_float), &mut terms[..])
        {
            (term.plus, term.minus, term.weight) = (self.compose(shape, &[about]), None, 1.0 / about);
        }
        terms
    }

    /// The parameters of the effect that has these `coefficients`, one for each of [`Kind::terms_at`], and `shape`.
    pub fn compose(&self, shape: &toml::Table, coefficients: &[f64]) -> toml::Table {
        let mut parameters = (self.terms.compose)(self, shape, coefficients);
        parameters.remove(OPERATING_POINT);
        parameters
    }

    /// The requirement of this effect at `place` that a recording with `recorded` does not meet, as a plain sentence; `None` if it meets
    /// all.
    pub fn missing(&self, place: &Place, recorded: &Recorded) -> Option<String> {
        let name = place.joint().map_or("the arm", |joint| &joint.name);
        self.needs.iter().find_map(|need| need.missing(place, recorded, self.site, name))
    }

    /// The same without the requirements on coverage of the motion: if the others are met, a fit is possible, though perhaps not unique.
    pub fn cannot_be_fitted(&self, place: &Place, recorded: &Recorded) -> Option<String> {
        let name = place.joint().map_or("the arm", |joint| &joint.name);
        let needs = self.needs.iter().filter(|need| !need.is_coverage());
        needs.copied().find_map(|need| need.missing(place, recorded, self.site, name))
    }

    /// The values of `table`, checked against this kind and the joints of `arm`.
    ///
    /// # Errors
    /// [`LawError`] with the line of the table: a joint that does not exist or cannot have the effect; a parameter that is unknown,
    /// missing, of the wrong type or out of its range.
    pub fn values(&self, table: &EffectTable, arm: &Arm) -> Result<Values, LawError> {
        Values::new(self.name, self.site, self.parameters, table, arm)
    }
}
