//! Results of an independent simulator and of an independent training, for comparison.
//!
//! Origin: the runs of `freeplay reference-runs` (semi-implicit Euler, 10 µs, Python and Pinocchio), a study of the printed
//! friction law with the same simulator, and a study of the paper's network in numpy, c = 0.6 mm, 125 Hz, prescribed motion.

use freeplay_harness::scenario::Drive;
use freeplay_laws::FrictionLaw;
use freeplay_path::PathKind;
use freeplay_terminal::exit::Failure;

use super::case::Case;
use crate::reference_pair::Figures;
use crate::reference_runs::{Reference, read_reference};

/// The independent results.
pub struct Independent {
    runs: Vec<Reference>,
}

impl Independent {
    /// Reads them.
    ///
    /// # Errors
    /// A table that can't be read.
    pub fn read() -> Result<Self, Failure> {
        Ok(Self { runs: read_reference().map_err(Failure::internal)? })
    }

    /// The run that corresponds to `case`, if there is one.
    pub fn run(&self, case: &Case) -> Option<&Figures> {
        let plain = Case::new(case.drive, case.path, case.period, case.clearance);
        let mode = if case.drive == Drive::Driven { "driven" } else { "ctc" };
        let same = |run: &&Reference| {
            run.mode == mode
                && run.path == case.path
                && run.period == case.period
                && (run.c_mm - case.clearance).abs() < 1e-9
        };
        self.runs.iter().find(same).filter(|_| *case == plain).map(|run| &run.figures)
    }
}

/// Standard deviation of the x deviation in 0.8–1.0 s, mm, c = 0.4 mm, for the friction coefficients of
/// [`super::case::FRICTIONS`].
pub fn friction_spread(law: FrictionLaw, coefficient: f64) -> Option<f64> {
    let values = match law {
        FrictionLaw::Corrected => [0.0007, 0.0025, 0.0081],
        FrictionLaw::Printed => [0.0118, 0.178, 0.222],
        _ => return None,
    };
    super::case::FRICTIONS.iter().position(|known| *known == coefficient).map(|place| values[place])
}

/// Peaks of the normal force above 20 N without gravity, T = 6 and 12 s, for the three clearances.
pub const WEIGHTLESS_PEAKS: [[f64; 3]; 2] = [[7.0, 13.0, 17.0], [0.0, 0.0, 5.0]];

/// Sum over the axes of the one-step test error of network, persistence and ridge ARX, mm², for T = 6 and 12 s.
#[derive(Clone, Copy, Debug)]
pub struct NetworkErrors {
    /// The network.
    pub narx: [f64; 2],
    /// The last known value.
    pub persistence: [f64; 2],
    /// Ridge ARX.
    pub arx: [f64; 2],
}

/// The independent study of the network; `random` selects the split.
pub fn network_errors(drive: Drive, path: PathKind, random: bool) -> Option<NetworkErrors> {
    let errors = |narx, arx, persistence| Some(NetworkErrors { narx, persistence, arx });
    match (drive, path, random) {
        (Drive::Driven, PathKind::Lissajous, true) => {
            errors([1.6e-3, 3.0e-4], [1.2e-3, 3.3e-4], [1.1e-3, 5.8e-4])
        }
        (Drive::Driven, PathKind::Lissajous, false) => {
            errors([1.4e-3, 3.0e-3], [9e-2, 7e-4], [1.5e-8, 9e-10])
        }
        (Drive::Driven, PathKind::SquareSharp, true) => {
            errors([1.5e-2, 9.5e-4], [4.4e-2, 1.1e-2], [6.6e-2, 1.6e-2])
        }
        (Drive::Driven, PathKind::SquareSharp, false) => {
            errors([5.4e-2, 2.2e-2], [4.4e-2, 5.0e-3], [5.0e-2, 2.0e-2])
        }
        _ => None,
    }
}
