//! Passages: motions of the arm through the corners of its path, planned before the run.
//!
//! If the acceleration of the reference jumps, the force in a joint with play changes at once to another side of the bearing. The
//! quasi-static prediction then lets the journal jump across the bearing. A real journal cannot jump: it flies, lands and bounces. A
//! passage is a physically possible motion of joints and journals through the corner: every journal rolls along its bearing and stays
//! pressed against it, and the planner minimises the deviation of the tool (see [`crate::passage_planner`]). The passage joins the
//! quasi-static correction before and after the corner.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::qp::{QpError, QpStatus};

/// Reasons why there is no passage through a corner; the arm then passes it with the quasi-static correction.
#[derive(Debug, Error)]
pub enum PassageFault {
    /// The bearing force before the corner is too small to define the side of its journal.
    #[error("the bearing of joint {joint} pushes with {force:.2} N only before the corner")]
    NoPush {
        /// Index of the joint.
        joint: usize,
        /// Force of the bearing, N.
        force: f64,
    },
    /// A programme had no solution.
    #[error("a quadratic programme of the planning ended with {0:?}")]
    Unsolved(QpStatus),
    /// The solver refused the data.
    #[error(transparent)]
    Refused(#[from] QpError),
    /// The steps of the planning did not reach a physically possible course.
    #[error("after the last step the forces at a journal leave {0:.3} mm unexplained")]
    NotConsistent(f64),
    /// In a rollout of the model, the planned passage has a larger deviation than the quasi-static correction.
    #[error("in a rollout it leaves {planned:.4} mm RMS, the quasi-static correction {plain:.4} mm")]
    NoGain {
        /// RMS of the tool's deviation with the passage, mm.
        planned: f64,
        /// RMS without the passage, mm.
        plain: f64,
    },
    /// The path has more corners than are planned before a run.
    #[error("the passages planned before a run may take {0} ticks")]
    TooMany(usize),
}

/// Cost and starting point of the planning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PassageOptions {
    /// ε_a, mm²/(rad/s²)²: weight of the correction's acceleration. By default 100 rad/s² cost as much as 0.1 mm.
    pub acceleration: f64,
    /// F_min, N: least force of a bearing on its journal.
    pub least_push: f64,
    /// γ, mm²/N: cost of a newton below F_min.
    pub missing_push: f64,
    /// Emphasis on large deviations: the planner minimises Σ‖e‖^(2 + emphasis).
    pub emphasis: f64,
    /// Turn of the journals' angles in the middle of the first course relative to the quasi-static ones, rad: another starting point.
    pub detour: f64,
    /// Time of a passage before and after its corner, s.
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

/// One tick of a passage.
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
    /// Corrections of the joints, one row a tick.
    corrections: Vec<f64>,
    journals: Vec<f64>,
    moments: Vec<f64>,
}

impl Passage {
    /// Creates a passage that begins at the tick `first`, from its values tick by tick: corrections of the joints, rad (m), displacements
    /// of the journals, m, and moments of their friction, N·m.
    pub fn new(first: u64, corrections: &[Vec<f64>], journals: &[Vec<f64>], moments: &[Vec<f64>]) -> Passage {
        Passage {
            first,
            ticks: corrections.len(),
            corrections: corrections.concat(),
            journals: journals.concat(),
            moments: moments.concat(),
        }
    }

    /// The same motion, beginning at the tick `first`.
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

    /// The step of the passage at the tick `tick`, if the passage contains it.
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

/// A corner without a passage.
#[derive(Debug)]
pub struct Unplanned {
    /// First tick of the corner.
    pub first: u64,
    /// Last tick of the corner.
    pub last: u64,
    /// Reason why there is no passage.
    pub fault: PassageFault,
}

/// The passages of one path, in chronological order.
#[derive(Debug, Default)]
pub struct Passages {
    planned: Vec<Passage>,
    unplanned: Vec<Unplanned>,
}

impl Passages {
    /// Collects the passages `planned` and the corners `unplanned`, each in chronological order.
    pub fn new(planned: Vec<Passage>, unplanned: Vec<Unplanned>) -> Passages {
        Passages { planned, unplanned }
    }

    /// The step at the tick `tick` of the passage that contains it, if there is one; see [`Passage::at`].
    pub fn at(&self, tick: u64) -> Option<Step<'_>> {
        let after = self.planned.partition_point(|passage| passage.first <= tick);
        self.planned[..after].last()?.at(tick)
    }

    /// The reason why the corner at the tick `tick` has no passage, if the tick lies in such a corner.
    pub fn fault(&self, tick: u64) -> Option<&PassageFault> {
        let after = self.unplanned.partition_point(|corner| corner.first <= tick);
        let corner = self.unplanned[..after].last()?;
        (tick <= corner.last).then_some(&corner.fault)
    }

    /// Returns true if a corner without a passage begins at the tick `tick`. A corner where the quasi-static correction is better needs no
    /// passage and does not count.
    pub fn lacks_one_from(&self, tick: u64) -> bool {
        let corner = self.unplanned.binary_search_by_key(&tick, |corner| corner.first);
        corner.is_ok_and(|at| !matches!(self.unplanned[at].fault, PassageFault::NoGain { .. }))
    }

    /// The planned passages.
    pub fn planned(&self) -> &[Passage] {
        &self.planned
    }

    /// The corners without a passage.
    pub fn unplanned(&self) -> &[Unplanned] {
        &self.unplanned
    }
}
