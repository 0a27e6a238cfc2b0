//! What the network looks at: made from the states of a run, one by one, in training and in the loop alike.
//!
//! One joint with play, the frame of its contact: n along the load that presses the journal against its bearing on the reference, t
//! across it (a quarter turn from n in the plane of the slides). At tick k, for the tick k + h:
//!
//! - *physics*: where the journal rests at k + h ([`QuasiStatic`]), and where the twin of the journals expects it ([`JournalTwin`]);
//! - *error* of the twin's forecasts that have come due at k, k − 1, k − 2: what the network predicts is the error at k + h;
//! - *motion*: the forecast against rest, the journal's offset and velocity, in units of c (and of c a horizon);
//! - *load*: its force at k and k + h in units of the outer links' weight, and how far it turns in between;
//! - *excess*: acceleration of the journal beyond that on the reference (the correction's own, the feedback), at k and k − 1;
//! - *scale* σ: how wrong the forecasts have been lately. Errors range over four orders of magnitude between steady contact and an
//!   impact; the network sees and predicts them in units of σ.
//!
//! Everything is measured or planned by tick k; no torque after that of tick k is looked at. Without a tracked tool the twin runs
//! on its own and the errors are taken to be what the network said they would be.

use freeplay_laws::ArmWithPlay;
use freeplay_path::JointPath;
use freeplay_shm::State;
use nalgebra::Vector3;

use crate::compensation::Motion;
use crate::deviation::QuasiStatic;
use crate::journal_twin::JournalTwin;
use crate::look_ahead::drive_frictions;
use crate::model::Model;
use crate::outlook::SAME_PATH;
use crate::task::TaskMode;

/// Names of the regressors, in their order.
pub const REGRESSORS: [&str; 26] = [
    "error_n_0",
    "error_t_0",
    "error_n_1",
    "error_t_1",
    "error_n_2",
    "error_t_2",
    "innovation_n",
    "innovation_t",
    "forecast_n",
    "forecast_t",
    "residual_n",
    "residual_t",
    "velocity_n",
    "velocity_t",
    "gap_now",
    "gap_ahead",
    "touch_now",
    "touch_ahead",
    "load_now",
    "load_ahead",
    "turning",
    "excess_n",
    "excess_t",
    "excess_change_n",
    "excess_change_t",
    "scale",
];
/// Names of the outputs: the error of the twin's forecast in units of σ.
pub const OUTPUTS: [&str; 2] = ["error_n", "error_t"];
/// Greatest error in units of σ that is looked at: beyond, there is nothing to learn but that it is large.
pub const LARGEST_ERROR: f64 = 10.0;
/// Least σ in units of c.
const LEAST_SCALE: f64 = 1e-5;
/// Share of the journal's movement within the horizon that counts for σ.
const SCALE_OF_MOVEMENT: f64 = 0.01;
/// Forecasts whose errors make σ.
const SCALE_TICKS: usize = 6;
/// Longest horizon, ticks.
pub const LONGEST_HORIZON: usize = 16;
/// Rows of memory: the horizon, and the ticks before.
const ROWS: usize = 32;

/// Along the two slides, or along the load and across it.
pub type Pair = [f64; 2];

/// What is known of one tick.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    /// Direction of the load on the reference, and its two slide components, N.
    direction: Pair,
    load: Pair,
    /// Where the journal rests, m.
    rest: Pair,
    /// Where the twin expected the journal, h ticks before, m, and the σ of then.
    forecast: Option<(Pair, f64)>,
    /// Error that the network predicted, frame of the contact, m.
    predicted: Pair,
    /// Error that came out, or was assumed, frame of the contact, m.
    error: Pair,
}

/// One prediction to be made, at tick k for tick k + h.
#[derive(Clone, Copy, Debug)]
pub struct Outlines<'a> {
    /// The regressors, in the order of [`REGRESSORS`].
    pub regressors: &'a [f64; REGRESSORS.len()],
    /// σ, m.
    pub scale: f64,
    /// Error of the forecast for tick k in units of its own σ, if the tool was tracked: what the network should have said.
    pub came_due: Option<Pair>,
}

/// The extractor of one run; see the module.
pub struct Features {
    path: JointPath,
    statics: QuasiStatic,
    twin: JournalTwin,
    period: f64,
    horizon: usize,
    clearance: f64,
    weight: f64,
    rows: [Row; ROWS],
    /// Tick of the last state, and the last tick whose rest is known.
    tick: Option<u64>,
    settled: u64,
    excess: Pair,
    loads: Vec<Pair>,
    regressors: [f64; REGRESSORS.len()],
    scale: f64,
    motion: [Vec<f64>; 3],
}

impl Features {
    /// For the one joint with play of `model` on `path`, in `mode`, ticks of `period` s, looking `horizon` ticks ahead. `None` if the
    /// model has not exactly one joint with play, or the horizon is not 1 to [`LONGEST_HORIZON`].
    pub fn new(
        model: &Model,
        arm: &ArmWithPlay,
        path: JointPath,
        mode: TaskMode,
        period: f64,
        horizon: usize,
    ) -> Option<Features> {
        let [play] = arm.plays() else { return None };
        if !(1..=LONGEST_HORIZON).contains(&horizon) {
            return None;
        }
        let n = model.arm.dof();
        let outer: f64 = model.arm.joints()[play.joint..].iter().map(|joint| joint.inertia.mass).sum();
        let gravity = model.arm.gravity().norm();
        Some(Features {
            path,
            statics: QuasiStatic::new(arm, period),
            twin: JournalTwin::new(arm, drive_frictions(&model.arm), mode, period),
            period,
            horizon,
            clearance: play.clearance.clearance,
            weight: outer * if gravity > 0.0 { gravity } else { EARTH },
            rows: [Row::default(); ROWS],
            tick: None,
            settled: 0,
            excess: [0.0; 2],
            loads: vec![[0.0; 2]; horizon],
            regressors: [0.0; REGRESSORS.len()],
            scale: 0.0,
            motion: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
        })
    }

    /// Ticks looked ahead.
    pub fn horizon(&self) -> usize {
        self.horizon
    }

    /// Radial clearance that the model believes in, m.
    pub fn clearance(&self) -> f64 {
        self.clearance
    }

    /// Takes `state`. `None` if nothing can be predicted: the reference is not that of the path, a tick is missing since the last
    /// state, or the twin has no finite answer; the next state then starts anew.
    pub fn push(&mut self, state: &State) -> Option<Outlines<'_>> {
        let follows = self.tick.is_some_and(|last| last + 1 == state.tick);
        self.tick = Some(state.tick);
        if !self.on_path(state) {
            self.tick = None;
            return None;
        }
        if !follows {
            self.begin(state.tick);
        }
        let target = state.tick + self.horizon as u64;
        self.settle(target);
        let came_due = self.advance(state)?;
        self.gather(state.tick, came_due)
    }

    /// What the network looks at at the last state, and the unit σ of its answer, m.
    pub fn outlines(&self) -> (&[f64; REGRESSORS.len()], f64) {
        (&self.regressors, self.scale)
    }

    /// Notes what the network says of the last state: the error at k + h in units of σ.
    pub fn predicted(&mut self, error: &[f64], scale: f64) {
        if let Some(tick) = self.tick {
            let target = &mut self.rows[slot(tick + self.horizon as u64)];
            target.predicted = [error[0] * scale, error[1] * scale];
        }
    }

    /// What the twin expects of the journal h ticks after the last state beyond its rest there, slides, m.
    pub fn forecast(&self) -> Pair {
        let row = self.row_ahead();
        let ahead = self.twin.ahead();
        [ahead.offset[0] - row.rest[0], ahead.offset[1] - row.rest[1]]
    }

    /// Where the journal rests at the last state and h ticks after it, slides, m.
    pub fn rests(&self) -> [Pair; 2] {
        [self.rows[slot(self.tick.unwrap_or(0))].rest, self.row_ahead().rest]
    }

    /// `error` in the frame of the contact h ticks after the last state, along the slides.
    pub fn along_slides(&self, error: Pair) -> Pair {
        let n = self.row_ahead().direction;
        [error[0] * n[0] - error[1] * n[1], error[0] * n[1] + error[1] * n[0]]
    }

    fn row_ahead(&self) -> &Row {
        &self.rows[slot(self.tick.unwrap_or(0) + self.horizon as u64)]
    }

    /// The journal's offset as the twin has it at the last state, slides, m: measured where the tool is tracked.
    pub fn journal(&self) -> Pair {
        [self.twin.now().offset[0], self.twin.now().offset[1]]
    }

    fn on_path(&mut self, state: &State) -> bool {
        self.follow(state.tick);
        let own = &self.motion[0];
        own.iter().zip(&state.reference.q).all(|(own, given)| (own - given).abs() <= SAME_PATH)
    }

    fn follow(&mut self, tick: u64) {
        let [q, v, a] = &mut self.motion;
        self.path.at(tick as f64 * self.period, q, v, a);
    }

    /// Starts anew at `tick`.
    fn begin(&mut self, tick: u64) {
        self.twin.restart();
        self.statics.restart();
        self.rows = [Row::default(); ROWS];
        self.excess = [0.0; 2];
        self.settled = tick;
        self.settle_one(tick);
    }

    /// Lets the journal rest on the reference up to `tick`.
    fn settle(&mut self, tick: u64) {
        while self.settled < tick {
            self.settled += 1;
            self.settle_one(self.settled);
        }
    }

    fn settle_one(&mut self, tick: u64) {
        self.follow(tick);
        let [q, v, a] = &self.motion;
        self.statics.advance(Motion { q, v, a });
        let rest = self.statics.rests()[0];
        let direction = rest.direction().unwrap_or([1.0, 0.0]);
        self.rows[slot(tick)] = Row {
            direction,
            load: direction.map(|u| -u * rest.force),
            rest: rest.displacement,
            ..Row::default()
        };
    }

    /// Lets the twin go on; the error that came due in units of its σ, if the tool was tracked.
    fn advance(&mut self, state: &State) -> Option<Option<Pair>> {
        for (step, load) in self.loads.iter_mut().enumerate() {
            *load = self.rows[slot(state.tick + step as u64)].load;
        }
        let rest = self.rows[slot(state.tick)].rest;
        let before = self.twin.excess();
        let before = [before[0], before[1]];
        let loads = self.loads.iter().map(Pair::as_slice);
        if self.twin.advance(state, &rest, loads).is_none() {
            self.tick = None;
            return None;
        }
        self.excess = before;
        let tracked = state.has(State::FLAG_TOOL_TRACKED);
        let journal = self.journal();
        let row = &mut self.rows[slot(state.tick)];
        row.error = row.predicted;
        let (forecast, scale) = row.forecast.filter(|_| tracked).unzip();
        let error = forecast.map(|forecast| turned(difference(journal, forecast), row.direction));
        if let Some(error) = error {
            row.error = error;
        }
        Some(error.zip(scale).map(|(error, scale)| error.map(|e| bounded(e / scale))))
    }

    /// Writes the regressors at `tick` and remembers the forecast.
    fn gather(&mut self, tick: u64, came_due: Option<Pair>) -> Option<Outlines<'_>> {
        let (now, ahead) = (self.rows[slot(tick)], self.rows[slot(tick + self.horizon as u64)]);
        let journal = self.journal();
        let forecast = [self.twin.ahead().offset[0], self.twin.ahead().offset[1]];
        let velocity = [self.twin.now().velocity[0], self.twin.now().velocity[1]];
        let innovation = [self.twin.innovation()[0], self.twin.innovation()[1]];
        let excess = [self.twin.excess()[0], self.twin.excess()[1]];
        let span = self.horizon as f64 * self.period;
        let (c, square) = (self.clearance, span * span / self.clearance);
        let errors = [0, 1, 2].map(|age| self.past(tick, age).error);
        let scale = self.scale_at(tick, difference(forecast, journal));
        let in_scale = |pair: Pair| pair.map(|value| bounded(value / scale));
        let pairs = [
            in_scale(errors[0]),
            in_scale(errors[1]),
            in_scale(errors[2]),
            in_scale(turned(innovation, now.direction)),
            turned(difference(forecast, ahead.rest), ahead.direction).map(|value| value / c),
            turned(difference(journal, now.rest), now.direction).map(|value| value / c),
            turned(velocity, now.direction).map(|value| value * span / c),
            [journal[0].hypot(journal[1]) / c - 1.0, forecast[0].hypot(forecast[1]) / c - 1.0],
            [self.twin.now().touches(0), self.twin.ahead().touches(0)]
                .map(|touches| f64::from(u8::from(touches))),
            [now.load[0].hypot(now.load[1]) / self.weight, ahead.load[0].hypot(ahead.load[1]) / self.weight],
        ];
        let turning = turned(ahead.direction, now.direction);
        let excesses =
            [turned(excess, now.direction), turned(difference(excess, self.excess), now.direction)];
        let values = pairs.into_iter().flatten();
        let values = values.chain([turning[1].atan2(turning[0])]);
        let values = values.chain(excesses.into_iter().flatten().map(|value| value * square));
        for (slot, value) in self.regressors.iter_mut().zip(values.chain([(scale / c).log10()])) {
            *slot = value;
        }
        self.scale = scale;
        self.rows[slot(tick + self.horizon as u64)].forecast = Some((forecast, scale));
        let finite = self.regressors.iter().all(|value| value.is_finite());
        finite.then_some(Outlines { regressors: &self.regressors, scale, came_due })
    }

    fn past(&self, tick: u64, age: u64) -> Row {
        tick.checked_sub(age).map_or_else(Row::default, |tick| self.rows[slot(tick)])
    }

    /// σ, m: the root mean square of the latest errors, and a share of the movement to come. At most c: no journal is farther off, but a
    /// network that believes itself without a tracked tool may say so, and more with every tick.
    fn scale_at(&self, tick: u64, movement: Pair) -> f64 {
        let squares = (0..SCALE_TICKS as u64).map(|age| {
            let [n, t] = self.past(tick, age).error;
            n * n + t * t
        });
        let recent = (squares.sum::<f64>() / SCALE_TICKS as f64).sqrt();
        let scale = recent + SCALE_OF_MOVEMENT * movement[0].hypot(movement[1]);
        (scale + LEAST_SCALE * self.clearance).min(self.clearance)
    }

    /// Directions of the two slides in the base frame with the joints on the reference h ticks after the last state.
    pub fn directions(&mut self) -> [Vector3<f64>; 2] {
        let q = &self.motion[0];
        [[1.0, 0.0], [0.0, 1.0]].map(|slide| self.statics.deviation_with(q, &slide))
    }
}

/// Gravity by which loads are judged where there is none, m/s².
const EARTH: f64 = 9.81;

fn slot(tick: u64) -> usize {
    (tick % ROWS as u64) as usize
}

fn difference(a: Pair, b: Pair) -> Pair {
    [a[0] - b[0], a[1] - b[1]]
}

fn bounded(value: f64) -> f64 {
    value.clamp(-LARGEST_ERROR, LARGEST_ERROR)
}

/// `pair` in the frame whose first axis is `direction`.
fn turned(pair: Pair, direction: Pair) -> Pair {
    [pair[0] * direction[0] + pair[1] * direction[1], pair[1] * direction[0] - pair[0] * direction[1]]
}
