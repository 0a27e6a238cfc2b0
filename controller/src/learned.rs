//! The learned forecast of the journal: the twin's, corrected by the network, trusted as far as it has proved right.
//!
//! At each state the place of the journal at the tick h ahead is predicted. When that tick has come and the tool was tracked, the
//! prediction is judged beside the one that needs no learning, rest plus today's residual: with E the mean squared errors over the
//! last `MEMORY` s, the trust is `2 (1 − E_learned/E_plain)`, within 0 and 1. The network's correction of the twin is judged beside
//! the twin alone in the same way: on motions wilder than those that trained it, it is wrong by much more. It corrects nothing unless it has
//! proved better than the twin in training, on runs of their own ([`Provenance::proved`](freeplay_predictor::Provenance)). Where the path is
//! run several times, what the twin was off by a lap ago is taken away ([`Repeating`]). Without a tracked tool there is nothing to judge
//! by: the forecast is the twin's, and no trust in it.

use freeplay_arm::Arm;
use freeplay_predictor::weight_file::MismatchError;
use freeplay_predictor::window::Layout;
use freeplay_predictor::{Narx, Predictor};
use freeplay_shm::State;
use nalgebra::Vector3;

use crate::features::{Features, LONGEST_HORIZON, OUTPUTS, Pair, REGRESSORS};
use crate::identity::identity;
use crate::repeating::Repeating;

/// Weights that come with the project.
const SHIPPED: [&str; 1] = [include_str!("../weights/erkaya2018.narx.json")];
/// Time over which predictions are judged, s.
const MEMORY: f64 = 0.25;
/// Predictions that are remembered until they are judged.
const PENDING: usize = LONGEST_HORIZON + 1;

/// The weights that come with the project for `arm` with play at `joint`, if there are any.
pub fn shipped(arm: &Arm, joint: &str) -> Option<Narx> {
    let read = |text: &&str| Narx::from_json(text, "the weights that come with narx-qp").ok();
    SHIPPED.iter().filter_map(read).find(|narx| check(narx, arm, Some(joint)).is_ok())
}

/// Whether `narx` is for `arm`, with play at `joint` if that is one, and looks at what the controller makes of a state.
///
/// # Errors
/// Another arm or joint, other channels or another layout.
pub fn check(narx: &Narx, arm: &Arm, joint: Option<&str>) -> Result<(), MismatchError> {
    narx.check_arm(arm.name(), &identity(arm))?;
    joint.map_or(Ok(()), |joint| narx.check_joint(joint))?;
    narx.check_channels(&REGRESSORS, &OUTPUTS)?;
    let horizon = narx.layout().horizon.clamp(1, LONGEST_HORIZON);
    narx.check_layout(&Layout { input_lags: vec![0], output_lags: vec![], horizon, input_at_target: false })
}

/// Two predictions for one tick.
#[derive(Clone, Copy, Default)]
struct Pending {
    tick: u64,
    network: Pair,
    twin: Pair,
    plain: Pair,
}

/// The forecast of one run; see the module.
pub struct Learned {
    features: Features,
    network: Option<Predictor>,
    /// Whether the network may correct the forecast.
    proved: bool,
    /// What repeats from lap to lap, on a path with laps.
    repeating: Option<Repeating>,
    /// What the network said last, along the slides, m.
    said: Pair,
    /// The forecast, slides, m.
    forecast: Pair,
    pending: [Option<Pending>; PENDING],
    /// Mean squared errors with the network in full, of the twin alone, and without learning, m².
    errors: [f64; 3],
    share: f64,
    judged: u64,
    ignored: u64,
}

impl Learned {
    /// A forecast from `features`, corrected by `network` if there is one for this horizon; ticks of `period` s, and `lap` of them before
    /// the path begins again, if it does.
    pub fn new(features: Features, network: Option<Narx>, period: f64, lap: Option<u64>) -> Learned {
        Learned {
            features,
            proved: network.as_ref().is_some_and(|narx| narx.provenance().proved),
            network: network.map(Predictor::new),
            repeating: lap.and_then(|lap| Repeating::new(lap, (period / MEMORY).min(1.0))),
            said: [0.0; 2],
            forecast: [0.0; 2],
            pending: [None; PENDING],
            errors: [0.0; 3],
            share: (period / MEMORY).min(1.0),
            judged: 0,
            ignored: 0,
        }
    }

    /// Outputs of the network that were not finite; they were not used.
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    /// Trust in the forecast, 0 to 1.
    pub fn trust(&self) -> f64 {
        let [network, twin, plain] = self.errors;
        let repeating = self.repeating.as_ref().and_then(Repeating::square).unwrap_or(f64::INFINITY);
        let network = if self.proved { network } else { f64::INFINITY };
        trust(network.min(twin).min(repeating), plain)
    }

    /// What the forecast is made from.
    pub fn features(&mut self) -> &mut Features {
        &mut self.features
    }

    /// What the network says that the twin's forecast is off by, along the slides, m, whether it is believed or not.
    pub fn said(&self) -> Pair {
        self.said
    }

    /// Where the journal is expected h ticks after the last state, slides, m.
    pub fn forecast(&self) -> Pair {
        self.forecast
    }

    /// Takes `state`; where the journal will be at the tick h ahead beyond its rest there, base frame, m, as far as that is to be
    /// trusted. `None` if nothing can be said.
    pub fn push(&mut self, state: &State) -> Option<Vector3<f64>> {
        let outlines = self.features.push(state)?;
        let scale = outlines.scale;
        let error = match self.network.as_mut().map(|network| network.push(outlines.regressors, None)) {
            Some(Ok(Some(said))) => [said[0], said[1]],
            Some(Err(_)) => {
                self.ignored += 1;
                [0.0; 2]
            }
            Some(Ok(None)) | None => [0.0; 2],
        };
        self.features.predicted(&error, scale);
        self.said = self.features.along_slides(error.map(|error| error * scale));
        let expected = self.features.forecast();
        self.judge(state, expected, self.said);
        let correction = self.correction(state);
        let beyond = [expected[0] + correction[0], expected[1] + correction[1]];
        let [_, rest] = self.features.rests();
        self.forecast = [rest[0] + beyond[0], rest[1] + beyond[1]];
        let [first, second] = self.features.directions();
        Some((first * beyond[0] + second * beyond[1]) * self.trust())
    }

    /// What is taken off the twin's forecast, along the slides, m: what repeats, or what the network says, whichever was better lately.
    fn correction(&self, state: &State) -> Pair {
        if !state.has(State::FLAG_TOOL_TRACKED) {
            return [0.0; 2];
        }
        let [network, twin, _] = self.errors;
        let share = if self.proved { trust(network, twin) } else { 0.0 };
        let target = state.tick + self.features.horizon() as u64;
        let repeating = self
            .repeating
            .as_ref()
            .filter(|repeating| share == 0.0 || repeating.square().is_some_and(|square| square < network));
        match repeating.and_then(|repeating| repeating.expected(target)) {
            Some(error) => error,
            None => self.said.map(|said| share * said),
        }
    }

    /// Judges what was said of this tick and remembers what is said now.
    fn judge(&mut self, state: &State, twin: Pair, correction: Pair) {
        let (journal, [now, ahead]) = (self.features.journal(), self.features.rests());
        let horizon = self.features.horizon() as u64;
        let due = self.pending[slot(state.tick)].take().filter(|pending| pending.tick == state.tick);
        if let Some(due) = due.filter(|_| state.has(State::FLAG_TOOL_TRACKED)) {
            self.judged += 1;
            if let Some(repeating) = &mut self.repeating {
                repeating.note(state.tick, [journal[0] - due.twin[0], journal[1] - due.twin[1]]);
            }
            // The first errors weigh as much as the later ones: a mean before it is a moving one.
            let share = self.share.max(1.0 / self.judged as f64);
            for (mean, said) in self.errors.iter_mut().zip([due.network, due.twin, due.plain]) {
                let square = (said[0] - journal[0]).powi(2) + (said[1] - journal[1]).powi(2);
                *mean += share * (square - *mean);
            }
        }
        self.pending[slot(state.tick + horizon)] = Some(Pending {
            tick: state.tick + horizon,
            network: [ahead[0] + twin[0] + correction[0], ahead[1] + twin[1] + correction[1]],
            twin: [ahead[0] + twin[0], ahead[1] + twin[1]],
            plain: [ahead[0] + journal[0] - now[0], ahead[1] + journal[1] - now[1]],
        });
    }
}

/// Trust in predictions of the mean squared error `ours` where others have `theirs`, 0 to 1.
fn trust(ours: f64, theirs: f64) -> f64 {
    if theirs > 0.0 { (2.0 * (1.0 - ours / theirs)).clamp(0.0, 1.0) } else { 0.0 }
}

fn slot(tick: u64) -> usize {
    (tick % PENDING as u64) as usize
}
