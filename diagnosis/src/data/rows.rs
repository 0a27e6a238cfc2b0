//! The usable rows of a channel, and the error of a perfect model in them.
//!
//! The dry friction of a joint at rest has any value between ± its maximum. Where a joint reverses, the low-pass rounds the corner of its speed. Such
//! rows hold no information about a law of friction, and the fit does not use them for the torque of that joint.

use freeplay_laws::{DriveFriction, Placed};
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::data::columns::Answer;
use crate::data::instruments::simulated_motion;
use crate::data::linearised::LinearisedRecording;
use crate::random::normals;
use crate::signals::channel::{Channel, Kind};
use crate::signals::missing::masked;
use crate::signals::motion::Treatment;
use crate::signals::rest::STILL;
use crate::statistics::{Moments, UNMOVED, span};

/// Share of its greatest speed below which a joint is at rest if it stays below for longer than the filter's memory, unless its encoder shows slow
/// motion: the response of the low-pass to a stop is below this share.
const STANDING: f64 = 2e-3;
/// Factor of the rounding of a speed by the low-pass with the cutoff f_c where a joint starts to stick or to slip: the error is about this factor
/// times the acceleration over f_c, seen on simulated stops.
const ROUNDED: f64 = 0.05;
/// Share of the time at rest above which the fit also uses the rows at rest of a joint: forces other than friction show there, too, and too few other
/// rows remain.
const MOSTLY: f64 = 0.9;
/// Largest share of the model's change under the finer low-pass that a still finer one would add: the changes halve with each octave or faster.
const HIDDEN: f64 = 0.1;

/// The usable rows of a channel, and the errors that a perfect model has there.
pub(crate) struct Rows {
    /// Mask of the usable rows: 1 for a row that the fit may use, else 0.
    pub counts: Vec<f64>,
    /// Standard deviation of the error of a perfect model, in the channel's unit.
    pub row_error: Vec<f64>,
}

/// The usable rows of the channel number `channel` of `recording`, from the samples and the model.
pub(crate) fn usable_rows(recording: &LinearisedRecording, channel: usize) -> Rows {
    let present = recording.channels[channel].present.as_deref();
    let Rows { counts, row_error } = measured_rows(recording, channel);
    Rows { counts: masked(counts, present), row_error }
}

/// The usable rows if no sample were missing.
fn measured_rows(recording: &LinearisedRecording, channel: usize) -> Rows {
    let points = recording.motion().len();
    let all = |counts: f64| Rows { counts: vec![counts; points], row_error: vec![0.0; points] };
    let Kind::Torque(joint) = recording.channels[channel].kind else { return all(1.0) };
    if recording.prepared.is_stuck(Kind::Torque(joint)) {
        return all(0.0);
    }
    let (v, a) = (&recording.whole().v[joint], &recording.whole().a[joint]);
    let treatment = &recording.prepared.treatment;
    let (rate_hz, cutoff_hz) = (treatment.rate_hz(), treatment.filter().cutoff_hz());
    let reach = reach(treatment);
    let slow = slowest(v);
    // Speed, with a sign, that the encoder resolves within the filter's memory.
    let creeping =
        UNMOVED * recording.prepared.noises.positions[joint].deviation * rate_hz / reach.max(1) as f64;
    let dry = DriveFriction::nominal(recording.arm().joints()[joint].friction).coulomb;
    if dry > 0.0 && rests(recording, joint) || is_held(recording, joint) {
        return all(0.0);
    }
    let stands = treatment.keep(&standing(v, slow.min(creeping), reach));
    if Moments::of(&stands).mean > MOSTLY {
        return all(1.0);
    }
    let usual = Moments::of(a).rms;
    let sticks = sticking(recording, joint);
    let turns: Vec<f64> = v
        .iter()
        .zip(&envelope(a, reach))
        .zip(sticks)
        .map(|((v, here), sticks)| {
            let blurred = (ROUNDED * usual.max(*here) / cutoff_hz).max(slow);
            if v.abs() < blurred || sticks && v.abs() < creeping.max(4.0 * blurred) { 1.0 } else { 0.0 }
        })
        .collect();
    // The low-pass smears dry friction at these rows over the rows around.
    let smeared = treatment.keep(&envelope(&treatment.low_pass(&turns), reach));
    let turns = treatment.keep(&envelope(&turns, reach));
    let counts: Vec<f64> =
        stands.iter().zip(turns).map(|(stands, turns)| (1.0 - stands) * (1.0 - turns)).collect();
    let friction = dry + missing_dry_friction(recording, joint, channel, &counts);
    // The samples do not resolve the time of a jump between two of them. The error of this time is half the sample period, times the slope of the
    // low-pass's response: twice the cutoff times twice the part of the jump that the low-pass removes.
    let unresolved = treatment.keep(&envelope(&recording.prepared.sharpening.unresolved[joint], reach));
    let hidden = treatment.keep(&envelope(&recording.prepared.sharpening.more.torque[joint], reach));
    let row_error = unresolved
        .iter()
        .zip(hidden)
        .zip(smeared)
        .map(|((unresolved, hidden), smeared)| {
            (2.0 * cutoff_hz / rate_hz * unresolved).hypot(HIDDEN * hidden).hypot(friction * smeared)
        })
        .collect();
    Rows { counts, row_error }
}

/// Standard deviation of the error of each row of `recording`, by channel, for a model with the effects `found`; `row_error` is that of the model without them.
/// The low-pass attenuates the jumps of their torques, such as those of dry friction where a joint reverses. If speeds below the resolution of the
/// encoder would invert a torque, as where two coupled joints hold each other, the torque may have any value in between.
pub(crate) fn row_error_with(
    recording: &LinearisedRecording,
    found: &[Placed],
    row_error: &[Vec<f64>],
    seed: u64,
) -> Vec<Vec<f64>> {
    let treatment = &recording.prepared.treatment;
    let reach = reach(treatment);
    let unseen = unseen_speeds(recording, &mut ChaCha8Rng::seed_from_u64(seed));
    let along = |way: f64| {
        let mut motion = recording.whole().clone();
        for (v, unseen) in motion.v.iter_mut().zip(&unseen) {
            v.iter_mut().zip(unseen).for_each(|(v, unseen)| *v += way * unseen);
        }
        recording.raw_torques(found, &motion)
    };
    let (Ok(less), Ok(as_seen), Ok(more)) = (along(-1.0), along(0.0), along(1.0)) else {
        // An arm that is not physical leaves the rows unchanged.
        return row_error.to_vec();
    };
    let of_channel = |(channel, row_error): (&Channel, &Vec<f64>)| match channel.kind {
        Kind::Torque(joint) => {
            let through = treatment.low_pass(&as_seen[joint]);
            let jumps: Vec<f64> = (0..through.len())
                .map(|k| {
                    let as_seen = as_seen[joint][k];
                    // A torque in proportion to the speed is no jump.
                    (as_seen - through[k]).hypot(0.5 * (less[joint][k] + more[joint][k]) - as_seen)
                })
                .collect();
            let around = treatment.keep(&envelope(&jumps, reach));
            row_error.iter().zip(around).map(|(row_error, jump)| row_error.hypot(jump)).collect()
        }
        Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => row_error.clone(),
    };
    recording.channels.iter().zip(row_error).map(of_channel).collect()
}

/// Standard deviation between the possible solutions of the effects `found`, by channel. Each row has the largest deviation of the rows around it. A
/// channel in which all effects have one solution holds `None`.
pub(crate) fn solution_spread_with(recording: &LinearisedRecording, found: &[Placed]) -> Answer {
    let reach = reach(&recording.prepared.treatment);
    let mut squares: Answer = vec![None; recording.channels.len()];
    for placed in found {
        let courses = placed.effect.courses().into_iter().map(|effect| Placed { effect, ..*placed });
        let answers: Vec<Answer> = courses.filter_map(|course| recording.answer(&course).ok()).collect();
        for (channel, squares) in squares.iter_mut().enumerate() {
            let shown: Vec<&Vec<f64>> =
                answers.iter().filter_map(|answer| answer[channel].as_ref()).collect();
            let Some(first) = shown.first() else { continue };
            let squares = squares.get_or_insert_with(|| vec![0.0; first.len()]);
            for (row, square) in squares.iter_mut().enumerate() {
                let places: Vec<f64> = shown.iter().map(|course| course[row]).collect();
                *square += Moments::of(&places).std.powi(2);
            }
        }
    }
    let root = |squares: Vec<f64>| envelope(&squares.into_iter().map(f64::sqrt).collect::<Vec<_>>(), reach);
    squares.into_iter().map(|squares| squares.map(root)).collect()
}

/// Speeds of each joint of `recording` that its encoder does not show, on all grid points: those that the noise of the encoder hides, and those below the
/// speed of a joint at rest.
fn unseen_speeds(recording: &LinearisedRecording, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let (read, whole) = (simulated_motion(recording, rng), recording.whole());
    let of_joint = |(read, v): (&Vec<f64>, &Vec<f64>)| {
        let creeping = normals(rng, v.len(), slowest(v));
        (0..v.len()).map(|k| read[k] - v[k] + creeping[k]).collect()
    };
    read.v.iter().zip(&whole.v).map(of_joint).collect()
}

/// Half a period of the low-pass's cutoff, in points: the low-pass smears a jump over this distance.
fn reach(treatment: &Treatment) -> usize {
    (treatment.rate_hz() / treatment.filter().cutoff_hz() / 2.0) as usize
}

/// The speed below which a joint with the speeds `v` is at rest.
fn slowest(v: &[f64]) -> f64 {
    STANDING * v.iter().fold(0.0_f64, |most, v| most.max(v.abs()))
}

/// Dry friction of `joint` that the model lacks, approximately: the coefficient of the direction of motion in a least-squares fit of the residual,
/// with a constant and the speed.
fn missing_dry_friction(
    recording: &LinearisedRecording,
    joint: usize,
    channel: usize,
    counts: &[f64],
) -> f64 {
    let v = &recording.motion().v[joint];
    let residual = recording.channels[channel].residual();
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for ((v, residual), counts) in v.iter().zip(residual).zip(counts) {
        let row = Vector3::new(1.0, *v, v.signum());
        normal += *counts * row * row.transpose();
        right += *counts * residual * row;
    }
    normal.cholesky().map_or(0.0, |factor| factor.solve(&right)[2].abs())
}

/// Returns true if `joint` stays at rest throughout, as far as its encoder resolves.
pub(crate) fn rests(recording: &LinearisedRecording, joint: usize) -> bool {
    span(&recording.whole().q[joint])
        < STILL.max(2.0 * UNMOVED * recording.prepared.noises.positions[joint].deviation)
}

/// Returns true if something holds `joint`: it is at rest throughout, although the commands of `recording` would move it.
pub(crate) fn is_held(recording: &LinearisedRecording, joint: usize) -> bool {
    let told = recording.prepared.raw.q_ref.as_ref().and_then(|columns| columns.get(joint));
    rests(recording, joint) && told.is_some_and(|told| span(told) > STILL)
}

/// The points at which the encoder of `joint` shows no motion from one sample to the next.
fn sticking(recording: &LinearisedRecording, joint: usize) -> Vec<bool> {
    let prepared = recording.prepared;
    let read = prepared.treatment.whole_column(prepared.raw, &prepared.raw.q[joint]);
    let least = UNMOVED * prepared.noises.positions[joint].deviation;
    let still = |k: usize, other: usize| read.get(other).is_some_and(|x| (x - read[k]).abs() < least);
    (0..read.len()).map(|k| still(k, k + 1) || still(k, k.wrapping_sub(1))).collect()
}

/// 1 within `reach` points of an interval, longer than `reach`, in which the speed `v` stays below `slow`; else 0.
fn standing(v: &[f64], slow: f64, reach: usize) -> Vec<f64> {
    let is_slow = |point: usize| v[point].abs() < slow;
    let mut standing = vec![0.0; v.len()];
    let mut begin = 0;
    for end in 1..=v.len() {
        if end == v.len() || is_slow(end) != is_slow(begin) {
            if is_slow(begin) && end - begin > reach {
                let around = begin.saturating_sub(reach)..(end + reach).min(v.len());
                standing[around].fill(1.0);
            }
            begin = end;
        }
    }
    standing
}

/// Maximum of |x| within `reach` points of each point.
fn envelope(x: &[f64], reach: usize) -> Vec<f64> {
    let around = |k: usize| &x[k.saturating_sub(reach)..(k + reach + 1).min(x.len())];
    (0..x.len()).map(|k| around(k).iter().fold(0.0_f64, |most, x| most.max(x.abs()))).collect()
}
