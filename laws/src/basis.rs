//! An effect as a sum of terms, from which a diagnosis builds its columns.
//!
//! For a fixed shape, an effect adds Σ cᵢ·(column of term i) to a prediction. The coefficients cᵢ need not be the parameters: a·sin(Nq + φ)
//! is the sum of c₁ sin Nq and c₂ cos Nq, a spring k(q − q₀) that of k q and −k q₀. A [`Term`] defines its column as a difference of two
//! effects of the catalogue, and [`crate::Terms::compose`] converts coefficients to parameters.

use toml::{Table, Value};

/// One linear term of an effect: its coefficient and its column.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Name of the coefficient: that of a parameter, or one of the effect's own, such as `compliance`.
    pub name: &'static str,
    /// Unit of the coefficient at this place.
    pub unit: String,
    /// Least physical value here: a negative extra friction is at most the friction of the arm file.
    pub least: f64,
    /// Greatest value.
    pub most: f64,
    /// True if a fit clamps the coefficient to its bounds: a joint without friction is still a joint, and rigid flanks are still those of a
    /// gap.
    pub held: bool,
    /// The value on most machines, if one value is simpler than all others: a limit that removes everything beyond it.
    pub usual: Option<f64>,
    /// The column is `weight` times the prediction of the effect with the parameters `plus`, …
    pub plus: Table,
    /// … minus that of the effect with these parameters; `None`: minus zero.
    pub minus: Option<Table>,
    /// Reciprocal of the difference of the coefficient between the two.
    pub weight: f64,
}

impl Term {
    /// A term whose column is the prediction of `plus`.
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

    /// The same for a coefficient of `step` instead of 1.
    pub fn stepped(mut self, step: f64) -> Term {
        self.weight = 1.0 / step;
        self
    }

    /// The same with the usual value `value`.
    pub fn with_usual_value(mut self, value: f64) -> Term {
        self.usual = Some(value);
        self
    }

    /// The same, clamped to its bounds.
    pub fn clamped(mut self) -> Term {
        self.held = true;
        self
    }

    /// The same minus the prediction of `minus`.
    pub fn less(mut self, minus: Table) -> Term {
        self.minus = Some(minus);
        self
    }
}

/// `shape` with these numbers.
pub fn with<'a>(shape: &Table, values: impl IntoIterator<Item = (&'a str, f64)>) -> Table {
    let mut table = shape.clone();
    table.extend(values.into_iter().map(|(name, value)| (name.to_owned(), Value::Float(value))));
    table
}

/// A vector as a value of an arm file.
pub fn vector(of: [f64; 3]) -> Value {
    Value::Array(of.into_iter().map(Value::Float).collect())
}

/// A vector of `length` along the axis number `axis`.
pub fn along(axis: usize, length: f64) -> [f64; 3] {
    std::array::from_fn(|i| if i == axis { length } else { 0.0 })
}
