//! What goes again: effects that are not physical beside the others, or that these made idle.

use freeplay_laws::{Placed, changed};
use nalgebra::DVector;

use super::search::Search;
use super::system::Fit;

impl Search<'_, '_> {
    /// Drops what is not physical beside the others, or else the weakest effect if the others made it idle; whether one was dropped.
    pub(super) fn drop_one(&mut self) -> Option<bool> {
        self.update_gains()?;
        if self.drop_unphysical()? {
            return Some(true);
        }
        let fit = self.system.fit(&self.active(None))?;
        if let Some(index) = self.weakest(|index| !self.is_material(&fit, index)) {
            self.bar(index);
            return Some(true);
        }
        let dropped = self.weakest(|index| self.is_idle(index));
        if let Some(index) = dropped {
            self.chosen.remove(index);
        }
        Some(dropped.is_some())
    }

    /// Where an effect is not physical beside the others, drops the weakest of those without which it is, itself among them, and bars it:
    /// it would come back as strong, and do the same again.
    fn drop_unphysical(&mut self) -> Option<bool> {
        let fit = self.system.fit(&self.active(None))?;
        let Some(victim) = self.weakest(|index| !self.is_sayable(&fit, index)) else { return Some(false) };
        let restores = |index: usize| {
            let without = || self.system.fit(&self.active(Some(index)));
            index == victim || without().is_some_and(|fit| self.is_sayable(&fit, victim))
        };
        let dropped = self.weakest(restores).unwrap_or(victim);
        self.bar(dropped);
        Some(true)
    }

    /// Whether an arm can have all that was taken in.
    pub fn is_possible(&self) -> bool {
        self.system.fit(&self.active(None)).is_some_and(|fit| self.is_possible_with(&fit))
    }

    /// Whether an arm can have all that was taken in with the coefficients of `fit`.
    pub fn is_possible_with(&self, fit: &Fit) -> bool {
        (0..self.chosen.len()).all(|index| self.is_sayable(fit, index))
    }

    /// Whether the effect number `index` is physical in `fit`, an arm file can say it, and an arm can have it beside those before it.
    fn is_sayable(&self, fit: &Fit, index: usize) -> bool {
        let arm = self.case.stages[0].arm();
        let placed = |index: usize| self.named(index).placed(arm, &self.coefficients(fit, index));
        let Some(one) = placed(index) else { return false };
        let before: Vec<Placed> = (0..index).filter_map(placed).collect();
        changed(arm, before.iter().chain([&one])).is_ok() || changed(arm, &before).is_err()
    }

    /// Whether the effect number `index` says enough in `fit` to be a finding.
    pub(super) fn is_material(&self, fit: &Fit, index: usize) -> bool {
        let beta = DVector::from_vec(self.coefficients(fit, index));
        self.system.is_material(&self.named(index).block, &beta)
    }

    /// By how much the effect number `index` explains more than counts.
    pub(super) fn margin(&self, index: usize) -> f64 {
        self.chosen[index].gain - self.threshold(self.named(index))
    }

    /// Whether the effect number `index` explains less than counts.
    pub(super) fn is_idle(&self, index: usize) -> bool {
        self.margin(index) < 0.0
    }

    /// The effect that explains least of those that are `such`.
    pub(super) fn weakest(&self, such: impl Fn(usize) -> bool) -> Option<usize> {
        let among = (0..self.chosen.len()).filter(|&index| such(index));
        among.min_by(|&a, &b| self.margin(a).total_cmp(&self.margin(b)))
    }

    /// Weights and gains under what was taken in, less what is not physical under these.
    pub fn settle(&mut self) -> Option<()> {
        self.weigh_anew()?;
        self.update_gains()?;
        while self.drop_unphysical()? {
            self.weigh_anew()?;
            self.update_gains()?;
        }
        Some(())
    }
}
