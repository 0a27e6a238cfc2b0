//! The simulated scenarios: those of the paper, and those needed to judge its claims.

use freeplay_harness::scenario::Drive;
use freeplay_laws::{ClearanceTable, FrictionLaw};
use freeplay_path::{PathKind, PathSpec};
use serde::Serialize;

use crate::simulation::{Scene, TICK};

/// The paper's radial clearances, mm.
pub const CLEARANCES: [f64; 3] = [0.2, 0.4, 0.6];
/// The paper's times of a lap, s: the shorter and the longer.
pub const PERIODS: [f64; 2] = [6.0, 12.0];
/// Friction coefficients at which the printed law is compared with the corrected one; the paper's is the first.
pub const FRICTIONS: [f64; 3] = [0.01, 0.1, 0.3];
/// Clearance of those runs, mm.
pub const FRICTION_CLEARANCE: f64 = 0.4;
/// Laps of the runs that are compared lap by lap.
pub const LAPS: u32 = 3;
/// Relative changes of a clearance below any measurement (at most 0.01 µm). If corners make a run chaotic, they show the uncertainty of its numbers.
pub const PERTURBATIONS: [f64; 2] = [-1e-5, 1e-5];
/// Sub-steps of a tick: 20 µs, with an error of 0.7 % in the first peak.
const SUBSTEPS: u32 = 50;

/// Friction in the bearing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Friction {
    /// The law.
    pub law: FrictionLaw,
    /// μ_s = μ_d.
    pub coefficient: f64,
}

/// One run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Drive of the joints.
    pub drive: Drive,
    /// Shape of the path.
    pub path: PathKind,
    /// Time of a lap, s.
    pub period: f64,
    /// Radial clearance, mm; 0 is a perfect joint.
    pub clearance: f64,
    /// True if there is gravity.
    pub gravity: bool,
    /// Laps.
    pub laps: u32,
    /// Friction in the bearing.
    pub friction: Friction,
    /// Relative change of the clearance, see [`PERTURBATIONS`].
    pub nudge: f64,
}

impl Case {
    /// The paper's joint over one lap under gravity.
    pub fn new(drive: Drive, path: PathKind, period: f64, clearance: f64) -> Self {
        let friction = Friction { law: FrictionLaw::Corrected, coefficient: FRICTIONS[0] };
        Self { drive, path, period, clearance, gravity: true, laps: 1, friction, nudge: 0.0 }
    }

    /// The same run without gravity.
    pub fn weightless(self) -> Self {
        Self { gravity: false, ..self }
    }

    /// The scene of its simulation.
    pub fn scene(&self) -> Scene {
        let mut play = ClearanceTable::new(self.clearance * 1e-3 * (1.0 + self.nudge));
        play.friction = self.friction.coefficient;
        play.friction_law = self.friction.law;
        Scene {
            drive: self.drive,
            path: PathSpec { kind: self.path, period: self.period, laps: self.laps, ..PathSpec::default() },
            play: (self.clearance > 0.0).then_some(play),
            gravity: if self.gravity { 9.81 } else { 0.0 },
            tick: TICK,
            substeps: SUBSTEPS,
        }
    }

    /// The situation in words, without the clearance.
    pub fn situation(&self) -> String {
        let weight = if self.gravity { "" } else { ", no gravity" };
        format!("{}, {}{weight}, T = {} s", path_name(self.path), drive_name(self.drive), self.period)
    }
}

/// A path in words.
pub fn path_name(path: PathKind) -> &'static str {
    match path {
        PathKind::Lissajous => "smooth path",
        PathKind::Square => "soft square",
        PathKind::SquareSharp => "sharp square",
        other => other.name(),
    }
}

/// A drive in words.
pub fn drive_name(drive: Drive) -> &'static str {
    match drive {
        Drive::Driven => "prescribed motion",
        Drive::Torque => "torque-driven",
        Drive::Servo => "on position servos",
    }
}

/// Selection of the simulated runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Scope {
    /// Drive of the joints.
    pub drives: Vec<Drive>,
    /// Shapes of the path.
    pub paths: Vec<PathKind>,
    /// Friction coefficients at which the printed law is compared with the corrected one.
    pub frictions: Vec<f64>,
    /// True if the scope also contains runs of several laps and runs without gravity.
    pub beside: bool,
}

impl Scope {
    /// The paper's runs and those that it left open.
    pub fn whole() -> Self {
        Self {
            drives: vec![Drive::Driven, Drive::Torque],
            paths: vec![PathKind::Lissajous, PathKind::SquareSharp],
            frictions: FRICTIONS.to_vec(),
            beside: true,
        }
    }

    /// The smooth path with prescribed motion alone.
    pub fn quick() -> Self {
        Self {
            drives: vec![Drive::Driven],
            paths: vec![PathKind::Lissajous],
            frictions: vec![FRICTIONS[1]],
            beside: false,
        }
    }

    /// Every pair of drive and path.
    pub fn pairs(&self) -> impl Iterator<Item = (Drive, PathKind)> + '_ {
        self.drives.iter().flat_map(|&drive| self.paths.iter().map(move |&path| (drive, path)))
    }

    /// All runs, each once.
    pub fn cases(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for (drive, path) in self.pairs() {
            for period in PERIODS {
                cases.push(Case::new(drive, path, period, 0.0));
                cases.extend(CLEARANCES.map(|clearance| Case::new(drive, path, period, clearance)));
            }
        }
        for case in cases.clone() {
            if case.path == PathKind::SquareSharp && case.clearance > 0.0 {
                cases.extend(PERTURBATIONS.map(|nudge| Case { nudge, ..case }));
            }
        }
        for &coefficient in &self.frictions {
            cases.extend([FrictionLaw::Corrected, FrictionLaw::Printed].map(|law| rubbing(law, coefficient)));
        }
        if self.beside {
            cases.extend(self.pairs().flat_map(|(drive, path)| PERIODS.map(|t| lapping(drive, path, t))));
            for period in PERIODS {
                cases.extend(CLEARANCES.map(|clearance| smooth(period, clearance).weightless()));
            }
        }
        let mut once: Vec<Case> = Vec::new();
        for case in cases {
            if !once.contains(&case) {
                once.push(case);
            }
        }
        once
    }
}

/// Prescribed motion along the smooth path.
pub fn smooth(period: f64, clearance: f64) -> Case {
    Case::new(Drive::Driven, PathKind::Lissajous, period, clearance)
}

/// The run that is compared lap by lap: the largest clearance.
pub fn lapping(drive: Drive, path: PathKind, period: f64) -> Case {
    Case { laps: LAPS, ..Case::new(drive, path, period, CLEARANCES[2]) }
}

/// The run that compares one friction law with another.
pub fn rubbing(law: FrictionLaw, coefficient: f64) -> Case {
    Case { friction: Friction { law, coefficient }, ..smooth(PERIODS[0], FRICTION_CLEARANCE) }
}

#[cfg(test)]
mod tests {
    use super::{Case, Scope, lapping, smooth};
    use freeplay_harness::scenario::Drive;
    use freeplay_path::PathKind;

    #[test]
    fn no_run_is_made_twice_and_the_paper_s_are_there() {
        let cases = Scope::whole().cases();
        for (index, case) in cases.iter().enumerate() {
            assert!(!cases[..index].contains(case), "{case:?}");
        }
        for clearance in [0.0, 0.2, 0.4, 0.6] {
            assert!(cases.contains(&Case::new(Drive::Torque, PathKind::SquareSharp, 12.0, clearance)));
        }
        assert!(cases.contains(&lapping(Drive::Driven, PathKind::Lissajous, 6.0)));
        assert!(cases.contains(&smooth(6.0, 0.2).weightless()));
        let quick = Scope::quick().cases();
        println!("{} runs, quick {}", cases.len(), quick.len());
        assert!(quick.len() < cases.len() / 2 && quick.iter().all(|case| cases.contains(case)));
    }
}
