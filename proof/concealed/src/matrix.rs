//! The systematic sweep: every kind at every possible place, at every severity, with controls without any effect.

use rand::RngExt;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use crate::arms::Machine;
use crate::case::{Case, Demand, GenerateError, Severity};
use crate::kinds::{CATALOGUE, Seat, seats};
use crate::random::{pick, stream};
use crate::sensors::Noise;
use crate::set::Quota;

/// Range of the sweep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Matrix {
    /// The machines.
    pub machines: Vec<Machine>,
    /// Kinds of the catalogue.
    pub kinds: Vec<String>,
    /// Number of controls without any effect, dealt evenly to the machines.
    pub negative: usize,
}

/// A place for a kind: row and column of the matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The machine.
    pub machine: Machine,
    /// The kind.
    pub kind: String,
    /// The joint, from 0; `None` for the arm as a whole.
    pub seat: Seat,
}

impl Matrix {
    /// The machines of a whole matrix: six, three and seven joints.
    pub const MACHINES: [Machine; 3] = [Machine::Paper, Machine::Three, Machine::Seven];
    /// Controls of a whole matrix.
    pub const CONTROL_COUNT: usize = 200;

    /// Every kind of the catalogue on three machines.
    pub fn whole() -> Self {
        let kinds = CATALOGUE.map(str::to_owned).to_vec();
        Self { machines: Self::MACHINES.to_vec(), kinds, negative: Self::CONTROL_COUNT }
    }

    /// Every place of every kind.
    ///
    /// # Errors
    /// As [`Machine::data_sheet`].
    pub fn places(&self) -> Result<Vec<Place>, GenerateError> {
        let mut places = Vec::new();
        for &machine in &self.machines {
            let arm = machine.data_sheet()?;
            for kind in &self.kinds {
                let of = seats(kind, &arm).into_iter();
                places.extend(of.map(|seat| Place { machine, kind: kind.clone(), seat }));
            }
        }
        Ok(places)
    }

    /// Number of cases of each sort.
    ///
    /// # Errors
    /// As [`Machine::data_sheet`].
    pub fn quota(&self) -> Result<Quota, GenerateError> {
        let single = Severity::ALL.len() * self.places()?.len();
        // Without a place there are no cases for controls.
        let negative = if single == 0 { 0 } else { self.negative };
        Ok(Quota { single, negative, ..Quota::default() })
    }

    /// The cases from `seed`, in an uninformative order: each place once at each severity, with the three noise levels dealt to them; and the controls, each
    /// drawn as for one of the kinds on its machine.
    ///
    /// # Errors
    /// As [`Machine::data_sheet`].
    pub fn draw(&self, seed: u64) -> Result<Vec<Case>, GenerateError> {
        let mut rng = stream(seed, "matrix");
        let mut places = self.places()?;
        places.shuffle(&mut rng);
        let mut cases = Vec::new();
        let mut add = |machine, kind: &str, joint, severity, noise, hollow, seed| {
            let effects = vec![Demand { kind: kind.to_owned(), joint, severity }];
            cases.push(Case { machine, effects, family: None, noise, hollow, seed });
        };
        for (number, Place { machine, kind, seat }) in places.iter().enumerate() {
            for (level, severity) in Severity::ALL.into_iter().enumerate() {
                let noise = Noise::ALL[(number + level) % Noise::ALL.len()];
                add(*machine, kind, *seat, severity, noise, false, rng.random());
            }
        }
        let held = |machine: Machine| places.iter().filter(move |place| place.machine == machine);
        let machines: Vec<Machine> =
            self.machines.iter().copied().filter(|m| held(*m).next().is_some()).collect();
        for number in 0..self.quota()?.negative {
            let machine = machines[number % machines.len()];
            let round = number / machines.len();
            let (severity, noise) = (Severity::ALL[round % 3], Noise::ALL[round / 3 % 3]);
            let kinds: Vec<&str> = held(machine).map(|place| place.kind.as_str()).collect();
            add(machine, pick(&mut rng, &kinds), None, severity, noise, true, rng.random());
        }
        cases.shuffle(&mut rng);
        Ok(cases)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::Matrix;
    use crate::arms::Machine;
    use crate::case::Severity;
    use crate::kinds::{CATALOGUE, seats};
    use crate::sensors::Noise;

    /// Every kind at every possible place, on every machine, at every severity: each exactly once.
    #[test]
    fn the_draw_covers_every_place_once_at_each_severity() {
        let matrix = Matrix::whole();
        let cases = matrix.draw(3).expect("cases");
        let quota = matrix.quota().expect("a quota");
        let mut wanted = BTreeSet::new();
        for machine in Matrix::MACHINES {
            let arm = machine.data_sheet().expect("a data sheet");
            for kind in CATALOGUE {
                for seat in seats(kind, &arm) {
                    wanted.extend(Severity::ALL.map(|s| (machine, kind.to_owned(), seat, s.name())));
                }
            }
        }
        let singles: Vec<_> = cases.iter().filter(|case| !case.hollow).collect();
        let drawn: BTreeSet<_> = singles
            .iter()
            .map(|case| {
                let effect = &case.effects[0];
                (case.machine, effect.kind.clone(), effect.joint, effect.severity.name())
            })
            .collect();
        println!("{} cases of one effect, {} controls", singles.len(), quota.negative);
        assert_eq!(drawn, wanted);
        assert_eq!((singles.len(), cases.len()), (wanted.len(), quota.cases()));
        assert_eq!(quota.negative, Matrix::CONTROL_COUNT);
        assert_ne!(cases, matrix.draw(4).expect("cases"));
    }

    /// Noise levels and machines of the controls occur equally often, to within one.
    #[test]
    fn noise_and_controls_are_dealt_evenly() {
        let cases = Matrix::whole().draw(3).expect("cases");
        let even =
            |counts: &[usize], slack| counts.iter().max() <= counts.iter().min().map(|n| n + slack).as_ref();
        for severity in Severity::ALL {
            let of = |noise: Noise| {
                let is = |case: &&crate::Case| !case.hollow && case.effects[0].severity == severity;
                cases.iter().filter(is).filter(|case| case.noise == noise).count()
            };
            assert!(even(&Noise::ALL.map(of), 1), "{severity:?}: {:?}", Noise::ALL.map(of));
        }
        let controls = |machine: Machine| cases.iter().filter(|c| c.hollow && c.machine == machine).count();
        assert!(even(&Matrix::MACHINES.map(controls), 1), "{:?}", Matrix::MACHINES.map(controls));
    }

    #[test]
    fn a_kind_without_a_place_gives_no_case() {
        let kinds = vec!["joint_coupling".to_owned()];
        let matrix = Matrix { machines: vec![Machine::Slide], kinds, negative: 5 };
        assert!(matrix.draw(1).expect("no cases").is_empty());
    }
}
