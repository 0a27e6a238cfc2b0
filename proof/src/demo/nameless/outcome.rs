//! Outcome of a machine: the table's cells, and the checks.

use serde::{Deserialize, Serialize};

/// The five methods, in the order of the columns.
pub const METHODS: [&str; 5] = [
    "no compensation",
    "quasi-static, nominal model",
    "quasi-static, diagnosed model",
    "network on the nominal model",
    "diagnosed model and network",
];

/// The tool's deviation in a run, after the first 0.5 s, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// Root of the mean square.
    pub rms: f64,
    /// Greatest.
    pub max: f64,
}

/// One path, under all five methods.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Name of the path.
    pub path: String,
    /// In the order of [`METHODS`]; `None` for a run that failed.
    pub reached: Vec<Option<Reached>>,
}

/// Outcome of a machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Its name.
    pub machine: String,
    /// The concealed physics, in words.
    pub hidden: String,
    /// True if a part of it has no name in the catalogue.
    pub is_nameless: bool,
    /// True if nothing is concealed.
    pub is_its_model: bool,
    /// Verdict of the diagnosis.
    pub verdict: String,
    /// The effects that it named.
    pub named: Vec<String>,
    /// Results of the proof of the trained weights on the nominal and on the diagnosed model.
    pub proved: [bool; 2],
    /// True if the last method uses the nominal model: held-out paths do not show that the network on the diagnosed model leaves a smaller deviation.
    pub is_nominal: bool,
    /// The paths.
    pub cells: Vec<Cell>,
    /// On a path far outside of the training paths: `narx-qp` on the model of the last method without and with the network.
    pub far: [Option<Reached>; 2],
}

/// A requirement on a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The requirement.
    pub what: &'static str,
    /// True if it holds.
    pub holds: bool,
}

/// Permitted factor of the last method's deviation over the best.
const WITHIN: f64 = 1.02;
/// Smaller differences do not count, mm.
const SAME: f64 = 0.2e-3;
/// Share of a remaining deviation that the network has to remove.
const TAKEN: f64 = 0.7;
/// Share of the play's deviation that the network has to remove on the nominal model.
const PLAY_TAKEN: f64 = 0.9;

/// True if `found` is no worse than `known` beyond the tolerance.
fn is_as_good(found: f64, known: f64) -> bool {
    found <= (known * WITHIN).max(known + SAME)
}

impl Cell {
    /// True if the diagnosed model with the network is the best method, or as good.
    pub fn holds(&self) -> bool {
        let best = self.reached.iter().flatten().map(|reached| reached.rms).fold(f64::INFINITY, f64::min);
        self.reached.last().copied().flatten().is_some_and(|last| is_as_good(last.rms, best))
    }

    /// Share of the deviation under the method `of` that the method `by` removes; indices into [`METHODS`].
    fn taken_by(&self, by: usize, of: usize) -> Option<f64> {
        let rms = |way: usize| self.reached.get(way).copied().flatten().map(|reached| reached.rms);
        Some(1.0 - rms(by)? / rms(of)?)
    }

    /// Share of the diagnosed model's deviation that the network removes.
    pub fn taken(&self) -> Option<f64> {
        self.taken_by(4, 2)
    }

    /// Change of the diagnosed model's deviation by the network, mm.
    fn change(&self) -> f64 {
        let rms =
            |way: usize| self.reached.get(way).copied().flatten().map_or(f64::NAN, |reached| reached.rms);
        (rms(4) - rms(2)).abs()
    }
}

impl Outcome {
    /// All checks of the machine.
    pub fn checks(&self) -> Vec<Check> {
        let all = |holds: &dyn Fn(&Cell) -> bool| self.cells.iter().all(holds);
        let far = match self.far {
            [Some(without), Some(with)] => is_as_good(with.rms, without.rms),
            _ => false,
        };
        let mut checks = vec![
            Check { what: "diagnosed model and network is the best in every cell", holds: all(&Cell::holds) },
            Check { what: "far outside the training it is not worse than physics alone", holds: far },
        ];
        if self.is_nameless {
            let holds = all(&|cell| cell.taken().is_some_and(|taken| taken >= TAKEN));
            checks.push(Check { what: "the network removes at least 70 % of the remainder", holds });
        } else if self.is_its_model {
            let holds = all(&|cell| cell.change() <= SAME);
            checks.push(Check { what: "if the model lacks nothing, the network changes nothing", holds });
        }
        if self.machine == "play" {
            let holds = all(&|cell| cell.taken_by(3, 0).is_some_and(|taken| taken >= PLAY_TAKEN));
            let what = "the network on the nominal model removes at least 90 % of the play's deviation";
            checks.push(Check { what, holds });
        }
        checks
    }
}

#[cfg(test)]
mod tests {
    use super::{Cell, Outcome, Reached};

    fn outcome(rms: [f64; 5], far: [f64; 2], is_nameless: bool) -> Outcome {
        let reached = |rms: f64| Some(Reached { rms, max: 2.0 * rms });
        let cell = Cell { path: "a".to_owned(), reached: rms.map(reached).to_vec() };
        Outcome {
            machine: "play".to_owned(),
            hidden: String::new(),
            is_nameless,
            is_its_model: !is_nameless,
            verdict: String::new(),
            named: Vec::new(),
            proved: [true; 2],
            is_nominal: false,
            cells: vec![cell],
            far: far.map(reached),
        }
    }

    fn failing(outcome: &Outcome) -> Vec<&'static str> {
        outcome.checks().into_iter().filter(|check| !check.holds).map(|check| check.what).collect()
    }

    #[test]
    fn every_check_can_fail() {
        assert!(failing(&outcome([0.6, 0.5, 0.1, 0.02, 0.01], [0.1, 0.1], true)).is_empty());
        let is = |outcome: Outcome, words: &str| {
            let failing = failing(&outcome);
            println!("{failing:?}");
            assert!(failing.len() == 1 && failing[0].contains(words));
        };
        is(outcome([0.6, 0.5, 0.1, 0.009, 0.01], [0.1, 0.1], true), "best");
        is(outcome([0.6, 0.5, 0.1, 0.05, 0.04], [0.1, 0.1], true), "70 %");
        is(outcome([0.6, 0.5, 0.1, 0.07, 0.01], [0.1, 0.1], true), "90 %");
        is(outcome([0.6, 0.5, 0.1, 0.02, 0.01], [0.1, 0.103], true), "far");
        is(outcome([0.6, 0.5, 0.01, 0.02, 0.009], [0.1, 0.1], false), "lacks nothing");
        let mut cut = outcome([0.6, 0.5, 0.1, 0.02, 0.01], [0.1, 0.1], true);
        cut.cells[0].reached[4] = None;
        assert_eq!(
            failing(&cut).len(),
            2,
            "a run that did not end well is neither best nor takes anything away"
        );
    }
}
