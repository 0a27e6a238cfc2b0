//! Lower bound of the deviation at sharp corners; `bound_table` compares the controllers with it.
//!
//! The bound of a cell (period T, clearance c of the sharp square) is the least deviation that an offline optimisation with the true arm finds. The variables
//! are the corrections of the joints, within their limits of speed, acceleration and torque, and the motion of the journal, tick by tick in a window around
//! every corner; the law of contact holds the journal (Gauss–Newton, see `freeplay_controller::passage_planner`). The optimisation drops the weights that keep
//! a controller's plan gentle: corrections may use the whole acceleration limits, the contact force of the bearing may fall to zero, the tool may turn. For RMS
//! it minimises the squares of the deviation after the start, for the maximum their fourth powers; both from several starts, in which the journal first goes
//! ahead or behind. Outside the windows the bound counts no deviation at all, so that it is on the low side. The bound assumes journals that stay in contact:
//! the optimisation does not search motions that throw the journal on purpose.
//!
//! As a check, the true plant runs the optimal motion with prescribed joints; the output shows its measurement beside the bound.

use freeplay_arm::{Workspace, forward_kinematics};
use freeplay_controller::displacement_preview::DisplacementPreview;
use freeplay_controller::{CornerSearch, Passage, PassageOptions, Step, Weights};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathKind, PathSpec};
use freeplay_plant::{DeviationStatistics, Hermite, Input, System};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::messages;
use serde::Serialize;

/// Length of a tick, s.
const PERIOD: f64 = 1e-3;
/// Joint with play.
const JOINT: usize = 4;
/// Half width of the moving average of the predicted journals at both ends of a window, ticks.
const HALF: usize = 10;
/// Starts: rotation of the journal's path in the middle of a window, rad.
const STARTS: [f64; 3] = [0.0, 0.6, -0.6];

/// Result of one start, mm.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Found {
    /// The start: rotation of the journal's path, rad.
    pub start: f64,
    /// RMS after the start of the run.
    pub rms: f64,
    /// Greatest deviation.
    pub max: f64,
}

/// The bound of one cell, mm.
#[derive(Clone, Debug, Serialize)]
pub struct Bound {
    /// Time of a lap, s.
    pub period: f64,
    /// Clearance, mm.
    pub clearance: f64,
    /// Results of the starts, with the squares minimised.
    pub squares: Vec<Found>,
    /// Results with the fourth powers minimised.
    pub fourth_powers: Vec<Found>,
    /// RMS and maximum in the windows that the true plant measures on the motion with the least squares.
    pub measured: Option<Found>,
    /// Deviation of the passages as `narx-qp` plans them.
    pub planned: Found,
}

impl Bound {
    /// The least RMS.
    pub fn rms(&self) -> f64 {
        self.squares.iter().map(|found| found.rms).fold(f64::NAN, f64::min)
    }

    /// The least maximum.
    pub fn max(&self) -> f64 {
        self.squares.iter().chain(&self.fourth_powers).map(|found| found.max).fold(f64::NAN, f64::min)
    }
}

/// One cell: the arm with play, and the path with its laps.
struct Cell {
    play: ArmWithPlay,
    path: JointPath,
    period: f64,
    ticks: u64,
}

impl Cell {
    fn new(period: f64, clearance: f64) -> Result<Cell, Failure> {
        let arm = paper_arm().arm;
        let law = Clearance::new(&ClearanceTable::new(clearance * 1e-3)).map_err(Failure::input)?;
        let spec = PathSpec { kind: PathKind::SquareSharp, period, ..PathSpec::default() };
        Ok(Cell {
            play: ArmWithPlay::new(&arm, &[(JOINT, law)]).map_err(Failure::input)?,
            path: JointPath::plan(&arm, &spec, 1.0 / PERIOD).map_err(Failure::input)?,
            period,
            ticks: (period / PERIOD).round() as u64,
        })
    }

    /// The passages for `weights` and `options`.
    fn passages(&self, weights: Weights, options: PassageOptions) -> Vec<Passage> {
        let arm = paper_arm().arm;
        let search = CornerSearch { arm: &arm, with_play: &self.play, period: PERIOD, weights, options };
        let mut outlook = DisplacementPreview::new(self.path.clone(), &self.play, PERIOD, HALF);
        let begin = (DeviationStatistics::START_DURATION / PERIOD) as u64;
        let found = search.passages(&mut outlook, begin, self.ticks);
        for corner in found.unplanned() {
            messages::note(format_args!("T = {} s, tick {}: {}", self.period, corner.first, corner.fault));
        }
        found.planned().to_vec()
    }

    /// The joints at `tick` with the corrections `corrections`.
    fn joints(&self, tick: u64, corrections: &[f64]) -> Vec<f64> {
        let (mut q, mut v, mut a) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]);
        self.path.at(tick as f64 * PERIOD, &mut q, &mut v, &mut a);
        q.iter().zip(corrections).map(|(q, correction)| q + correction).collect()
    }

    /// RMS and maximum over the run of the deviations `norms` (mm) of the ticks in windows.
    fn figures(&self, start: f64, norms: &[f64]) -> Found {
        let counted = self.ticks as f64 - DeviationStatistics::START_DURATION / PERIOD;
        let squares: f64 = norms.iter().map(|norm| norm * norm).sum();
        Found { start, rms: (squares / counted).sqrt(), max: norms.iter().copied().fold(0.0, f64::max) }
    }

    /// The planned deviation of the tool in a passage, mm, tick by tick to the end of the run.
    fn meant(&self, passage: &Passage) -> Vec<f64> {
        let arm = paper_arm().arm;
        let (mut nominal, mut workspace) = (Workspace::new(&arm), Workspace::new(self.play.arm()));
        let slides = self.play.plays()[0].slides;
        let end = (passage.first() + passage.ticks() as u64).min(self.ticks);
        let rows = (passage.first()..end).filter_map(|tick| passage.at(tick).map(|row| (tick, row)));
        rows.map(|(tick, Step { corrections, journals, .. })| {
            let mut extended = vec![0.0; self.play.arm().dof()];
            self.play.spread(&self.joints(tick, corrections), &mut extended);
            slides.into_iter().zip(journals).for_each(|(slide, &journal)| extended[slide] = journal);
            let tool = forward_kinematics(self.play.arm(), &mut workspace, &extended);
            let desired = forward_kinematics(&arm, &mut nominal, &self.joints(tick, &[0.0; 6]));
            1e3 * (tool.translation.vector - desired.translation.vector).norm()
        })
        .collect()
    }

    fn all_meant(&self, passages: &[Passage]) -> Vec<f64> {
        passages.iter().flat_map(|passage| self.meant(passage)).collect()
    }

    /// The deviation that the true plant measures with its joints prescribed by `passage`, mm, tick by tick.
    fn measured(&self, passage: &Passage) -> Result<Vec<f64>, Failure> {
        let arm = paper_arm().arm;
        let mut system = System::new(self.play.clone(), &arm, PERIOD, 50).map_err(Failure::input)?;
        let row = |tick: u64| passage.at(tick).map(|step| self.joints(tick, step.corrections));
        let centred = |tick: u64| -> Option<Vec<[f64; 3]>> {
            let [before, now, after] = [row(tick - 1)?, row(tick)?, row(tick + 1)?];
            let state = |i: usize| {
                let v = (after[i] - before[i]) / (2.0 * PERIOD);
                [now[i], v, (after[i] - 2.0 * now[i] + before[i]) / (PERIOD * PERIOD)]
            };
            Some((0..now.len()).map(state).collect())
        };
        let first = passage.first() + 1;
        let Some(begin) = centred(first) else { return Ok(Vec::new()) };
        let start = |order: usize| begin.iter().map(|state| state[order]).collect::<Vec<_>>();
        system.start(&start(0), &start(1));
        if let (Some(before), Some(now), Some(after)) =
            (passage.at(first - 1), passage.at(first), passage.at(first + 1))
        {
            let [before, now, after] = [before, now, after].map(|step| step.journals);
            let speed = [0, 1].map(|i| (after[i] - before[i]) / (2.0 * PERIOD));
            system.place_journal(0, [now[0], now[1]], speed);
        }
        let (mut motion, mut norms, mut nominal) = (Hermite::new(6), Vec::new(), Workspace::new(&arm));
        let last = (first + passage.ticks() as u64 - 3).min(self.ticks);
        for tick in first..last {
            let desired = forward_kinematics(&arm, &mut nominal, &self.joints(tick, &[0.0; 6]));
            norms.push(1e3 * (system.tool().translation.vector - desired.translation.vector).norm());
            let (Some(from), Some(to)) = (centred(tick), centred(tick + 1)) else { break };
            motion.begin(system.time(), PERIOD, from.into_iter());
            motion.finish(to.into_iter());
            let input = Input { torque: &[0.0; 6], driven: &[true; 6], motion: &motion };
            system.tick(&input).map_err(Failure::internal)?;
        }
        Ok(norms)
    }

    fn bound(&self, clearance: f64) -> Result<Bound, Failure> {
        let free = PassageOptions {
            acceleration: 1e-9,
            least_push: 0.5,
            missing_push: 1e-3,
            ..PassageOptions::default()
        };
        let mut bound = Bound {
            period: self.period,
            clearance,
            squares: Vec::new(),
            fourth_powers: Vec::new(),
            measured: None,
            planned: self
                .figures(0.0, &self.all_meant(&self.passages(Weights::default(), PassageOptions::default()))),
        };
        // The tool may turn.
        let weights = Weights { orientation: 1e-5, ..Weights::default() };
        for emphasis in [0.0, 2.0] {
            for detour in STARTS {
                let passages = self.passages(weights, PassageOptions { emphasis, detour, ..free });
                let norms = self.all_meant(&passages);
                let found = self.figures(detour, &norms);
                if emphasis > 0.0 {
                    bound.fourth_powers.push(found);
                    continue;
                }
                if bound.squares.iter().all(|other| found.rms < other.rms) {
                    let norms = passages.iter().map(|passage| self.measured(passage));
                    bound.measured =
                        Some(self.figures(detour, &norms.collect::<Result<Vec<_>, _>>()?.concat()));
                }
                bound.squares.push(found);
            }
        }
        Ok(bound)
    }
}

/// The bound of the sharp square with laps of `period` s and `clearance` mm in joint 5.
///
/// # Errors
/// An impossible clearance or period.
pub fn sharp_square(period: f64, clearance: f64) -> Result<Bound, Failure> {
    Cell::new(period, clearance)?.bound(clearance)
}
