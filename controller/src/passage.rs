//! Passages: how the arm goes through the corners of its path, planned before the run.
//!
//! Where the acceleration of the reference jumps, the force in a joint with play turns to another side of the bearing at once. The
//! quasi-static prediction then has the journal jump across the bearing, which it cannot: it flies, lands and bounces. A passage
//! is a motion of joints and journals through the corner that physics allows: every journal rolls along its bearing, pressed
//! against it all the time, and what that costs of the tool's accuracy is least (see [`crate::passage_planner`]). It joins the quasi-static
//! correction before and after the corner.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::qp::{QpError, QpStatus};

/// Why there is no passage through a corner; the quasi-static correction then goes through it as it is.
#[derive(Debug, Error)]
pub enum PassageFault {
    /// A bearing pushes too little before the corner for its journal to have a side.
    #[error("the bearing of joint {joint} pushes with {force:.2} N only before the corner")]
    NoPush {
        /// Index of the joint.
        joint: usize,
        /// Its bearing's force, N.
        force: f64,
    },
    /// A programme had no solution.
    #[error("a programme of the planning ended with {0:?}")]
    Unsolved(QpStatus),
    /// The solver refused the data.
    #[error(transparent)]
    Refused(#[from] QpError),
    /// The steps of the planning did not lead to a course that physics allows.
    #[error("after the last step the forces at a journal leave {0:.3} mm unexplained")]
    NotConsistent(f64),
    /// In a rollout of the model the planned passage leaves more deviation than the quasi-static correction.
    #[error("in a rollout it leaves {planned:.4} mm RMS, the quasi-static correction {plain:.4} mm")]
    NoGain {
        /// RMS of the tool's deviation with the passage, mm.
        planned: f64,
        /// And without, mm.
        plain: f64,
    },
    /// More corners than are planned before a run.
    #[error("the passages planned before a run may take {0} ticks")]
    TooMany(usize),
}

/// What a course is judged by, and where its planning starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PassageOptions {
    /// ε_a, mm²/(rad/s²)²: weight of the correction's acceleration. By default 100 rad/s² cost as much as 0.1 mm.
    pub acceleration: f64,
    /// F_min, N: least force that a bearing is to push with.
    pub least_push: f64,
    /// γ, mm²/N: what a missing newton costs.
    pub missing_push: f64,
    /// How much more large deviations count than small ones: Σ‖e‖^(2 + emphasis) is minimised.
    pub emphasis: f64,
    /// Turn by which the journals' angles in the middle of the first course differ from the quasi-static ones, rad: another start.
    pub detour: f64,
    /// Time that a passage takes before and after its corner, s.
    pub margin: f64,
}

impl Default for PassageOptions {
    fn default() -> PassageOptions {
        PassageOptions {
            acceleration: 1e-6,
            least_push: 5.0,
            missing_push: 1e-2,
            emphasis: 0.0,
            detour: 0.0,
            margin: 0.036,
        }
    }
}

/// What a passage says of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<'a> {
    /// Corrections of the joints, rad (m).
    pub corrections: &'a [f64],
    /// Displacements of the journals, m: two for each joint with play.
    pub journals: &'a [f64],
    /// Moments of the contacts' friction on the joints with play, N·m.
    pub moments: &'a [f64],
}

/// A planned motion through one corner, tick by tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Passage {
    first: u64,
    ticks: usize,
    /// Row after row.
    corrections: Vec<f64>,
    journals: Vec<f64>,
    moments: Vec<f64>,
}

impl Passage {
    /// From the tick `first` on: corrections of the joints, rad (m), displacements of the journals, m, and moments of their friction, N·m,
    /// tick by tick.
    pub fn new(first: u64, corrections: &[Vec<f64>], journals: &[Vec<f64>], moments: &[Vec<f64>]) -> Passage {
        Passage {
            first,
            ticks: corrections.len(),
            corrections: corrections.concat(),
            journals: journals.concat(),
            moments: moments.concat(),
        }
    }

    /// The same motion from the tick `first` on.
    pub fn starting_at(&self, first: u64) -> Passage {
        Passage { first, ..self.clone() }
    }

    /// First tick.
    pub fn first(&self) -> u64 {
        self.first
    }

    /// Number of ticks.
    pub fn ticks(&self) -> usize {
        self.ticks
    }

    /// What it says of the tick `tick`, if that is within.
    pub fn at(&self, tick: u64) -> Option<Step<'_>> {
        let k = usize::try_from(tick.checked_sub(self.first)?).ok().filter(|&k| k < self.ticks)?;
        let row = |values: &'_ [f64]| -> std::ops::Range<usize> {
            let width = values.len() / self.ticks;
            k * width..(k + 1) * width
        };
        Some(Step {
            corrections: &self.corrections[row(&self.corrections)],
            journals: &self.journals[row(&self.journals)],
            moments: &self.moments[row(&self.moments)],
        })
    }
}

/// A corner through which there is no passage.
#[derive(Debug)]
pub struct Unplanned {
    /// Its first tick.
    pub first: u64,
    /// Its last tick.
    pub last: u64,
    /// Why.
    pub fault: PassageFault,
}

/// The passages of one path, in the order of time.
#[derive(Debug, Default)]
pub struct Passages {
    planned: Vec<Passage>,
    unplanned: Vec<Unplanned>,
}

impl Passages {
    /// Of the passages `planned` and the corners `unplanned`, each in the order of time.
    pub fn new(planned: Vec<Passage>, unplanned: Vec<Unplanned>) -> Passages {
        Passages { planned, unplanned }
    }

    /// What the passage at the tick `tick`, if there is one, says: see [`Passage::at`].
    pub fn at(&self, tick: u64) -> Option<Step<'_>> {
        let after = self.planned.partition_point(|passage| passage.first <= tick);
        self.planned[..after].last()?.at(tick)
    }

    /// Why there is no passage through the corner at the tick `tick`, if it lies in one without.
    pub fn fault(&self, tick: u64) -> Option<&PassageFault> {
        let after = self.unplanned.partition_point(|corner| corner.first <= tick);
        let corner = self.unplanned[..after].last()?;
        (tick <= corner.last).then_some(&corner.fault)
    }

    /// Whether a corner through which no passage could be planned begins at the tick `tick`. Where the quasi-static correction is the
    /// better way through, none is lacking.
    pub fn lacks_one_from(&self, tick: u64) -> bool {
        let corner = self.unplanned.binary_search_by_key(&tick, |corner| corner.first);
        corner.is_ok_and(|at| !matches!(self.unplanned[at].fault, PassageFault::NoGain { .. }))
    }

    /// The passages.
    pub fn planned(&self) -> &[Passage] {
        &self.planned
    }

    /// The corners without one.
    pub fn unplanned(&self) -> &[Unplanned] {
        &self.unplanned
    }
}
