//! Where a journal in oil begins once the numbers of its law are known, and how much hangs on it.

use freeplay_laws::{LawError, Parameter, Range, START, Start};

use super::case::Case;
use super::columns::Column;
use super::hypothesis::Hypothesis;
use super::moment::plain;
use super::search::Search;
use super::stage::{Answer, Stage};
use crate::begin::{InBearing, square, way, within};

impl Search<'_, '_> {
    /// The numbers of those effects whose journals begin in a bearing.
    pub fn in_bearings(&self) -> Vec<usize> {
        (0..self.chosen.len()).filter(|&index| self.named(index).bearing().is_some()).collect()
    }
}

impl Hypothesis {
    /// The joint in whose bearing a journal begins, if the law has one.
    fn bearing(&self) -> Option<usize> {
        let is_vector = |start: &&Parameter| matches!(start.range, Range::Vector { .. });
        self.joint.filter(|_| self.kind.parameter(START).filter(is_vector).is_some())
    }

    /// The column of its only term where a journal begins in each recording of `case` as leaves least of its `rest` with the coefficients `beta`; `None`
    /// for laws that don't begin in a bearing.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn begun_on(
        &self,
        case: &Case,
        beta: &[f64],
        rest: &[Vec<f64>],
    ) -> Result<Option<Vec<Column>>, LawError> {
        let begun = self.begun(case, beta, rest)?;
        Ok(begun.map(|stages| {
            let answers = stages.into_iter().map(|(_, answer)| answer).collect();
            vec![case.centred(case.column(answers))]
        }))
    }

    /// What it says more in `case` where a journal begins a nudge farther in: two columns a recording for laws that begin in a bearing, see
    /// [`InBearing::nudged`].
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn slopes_of_start(
        &self,
        case: &Case,
        beta: &[f64],
        rest: &[Vec<f64>],
    ) -> Result<Vec<Column>, LawError> {
        let (Some(joint), Some(begun)) = (self.bearing(), self.begun(case, beta, rest)?) else {
            return Ok(Vec::new());
        };
        let nothing = || -> Vec<Answer> { vec![vec![None; case.per_stage()]; case.stages.len()] };
        let mut slopes = Vec::new();
        for (number, (stage, (place, here))) in case.stages.iter().zip(&begun).enumerate() {
            for nudged in place.nudged() {
                let there = self.said_from(stage, joint, nudged.eccentricity())?;
                let mut answers = nothing();
                answers[number] = slope(&there.unwrap_or_default(), here, beta[0]);
                slopes.push(case.centred(case.column(answers)));
            }
        }
        Ok(slopes)
    }

    /// Where a journal begins in each recording of `case` as leaves least of its `rest` with the coefficients `beta`, and what its only term says then;
    /// `None` for laws that don't begin in a bearing.
    fn begun(
        &self,
        case: &Case,
        beta: &[f64],
        rest: &[Vec<f64>],
    ) -> Result<Option<Vec<(InBearing, Answer)>>, LawError> {
        let Some(joint) = self.bearing() else { return Ok(None) };
        let per_stage = case.per_stage();
        let mut all = Vec::new();
        for (number, stage) in case.stages.iter().enumerate() {
            let left = |answer: &Answer| -> Vec<f64> {
                let said = |(said, channel): (&Option<Vec<f64>>, usize)| {
                    let rows = said.as_ref()?.iter().zip(&case.kept[channel]).zip(&rest[channel]);
                    Some(rows.map(|((said, kept), rest)| rest - beta[0] * kept * said).collect::<Vec<f64>>())
                };
                answer.iter().zip(number * per_stage..).filter_map(said).flatten().collect()
            };
            let at = |place: [f64; 2]| -> Result<_, LawError> {
                let answer = self.said_from(stage, joint, place)?;
                Ok(answer.map(|answer| (left(&answer), answer)))
            };
            let squares = |(left, _): &(Vec<f64>, Answer)| square(left);
            let step = |(here, _): &(Vec<f64>, Answer), nudged: [&(Vec<f64>, Answer); 2]| {
                way(here, nudged.map(|(there, _)| &**there))
            };
            let found = within(f64::INFINITY, at, squares, step)?;
            all.push(found.map(|(place, (_, answer))| (place, answer)));
        }
        Ok(all.into_iter().collect())
    }

    /// What its only term says in `stage` per unit where the journal of `joint` begins at `place`.
    fn said_from(&self, stage: &Stage, joint: usize, place: [f64; 2]) -> Result<Option<Answer>, LawError> {
        let terms = stage.terms_begun(self.kind, joint, &plain(&self.shape), Start::Within(place), &[])?;
        Ok(terms.into_iter().next().map(|(_, answer)| answer))
    }
}

/// `times` what is `there` more than `here`, where both say something.
fn slope(there: &Answer, here: &Answer, times: f64) -> Answer {
    let slope = |(there, here): (&Vec<f64>, &Vec<f64>)| {
        there.iter().zip(here).map(|(there, here)| times * (there - here)).collect()
    };
    there.iter().zip(here).map(|(there, here)| there.as_ref().zip(here.as_ref()).map(slope)).collect()
}
