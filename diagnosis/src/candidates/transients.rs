//! Shapes of transient effects, which begin and end at a time: a push, a load that drops. Each recording has its own clock, and a repeated recording
//! need not have the push.

use freeplay_laws::Kind as EffectKind;
use toml::{Table, Value};

use crate::candidates::windows::{Step, Torque, windows};
use crate::data::linearised::LinearisedRecording;
use crate::data::stacked::{Data, REMEMBERED};
use crate::data::whitening::Whitening;
use crate::signals::channel::Kind;

/// Largest number of events of a recording in the search after all other laws, and of candidate windows of each kind: a recording with more events
/// comes from a disturbed machine and has to be repeated.
pub(crate) const MOST: usize = 8;
/// Names of the parameters of a law that begins and ends.
const BEGIN: &str = "start";
pub(crate) const END: &str = "end";

/// Start and end of the event with this `shape`; `None` if it does not end.
pub(crate) fn window(shape: &Table) -> Option<[f64; 2]> {
    let time = |name| shape.get(name).and_then(Value::as_float);
    Some([time(BEGIN)?, time(END)?])
}

/// The whitened torques of all recordings, in which the search looks for events.
pub(crate) struct WhiteTorques {
    /// By channel; `None` for a channel that is no torque.
    torques: Vec<Option<Torque>>,
    channels_per_recording: usize,
}

impl WhiteTorques {
    /// The torques of `data` with the drift models of `whitening` and the `residual`.
    pub fn new(data: &Data, whitening: &Whitening, residual: &[Vec<f64>]) -> Self {
        let of_recording: Vec<(Step, Vec<usize>)> =
            data.recordings.iter().map(|recording| (step_of(recording), edges_of(recording))).collect();
        let torque = |c: usize| {
            let (step, edges) = &of_recording[data.place(c).0];
            matches!(data.kind(c), Kind::Torque(_))
                .then(|| Torque::new(whitening.channel(c), &residual[c], step, edges))
        };
        Self {
            torques: (0..data.channels()).map(torque).collect(),
            channels_per_recording: data.channels_per_recording(),
        }
    }

    /// Sets the `residual` of the torques.
    pub fn set(&mut self, residual: &[Vec<f64>]) {
        let torques = self.torques.iter_mut().zip(residual);
        torques.for_each(|(torque, residual)| torque.iter_mut().for_each(|torque| torque.set(residual)));
    }

    /// Number of equally probable ways in which a `kind` may happen at one place. It may start at each used row, and its duration is between one row
    /// and all rows, uniform in the logarithm (Jeffreys 1961, Theory of Probability, §3.1).
    pub fn way_count(&self, kind: &EffectKind) -> usize {
        let rows = self.torques.iter().flatten().map(Torque::count).sum::<usize>();
        let torques = self.torques.iter().flatten().count().max(1);
        let recordings = (self.torques.len() / self.channels_per_recording.max(1)).max(1);
        let rows = (rows * recordings / torques).max(2) as f64;
        if kind.parameter(END).is_some() { (rows * rows.ln()) as usize } else { rows as usize }
    }

    /// The shapes of a `kind` at `joint` that begins and ends, in the windows of the recording number `index` in which it would explain most.
    pub fn shapes(&self, data: &Data, kind: &EffectKind, joint: Option<usize>, index: usize) -> Vec<Table> {
        if kind.parameter(END).is_none() {
            return Vec::new();
        }
        let is_asked = |c: &usize| joint.is_none_or(|joint| data.kind(*c) == Kind::Torque(joint));
        let channels = (0..self.channels_per_recording)
            .map(|c| index * self.channels_per_recording + c)
            .filter(is_asked);
        let torques: Vec<&Torque> = channels.filter_map(|c| self.torques[c].as_ref()).collect();
        let t = &data.recordings[index].motion().t;
        windows(&torques, MOST).into_iter().map(|[begin, end]| between(t[begin], t[end])).collect()
    }
}

/// A step in a torque of `recording`, after the low-pass.
fn step_of(recording: &LinearisedRecording) -> Step {
    let treatment = &recording.prepared.treatment;
    let t = &recording.motion().t;
    let Some(&at) = t.get(t.len() / 2) else { return Step::new(vec![1.0]) };
    let whole: Vec<f64> = recording.whole().t.iter().map(|t| if *t >= at { 1.0 } else { 0.0 }).collect();
    let seen = treatment.keep(&treatment.low_pass(&whole));
    let (middle, least) = (t.len() / 2, REMEMBERED.sqrt());
    let reach = (0..middle).rev().take_while(|row| seen[*row].abs() > least).count() + 1;
    Step::new(seen[middle.saturating_sub(reach)..(middle + reach).min(seen.len())].to_vec())
}

/// The rows of `recording` at which an event may start or end: four in a period of its low-pass's cutoff.
fn edges_of(recording: &LinearisedRecording) -> Vec<usize> {
    let motion = recording.motion();
    let step = motion.stretches.first().map_or(1.0, |stretch| motion.step(stretch));
    let every = (0.25 / recording.prepared.treatment.filter().cutoff_hz() / step) as usize;
    (0..motion.len()).step_by(every.max(1)).collect()
}

/// The shape of an event that begins and ends at these times.
pub(crate) fn between(begin: f64, end: f64) -> Table {
    [(BEGIN, begin), (END, end)]
        .map(|(name, time)| (name.to_owned(), Value::from(time)))
        .into_iter()
        .collect()
}
