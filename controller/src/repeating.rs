//! What repeats from lap to lap: the error of the twin's forecast one lap ago.
//!
//! On a path that is run several times, what the twin leaves out (how the correction's acceleration changes within the horizon, a
//! friction unlike the believed one) makes nearly the same error at the same place of every lap. The error of each tick is kept for a lap
//! and taken from the forecast of the same tick of the next (the idea of iterative learning control; Arimoto et al. 1984), as long
//! as that has made the forecasts of the last quarter second better. Flight from an impact does not repeat as well, but its start
//! mostly does.

use crate::features::Pair;

/// Longest lap that is kept, ticks.
pub const LONGEST_LAP: u64 = 120_000;

/// The errors of one lap; see the module.
pub struct Repeating {
    /// Error of the forecast for each tick of the lap, slides, m, once it has come due.
    errors: Vec<Option<Pair>>,
    /// Mean squared errors of the forecasts as they are and without what they were off by a lap ago, m².
    squares: [f64; 2],
    /// Share of the newest error in them.
    share: f64,
    judged: u64,
}

impl Repeating {
    /// For laps of `lap` ticks, judged over about 1/`share` forecasts. `None` if a lap has no tick, or more than [`LONGEST_LAP`].
    pub fn new(lap: u64, share: f64) -> Option<Repeating> {
        let fits = (1..=LONGEST_LAP).contains(&lap);
        fits.then(|| Repeating { errors: vec![None; lap as usize], squares: [0.0; 2], share, judged: 0 })
    }

    /// Error to be expected of the forecast for the tick `tick`, slides, m: where no lap has been run, or errors do not repeat, none.
    pub fn expected(&self, tick: u64) -> Option<Pair> {
        let [plain, without] = self.squares;
        self.errors[self.slot(tick)].filter(|_| without < plain)
    }

    /// Mean squared error of forecasts without what repeats, m²; none before any has been judged.
    pub fn square(&self) -> Option<f64> {
        (self.judged > 0).then_some(self.squares[1])
    }

    /// Notes that the forecast for the tick `tick` was off by `error`, slides, m.
    pub fn note(&mut self, tick: u64, error: Pair) {
        let slot = self.slot(tick);
        if let Some(before) = self.errors[slot].replace(error) {
            self.judged += 1;
            // The first errors weigh as much as the later ones: a mean before it is a moving one.
            let share = self.share.max(1.0 / self.judged as f64);
            let plain = error[0].powi(2) + error[1].powi(2);
            let without = (error[0] - before[0]).powi(2) + (error[1] - before[1]).powi(2);
            for (mean, square) in self.squares.iter_mut().zip([plain, without]) {
                *mean += share * (square - *mean);
            }
        }
    }

    fn slot(&self, tick: u64) -> usize {
        (tick % self.errors.len() as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::{LONGEST_LAP, Repeating};

    /// What is left of errors that `error` makes over three laps of 100 ticks, the last lap alone, relative to them.
    fn left(error: impl Fn(u64) -> f64) -> f64 {
        let mut repeating = Repeating::new(100, 0.04).expect("a lap");
        let (mut plain, mut without) = (0.0, 0.0);
        for tick in 0..300 {
            let expected = repeating.expected(tick).unwrap_or_default();
            if tick >= 200 {
                plain += error(tick).powi(2);
                without += (error(tick) - expected[0]).powi(2);
            }
            repeating.note(tick, [error(tick), 0.0]);
        }
        without / plain
    }

    #[test]
    fn what_repeats_is_taken_away_and_what_does_not_is_left_alone() {
        let wave = |tick: u64| (tick as f64 * std::f64::consts::TAU / 100.0).sin();
        let same = left(wave);
        let nearly = left(|tick| wave(tick) + 0.01 * (tick as f64 * 0.731).sin());
        let opposite = left(|tick| wave(tick) * if (tick / 100) % 2 == 0 { 1.0 } else { -1.0 });
        println!(
            "left: of the same {same:.1e}, of nearly the same {nearly:.1e}, of what turns about {opposite:.3}"
        );
        assert!(same < 1e-20 && nearly < 1e-3 && (opposite - 1.0).abs() < 1e-12);
    }

    #[test]
    fn laps_that_cannot_be_kept_are_not() {
        assert!(Repeating::new(0, 0.1).is_none() && Repeating::new(LONGEST_LAP + 1, 0.1).is_none());
        assert_eq!(Repeating::new(5, 0.1).and_then(|repeating| repeating.expected(3)), None);
    }
}
