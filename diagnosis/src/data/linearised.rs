//! One prepared recording: its motion, its measurements, and the contribution of any effect to every channel.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use freeplay_arm::Arm;
use freeplay_laws::{
    ArmParts, Baseline, Change, Kind as EffectKind, LawError, Place, Placed, Prediction, Range, Recorded,
    START, Start, Term, Trajectory, rigid_torques, tool_positions,
};
use freeplay_recording::Recording;
use toml::Table;

use crate::data::beside::Beside;
use crate::data::columns::Answer;
use crate::data::noise::Noises;
use crate::data::tolerance::Nuisance;
use crate::error::ResidualError;
use crate::signals::channel::{Channel, Kind};
use crate::signals::filter::derivatives;
use crate::signals::initial_state::{InBearing, between, predicted_with_initial_states, within};
use crate::signals::law_grid::LawGrid;
use crate::signals::missing::masked;
use crate::signals::motion::{Settings, Treatment};
use crate::signals::residual::{Sharpening, check_joints, residuals_along};
use crate::signals::stuck::Stuck;
use crate::statistics::{Moments, difference};

/// The object on which an effect acts. A drive moves the arm, a sensor reads the sum of both, and the reading is what a sensor gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Arm,
    Drive,
    Sensor,
    Reading,
}

/// The points in time at which a model is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Points {
    /// Those that the treatment keeps.
    Kept,
    /// Those of the grid of laws.
    Laws,
    /// All grid points.
    All,
}

type LowPass = dyn Fn(&[f64]) -> Vec<f64>;

/// A recording on a grid of laws that is coarser than its own.
struct Coarse {
    grid: LawGrid,
    motion: Trajectory,
    /// [`Sharpening::more`] on that grid.
    hidden: Change,
    treated: Box<LowPass>,
}

impl Coarse {
    fn new(grid: LawGrid, whole: &Trajectory, sharpening: &Sharpening) -> Self {
        let (motion, hidden) = (grid.motion(whole), grid.change(&sharpening.more));
        let own = grid.clone();
        Self { grid, motion, hidden, treated: Box::new(move |column| own.low_pass(column)) }
    }
}

/// One recording after its treatment: the basis of a [`LinearisedRecording`].
pub(crate) struct PreparedRecording<'a> {
    /// The recording.
    pub raw: &'a Recording,
    /// The treatment of every column.
    pub treatment: Treatment,
    /// The motion on the kept points.
    pub motion: Trajectory,
    /// The motion on all grid points, for laws that jump or have a memory.
    pub whole: Trajectory,
    /// The recording on the grid on which the search evaluates such laws; `None` if that grid has all points.
    coarse: Option<Coarse>,
    /// Measured, channel by channel.
    pub channels: Vec<Channel>,
    /// The noise of the measurements.
    pub noises: Noises,
    /// Torques that are no measurement, by joint; `None` for a measured torque.
    pub stuck: Vec<Option<Stuck>>,
    /// The error that the low-pass on the motion causes in the model.
    pub sharpening: Sharpening,
    treated: Box<LowPass>,
    as_it_is: Box<LowPass>,
}

impl<'a> PreparedRecording<'a> {
    /// Treats `recording` for the nominal `arm`.
    ///
    /// # Errors
    /// See [`ResidualError`].
    pub fn new(arm: &Arm, recording: &'a Recording, settings: &Settings) -> Result<Self, ResidualError> {
        check_joints(arm, recording)?;
        let treatment = Treatment::new(arm, recording, settings)?;
        let (motion, whole) = (treatment.motion(recording), treatment.whole_motion(recording));
        let sharpening = Sharpening::of(arm, recording, &treatment, &whole);
        let channels = residuals_along(arm, &[], recording, &treatment, &whole, &sharpening)?.channels;
        let noises = Noises::of(recording, &treatment, &channels, &sharpening.unresolved);
        let stuck = Stuck::of(recording, &treatment, &whole);
        let own = treatment.clone();
        let treated = Box::new(move |column: &[f64]| own.low_pass(column));
        let as_it_is = Box::new(|column: &[f64]| column.to_vec());
        let law_grid = Some(treatment.law_grid()?).filter(|grid| grid.every > 1);
        let coarse = law_grid.map(|grid| Coarse::new(grid, &whole, &sharpening));
        Ok(Self {
            coarse,
            raw: recording,
            treatment,
            motion,
            whole,
            channels,
            noises,
            stuck,
            sharpening,
            treated,
            as_it_is,
        })
    }

    /// Prepares a `recording` of a planned motion. Its torques are all zero; only their number matters.
    ///
    /// # Errors
    /// See [`ResidualError`].
    pub fn planned(arm: &Arm, recording: &'a Recording, settings: &Settings) -> Result<Self, ResidualError> {
        Ok(Self { stuck: vec![None; arm.dof()], ..Self::new(arm, recording, settings)? })
    }

    /// Returns true if the channel of `kind` is no measurement: its value never changes, or is missing throughout.
    pub fn is_stuck(&self, kind: Kind) -> bool {
        let is_missing = self.channels.iter().any(|channel| channel.kind == kind && channel.is_missing());
        is_missing || matches!(kind, Kind::Torque(joint) if self.stuck[joint].is_some())
    }
}

/// One prepared recording, and the prediction of the model for it.
pub(crate) struct LinearisedRecording<'a> {
    /// The prepared recording.
    pub prepared: &'a PreparedRecording<'a>,
    /// Measured and model, channel by channel.
    pub channels: Vec<Channel>,
    /// The model on the kept points: for effects that are smooth.
    smooth: Baseline<'a>,
    /// The model on all grid points: for effects that jump.
    rough: Baseline<'a>,
    /// The model on the grid of laws, if that is coarser: for the columns of lasting effects that jump.
    coarse: Option<Baseline<'a>>,
    /// Torque and tool of the rigid arm on the kept points.
    rigid: (Vec<Vec<f64>>, Vec<Vec<f64>>),
    /// The arm of the file, without its effects.
    nominal: &'a Arm,
    /// The effects that the arm file has.
    known: Vec<&'a Placed>,
    /// The effects that were found, each with its level; other laws act on the machine with these effects.
    found: RefCell<Vec<(Level, Rc<Placed>)>>,
    /// The model with the found effects below a level on some points, once it was computed.
    beneath: RefCell<BTreeMap<(Level, Points), Rc<Baseline<'a>>>>,
    /// The effect of the sensors on the drives. The recording computes it at the first use and forgets it when other laws are found.
    sensors: RefCell<Option<Rc<Sensors>>>,
}

/// The found sensors, by channel.
struct Sensors {
    /// The share of a small change that they let through: where a torque has reached its limit, a drive changes nothing of it. A channel whose sensor bends nothing
    /// holds `None`.
    through: Answer,
    /// The contribution of the found drive laws to what the sensors measure.
    measured: Answer,
}

impl<'a> LinearisedRecording<'a> {
    /// The linearised recording of `arm` with the `effects` of its file.
    ///
    /// # Errors
    /// [`LawError::Changed`] if these leave no possible arm.
    pub fn new(
        arm: &'a Arm,
        effects: &[&'a Placed],
        prepared: &'a PreparedRecording<'a>,
    ) -> Result<Self, LawError> {
        let smooth = Baseline::new(arm, effects, &prepared.motion, &*prepared.as_it_is)?;
        let hidden = Some(&prepared.sharpening.more);
        let rough = Baseline::with_hidden(arm, effects, &prepared.whole, &*prepared.treated, hidden)?;
        let on_coarse = |coarse: &'a Coarse| {
            Baseline::with_hidden(arm, effects, &coarse.motion, &*coarse.treated, Some(&coarse.hidden))
        };
        let coarse = prepared.coarse.as_ref().map(on_coarse).transpose()?;
        let mut channels = prepared.channels.clone();
        for channel in &mut channels {
            channel.model = prepared.treatment.keep(channel.kind.of(rough.prediction()));
        }
        let now = &smooth.scene().arm;
        let rigid = (rigid_torques(now, &prepared.motion, None), tool_positions(now, &prepared.motion.q));
        let known = effects.to_vec();
        let (found, beneath, sensors) = (RefCell::default(), RefCell::default(), RefCell::default());
        Ok(Self {
            prepared,
            channels,
            smooth,
            rough,
            coarse,
            rigid,
            nominal: arm,
            known,
            found,
            beneath,
            sensors,
        })
    }

    /// Sets the effects that were `found`; the columns of all other laws then act on the machine with these effects. Load-dependent friction grows with
    /// a found payload, a found torque limit clips the friction of its drive, and a delay shifts the found effects.
    pub fn set_found(&self, found: Vec<Placed>) {
        let with_level = |placed| (self.level(&placed), Rc::new(placed));
        self.found.replace(found.into_iter().map(with_level).collect());
        self.beneath.take();
        self.sensors.take();
    }

    /// The arm, with the effects that change it.
    pub fn arm(&self) -> &Arm {
        &self.smooth.scene().arm
    }

    /// The effects of the arm file.
    pub fn known(&self) -> &[&'a Placed] {
        &self.known
    }

    /// The motion on the kept points.
    pub fn motion(&self) -> &'a Trajectory {
        &self.prepared.motion
    }

    /// The motion on all grid points.
    pub fn whole(&self) -> &'a Trajectory {
        &self.prepared.whole
    }

    /// Torques of the rigid arm on the kept points, `[joint][point]`.
    pub fn load(&self) -> &[Vec<f64>] {
        &self.smooth.scene().load
    }

    /// Torques of the rigid arm on all grid points, `[joint][point]`.
    pub fn whole_load(&self) -> &[Vec<f64>] {
        &self.rough.scene().load
    }

    /// Treats a signal on all grid points as a measured column.
    pub fn treated(&self, whole: &[f64]) -> Vec<f64> {
        self.prepared.treatment.keep(&(self.prepared.treated)(whole))
    }

    /// The model on the grid on which effects of `kind` are evaluated.
    pub fn baseline(&self, kind: &EffectKind) -> &Baseline<'a> {
        self.on(self.points(kind, false))
    }

    /// The points at which the columns of a `kind` are evaluated. An event begins and ends between two points, and a sensor that `measures` shifts jumps by less than
    /// a point of the grid of laws: on all points both are most accurate.
    fn points(&self, kind: &EffectKind, measures: bool) -> Points {
        match (kind.rough, kind.happens() || measures) {
            (false, _) => Points::Kept,
            (true, false) if self.coarse.is_some() => Points::Laws,
            (true, _) => Points::All,
        }
    }

    /// The model on `points`.
    fn on(&self, points: Points) -> &Baseline<'a> {
        match points {
            Points::Kept => &self.smooth,
            Points::Laws => self.coarse.as_ref().unwrap_or(&self.rough),
            Points::All => &self.rough,
        }
    }

    /// Derivative with respect to time of the prediction for `kind` by the model with the found effects, per second: the column of a delay of that channel.
    pub fn rate_of_change(&self, kind: Kind) -> Vec<f64> {
        // Effects that leave no possible arm delay nothing.
        let beneath = self.beneath(Level::Reading, Points::All).ok().flatten();
        let baseline = beneath.as_deref().unwrap_or(&self.rough);
        let (model, motion) = (kind.of(baseline.prediction()), self.whole());
        let mut rate = Vec::with_capacity(model.len());
        for stretch in &motion.stretches {
            rate.extend(derivatives(&model[stretch.clone()], motion.step(stretch)).0);
        }
        self.prepared.treatment.keep(&rate)
    }

    /// The kinds of columns that the recording has.
    pub fn recorded(&self) -> Recorded {
        let recording = self.prepared.raw;
        Recorded {
            torque: recording.tau.is_some(),
            tool: recording.tool.is_some(),
            link: recording.q_link.iter().map(Option::is_some).collect(),
        }
    }

    /// The contribution of each term of the effect `kind` at `joint` with `shape`, on the machine with the found effects. If the effect has a memory,
    /// the method estimates its initial state from the recording, with the `nuisances` fitted. The search for the position of a journal in its
    /// bearing starts from `begins`, if a similar shape has set it, and stores the result there.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn terms(
        &self,
        (kind, joint): (&'static EffectKind, Option<usize>),
        shape: &Table,
        nuisances: &[Nuisance],
        begins: &mut Option<InBearing>,
    ) -> Result<Vec<(Term, Answer)>, LawError> {
        let middle = self.terms_as(kind, joint, shape)?;
        let (Some(joint), Some(start)) = (joint, kind.memory()) else { return Ok(middle) };
        let at = |start: Start| self.terms_with_initial_state(kind, joint, shape, start).map(Some);
        let is_open = shape.contains_key(START) && self.number_of(Kind::Torque(joint)).is_some();
        let better = match start.range {
            Range::Number { .. } if is_open => {
                let beside = Beside::new(&self.channels, &self.prepared.noises, &[], |kind| {
                    kind == Kind::Torque(joint)
                });
                between(
                    beside.residual_squares(&middle),
                    |place| at(Start::Between(place)),
                    |terms| beside.residual_squares(terms),
                )?
            }
            Range::Vector { .. } if self.number_of(Kind::Tool(0)).is_some() => {
                let beside = Beside::new(&self.channels, &self.prepared.noises, nuisances, |kind| {
                    matches!(kind, Kind::Tool(_))
                });
                let residual = |terms: &Vec<(Term, Answer)>| beside.residual_squares(terms);
                let step = |here: &Vec<_>, nudged: [&Vec<_>; 2]| beside.step(here, nudged);
                let from = (residual(&middle), *begins);
                within(from, |place| at(Start::Within(place)), residual, step)?.map(|(place, terms)| {
                    *begins = Some(place);
                    terms
                })
            }
            _ => None,
        };
        Ok(better.unwrap_or(middle))
    }

    /// The terms with the initial state `start`.
    ///
    /// # Errors
    /// See [`LawError`].
    pub fn terms_with_initial_state(
        &self,
        kind: &'static EffectKind,
        joint: usize,
        shape: &Table,
        start: Start,
    ) -> Result<Vec<(Term, Answer)>, LawError> {
        let mut begun = shape.clone();
        begun.insert(START.to_owned(), start.file_value(&self.arm().joints()[joint]));
        self.terms_as(kind, Some(joint), &begun)
    }

    /// The terms with the initial state of `shape`.
    fn terms_as(
        &self,
        kind: &'static EffectKind,
        joint: Option<usize>,
        shape: &Table,
    ) -> Result<Vec<(Term, Answer)>, LawError> {
        let place = Place { scene: self.baseline(kind).scene(), joint };
        let first = kind.terms_at(&place, shape).into_iter().next();
        let placed = first.map(|term| kind.place(&place, term.plus)).transpose()?;
        let points = self.points(kind, placed.as_ref().is_some_and(|placed| placed.effect.measures()));
        let level = match &placed {
            Some(placed) if !self.found.borrow().is_empty() => self.level(placed),
            _ => Level::Arm,
        };
        let columns = match self.beneath(level, points)? {
            Some(beneath) => kind.columns(&beneath, joint, shape)?,
            None => kind.columns(self.on(points), joint, shape)?,
        };
        let mut terms: Vec<(Term, Answer)> =
            columns.into_iter().map(|(term, column)| (term, self.answer_of(points, &column))).collect();
        let found = self.found.borrow();
        let own = placed.and_then(|placed| {
            let is_own = |known: &&Placed| known.kind.name == placed.kind.name && known.joint == placed.joint;
            found.iter().map(|(_, known)| &**known).find(is_own)
        });
        match (level, own) {
            (Level::Drive, _) => {
                let through = &self.sensors()?.through;
                for (_, answer) in &mut terms {
                    let column = std::mem::take(answer);
                    // The times of an event are those of the recording: sensors do not shift it.
                    *answer = if kind.happens() {
                        scaled(column, through)
                    } else {
                        self.as_recorded(column, through)
                    };
                }
            }
            (Level::Sensor, Some(own)) => self.with_kept(&mut terms, own)?,
            _ => {}
        }
        Ok(terms)
    }

    /// Adds to `terms` of the found sensor `own` the part of the found drive laws' contributions that it keeps off the recording. Their columns are as recorded, so
    /// that its column and theirs add up to the prediction of the machine with both.
    fn with_kept(&self, terms: &mut [(Term, Answer)], own: &Placed) -> Result<(), LawError> {
        let sensors = self.sensors()?;
        let recorded = if own.effect.bends() {
            scaled(sensors.measured.clone(), &sensors.through)
        } else {
            self.read_by(&[own], &sensors.measured)
        };
        for (_, answer) in terms {
            for ((column, measured), recorded) in answer.iter_mut().zip(&sensors.measured).zip(&recorded) {
                let Some(column) = column else { continue };
                column.iter_mut().zip(measured.iter().flatten()).for_each(|(x, measured)| *x += measured);
                column.iter_mut().zip(recorded.iter().flatten()).for_each(|(x, recorded)| *x -= recorded);
            }
        }
        Ok(())
    }

    /// The found sensors, from the cache or computed now.
    fn sensors(&self) -> Result<Rc<Sensors>, LawError> {
        if let Some(known) = &*self.sensors.borrow() {
            return Ok(Rc::clone(known));
        }
        let through = self.let_through()?;
        let prediction = |level| -> Result<Prediction, LawError> {
            let beneath = self.beneath(level, Points::All)?;
            Ok(beneath.as_deref().unwrap_or(&self.rough).prediction().clone())
        };
        let (with, without) = (prediction(Level::Sensor)?, prediction(Level::Drive)?);
        let measured = self.by_channel(|kind| {
            Some(self.prepared.treatment.keep(&change(kind.of(&with), kind.of(&without))?))
        });
        let sensors = Rc::new(Sensors { through, measured });
        self.sensors.replace(Some(Rc::clone(&sensors)));
        Ok(sensors)
    }

    /// The model with the found effects below `level`; `None` if there are none.
    fn beneath(&self, level: Level, points: Points) -> Result<Option<Rc<Baseline<'a>>>, LawError> {
        let found = self.found.borrow();
        let shared = |(_, placed): &(Level, Rc<Placed>)| Rc::clone(placed);
        let more: Vec<Rc<Placed>> = found.iter().filter(|(own, _)| *own < level).map(shared).collect();
        if more.is_empty() {
            return Ok(None);
        }
        if let Some(known) = self.beneath.borrow().get(&(level, points)) {
            return Ok(Some(Rc::clone(known)));
        }
        let baseline = Rc::new(self.on(points).extended_shared(&more)?);
        self.beneath.borrow_mut().insert((level, points), Rc::clone(&baseline));
        Ok(Some(baseline))
    }

    /// The level on which `placed` acts.
    fn level(&self, placed: &Placed) -> Level {
        let mut parts = ArmParts::of(self.arm());
        if placed.effect.arm(&mut parts).is_ok() && !parts.are_of(self.arm()) {
            Level::Arm
        } else if placed.effect.measures() {
            Level::Sensor
        } else {
            Level::Drive
        }
    }

    /// The contribution of `placed` to each channel.
    ///
    /// # Errors
    /// [`LawError::Changed`] if it leaves no possible arm.
    pub fn answer(&self, placed: &Placed) -> Result<Answer, LawError> {
        let points = self.points(placed.kind, placed.effect.measures());
        Ok(self.answer_of(points, &self.on(points).change(placed)?))
    }

    /// Measured minus the model with `more` effects, channel by channel. All effects act together, as in an arm file.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they leave no possible arm.
    pub fn residual_with(&self, more: &[&Placed]) -> Result<Vec<Vec<f64>>, LawError> {
        let residual = |prediction: &Prediction, channel: &Channel| -> Vec<f64> {
            let model = self.prepared.treatment.keep(channel.kind.of(prediction));
            let off = difference(&channel.measured, &model);
            masked(off, channel.present.as_deref())
        };
        let left_of = |prediction: &Prediction, kind: Kind| {
            Some(residual(prediction, &self.channels[self.number_of(kind)?]))
        };
        let best = predicted_with_initial_states(more, |more| self.rough.extended(more), left_of)?;
        Ok(self.channels.iter().map(|channel| residual(&best, channel)).collect())
    }

    /// Measured minus the model in which `instead` replaces the effects for which `is_out` holds, channel by channel.
    ///
    /// # Errors
    /// [`LawError::Changed`] if it leaves no possible arm.
    pub fn residual_replacing(
        &self,
        is_out: &dyn Fn(&Placed) -> bool,
        instead: Option<&Placed>,
    ) -> Result<Vec<Vec<f64>>, LawError> {
        let prediction = self.rough.with_replacement(is_out, instead)?;
        let residual = |channel: &Channel| {
            let model = self.prepared.treatment.keep(channel.kind.of(&prediction));
            let off = difference(&channel.measured, &model);
            masked(off, channel.present.as_deref())
        };
        Ok(self.channels.iter().map(residual).collect())
    }

    /// The share of a small change of each channel that the sensors of the machine with the found effects transmit, on the kept points. The share is
    /// zero for a torque at its limit. A channel whose sensor bends nothing holds `None`.
    ///
    /// # Errors
    /// [`LawError::Changed`] if what was found leaves no possible arm.
    pub fn let_through(&self) -> Result<Answer, LawError> {
        // The change is so small, relative to the channel, that it moves no corner; the quotient has as many correct figures as the change is below
        // the channel.
        let small = f64::EPSILON.sqrt();
        let found = self.found.borrow();
        let all = self.known.iter().copied().chain(found.iter().map(|(_, placed)| &**placed));
        if !all.clone().any(|placed| placed.effect.bends()) {
            return Ok(vec![None; self.channels.len()]);
        }
        let beneath = self.beneath(Level::Sensor, Points::All)?;
        let baseline = beneath.as_deref().unwrap_or(&self.rough);
        let mut now = baseline.before_sensors().clone();
        let steps: Vec<f64> =
            now.columns().map(|column| small * Moments::of(column).rms.max(f64::MIN_POSITIVE)).collect();
        let mut then = now.clone();
        for (column, step) in then.columns_mut().zip(&steps) {
            column.iter_mut().for_each(|x| *x += step);
        }
        for placed in all {
            placed.effect.measure(baseline.scene(), &mut now);
            placed.effect.measure(baseline.scene(), &mut then);
        }
        for ((then, now), step) in then.columns_mut().zip(now.columns()).zip(&steps) {
            then.iter_mut().zip(now).for_each(|(then, now)| *then = (*then - now) / step);
        }
        let is_bent = |share: &[f64]| share.iter().any(|share| (share - 1.0).abs() > small.sqrt());
        Ok(self.by_channel(|kind| is_bent(kind.of(&then)).then(|| self.treated(kind.of(&then)))))
    }

    /// A small change `answer` of what the sensors measure, as the sensors of the machine with the found effects record it; `let_through` comes from the method
    /// of that name.
    pub fn as_recorded(&self, answer: Answer, let_through: &Answer) -> Answer {
        let found = self.found.borrow();
        let all = self.known.iter().copied().chain(found.iter().map(|(_, placed)| &**placed));
        let linear: Vec<&Placed> =
            all.filter(|placed| placed.effect.measures() && !placed.effect.bends()).collect();
        let answer = if linear.is_empty() { answer } else { self.read_by(&linear, &answer) };
        scaled(answer, let_through)
    }

    /// The change `answer` of what linear `sensors` measure, in their readings.
    fn read_by(&self, sensors: &[&Placed], answer: &Answer) -> Answer {
        let mut without = Prediction::blank(self.nominal.dof(), self.motion().len());
        let mut with = without.clone();
        for (channel, column) in self.channels.iter().zip(answer) {
            let both = channel.kind.of_mut(&mut with).iter_mut().zip(column.iter().flatten());
            both.for_each(|(x, column)| *x = *column);
        }
        for sensor in sensors {
            sensor.effect.measure(self.smooth.scene(), &mut without);
            sensor.effect.measure(self.smooth.scene(), &mut with);
        }
        self.by_channel(|kind| change(kind.of(&with), kind.of(&without)))
    }

    /// The rows of a `change` on these points.
    fn answer_of(&self, points: Points, change: &Change) -> Answer {
        self.by_channel(|channel| {
            let column = match channel {
                Kind::Torque(joint) => change.torque.written(joint),
                Kind::Tool(axis) => change.tool.written(axis),
                Kind::Link(joint) => change.link.written(joint),
                Kind::Position(_) => None,
            };
            let column = column.filter(|column| column.iter().any(|&x| x != 0.0))?;
            Some(match (points, &self.prepared.coarse) {
                (Points::Kept, _) => column.to_vec(),
                (Points::Laws, Some(coarse)) => coarse.grid.keep(column),
                (Points::Laws | Points::All, _) => self.prepared.treatment.keep(column),
            })
        })
    }

    /// The prediction of the rigid arm `arm`, with the links displaced by `shift`, minus that of the present arm.
    pub fn rigid_answer(&self, arm: &Arm, shift: Option<&[Vec<f64>]>) -> Answer {
        let motion = self.motion();
        let torque = rigid_torques(arm, motion, shift);
        let moved: Vec<Vec<f64>> = match shift {
            Some(shift) => motion.q.iter().zip(shift).map(|(q, s)| sum(q, s)).collect(),
            None => motion.q.clone(),
        };
        let tool = tool_positions(arm, &moved);
        self.by_channel(|kind| match kind {
            Kind::Torque(joint) => change(&torque[joint], &self.rigid.0[joint]),
            Kind::Tool(axis) => change(&tool[axis], &self.rigid.1[axis]),
            Kind::Link(_) | Kind::Position(_) => None,
        })
    }

    /// For each of `arms`: the change of what the sensors measure if the machine has that arm in the place of its own. The smooth laws of the model and those that
    /// were found act on that arm; without any, the arm is rigid. Laws that jump take no part: a slightly different arm shifts only the instant of a jump.
    pub fn answers_of(&self, arms: &[Arm]) -> Vec<Answer> {
        let found = self.found.borrow();
        // The arms include the changes that the model's laws make to an arm.
        let known = self.known.iter().filter(|placed| self.level(placed) != Level::Arm).copied();
        let all = known.chain(found.iter().map(|(_, placed)| &**placed));
        let smooth: Vec<&Placed> =
            all.filter(|placed| !placed.kind.rough && !placed.effect.measures()).collect();
        let now =
            if smooth.is_empty() { None } else { self.predicted(self.arm(), &smooth, self.motion()).ok() };
        let beside = |arm: &Arm| {
            let (now, then) = (now.as_ref()?, self.predicted(arm, &smooth, self.motion()).ok()?);
            Some(self.by_channel(|kind| change(kind.of(&then), kind.of(now))))
        };
        arms.iter().map(|arm| beside(arm).unwrap_or_else(|| self.rigid_answer(arm, None))).collect()
    }

    /// The prediction for `arm` with `effects` along `motion`, without the low-pass.
    fn predicted(&self, arm: &Arm, effects: &[&Placed], motion: &Trajectory) -> Result<Prediction, LawError> {
        Ok(Baseline::new(arm, effects, motion, &*self.prepared.as_it_is)?.prediction().clone())
    }

    /// The torques of the model with `more` effects along `motion`, on all grid points and without the low-pass, `[joint][point]`.
    ///
    /// # Errors
    /// [`LawError::Changed`] if they leave no possible arm.
    pub fn raw_torques(&self, more: &[Placed], motion: &Trajectory) -> Result<Vec<Vec<f64>>, LawError> {
        let effects: Vec<&Placed> = self.known.iter().copied().chain(more).collect();
        let model = self.predicted(self.nominal, &effects, motion)?;
        let joints = 0..self.nominal.dof();
        Ok(joints.map(|joint| Kind::Torque(joint).of(&model).to_vec()).collect())
    }

    /// The number of the channel that measures `kind`.
    pub fn number_of(&self, kind: Kind) -> Option<usize> {
        self.channels.iter().position(|channel| channel.kind == kind)
    }

    /// One column for each channel by its kind.
    pub fn by_channel(&self, column: impl Fn(Kind) -> Option<Vec<f64>>) -> Answer {
        self.channels.iter().map(|channel| column(channel.kind)).collect()
    }
}

/// Each value of `answer` times the `share` of its row.
fn scaled(mut answer: Answer, share: &Answer) -> Answer {
    for (column, share) in answer.iter_mut().zip(share) {
        column.iter_mut().flatten().zip(share.iter().flatten()).for_each(|(x, share)| *x *= share);
    }
    answer
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// `a − b`; `None` if they are the same.
fn change(a: &[f64], b: &[f64]) -> Option<Vec<f64>> {
    let difference = difference(a, b);
    difference.iter().any(|&x| x != 0.0).then_some(difference)
}

#[cfg(test)]
mod tests {
    use freeplay_arm::{Arm, JointFriction, JointKind};
    use freeplay_laws::Placed;
    use freeplay_model::EffectTable;
    use freeplay_recording::Recording;
    use toml::Table;

    use super::{LinearisedRecording, PreparedRecording};
    use crate::made::{arm, columns_along, even, link, recording, sines};
    use crate::signals::channel::Kind;
    use crate::signals::motion::Settings;

    /// One joint with friction, and its motion on sines.
    fn swinging() -> (Arm, Recording) {
        let friction = JointFriction { viscous: 2.0, coulomb: 3.0 };
        let arm = arm(vec![link("first", JointKind::Revolute, friction)]);
        let made = recording(columns_along(sines, &arm, &even(12.0, 250.0), |_, _| 0.0));
        (arm, made)
    }

    /// A found delay shifts the torque of the model by [`LinearisedRecording::as_recorded`] just as the law of the delay does.
    #[test]
    fn a_found_delay_acts_on_the_contributions_of_other_laws() {
        let (arm, made) = swinging();
        let prepared = PreparedRecording::new(&arm, &made, &Settings::default()).expect("a ground");
        let recording = LinearisedRecording::new(&arm, &[], &prepared).expect("a stage");
        let delay = || {
            let parameters: Table = "channel = \"torque\"\ndelay = 0.019".parse().expect("a table");
            let table = EffectTable { kind: "time_delay".to_owned(), joint: None, parameters, line: 0 };
            Placed::new(&table, &arm).expect("a delay")
        };
        let change = recording.answer(&delay()).expect("an arm");
        recording.set_found(vec![delay()]);
        let model = recording.by_channel(|kind| {
            let channel = recording.number_of(kind)?;
            matches!(kind, Kind::Torque(_)).then(|| recording.channels[channel].model.clone())
        });
        let read = recording.as_recorded(model.clone(), &vec![None; model.len()]);
        let channel = recording.number_of(Kind::Torque(0)).expect("a torque");
        let [model, read, change] =
            [model, read, change].map(|answer| answer[channel].clone().expect("rows"));
        let size = |rows: &[f64]| rows.iter().map(|x| x * x).sum::<f64>().sqrt();
        let off: Vec<f64> = (0..model.len()).map(|row| read[row] - model[row] - change[row]).collect();
        let share = size(&off) / size(&change);
        println!("{share:.3} of the change of {:.3} of the torque", size(&change) / size(&model));
        // The first rows have no value from before, and a curve between kept points rounds a jump.
        assert!(share < 0.05);
    }

    /// While a drive is at its limit, its torque is the limit, with a push on its joint or without.
    #[test]
    fn a_drive_at_its_limit_does_not_show_a_push() {
        let (arm, made) = swinging();
        let prepared = PreparedRecording::new(&arm, &made, &Settings::default()).expect("a ground");
        let recording = LinearisedRecording::new(&arm, &[], &prepared).expect("a stage");
        let channel = recording.number_of(Kind::Torque(0)).expect("a torque");
        let needed = recording.channels[channel].model.clone();
        let limit = 0.6 * needed.iter().fold(0.0_f64, |most, torque| most.max(torque.abs()));
        let parameters: Table = format!("limit = {limit}").parse().expect("a table");
        let table = EffectTable {
            kind: "actuator_saturation".to_owned(),
            joint: Some("first".to_owned()),
            parameters,
            line: 0,
        };
        recording.set_found(vec![Placed::new(&table, &arm).expect("a limit")]);
        let push = freeplay_laws::kind("external_torque").expect("in the catalogue");
        let window: Table = "start = 0.0\nend = 1e3".parse().expect("a table");
        let terms = recording.terms((push, Some(0)), &window, &[], &mut None).expect("an arm");
        let column = terms[0].1[channel].as_ref().expect("rows");
        let through = |is_at_limit: bool| {
            let rows = (0..needed.len()).filter(|&row| (needed[row].abs() > limit) == is_at_limit);
            let shares: Vec<f64> = rows.map(|row| -column[row]).collect();
            println!("{} rows, at the limit: {is_at_limit}", shares.len());
            shares.iter().sum::<f64>() / shares.len() as f64
        };
        let (at_limit, free) = (through(true), through(false));
        println!("the torque shows {at_limit:.3} of the push at the limit, {free:.3} elsewhere");
        // Rows beside a corner hold both sides of it.
        assert!(at_limit < 0.1);
        assert!((free - 1.0).abs() < 0.1);
    }
}
