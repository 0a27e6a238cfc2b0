//! What the sensors let through of the machine's tolerances. The numbers of a limit of a drive would else be off by these: where the drive gives its
//! limit, a link that is heavier changes nothing of the torque.

use freeplay_laws::{LawError, Placed};

use super::case::Case;
use super::search::Search;

/// How often the shape of a law of the sensors and what it lets through are brought into agreement.
const ROUNDS: usize = 3;

impl<'a> Search<'a, '_> {
    /// What was taken in, laid on `case` for its numbers: the tolerances there go through the laws of the sensors. `None` if a fit is singular.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn given_on<'c>(&self, case: &'c Case<'a>) -> Result<Option<Search<'a, 'c>>, LawError> {
        let mut laid = self.laid_on(case, &case.system(case.target()))?;
        let machine: Vec<usize> = (0..laid.chosen.len())
            .filter(|&index| !laid.named(index).is_read)
            .map(|index| laid.chosen[index].hypothesis)
            .collect();
        if machine.len() == laid.chosen.len() {
            return Ok(Some(laid));
        }
        for _ in 0..ROUNDS {
            let Some(shares) = laid.let_through()? else { return Ok(None) };
            laid = laid.laid_on(case, &case.system_behind(case.target(), Some(&shares)))?;
            match laid.refine_others(&machine) {
                Some(true) => {}
                Some(false) => break,
                None => return Ok(None),
            }
        }
        Ok(Some(laid))
    }

    /// Which share of a small change each channel of each recording shows with what was taken in. `None` if a fit is singular.
    fn let_through(&self) -> Result<Option<Vec<Vec<f64>>>, LawError> {
        let Some(fit) = self.system.fit(&self.active(None)) else { return Ok(None) };
        let arm = self.case.stages[0].arm();
        let placed = |is_read: bool| -> Vec<Placed> {
            let those = (0..self.chosen.len()).filter(|&index| self.named(index).is_read == is_read);
            those.filter_map(|index| self.named(index).placed(arm, &self.coefficients(&fit, index))).collect()
        };
        let (machine, sensors) = (placed(false), placed(true));
        let of_stages: Vec<Vec<Vec<f64>>> = self
            .case
            .stages
            .iter()
            .map(|stage| stage.let_through(&machine, &sensors))
            .collect::<Result<_, _>>()?;
        Ok(Some(of_stages.into_iter().flatten().collect()))
    }
}
