//! Planner of passages: it finds the course of joints and journals through a corner with the least deviation of the tool.
//!
//! The unknowns are the corrections of the joints and the contact angles of the journals in their bearings, at every tick of the passage.
//! Gauss–Newton steps find them, starting from the quasi-static correction; each step is a sparse quadratic programme (see
//! [`crate::passage_programme`]). The law of contact, a bearing force along the normal with friction along the tangent, enters as a square
//! whose weight grows tenfold from step to step. The planner halves a step that does not lower the cost. If the steps reach no physically
//! possible course, the planner repeats them from other starting points. It returns a passage only if the passage does better in a rollout
//! of the model than the quasi-static correction ([`TrialMotion`]).

use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

use freeplay_arm::{Arm, Limits, Workspace, jacobian};
use freeplay_laws::ArmWithPlay;
use nalgebra::{DMatrix, DVector};

use crate::compensation::Weights;
use crate::passage::{Passage, PassageFault, PassageOptions};
use crate::passage_corner::{Corner, Frame};
use crate::passage_trajectory::{Change, Instant, PassageTrajectory};
use crate::pin_force::PinForce;
use crate::trial::TrialMotion;

/// Weights of the law of contact, step by step; later steps use the last weight.
const CONTACT: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
/// Most steps of the planning.
const STEPS: usize = 12;
/// Further starting points if the first gives no passage, rad: turns of the journals' angles in the middle of the corner.
const OTHER_STARTS: [f64; 2] = [0.3, -0.3];
/// Halvings of a step that does not lower the cost.
const HALVINGS: i32 = 4;
/// Largest turn of an angle in one step, rad.
const LONGEST_TURN: f64 = 0.5;
/// The planning ends when no angle turns by more than this, rad,
const LAST_TURN: f64 = 5e-3;
/// and the displacement by unexplained forces is at most this, mm.
const EXPLAINED: f64 = 0.005;
/// Largest displacement by unexplained forces in an accepted course, mm.
const UNEXPLAINED: f64 = 0.05;
/// Least bearing force before the corner, N.
const LEAST_REST: f64 = 5.0;

/// The planner of one arm with play.
pub struct PassagePlanner {
    arm: Arm,
    pin: PinForce,
    nominal: Workspace,
    extended: Workspace,
    limits: Vec<Limits>,
    period: f64,
    weights: Weights,
    options: PassageOptions,
}

impl PassagePlanner {
    /// Creates a planner for `arm`, ticks of `period` seconds, the compensation's `weights` and `options`; `with_play` is `arm` with its
    /// plays.
    pub fn new(
        arm: &Arm,
        with_play: &ArmWithPlay,
        period: f64,
        weights: Weights,
        options: PassageOptions,
    ) -> PassagePlanner {
        PassagePlanner {
            pin: PinForce::new(with_play),
            nominal: Workspace::new(arm),
            extended: Workspace::new(with_play.arm()),
            limits: arm.joints().iter().map(|joint| joint.limits).collect(),
            arm: arm.clone(),
            period,
            weights,
            options,
        }
    }

    /// Plans the passage that begins at the tick `first` along `reference` (positions of the joints, tick by tick). It begins and ends with
    /// the quasi-static correction of `journals` (their displacements, m, two for each joint with play).
    ///
    /// # Errors
    /// See [`PassageFault`].
    ///
    /// # Panics
    /// If there are fewer than eight ticks; a corner with its margins has more.
    pub fn plan(
        &mut self,
        first: u64,
        reference: Vec<Vec<f64>>,
        journals: &[Vec<f64>],
    ) -> Result<Passage, PassageFault> {
        assert!(reference.len() >= 8 && reference.len() == journals.len(), "a corner has more ticks");
        let frames: Vec<Frame> = reference.iter().map(|q| self.frame(q)).collect();
        let course = self.quasi_static(reference, journals, &frames);
        let first_try = self.plan_from(first, &course, self.options.detour, journals, &frames);
        if matches!(first_try, Ok(_) | Err(PassageFault::NoPush { .. })) {
            return first_try;
        }
        let mut others = OTHER_STARTS.into_iter();
        let other = others.find_map(|turn| {
            let detour = self.options.detour + turn;
            self.plan_from(first, &course, detour, journals, &frames).ok()
        });
        other.map_or(first_try, Ok)
    }

    /// Plans as [`Self::plan`] does, from the quasi-static `course` with its angles turned by up to `detour`, rad.
    fn plan_from(
        &mut self,
        first: u64,
        course: &PassageTrajectory,
        detour: f64,
        journals: &[Vec<f64>],
        frames: &[Frame],
    ) -> Result<Passage, PassageFault> {
        let plain = course.corrections.clone();
        let with_play = self.pin.arm().clone();
        let rest = self.resting_forces(course)?;
        let mut corner = Corner {
            arm: &with_play,
            limits: &self.limits,
            frames,
            weights: self.tool_weights(),
            rest: &rest,
            options: self.options,
            emphasis: vec![1.0; frames.len()],
        };
        let mut course = course.clone().detoured(detour);
        let (mut watched, mut unexplained) = (BTreeSet::new(), f64::INFINITY);
        for step in 0..STEPS {
            let weight = CONTACT[step.min(CONTACT.len() - 1)];
            corner.emphasise(&course);
            let programme = corner.programme(&course, &mut self.pin, weight, &mut watched);
            let solution = programme.solve()?.map_err(PassageFault::Unsolved)?;
            let change = corner.change(&course, &solution);
            let improved = improve(&corner, &mut self.pin, weight, &course, &change);
            let stuck = improved.is_none();
            course = improved.unwrap_or(course);
            unexplained = corner.unexplained(&course, &mut self.pin);
            let settled = change.largest_turn() < LAST_TURN && unexplained < EXPLAINED;
            if step + 1 >= CONTACT.len() && (stuck || settled) {
                break;
            }
        }
        if unexplained > UNEXPLAINED {
            return Err(PassageFault::NotConsistent(unexplained));
        }
        let rolled: Vec<Vec<f64>> = (0..course.ticks()).map(|k| course.journals(k)).collect();
        let remaining = |corrections: &[Vec<f64>], journals: &[Vec<f64>]| {
            TrialMotion { reference: &course.reference, corrections, journals }.remaining(
                &with_play,
                frames,
                self.period,
            )
        };
        let (with, without) = (remaining(&course.corrections, &rolled), remaining(&plain, journals));
        if with.is_nan() || with > without {
            return Err(PassageFault::NoGain { planned: with, plain: without });
        }
        Ok(Passage::new(first, &course.corrections, &rolled, &self.moments(&course)))
    }

    /// Weights of the tool's deviation; arms of fewer than six joints cannot keep their orientation.
    fn tool_weights(&self) -> [f64; 6] {
        let [x, y, z] = self.weights.position;
        let turn = if self.arm.dof() < 6 { 0.0 } else { self.weights.orientation };
        [x, y, z, turn, turn, turn]
    }

    /// The quantities that depend on the posture `q` only.
    fn frame(&mut self, q: &[f64]) -> Frame {
        let with_play = self.pin.arm();
        let (n, m) = (self.arm.dof(), with_play.arm().dof());
        let slides: Vec<usize> = with_play.plays().iter().flat_map(|play| play.slides).collect();
        let mut extended = vec![0.0; m];
        with_play.spread(q, &mut extended);
        let (mut joints, mut all) = (DMatrix::zeros(6, n), DMatrix::zeros(6, m));
        jacobian(&self.arm, &mut self.nominal, q, &mut joints);
        jacobian(with_play.arm(), &mut self.extended, &extended, &mut all);
        let tool = DMatrix::from_fn(6, n + slides.len(), |row, column| {
            if column < n { joints[(row, column)] } else { all[(row, slides[column - n])] }
        });
        let still = |q: Vec<f64>| Instant { v: vec![0.0; q.len()], a: vec![0.0; q.len()], q };
        self.pin.forces(still(q.to_vec()).as_motion(), still(vec![0.0; slides.len()]).as_motion());
        self.pin.update_mass();
        Frame { tool, mass: self.pin.mass().clone() }
    }

    /// The course that compensates the displacements `journals`, with their angles and radii; radii are interpolated from the first tick to
    /// the last.
    fn quasi_static(
        &self,
        reference: Vec<Vec<f64>>,
        journals: &[Vec<f64>],
        frames: &[Frame],
    ) -> PassageTrajectory {
        let ticks = reference.len();
        let radius = |row: &[f64], play: usize| row[2 * play].hypot(row[2 * play + 1]);
        let plays = self.pin.arm().plays().len();
        let mut angles: Vec<Vec<f64>> = Vec::with_capacity(ticks);
        for row in journals {
            let angle = |play: usize| {
                let angle = row[2 * play + 1].atan2(row[2 * play]);
                let before = angles.last().map_or(angle, |last| last[play]);
                before + (angle - before + PI).rem_euclid(TAU) - PI
            };
            let next = (0..plays).map(angle).collect();
            angles.push(next);
        }
        let (begin, end) = (&journals[0], &journals[ticks - 1]);
        let between = |k: usize, play: usize| {
            let share = k as f64 / (ticks - 1) as f64;
            radius(begin, play) * (1.0 - share) + radius(end, play) * share
        };
        PassageTrajectory {
            period: self.period,
            corrections: frames.iter().zip(journals).map(|(frame, row)| self.take_out(frame, row)).collect(),
            radii: (0..ticks).map(|k| (0..plays).map(|play| between(k, play)).collect()).collect(),
            reference,
            angles,
        }
    }

    /// The correction of the joints that compensates the displacements `journals`: damped least squares.
    fn take_out(&self, frame: &Frame, journals: &[f64]) -> Vec<f64> {
        let n = self.arm.dof();
        let weights = DMatrix::from_diagonal(&DVector::from_row_slice(&self.tool_weights()));
        let joints = frame.tool.columns(0, n);
        let deviation = frame.tool.columns(n, journals.len()) * DVector::from_row_slice(journals);
        let normal = joints.transpose() * &weights * joints + DMatrix::identity(n, n) * 1e-12;
        let right = joints.transpose() * &weights * deviation;
        match normal.cholesky() {
            Some(factor) => factor.solve(&right).iter().map(|correction| -correction).collect(),
            None => vec![0.0; n],
        }
    }

    /// The moments of the contacts' friction on the joints with play, N·m, tick by tick; the first and last tick copy their neighbours.
    fn moments(&mut self, course: &PassageTrajectory) -> Vec<Vec<f64>> {
        let plays = self.pin.arm().plays().to_vec();
        let last = course.ticks() - 1;
        let rows = (0..=last).map(|k| {
            let k = k.clamp(1, last - 1);
            let forces = course.forces(k, &mut self.pin);
            let each = plays.iter().enumerate();
            each.map(|(index, play)| course.contact(k, index, play, &forces).moment(&play.clearance))
                .collect()
        });
        rows.collect()
    }

    /// The bearing forces before the corner, N.
    fn resting_forces(&mut self, course: &PassageTrajectory) -> Result<Vec<f64>, PassageFault> {
        let forces = course.forces(1, &mut self.pin);
        let plays = self.pin.arm().plays().iter();
        plays
            .map(|play| {
                let force = forces[play.slides[0]].hypot(forces[play.slides[1]]);
                let enough = force >= LEAST_REST;
                enough.then_some(force).ok_or(PassageFault::NoPush { joint: play.joint, force })
            })
            .collect()
    }
}

/// Moves `course` along `change` by the largest tried share that lowers the cost; returns `None` if no share does.
fn improve(
    corner: &Corner<'_>,
    pin: &mut PinForce,
    weight: f64,
    course: &PassageTrajectory,
    change: &Change,
) -> Option<PassageTrajectory> {
    let before = corner.cost(course, pin, weight);
    let longest = (LONGEST_TURN / change.largest_turn().max(f64::MIN_POSITIVE)).min(1.0);
    (0..=HALVINGS).map(|halving| course.moved(change, longest * 0.5_f64.powi(halving))).find(|moved| {
        let after = corner.cost(moved, pin, weight);
        after < before
    })
}
