//! Search for the corners of a path, where the journals cannot follow the quasi-static prediction.
//!
//! The smoothed prediction comes from a [`DisplacementPreview`]. If moving the journals along it needs a noticeable share of the force that
//! holds them in their bearings, the journals will not follow. A [`Passage`](crate::passage) is then planned from some time before the corner
//! to some time after it.

use freeplay_arm::Arm;
use freeplay_laws::ArmWithPlay;

use crate::compensation::Weights;
use crate::displacement_preview::DisplacementPreview;
use crate::passage::{Passage, PassageFault, PassageOptions, Passages, Unplanned};
use crate::passage_planner::PassagePlanner;
use crate::passage_trajectory::Instant;
use crate::pin_force::PinForce;

/// Least share of a bearing's force for moving the journal that marks a corner.
const NOTICEABLE: f64 = 0.01;
/// Most ticks of all passages planned before a run; repeated laps count once.
const MOST_PLANNED: usize = 3000;
/// Length of the searched part of a run, ticks.
const MOST_SEARCHED: u64 = 120_000;
/// Two corners have the same passage if their references differ by less than this, rad (m).
const SAME: f64 = 1e-9;

/// Inputs of the search for corners and of the planning of passages.
pub struct CornerSearch<'a> {
    /// The nominal arm.
    pub arm: &'a Arm,
    /// The arm with play.
    pub with_play: &'a ArmWithPlay,
    /// Time of a tick, s.
    pub period: f64,
    /// The compensation's weights.
    pub weights: Weights,
    /// Options of the planning of passages.
    pub options: PassageOptions,
}

impl CornerSearch<'_> {
    /// The passages between the ticks `from` and `to`.
    pub fn passages(&self, outlook: &mut DisplacementPreview, from: u64, to: u64) -> Passages {
        let margin = (self.options.margin / self.period).ceil().max(4.0) as u64;
        let to = to.min(from + MOST_SEARCHED);
        let corners = self.corners(outlook, from + margin, to, margin);
        let mut planner =
            PassagePlanner::new(self.arm, self.with_play, self.period, self.weights, self.options);
        let (mut planned, mut unplanned): (Vec<Planned>, Vec<Unplanned>) = (Vec::new(), Vec::new());
        let mut spent = 0;
        for (first, last) in corners {
            let piece = Piece::of(outlook, first, last);
            if let Some(same) = planned.iter().find(|known| known.piece.is(&piece)) {
                let passage = same.passage.starting_at(first);
                planned.push(Planned { piece, passage });
                continue;
            }
            spent += piece.reference.len();
            let passage = if spent > MOST_PLANNED {
                Err(PassageFault::TooMany(MOST_PLANNED))
            } else {
                planner.plan(first, piece.reference.clone(), &piece.journals)
            };
            match passage {
                Ok(passage) => planned.push(Planned { piece, passage }),
                Err(fault) => unplanned.push(Unplanned { first, last, fault }),
            }
        }
        Passages::new(planned.into_iter().map(|known| known.passage).collect(), unplanned)
    }

    /// First and last tick of every corner, margins included; overlapping corners are merged.
    fn corners(&self, outlook: &mut DisplacementPreview, from: u64, to: u64, margin: u64) -> Vec<(u64, u64)> {
        let mut pin = PinForce::new(self.with_play);
        let mut corners: Vec<(u64, u64)> = Vec::new();
        let mut journals = [from, from + 1].map(|tick| outlook.at(tick).to_vec());
        for tick in from + 1..to {
            let [before, now] = journals;
            let after = outlook.at(tick + 1).to_vec();
            let moving = Instant::centred([&before, &now, &after], self.period);
            if self.is_corner(&mut pin, outlook, tick, &moving) {
                match corners.last_mut() {
                    Some((_, last)) if tick <= *last + 2 * margin => *last = tick,
                    _ => corners.push((tick, tick)),
                }
            }
            journals = [now, after];
        }
        corners.into_iter().map(|(first, last)| (first - margin, last + margin)).collect()
    }

    /// Returns true if moving the journals along `moving` at `tick` needs a noticeable share of the force that holds one of them.
    fn is_corner(
        &self,
        pin: &mut PinForce,
        outlook: &mut DisplacementPreview,
        tick: u64,
        moving: &Instant,
    ) -> bool {
        let forces = pin.forces(outlook.on_path(tick), moving.as_motion()).to_vec();
        pin.update_mass();
        let mass = pin.mass();
        let plays = self.with_play.plays();
        let slides: Vec<usize> = plays.iter().flat_map(|play| play.slides).collect();
        plays.iter().any(|play| {
            let spent = play.slides.map(|row| {
                slides.iter().zip(&moving.a).map(|(&column, a)| mass[(row, column)] * a).sum::<f64>()
            });
            let held = play.slides.map(|slide| forces[slide]);
            spent[0].hypot(spent[1]) > NOTICEABLE * held[0].hypot(held[1])
        })
    }
}

/// A passage and the part of the path for which it was planned.
struct Planned {
    piece: Piece,
    passage: Passage,
}

/// The part of a path in a corner, tick by tick.
struct Piece {
    reference: Vec<Vec<f64>>,
    journals: Vec<Vec<f64>>,
}

impl Piece {
    fn of(outlook: &mut DisplacementPreview, first: u64, last: u64) -> Piece {
        Piece {
            reference: (first..=last).map(|tick| outlook.on_path(tick).q.to_vec()).collect(),
            journals: (first..=last).map(|tick| outlook.at(tick).to_vec()).collect(),
        }
    }

    /// Returns true if the reference and the journals equal those of `other`, apart from the time.
    fn is(&self, other: &Piece) -> bool {
        let near = |one: &[Vec<f64>], two: &[Vec<f64>]| {
            let pairs = one.iter().flatten().zip(two.iter().flatten());
            one.len() == two.len() && pairs.into_iter().all(|(one, two)| (one - two).abs() < SAME)
        };
        near(&self.reference, &other.reference) && near(&self.journals, &other.journals)
    }
}
