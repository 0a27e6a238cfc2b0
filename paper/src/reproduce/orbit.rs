//! The journal's path in its bearing, with ten points per tick: an impact lasts half a tick.

use freeplay_terminal::exit::Failure;

use super::case::Case;
use super::peaks::{ContactMode, contact_modes};
use crate::simulation::{Scene, Simulation};

/// Length of a recorded step, s.
const STEP: f64 = 1e-4;
/// Sub-steps of it: 20 µs, as in all other runs.
const SUBSTEPS: u32 = 5;

/// The orbit of the journal in its bearing during a part of a run.
#[derive(Clone, Debug, Default)]
pub struct JournalOrbit {
    /// Times, s.
    pub time: Vec<f64>,
    /// Offset of the journal in the plane across the joint's axis, along the forearm and across it, mm.
    pub offset: [Vec<f64>; 2],
    /// Mode of contact at each instant.
    pub mode: Vec<ContactMode>,
}

impl JournalOrbit {
    /// Follows the journal of `case` from `start` for `length` seconds.
    ///
    /// # Errors
    /// A motion that can't be integrated.
    pub fn follow(case: &Case, start: f64, length: f64) -> Result<Self, Failure> {
        let scene = Scene { tick: STEP, substeps: SUBSTEPS, ..case.scene() };
        let mut run = Simulation::new(&scene)?;
        let (mut orbit, mut episode) = (Self::default(), Vec::new());
        while run.system().time() < start + length {
            run.desired_tool();
            run.tick()?;
            let system = run.system();
            if system.time() < start {
                continue;
            }
            let Some((play, bearing)) = system.play().plays().first().zip(system.bearings().first()) else {
                break;
            };
            orbit.time.push(system.time());
            for (column, slide) in orbit.offset.iter_mut().zip(play.slides) {
                column.push(system.q()[slide] * 1e3);
            }
            episode.push(bearing.episode());
        }
        orbit.mode = contact_modes(&episode);
        Ok(orbit)
    }

    /// `column` while the journal is in `mode`, NaN elsewhere. A line continues to the first point of the next mode.
    pub fn only(&self, mode: ContactMode, column: &[f64]) -> Vec<f64> {
        let here = |i: usize| self.mode[i] == mode || (i > 0 && self.mode[i - 1] == mode);
        (0..column.len()).map(|i| if here(i) { column[i] } else { f64::NAN }).collect()
    }

    /// Distance of the journal from the bearing's centre, mm.
    pub fn eccentricity(&self) -> Vec<f64> {
        self.offset[0].iter().zip(&self.offset[1]).map(|(x, z)| x.hypot(*z)).collect()
    }
}
