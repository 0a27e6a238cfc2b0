//! Reference tracking with compensation of the deviation that the play causes; `quasi-static` and `narx-qp` share it.
//!
//! The module plans the reference path, so that the rest positions of the journals at the coming ticks are known. A centred moving average
//! smooths these positions, [`Correction`] corrects the joints for them, and inverse dynamics with feedback tracks the corrected motion. The
//! motion of the journals and the friction of their contacts are fed forward. The drives hold a torque for a tick, so the controller computes
//! the torque for the middle of the tick and for the mean acceleration from its start to its end. If the reference in the state is not that
//! of the planned path, the controller predicts the deviation from that reference alone, without a look ahead. With the option `passages`,
//! the arm passes corners as planned before the run ([`crate::passage`]). A corner that could not be planned is passed without a passage; the
//! controller reports it at the start, and the answer at its first tick has the status `QpFailed`.

use freeplay_arm::Arm;
use freeplay_controller_sdk::Answer;
use freeplay_laws::{ArmWithPlay, DriveFriction};
use freeplay_path::JointPath;
use freeplay_shm::{CommandStatus, Joints, Reference, State, now_ns};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::centred::Centred;
use crate::command_filter::CommandFilter;
use crate::compensation::{CompensationStatus, Motion, Weights};
use crate::computed_torque::{add_drive_friction, feedback};
use crate::corners::CornerSearch;
use crate::correction::Correction;
use crate::deviation::QuasiStatic;
use crate::displacement_preview::{DisplacementPreview, JointMotion};
use crate::geometry::Geometry;
use crate::horizon::{HorizonReport, HorizonStatus, MOST_TICKS};
use crate::horizon_preview::HorizonPreview;
use crate::impact_detector::ImpactDetector;
use crate::known_effects::KnownEffects;
use crate::look_ahead::{LookAhead, drive_frictions};
use crate::model::Model;
use crate::not_ready::NotReady;
use crate::passage::{PassageOptions, Passages, Unplanned};
use crate::qp::QpStatus;
use crate::task::{Gains, Task, TaskError, TaskMode};

/// Shortest span of the moving average, s. The predicted journals jump; a shorter span would demand very large torques.
pub const SHORTEST_AVERAGE: f64 = 0.01;
/// After up to this many missed ticks, the controller catches up tick by tick; after more, the correction restarts from its last value.
const MOST_CAUGHT_UP: u64 = 3;
/// Ticks between the instant of an answer and the newest planned instant: the look-ahead of [`Centred`].
const AHEAD: u64 = 2;

/// Options of the tracking and of the correction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrackingOptions {
    /// Time in which the correction goes from none to full, s.
    pub blend: f64,
    /// Span of the moving average over the predicted journals, s: 0 for none, otherwise at least [`SHORTEST_AVERAGE`].
    pub average: f64,
    /// Span of the horizon over which corrections are planned, s: 0 plans each tick by itself, otherwise 1 to [`MOST_TICKS`] ticks. With a
    /// horizon, the average smooths the journals only for the feedforward, not for the compensation, because `weights.acceleration` keeps the
    /// corrections smooth; see [`crate::horizon`].
    pub horizon: f64,
    /// Weights of the compensation.
    pub weights: Weights,
    /// If true, passages through the corners of the path are planned before the run; see [`crate::passage`].
    pub passages: bool,
    /// Options of the planning of passages.
    pub passage: PassageOptions,
    /// If true, the commands compensate the dynamics of the servos in the model; mode servo. See [`crate::command_filter`].
    pub command_filter: bool,
    /// If true, the feedback is softer for a while after a journal has landed; with play in one joint, only while the journal keeps bouncing.
    /// See [`crate::impact_detector`].
    pub soft_landing: bool,
}

impl Default for TrackingOptions {
    fn default() -> TrackingOptions {
        TrackingOptions {
            blend: 0.3,
            average: 0.021,
            horizon: 0.0,
            weights: Weights::default(),
            passages: false,
            passage: PassageOptions::default(),
            soft_landing: false,
            command_filter: false,
        }
    }
}

impl TrackingOptions {
    /// Ticks of the horizon at ticks of `period` seconds; 0 for none.
    fn ticks_ahead(&self, period: f64) -> usize {
        (self.horizon / period).round() as usize
    }

    /// Checks the ranges of the options of the controller `controller`, at ticks of `period` seconds.
    ///
    /// # Errors
    /// [`TaskError::OptionValue`] names the first option outside its range.
    pub fn check(&self, controller: &str, period: f64) -> Result<(), TaskError> {
        let within = |value: f64, least: f64, most: f64| value >= least && value <= most;
        let fault = if !within(self.blend, 1e-3, 60.0) {
            Some("blend must be 0.001 to 60 s")
        } else if self.average != 0.0 && !within(self.average, SHORTEST_AVERAGE, 1.0) {
            Some("average must be 0, or 0.01 to 1 s")
        } else if self.horizon != 0.0 && !within((self.horizon / period).round(), 1.0, MOST_TICKS as f64) {
            Some("horizon must be 0 s, or 1 to 60 ticks")
        } else {
            self.weights.fault()
        };
        fault.map_or(Ok(()), |fault| Err(TaskError::OptionValue { controller: controller.to_owned(), fault }))
    }
}

/// An instant for which a correction is planned.
pub struct Plan<'a> {
    /// The tick of the instant.
    pub tick: u64,
    /// Motion at that instant without the correction.
    pub motion: Motion<'a>,
    /// Deviation by the physical prediction at that instant, smoothed, base frame, m.
    pub deviation: Vector3<f64>,
}

/// Callback that returns the deviation beyond the physical prediction at a planned instant, base frame, m. It is called once for each
/// instant, in order.
pub type Beyond<'a> = dyn FnMut(&Plan<'_>) -> Vector3<f64> + 'a;

/// Tracking of one arm; see the module.
pub struct Tracking {
    arm: Arm,
    mode: TaskMode,
    gains: Gains,
    period: f64,
    /// True if the predicted journals are smooth enough to be differentiated.
    smooth: bool,
    friction: Vec<DriveFriction>,
    /// Displacement of the tool by the geometry of the model; none if the geometry is nominal.
    geometry: Option<Geometry>,
    /// Shifts and torques by the other effects of the model; none if there are no such effects.
    known: Option<KnownEffects>,
    filter: Option<CommandFilter>,
    look_ahead: LookAhead,
    /// Detector of landings, after which the feedback is softer.
    impact_detector: Option<ImpactDetector>,
    displacement_preview: DisplacementPreview,
    /// Preview of the horizon, if there is one.
    horizon_preview: Option<HorizonPreview>,
    /// Predictor for the instant of the answer; its result is fed forward.
    predictor: QuasiStatic,
    correction: Correction,
    /// The smoothed displacements of the journals, m.
    journals: Centred,
    /// Tick of the last state.
    tick: Option<u64>,
    planned: JointMotion,
    target: JointMotion,
    /// Desired positions of the links at that instant: the target without the shifts of encoders and transmissions.
    links: JointMotion,
    /// Moments of the contacts' friction on the joints with play during the tick of the answer, N·m.
    moments: Vec<f64>,
    /// Torques of these moments, the known effects and the motion of the journals on the joints during that tick, N·m (N).
    external: Vec<f64>,
    acceleration: Vec<f64>,
    /// Mean accelerations of the reference during the tick of the answer, rad/s² (m/s²).
    held: Vec<f64>,
    /// Joints and journals in the middle of that tick.
    halfway: JointMotion,
    journals_halfway: JointMotion,
    passages: Passages,
    /// True if the last reference was that of the planned path.
    own: bool,
    /// Deviations by geometry and learning, beyond the journals, at the last but one and the newest instant, m.
    learned: [Vector3<f64>; 2],
}

impl Tracking {
    /// Prepares the tracking of `path` for `ticks` ticks with `model`. Gains, mode and rate are those of `task`.
    ///
    /// # Errors
    /// A model with impossible play, or an error of the solver.
    pub fn new(
        task: &Task,
        model: &Model,
        path: JointPath,
        ticks: u64,
        options: &TrackingOptions,
    ) -> Result<Tracking, NotReady> {
        let (n, period) = (model.arm.dof(), task.period());
        let with_play = ArmWithPlay::new(&model.arm, &model.clearances)?;
        let known = KnownEffects::along(&model.arm, &model.effects, &path, period)?;
        let filter = options.command_filter.then(|| CommandFilter::along(model, &path, task, "the tracking"));
        let filter = filter.transpose()?;
        let half = ((options.average / period - 1.0) / 2.0).round().max(0.0) as usize;
        let ticks_ahead = options.ticks_ahead(period);
        let horizon_preview = (ticks_ahead > 0).then(|| {
            HorizonPreview::new(path.clone(), &model.arm, &with_play, period, &options.weights, ticks_ahead)
        });
        let mut horizon_preview = horizon_preview.transpose()?;
        let mut displacement_preview = DisplacementPreview::new(path, &with_play, period, half);
        let search = CornerSearch {
            arm: &model.arm,
            with_play: &with_play,
            period,
            weights: options.weights,
            options: options.passage,
        };
        let passages = if options.passages {
            search.passages(&mut displacement_preview, (options.blend / period).ceil() as u64, ticks)
        } else {
            Passages::default()
        };
        // Prepares everything that the first answer, to tick 0, needs, except the newest value.
        displacement_preview.at(task.mode.lead() + AHEAD - 1);
        let mut predictor = QuasiStatic::new(&with_play, period);
        if let Some(horizon_preview) = &mut horizon_preview {
            horizon_preview.seen_from(task.mode.lead() + AHEAD - 1, &model.arm, &passages, &mut predictor);
        }
        Ok(Tracking {
            mode: task.mode,
            gains: task.gains,
            period,
            smooth: half > 0,
            friction: drive_frictions(&model.arm),
            geometry: Geometry::between(&model.nominal, &model.arm),
            known,
            filter,
            look_ahead: LookAhead::new(&model.arm, period),
            impact_detector: (options.soft_landing && !model.clearances.is_empty())
                .then(|| ImpactDetector::new(period, model.clearances.len())),
            displacement_preview,
            horizon_preview,
            predictor,
            correction: Correction::new(&model.arm, period, options.blend, &options.weights)?,
            journals: Centred::new(2 * model.clearances.len(), period),
            tick: None,
            planned: JointMotion::new(n),
            target: JointMotion::new(n),
            links: JointMotion::new(n),
            moments: vec![0.0; model.clearances.len()],
            external: vec![0.0; n],
            acceleration: vec![0.0; n],
            held: vec![0.0; n],
            halfway: JointMotion::new(n),
            journals_halfway: JointMotion::new(2 * model.clearances.len()),
            passages,
            own: true,
            learned: [Vector3::zeros(); 2],
            arm: model.arm.clone(),
        })
    }

    /// Answers `state`. The function adds the result of `beyond` for each planned instant to the deviation of the physical prediction, base
    /// frame, m. It returns `None` if the state or the prediction is not finite.
    pub fn answer(&mut self, state: &State, beyond: &mut Beyond<'_>, answer: &mut Answer) -> Option<()> {
        let n = self.arm.dof();
        let measured = state.q[..n].iter().chain(&state.qd[..n]);
        if !measured.copied().all(f64::is_finite) {
            return None;
        }
        self.catch_up(state, beyond, answer);
        let [learned, _] = self.learned;
        self.plan(state.tick, Some(&state.reference_next), beyond, answer);
        self.target.add(&state.reference_next, self.correction.motion());
        self.links.copy(self.target.as_motion());
        if let Some(known) = &mut self.known {
            let instant = state.tick.saturating_add(self.mode.lead());
            known.turn_to(instant as f64 * self.period, &state.reference_next);
            known.shift().into_iter().for_each(|shift| self.target.shift(shift));
        }
        let begun = now_ns();
        answer.deviation = (self.predict(&state.reference_next) + learned).into();
        answer.predict_ns += now_ns() - begun;
        let target = self.target.as_motion();
        answer.velocity[..n].copy_from_slice(target.v);
        match self.mode {
            TaskMode::Driven | TaskMode::Servo => {
                answer.value[..n].copy_from_slice(target.q);
                answer.acceleration[..n].copy_from_slice(target.a);
                if let Some(filter) = &self.filter {
                    let instant = state.tick.saturating_add(self.mode.lead()) as f64;
                    filter.apply(instant * self.period, &state.reference_next, answer);
                }
            }
            TaskMode::Torque => {
                self.update_contact_moments(state.tick + self.mode.lead());
                self.torque(state, &mut answer.value)?;
                answer.acceleration[..n].copy_from_slice(&self.held);
            }
        }
        let is_finite = answer.is_finite();
        if !is_finite {
            // Clears torques that are not finite, so that the next tick does not inherit them.
            self.external.fill(0.0);
        }
        is_finite.then_some(())
    }

    /// The corners of the path through which no passage could be planned.
    pub fn unplanned(&self) -> &[Unplanned] {
        self.passages.unplanned()
    }

    /// The corrected motion at the instant of the last answer.
    pub fn target(&self) -> Motion<'_> {
        self.target.as_motion()
    }

    /// Desired positions of the links at the instant of the last answer: the corrected motion without the shifts of encoders and
    /// transmissions.
    pub fn links(&self) -> Motion<'_> {
        self.links.as_motion()
    }

    /// Brings the correction up to the tick of `state`: starts it, or catches up on missed ticks.
    fn catch_up(&mut self, state: &State, beyond: &mut Beyond<'_>, answer: &mut Answer) {
        let n = self.arm.dof();
        match self.tick {
            Some(last) if state.tick > last => {
                let missed = state.tick - last - 1;
                if missed <= MOST_CAUGHT_UP {
                    for tick in last + 1..state.tick {
                        self.plan(tick, None, beyond, answer);
                    }
                } else {
                    self.correction.resume();
                    self.journals.clear();
                }
                if missed > 0 {
                    self.predictor.restart();
                }
            }
            _ => {
                self.correction.start(&state.q[..n], &state.reference.q[..n]);
                self.journals.clear();
                self.predictor.restart();
            }
        }
        self.tick = Some(state.tick);
    }

    /// Plans the correction of the answer to `tick`; the newest correction is for [`AHEAD`] ticks after the instant of the answer.
    /// `reference` is that of the answer. Without one, the function assumes that the arm follows the path.
    fn plan(
        &mut self,
        tick: u64,
        reference: Option<&Reference>,
        beyond: &mut Beyond<'_>,
        answer: &mut Answer,
    ) {
        let begun = now_ns();
        let instant = tick.saturating_add(self.mode.lead());
        let ahead = instant.saturating_add(AHEAD);
        let foreign =
            reference.filter(|reference| !self.displacement_preview.leads_through(reference, instant));
        match foreign {
            None => self.displacement_preview.held(instant, &mut self.held),
            Some(reference) => self.held.copy_from_slice(&reference.qdd[..self.arm.dof()]),
        }
        let journals = match foreign {
            None => {
                self.planned.copy(self.displacement_preview.on_path(ahead));
                self.displacement_preview.at(ahead)
            }
            Some(reference) => {
                let (q, v, a) = (&reference.q, &reference.qd, &reference.qdd);
                self.planned.coast(q, v, a, AHEAD as f64 * self.period);
                self.displacement_preview.of(self.planned.as_motion())
            }
        };
        self.own = foreign.is_none();
        let own = self.own;
        let passage = self.passages.at(ahead).filter(|_| own);
        match passage {
            Some(step) => self.journals.push(step.journals),
            None if own && self.smooth => self.journals.push(journals),
            None => self.journals.rest(journals),
        }
        if own && self.passages.lacks_one_from(ahead) {
            answer.status = CommandStatus::QpFailed;
        }
        let planned = self.planned.as_motion();
        let physics = self.predictor.deviation_with(planned.q, self.journals.newest());
        let geometry = self.geometry.as_mut().map_or_else(Vector3::zeros, |other| other.deviation(planned.q));
        let [_, before] = self.learned;
        let deviation = physics + geometry;
        let learned = geometry + beyond(&Plan { tick: ahead, motion: planned, deviation });
        self.learned = [before, learned];
        let horizon_preview = self.horizon_preview.as_mut().filter(|_| own);
        let horizon = horizon_preview.map(|horizon_preview| {
            horizon_preview.seen_from(ahead, &self.arm, &self.passages, &mut self.predictor)
        });
        let predicted = now_ns();
        let deviation = physics + learned;
        let report = match (passage, horizon) {
            (Some(step), _) => self.correction.follow(&self.arm, planned, step.corrections, &learned),
            (None, None) => self.correction.advance(&self.arm, planned, &deviation),
            (None, Some(horizon)) => {
                let found = self.correction.look_ahead(&self.arm, planned, horizon, &learned);
                found.unwrap_or_else(|HorizonReport { status, iterations }| {
                    // The status names the failure of the horizon; the programme of one tick then computes the correction.
                    answer.status = match status {
                        HorizonStatus::IterationLimit => CommandStatus::QpLimit,
                        _ => CommandStatus::QpFailed,
                    };
                    answer.qp_iterations += iterations;
                    self.correction.advance(&self.arm, planned, &deviation)
                })
            }
        };
        answer.predict_ns += predicted - begun;
        answer.qp_ns += now_ns() - predicted;
        answer.qp_iterations += report.iterations;
        match report.status {
            CompensationStatus::Free | CompensationStatus::Solved => {}
            CompensationStatus::Failed(QpStatus::IterationLimit) => {
                answer.status = CommandStatus::QpLimit;
            }
            CompensationStatus::LimitsConflict(_) | CompensationStatus::Failed(_) => {
                answer.status = CommandStatus::QpFailed;
            }
        }
    }

    /// The deviation at `reference`, not smoothed.
    fn predict(&mut self, reference: &Reference) -> Vector3<f64> {
        let n = self.arm.dof();
        let motion = Motion { q: &reference.q[..n], v: &reference.qd[..n], a: &reference.qdd[..n] };
        self.predictor.advance(motion);
        self.predictor.deviation(motion.q)
    }

    /// Sets the moments of the contacts' friction during the tick that begins at `instant`.
    fn update_contact_moments(&mut self, instant: u64) {
        let planned = self.passages.at(instant).zip(self.passages.at(instant + 1)).filter(|_| self.own);
        match planned {
            Some((from, to)) => {
                let pairs = from.moments.iter().zip(to.moments);
                self.moments
                    .iter_mut()
                    .zip(pairs)
                    .for_each(|(moment, (from, to))| *moment = 0.5 * (from + to));
            }
            None => self.moments.iter_mut().zip(self.predictor.moments()).for_each(|(m, rest)| *m = rest),
        }
    }

    fn torque(&mut self, state: &State, torque: &mut Joints) -> Option<()> {
        let n = self.arm.dof();
        let mut gains = self.gains;
        if let Some(impact_detector) = &mut self.impact_detector {
            impact_detector.observe(
                self.look_ahead.expected(state.tick).map(|state| state.v.as_slice()),
                &state.qd[..n],
            );
            gains = impact_detector.soften(gains);
        }
        let ahead = self.look_ahead.predict(&self.arm, state, &self.external)?;
        let target = self.target.as_motion();
        for (held, correction) in self.held.iter_mut().zip(self.correction.held()) {
            *held += correction;
        }
        feedback(gains, Motion { a: &self.held, ..target }, ahead, &mut self.acceleration);
        // The drives hold the torque for the tick, so it is computed for the middle of the tick.
        self.halfway.coast(&ahead.q, &ahead.v, &self.acceleration, 0.5 * self.period);
        let journals = self.journals.motion();
        self.journals_halfway.coast(journals.q, journals.v, self.journals.held(), 0.5 * self.period);
        let (joints, journals) = (self.halfway.as_motion(), self.journals_halfway.as_motion());
        self.predictor.feed_forward(joints, journals, &self.moments, &mut torque[..n], &mut self.external);
        add_drive_friction(&self.friction, target.v, &mut torque[..n]);
        if let Some(spent) = self.known.as_ref().and_then(KnownEffects::torque) {
            torque.iter_mut().zip(spent).for_each(|(torque, spent)| *torque += spent);
            self.external.iter_mut().zip(spent).for_each(|(external, spent)| *external -= spent);
        }
        Some(())
    }
}
