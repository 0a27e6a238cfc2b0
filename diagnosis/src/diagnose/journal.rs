//! Where a journal in oil begins once the numbers of its law are known, and how much hangs on it.

use freeplay_laws::{LawError, Parameter, Range, START};

use super::case::Case;
use super::columns::Column;
use super::hypothesis::Hypothesis;
use super::moment::plain;
use super::stage::Answer;
use crate::begin::{InBearing, square, way, within};

impl Hypothesis {
    /// The joint in whose bearing a journal begins, if the law has one.
    pub fn bearing(&self) -> Option<usize> {
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
        let (Some(joint), Some(begun)) = (self.joint, self.begun(case, beta, rest)?) else {
            return Ok(Vec::new());
        };
        let nothing = || -> Vec<Answer> { vec![vec![None; case.per_stage()]; case.stages.len()] };
        let mut slopes = Vec::new();
        for (number, (stage, (place, here))) in case.stages.iter().zip(&begun).enumerate() {
            for nudged in place.nudged() {
                let there = stage.begun_at(self.kind, joint, &plain(&self.shape), nudged.eccentricity())?;
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
        let (shape, per_stage) = (plain(&self.shape), case.per_stage());
        let mut all = Vec::new();
        for (number, stage) in case.stages.iter().enumerate() {
            let left = |answer: &Answer| -> Vec<f64> {
                let said = |(said, channel): (&Option<Vec<f64>>, usize)| {
                    let rows = said.as_ref()?.iter().zip(&case.kept[channel]).zip(&rest[channel]);
                    Some(rows.map(|((said, kept), rest)| rest - beta[0] * kept * said).collect::<Vec<f64>>())
                };
                answer.iter().zip(number * per_stage..).filter_map(said).flatten().collect()
            };
            let at = |place: [f64; 2]| stage.begun_at(self.kind, joint, &shape, place);
            let step = |here: &Answer, nudged: [&Answer; 2]| way(&left(here), nudged.map(&left));
            all.push(within(f64::INFINITY, at, |there| square(&left(there)), step)?);
        }
        Ok(all.into_iter().collect())
    }
}

/// `times` what is `there` more than `here`, where both say something.
fn slope(there: &Answer, here: &Answer, times: f64) -> Answer {
    let slope = |(there, here): (&Vec<f64>, &Vec<f64>)| {
        there.iter().zip(here).map(|(there, here)| times * (there - here)).collect()
    };
    there.iter().zip(here).map(|(there, here)| there.as_ref().zip(here.as_ref()).map(slope)).collect()
}
