//! An effect as a sum of terms: what a diagnosis builds its columns from.
//!
//! With its shape fixed, what an effect adds to a prediction is Σ cᵢ·(column of term i). The coefficients cᵢ need not be the
//! parameters: a·sin(Nq + φ) is the sum of c₁ sin Nq and c₂ cos Nq, a spring k(q − q₀) that of k q and −k q₀. A [`Term`] says its
//! column as a difference of two effects of the catalogue, and [`crate::Terms::compose`] gives the parameters back.

use toml::{Table, Value};

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
