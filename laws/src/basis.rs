//! An effect as a sum of terms: what a diagnosis builds its columns from.
//!
//! With its shape fixed, what an effect adds to a prediction is Σ cᵢ·(column of term i). The coefficients cᵢ need not be the
//! parameters: a·sin(Nq + φ) is the sum of c₁ sin Nq and c₂ cos Nq, a spring k(q − q₀) that of k q and −k q₀. A [`Term`] says its
//! column as a difference of two effects of the catalogue, and [`Terms::compose`] gives the parameters back.

use freeplay_arm::EffectTable;
use toml::{Table, Value};

use crate::columns::Change;
use crate::kind::Kind;
use crate::parameter::{Parameter, Range, Role};
use crate::predict::Baseline;
use crate::scene::Scene;
use crate::{LawError, Placed};

/// A place at which an effect may sit, in a scene.
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

    /// The speeds of the joint there, rad/s (m/s), ascending; none for the arm as a whole.
    pub fn speeds(&self) -> Vec<f64> {
        let column = self.joint.map(|joint| self.scene.motion.v[joint].as_slice()).unwrap_or_default();
        let mut speeds: Vec<f64> = column.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        speeds
    }
}

/// One linear term of an effect: its coefficient and its column.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Name of the coefficient: a parameter's, or one of the effect's own, such as `compliance`.
    pub name: &'static str,
    /// Unit of the coefficient at this place.
    pub unit: String,
    /// Least value that is physical here: an extra friction may take away what the arm file names, and no more.
    pub least: f64,
    /// Greatest value.
    pub most: f64,
    /// Whether a coefficient that would be less is the least one, and one that would be more the greatest: no friction at all is still a joint, and
    /// flanks that don't give are still those of a gap.
    pub held: bool,
    /// The value that it has on most machines, where one is plainer than all others: a limit that takes away all that is beyond it.
    pub usual: Option<f64>,
    /// The column is `weight` times what the effect with the parameters `plus` shows, …
    pub plus: Table,
    /// … less what the one with these shows; `None`: less nothing.
    pub minus: Option<Table>,
    /// One over the difference of the coefficient between the two.
    pub weight: f64,
}

impl Term {
    /// A term whose column is what `plus` shows.
    pub fn new(name: &'static str, unit: impl Into<String>, [least, most]: [f64; 2], plus: Table) -> Term {
        Term {
            name,
            unit: unit.into(),
            least,
            most,
            held: false,
            usual: None,
            plus,
            minus: None,
            weight: 1.0,
        }
    }

    /// The same for a coefficient of `step` in place of 1.
    pub fn stepped(mut self, step: f64) -> Term {
        self.weight = 1.0 / step;
        self
    }

    /// The same, of `value` on most machines.
    pub fn usually(mut self, value: f64) -> Term {
        self.usual = Some(value);
        self
    }

    /// The same, held at its least value.
    pub fn held(mut self) -> Term {
        self.held = true;
        self
    }

    /// The same less what `minus` shows.
    pub fn less(mut self, minus: Table) -> Term {
        self.minus = Some(minus);
        self
    }
}

/// How an effect is a sum of terms.
#[derive(Clone, Copy)]
pub struct Terms {
    /// The terms at a place for a shape.
    pub list: fn(&Kind, &Place, &Table) -> Vec<Term>,
    /// The parameters for a shape and the coefficients of the terms.
    pub compose: fn(&Kind, &Table, &[f64]) -> Table,
}

impl Terms {
    /// The parameters of [`Role::Linear`] are themselves the coefficients, and the effect is proportional to each.
    pub const PLAIN: Terms = Terms { list: plain_terms, compose: plain_compose };

    /// The same for a sum of which any part may be missing: none is negative.
    pub const PARTS: Terms = Terms {
        list: |kind, place, shape| plain_terms(kind, place, shape).into_iter().map(Term::held).collect(),
        compose: plain_compose,
    };

    /// The same for an extra to what the arm file names: the sum must not be negative. Read from the joint's friction.
    pub const EXTRA_COULOMB: Terms = Terms {
        list: |kind, place, shape| {
            let named = place.joint().map_or(0.0, |joint| joint.friction.coulomb);
            bounded_below(plain_terms(kind, place, shape), -named)
        },
        compose: plain_compose,
    };

    /// The same for viscous friction.
    pub const EXTRA_VISCOUS: Terms = Terms {
        list: |kind, place, shape| {
            let named = place.joint().map_or(0.0, |joint| joint.friction.viscous);
            bounded_below(plain_terms(kind, place, shape), -named)
        },
        compose: plain_compose,
    };
}

fn bounded_below(mut terms: Vec<Term>, least: f64) -> Vec<Term> {
    for term in &mut terms {
        (term.least, term.held) = (term.least.max(least), least < 0.0);
    }
    terms
}

/// The parameters that are coefficients.
fn linear(kind: &Kind) -> impl Iterator<Item = (&'static Parameter, [f64; 2])> + '_ {
    kind.parameters.iter().filter_map(|parameter| match parameter.range {
        Range::Number { least, most, role: Role::Linear, .. } => Some((parameter, [least, most])),
        _ => None,
    })
}

fn plain_terms(kind: &Kind, place: &Place, shape: &Table) -> Vec<Term> {
    let unit = |name: &str| kind.unit(name, place.joint());
    let term = |(index, (parameter, range)): (usize, (&'static Parameter, [f64; 2]))| {
        // The largest power of ten up to 1 that the range allows.
        let step = 10_f64.powf(range[1].min(1.0).log10().floor());
        let coefficients: Vec<f64> =
            (0..linear(kind).count()).map(|i| if i == index { step } else { 0.0 }).collect();
        let plus = plain_compose(kind, shape, &coefficients);
        Term::new(parameter.name, unit(parameter.name), range, plus).stepped(step)
    };
    linear(kind).enumerate().map(term).collect()
}

fn plain_compose(kind: &Kind, shape: &Table, coefficients: &[f64]) -> Table {
    let values = linear(kind).zip(coefficients).map(|((parameter, _), &value)| (parameter.name, value));
    with(shape, values)
}

/// `shape` with these numbers.
pub fn with<'a>(shape: &Table, values: impl IntoIterator<Item = (&'a str, f64)>) -> Table {
    let mut table = shape.clone();
    table.extend(values.into_iter().map(|(name, value)| (name.to_owned(), Value::Float(value))));
    table
}

/// A vector as an arm file has it.
pub fn vector(of: [f64; 3]) -> Value {
    Value::Array(of.into_iter().map(Value::Float).collect())
}

/// A vector of `length` along the axis number `axis`.
pub fn along(axis: usize, length: f64) -> [f64; 3] {
    std::array::from_fn(|i| if i == axis { length } else { 0.0 })
}

impl Kind {
    /// The effect of this kind with `parameters`, sitting at `joint` (an index; `None`: on the whole arm) of the scene's arm.
    ///
    /// # Errors
    /// See [`LawError`]: parameters that are missing or out of range.
    pub fn place(&'static self, place: &Place, parameters: Table) -> Result<Placed, LawError> {
        let joint = place.joint().map(|joint| joint.name.clone());
        let table = EffectTable { kind: self.name.to_owned(), joint, parameters, line: 0 };
        Placed::new(&table, &place.scene.arm)
    }

    /// One column for each term of the effect at `joint` with `shape`: the change of everything that is predicted per unit of the
    /// term's coefficient, about `baseline`. For small effects the prediction is the baseline's plus Σ coefficient × column; how well,
    /// [`Baseline::change`] says.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn columns(
        &'static self,
        baseline: &Baseline,
        joint: Option<usize>,
        shape: &Table,
    ) -> Result<Vec<(Term, Change)>, LawError> {
        let place = Place { scene: baseline.scene(), joint };
        let column = |term: Term| {
            let mut column = baseline.change(&self.place(&place, term.plus.clone())?)?;
            if let Some(minus) = &term.minus {
                column.add(&baseline.change(&self.place(&place, minus.clone())?)?, -1.0);
            }
            column.scale(term.weight);
            Ok((term, column))
        };
        self.terms_at(&place, shape).into_iter().map(column).collect()
    }
}
