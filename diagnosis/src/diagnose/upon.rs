//! Laws of a measurement, which act on what all other laws say: a limit of a drive clips its friction, a delay is late with it, as in an arm file.

use freeplay_arm::{Arm, EffectTable};
use freeplay_laws::Placed;
use toml::{Table, Value};

use super::hypothesis::hypothesis;
use super::search::Search;

/// Name of the entry in a shape that lists the laws on which it acts.
pub(crate) const UPON: &str = "upon";
/// Names of the entries of a law there.
const KIND: &str = "kind";
const JOINT: &str = "joint";
const PARAMETERS: &str = "parameters";

/// `shape` acting on what the laws in `tables` say.
fn laid_upon(mut shape: Table, tables: &[EffectTable]) -> Table {
    let as_value = |table: &EffectTable| {
        let mut value = Table::new();
        value.insert(KIND.to_owned(), table.kind.clone().into());
        value.extend(table.joint.clone().map(|joint| (JOINT.to_owned(), joint.into())));
        value.insert(PARAMETERS.to_owned(), table.parameters.clone().into());
        Value::Table(value)
    };
    shape.insert(UPON.to_owned(), Value::Array(tables.iter().map(as_value).collect()));
    shape
}

/// The laws on which `shape` acts, on `arm`.
pub(crate) fn acted_on(shape: &Table, arm: &Arm) -> Vec<Placed> {
    let text = |value: &Value, name: &str| value.get(name).and_then(Value::as_str).map(str::to_owned);
    let placed = |value: &Value| {
        let parameters = value.get(PARAMETERS)?.as_table()?.clone();
        let table = EffectTable { kind: text(value, KIND)?, joint: text(value, JOINT), parameters, line: 0 };
        Placed::new(&table, arm).ok()
    };
    let laws = shape.get(UPON).and_then(Value::as_array);
    laws.into_iter().flatten().filter_map(placed).collect()
}

/// How often laws of a measurement and those on which they act are brought into agreement.
const ROUNDS: usize = 3;

impl Search<'_, '_> {
    /// Brings the laws of a measurement that were taken in and those on which they act into agreement: a limit that clips a friction which was
    /// found without it is off until that friction is found with it. `None` if a fit is singular.
    pub fn agree(&mut self) -> Option<()> {
        for _ in 0..ROUNDS {
            let (measures, others): (Vec<usize>, Vec<usize>) =
                (0..self.chosen.len()).partition(|&index| self.named(index).measures());
            let is_read = |&index: &usize| measures.iter().any(|&it| self.named(it).meets(self.named(index)));
            let (read, apart): (Vec<usize>, Vec<usize>) = others.into_iter().partition(is_read);
            let apart: Vec<usize> = apart.into_iter().map(|index| self.chosen[index].hypothesis).collect();
            if read.is_empty() || !self.lay_upon_others()? || !self.refine_others(&apart)? {
                break;
            }
        }
        self.settle()
    }

    /// Lets the laws of a measurement act on what was taken in of the machine itself; whether anything was. `None` if a fit is singular.
    pub(super) fn lay_upon_others(&mut self) -> Option<bool> {
        let fit = self.system.fit(&self.active(None))?;
        let arm = self.case.stages[0].arm();
        let others: Vec<EffectTable> = (0..self.chosen.len())
            .filter(|&index| !self.named(index).is_read)
            .filter_map(|index| {
                let coefficients = self.coefficients(&fit, index);
                self.named(index).placed(arm, &coefficients)?;
                Some(self.named(index).table(arm, &coefficients))
            })
            .collect();
        if others.is_empty() {
            return Some(false);
        }
        for at in 0..self.hypotheses.len() {
            let now = &self.hypotheses[at];
            if !now.measures() {
                continue;
            }
            let shape = laid_upon(now.shape.clone(), &others);
            if let Ok(Some(laid)) = hypothesis(self.case, &self.system, now.kind, now.joint, shape) {
                self.hypotheses[at] = laid;
                self.admitted.remove(&at);
            }
        }
        for index in 0..self.chosen.len() {
            if self.named(index).measures() {
                self.take_shape(index);
            }
        }
        self.settle()?;
        Some(true)
    }
}
