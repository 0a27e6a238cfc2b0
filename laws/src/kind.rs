//! An entry of the catalogue: one kind of effect, with all that the documentation, the readers of files and a diagnosis need.

use std::fmt::Debug;

use freeplay_arm::{Arm, EffectTable, Joint, JointKind};
use toml::Table;

use crate::basis::{Term, with};
use crate::effect::Effect;
use crate::law_error::LawError;
use crate::needs::{Need, Recorded};
use crate::parameter::{Parameter, Range, Role};
use crate::place::{Place, Site};
use crate::values::Values;

/// A number of a data sheet: how far a machine may be from its model.
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

/// How often a machine has an effect, at a given place, that its model leaves out.
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

/// Where an effect shows.
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

/// Name of the number in a shape about which the only term of an effect is taken: its column is then what the law says with this
/// coefficient, per unit of it. For a law that is not linear, as a delay of more than a few samples, that is right where it is needed.
pub const ABOUT: &str = "about";

/// Name of a shape's entry and of a parameter: where a memory stands as a motion begins, a number from −1 to 1 between its stops or a vector in its bearing,
/// see [`crate::Start`]. What came before a recording is not in it, so that this is a state of each recording, not a property of the machine.
pub const START: &str = "start";

/// Name of the number in a shape that is the arm file's own: what the file names already of the effect.
pub(crate) const NOMINAL: &str = "nominal";

/// An entry of the catalogue: one kind of effect.
pub struct Kind {
    /// Name in arm files and in `diagnosis.json`.
    pub name: &'static str,
    /// What a mechanical engineer calls it.
    pub title: &'static str,
    /// The same with its numbers, as the object of "the model leaves out": the names of parameters in braces stand for their values. What is in brackets
    /// is left out where one of its numbers is not there.
    pub words: &'static str,
    /// Where it can sit.
    pub site: Site,
    /// Its parameters, in the order in which people name them.
    pub parameters: &'static [Parameter],
    /// How often machines have it that their model does not: the prior odds of a diagnosis.
    pub occurs: Occurrence,
    /// Which number of a data sheet says how far a machine may be from its model in it; `None` where none does.
    pub tolerance: Option<Tolerance>,
    /// Where it shows.
    pub seen: Seen,
    /// Whether its law jumps with the motion, or looks back in it: it is evaluated on every point of the recording's grid, and what it
    /// predicts before the sensors goes through the low-pass that the measurement went through.
    pub rough: bool,
    /// Whether parts come apart and meet again: what that does to torques, by blows and by the loop that answers them, is not in the law.
    pub shakes: bool,
    /// The law, in one line with its symbols.
    pub equation: &'static str,
    /// Author, year.
    pub source: &'static str,
    /// What gives it away.
    pub signature: &'static str,
    /// The kinds that look like it, and what separates them.
    pub confounders: &'static [(&'static str, &'static str)],
    /// The kinds that are special cases of this one, and what makes them that: to be tested nested, not as alternatives.
    pub contains: &'static [(&'static str, &'static str)],
    /// What a recording has to hold for the effect to be told; see [`Kind::missing`].
    pub needs: &'static [Need],
    /// The terms of which the effect is a sum while its shape is fixed, and how parameters come of their coefficients.
    pub terms: Terms,
    /// What a search tries for the shape: tables that [`Kind::terms_at`] takes. Empty where the motion tells no shape from another.
    pub shapes: fn(&Place) -> Vec<toml::Table>,
    /// Makes the effect of checked values.
    pub build: fn(&Values) -> Result<Box<dyn Effect>, LawError>,
}

/// How an effect is a sum of terms.
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

/// The shapes of an effect that has one only.
pub fn one_shape(_: &Place) -> Vec<toml::Table> {
    vec![toml::Table::new()]
}

/// `shape` for small coefficients of its only term, and [`ABOUT`] each of `coefficients`, for a law that is far from linear.
pub fn small_and_about(shape: toml::Table, coefficients: impl IntoIterator<Item = f64>) -> Vec<toml::Table> {
    let about = coefficients.into_iter().map(|about| with(&shape, [(ABOUT, about)]));
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

    /// Greatest value of the number called `name`; infinite for what is none.
    pub fn most(&self, name: &str) -> f64 {
        match self.parameter(name).map(|parameter| parameter.range) {
            Some(Range::Number { most, .. }) => most,
            _ => f64::INFINITY,
        }
    }

    /// Whether the effect can sit at `joint` (`None`: on the arm as a whole).
    pub fn fits(&self, joint: Option<&Joint>) -> bool {
        match (self.site, joint) {
            (Site::Arm, None) | (Site::Joint, Some(_)) => true,
            (Site::Revolute, Some(joint)) => joint.kind == JointKind::Revolute,
            _ => false,
        }
    }

    /// Whether it happens at a time of the recording's clock, which another recording need not repeat.
    pub fn happens(&self) -> bool {
        let is_time = |range: &Range| matches!(range, Range::Number { unit: "s", least, role: Role::Shape, .. } if *least < 0.0);
        self.parameters.iter().any(|parameter| is_time(&parameter.range))
    }

    /// Whether the number `name` of a shape has values between those that [`Kind::shapes`] lists.
    pub fn refines(&self, name: &str) -> bool {
        let is_choice = |range: &Range| matches!(range, Range::Number { role: Role::Choice, .. });
        let is_state = self.memory().is_some_and(|start| start.name == name);
        let is_chosen = self.parameter(name).is_some_and(|parameter| is_choice(&parameter.range));
        !(is_state || is_chosen || [ABOUT, NOMINAL].contains(&name))
    }

    /// The parameter that says where its memory stands at the beginning of a recording; `None` if it has none. A time at which something sets in is called the same.
    pub fn memory(&self) -> Option<&Parameter> {
        self.parameter(START).filter(|_| self.takes_as_given(START))
    }

    /// Whether `name` is a parameter that no recording tells: its value is a usual one.
    pub fn takes_as_given(&self, name: &str) -> bool {
        self.parameter(name).is_some_and(|parameter| {
            matches!(
                parameter.range,
                Range::Number { role: Role::Given, .. } | Range::Vector { role: Role::Given, .. }
            )
        })
    }

    /// The terms of the effect at `place` with `shape`, one of [`Kind::shapes`], which may say [`ABOUT`] which coefficient.
    pub fn terms_at(&self, place: &Place, shape: &toml::Table) -> Vec<Term> {
        let mut terms = (self.terms.list)(self, place, shape);
        if let (Some(about), [term]) = (shape.get(ABOUT).and_then(toml::Value::as_float), &mut terms[..]) {
            (term.plus, term.minus, term.weight) = (self.compose(shape, &[about]), None, 1.0 / about);
        }
        terms
    }

    /// The parameters of the effect that has these `coefficients`, one for each of [`Kind::terms_at`], and `shape`.
    pub fn compose(&self, shape: &toml::Table, coefficients: &[f64]) -> toml::Table {
        let mut parameters = (self.terms.compose)(self, shape, coefficients);
        parameters.remove(ABOUT);
        parameters
    }

    /// What a recording with `recorded` lacks for this effect at `place`: a plain sentence, or `None` if nothing.
    pub fn missing(&self, place: &Place, recorded: &Recorded) -> Option<String> {
        let name = place.joint().map_or("the arm", |joint| &joint.name);
        self.needs.iter().find_map(|need| need.missing(place, recorded, self.site, name))
    }

    /// The same without what the motion covers too little of: with that, the effect can be fitted, if not told from others.
    pub fn cannot_be_fitted(&self, place: &Place, recorded: &Recorded) -> Option<String> {
        let name = place.joint().map_or("the arm", |joint| &joint.name);
        let needs = self.needs.iter().filter(|need| !need.is_coverage());
        needs.copied().find_map(|need| need.missing(place, recorded, self.site, name))
    }

    /// The values of `table`, checked against this kind and the joints of `arm`.
    ///
    /// # Errors
    /// [`LawError`] with the line of the table: a joint that is not there or cannot have the effect; a parameter that is unknown,
    /// missing, of the wrong type or out of its range.
    pub fn values(&self, table: &EffectTable, arm: &Arm) -> Result<Values, LawError> {
        Values::new(self.name, self.site, self.parameters, table, arm)
    }
}
