//! The quality of a recording before any fit: the findings for which it suffices.

use crate::data::linearised::LinearisedRecording;
use crate::data::noise::Noise;
use crate::data::parts::{Part, file_name};
use crate::data::rows::{is_held, rests};
use crate::data::stacked::Data;
use crate::error::ENOUGH_S;
use crate::signals::channel::{Channel, Kind};
use crate::signals::missing::only;
use crate::signals::rest::STILL;
use crate::signals::stuck::Stuck;
use crate::statistics::{Moments, SHARES, UNMOVED, span};

/// Least length of the data for a fit, s: one motion of an arm takes about a second, and a fit needs one in each direction.
const LEAST_S: f64 = 2.0;

/// The defect that makes these recordings useless for any finding, with the remedy, in one sentence each; `None` without such a defect.
pub(crate) fn lack(data: &Data) -> Option<String> {
    let lasts = |part: Part| -> f64 {
        let of_recording = |(index, parts): (usize, &Vec<Part>)| -> f64 {
            let motion = data.recordings[index].motion();
            let step = motion.stretches.first().map_or(0.0, |stretch| motion.step(stretch));
            parts.iter().filter(|own| **own == part).count() as f64 * step
        };
        data.parts.iter().enumerate().map(of_recording).sum()
    };
    let [fit, choice, test] = [Part::Fit, Part::Choice, Part::Test].map(lasts);
    if fit < LEAST_S || choice + test < 0.25 * LEAST_S {
        let names: Vec<String> = data.recordings.iter().map(file_name).collect();
        let whole: f64 = data
            .recordings
            .iter()
            .map(|recording| {
                recording.prepared.raw.t.last().unwrap_or(&0.0)
                    - recording.prepared.raw.t.first().unwrap_or(&0.0)
            })
            .sum();
        return Some(format!(
            "{}: too short: it lasts {whole:.1} s, of which the low-pass leaves {fit:.1} s for the fit, {choice:.1} s for the choice and {test:.1} s for the \
             test; record at least {:.0} s of motion without a long rest",
            names.join(" and "),
            needed(data)
        ));
    }
    let moves =
        |joint: usize| data.recordings.iter().any(|recording| span(&recording.motion().q[joint]) > STILL);
    if !(0..data.arm().dof()).any(moves) {
        return Some("no joint moves; record a motion of the joints in question".to_owned());
    }
    let is_silent = |recording: &LinearisedRecording| {
        recording.channels.iter().all(|channel| recording.prepared.is_stuck(channel.kind))
    };
    if data.recordings.iter().all(is_silent) {
        return Some(
            "every torque stays at one value while its joint moves, and the recording has no other channel beside the motion; record measured torques \
             or currents times the torque constant, or the tool's position"
                .to_owned(),
        );
    }
    None
}

/// Length of a recording whose fit part lasts [`LEAST_S`] under the low-pass of `data`, s: the low-pass loses its settling time at both ends and around both
/// cuts.
fn needed(data: &Data) -> f64 {
    let settles =
        data.recordings.iter().map(|recording| recording.prepared.treatment.filter().settling_time());
    (LEAST_S / SHARES[0] + 4.0 * settles.fold(0.0, f64::max)).max(ENOUGH_S).ceil()
}

/// Notes on the recordings: noise, rounding, joints at rest, stuck torques.
pub(crate) fn notes(data: &Data) -> Vec<String> {
    let mut notes = Vec::new();
    for (number, recording) in data.recordings.iter().enumerate() {
        let (mut stuck, mut rounded, mut partly) = (Vec::new(), Vec::new(), Vec::new());
        for (index, (channel, noise)) in
            recording.channels.iter().zip(&recording.prepared.noises.channels).enumerate()
        {
            if let Some(words) = no_measurement(recording, channel) {
                stuck.push(words);
                continue;
            }
            if channel.is_missing() {
                continue;
            }
            let spread = Moments::of(&channel.measured).std;
            if spread <= 1e-9 * Moments::of(&channel.measured).rms || spread == 0.0 {
                notes.push(format!("{} is constant and shows no effect", channel.name));
            }
            if is_coarse(noise, spread) {
                rounded.push(format!("{} by {:.2e} {}", channel.name, noise.step, channel.unit));
            }
            notes.extend(told_to_move(recording, channel).or_else(|| rest(recording, channel, noise)));
            let kept = &data.counts[number * data.channels_per_recording() + index];
            let measured = only(kept, channel.present.as_deref());
            let left_out = 1.0 - measured.iter().sum::<f64>() / measured.len().max(1) as f64;
            if let (Kind::Torque(joint), true) = (channel.kind, left_out > 0.02) {
                partly.push(format!("{:.0} % of {}", 100.0 * left_out, recording.arm().joints()[joint].name));
            }
        }
        if !stuck.is_empty() {
            notes.push(format!(
                "torques that are left out, since they are not measured: {}",
                stuck.join(", ")
            ));
        }
        if !partly.is_empty() {
            notes.push(format!(
                "rows of a torque that do not count: {}; dry friction at standstill may take up any part of the torque, and the samples are too \
                 sparse at a jerk",
                partly.join(", ")
            ));
        }
        if !rounded.is_empty() {
            notes.push(format!("rounded coarsely: {}", rounded.join(", ")));
        }
    }
    notes
}

/// The constant value of a `channel` of `recording` that is stuck; `None` for a real measurement.
fn no_measurement(recording: &LinearisedRecording, channel: &Channel) -> Option<String> {
    let Kind::Torque(joint) = channel.kind else { return None };
    let Stuck { at, share } = recording.prepared.stuck[joint]?;
    Some(format!(
        "{} stays at {at} {} in {:.0} % of the rows in which {} moves",
        channel.name,
        channel.unit,
        100.0 * share,
        recording.arm().joints()[joint].name
    ))
}

/// The note that something holds the joint of a torque.
fn told_to_move(recording: &LinearisedRecording, channel: &Channel) -> Option<String> {
    let Kind::Torque(joint) = channel.kind else { return None };
    is_held(recording, joint).then(|| {
        format!(
            "{} was commanded to move and stands still throughout; a brake or an obstacle holds a joint as dry friction does",
            recording.arm().joints()[joint].name
        )
    })
}

/// A note on a held joint: its torque changes beyond the model's holding torque, and the joint stands throughout. The note gives the least torque that must
/// hold it.
fn rest(recording: &LinearisedRecording, channel: &Channel, noise: &Noise) -> Option<String> {
    let Kind::Torque(joint) = channel.kind else { return None };
    let residual = channel.residual();
    let residual = only(&residual, channel.present.as_deref());
    let beyond = 0.5 * span(&residual);
    (rests(recording, joint) && beyond > UNMOVED * noise.deviation.max(noise.step)).then(|| {
        format!(
            "{} stands still throughout, while {} changes by ± {beyond:.3} {} beyond the holding torque of the model: dry friction of at least that \
             size, a brake or an obstacle holds it; a motion in which the joint moves separates these causes",
            recording.arm().joints()[joint].name,
            channel.name,
            channel.unit
        )
    })
}

/// Returns true if the rounding is at least a tenth of the signal's spread.
fn is_coarse(noise: &Noise, spread: f64) -> bool {
    noise.step > 0.1 * spread && spread > 0.0
}
