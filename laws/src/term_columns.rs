//! The columns of an effect's terms: the change of the prediction by each term.

use freeplay_model::EffectTable;
use toml::Table;

use crate::basis::Term;
use crate::kind::Kind;
use crate::law_error::LawError;
use crate::place::Place;
use crate::placed::Placed;
use crate::predict::Baseline;
use crate::prediction::Change;

impl Kind {
    /// The effect of this kind with `parameters`, at `joint` (an index; `None`: on the whole arm) of the scene's arm.
    ///
    /// # Errors
    /// See [`LawError`]: parameters that are missing or out of range.
    pub fn place(&'static self, place: &Place, parameters: Table) -> Result<Placed, LawError> {
        let joint = place.joint().map(|joint| joint.name.clone());
        let table = EffectTable { kind: self.name.to_owned(), joint, parameters, line: 0 };
        Placed::new(&table, &place.scene.arm)
    }

    /// One column for each term of the effect at `joint` with `shape`: the change of the whole prediction per unit of the term's
    /// coefficient, about `baseline`. For small effects the prediction is the baseline's plus Σ coefficient × column; for the accuracy see
    /// [`Baseline::change`].
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
            let plus = self.place(&place, term.plus.clone())?;
            let mut column = match &term.minus {
                Some(minus) => baseline.change_between(&self.place(&place, minus.clone())?, &plus)?,
                None => baseline.change(&plus)?,
            };
            column.scale(term.weight);
            Ok((term, column))
        };
        self.terms_at(&place, shape).into_iter().map(column).collect()
    }
}
