//! Which rows of a channel count, and by how much a perfect model may be off in them.
//!
//! A joint that stands carries any torque between ± its dry friction, and where it turns the low-pass rounds the corner of its speed: such rows say nothing of
//! a law of friction. They are left out of the torque of that joint.

use freeplay_laws::{DriveFriction, Placed};
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::data::columns::Answer;
use crate::data::instruments::misread_whole;
use crate::data::stage::Stage;
use crate::random::normals;
use crate::signals::channel::{Channel, Kind};
use crate::signals::missing::masked;
use crate::signals::motion::Treatment;
use crate::signals::rest::STILL;
use crate::statistics::{Moments, UNMOVED, span};

/// Share of its greatest speed below which a joint stands still that is slower for longer than the filter remembers, unless its encoder sees it creep: what the
/// low-pass leaves of a stop is below it.
const STANDING: f64 = 2e-3;
/// The low-pass with the cutoff f_c rounds the corner of a speed where a joint starts to stick or to slip: by about this times the acceleration over f_c,
/// seen on simulated stops.
const ROUNDED: f64 = 0.05;
/// Share of the time from which on a joint that stands is judged at rest: what is not friction shows there, too, and there are too few other rows.
const MOSTLY: f64 = 0.9;
/// Share of what a sharper look at the motion adds to the model's torque that a still sharper one may add: the series of looks halves at each octave or faster.
const HIDDEN: f64 = 0.1;

/// What the samples and the model can say of each row.
pub(crate) struct Rows {
    /// Whether it counts, 1 or 0.
    pub counts: Vec<f64>,
    /// By how much a perfect model may be off there, in the channel's unit.
    pub off: Vec<f64>,
}

/// What the samples and the model can say of each row of the channel number `channel` of `stage`.
pub(crate) fn rows_that_count(stage: &Stage, channel: usize) -> Rows {
    let present = stage.channels[channel].present.as_deref();
    let Rows { counts, off } = measured_rows(stage, channel);
    Rows { counts: masked(counts, present), off }
}

/// The same, were nothing missing.
fn measured_rows(stage: &Stage, channel: usize) -> Rows {
    let points = stage.motion().len();
    let all = |counts: f64| Rows { counts: vec![counts; points], off: vec![0.0; points] };
    let Kind::Torque(joint) = stage.channels[channel].kind else { return all(1.0) };
    if stage.ground.is_stuck(Kind::Torque(joint)) {
        return all(0.0);
    }
    let (v, a) = (&stage.whole().v[joint], &stage.whole().a[joint]);
    let treatment = &stage.ground.treatment;
    let (rate_hz, cutoff_hz) = (treatment.rate_hz(), treatment.filter().cutoff_hz());
    let reach = reach(treatment);
    let slow = slowest(v);
    // Seen to creep, and to which side, within the filter's memory.
    let creeping = UNMOVED * stage.ground.noises.positions[joint].deviation * rate_hz / reach.max(1) as f64;
    let dry = DriveFriction::nominal(stage.arm().joints()[joint].friction).coulomb;
    if dry > 0.0 && rests(stage, joint) || is_held(stage, joint) {
        return all(0.0);
    }
    let stands = treatment.keep(&standing(v, slow.min(creeping), reach));
    if Moments::of(&stands).mean > MOSTLY {
        return all(1.0);
    }
    let usual = Moments::of(a).rms;
    let sticks = sticking(stage, joint);
    let turns: Vec<f64> = v
        .iter()
        .zip(&envelope(a, reach))
        .zip(sticks)
        .map(|((v, here), sticks)| {
            let blurred = (ROUNDED * usual.max(*here) / cutoff_hz).max(slow);
            if v.abs() < blurred || sticks && v.abs() < creeping.max(4.0 * blurred) { 1.0 } else { 0.0 }
        })
        .collect();
    // What dry friction does there, the low-pass smears over the rows around.
    let smeared = treatment.keep(&envelope(&treatment.low_pass(&turns), reach));
    let turns = treatment.keep(&envelope(&turns, reach));
    let counts: Vec<f64> =
        stands.iter().zip(turns).map(|(stands, turns)| (1.0 - stands) * (1.0 - turns)).collect();
    let friction = dry + left_dry(stage, joint, channel, &counts);
    // A sample says of a jump between two of them no more than that. By half the time between samples it is early or late, times
    // the slope of the low-pass's answer, which is twice the cutoff times twice what the low-pass takes from the jump.
    let unresolved = treatment.keep(&envelope(&stage.ground.sharpening.unresolved[joint], reach));
    let hidden = treatment.keep(&envelope(&stage.ground.sharpening.more.torque[joint], reach));
    let off = unresolved
        .iter()
        .zip(hidden)
        .zip(smeared)
        .map(|((unresolved, hidden), smeared)| {
            (2.0 * cutoff_hz / rate_hz * unresolved).hypot(HIDDEN * hidden).hypot(friction * smeared)
        })
        .collect();
    Rows { counts, off }
}

/// By how much each row of `stage` may be off, by channel, where its model has the effects `found` and is `off` without them. Where their torques jump, as those of dry friction
/// do where a joint turns, the low-pass does not let the whole jump through; and where speeds that no encoder sees would turn them round, as where two coupled joints stand against
/// each other, they may be anything between.
pub(crate) fn off_with(stage: &Stage, found: &[Placed], off: &[Vec<f64>], seed: u64) -> Vec<Vec<f64>> {
    let treatment = &stage.ground.treatment;
    let reach = reach(treatment);
    let unseen = unseen_speeds(stage, &mut ChaCha8Rng::seed_from_u64(seed));
    let along = |way: f64| {
        let mut motion = stage.whole().clone();
        for (v, unseen) in motion.v.iter_mut().zip(&unseen) {
            v.iter_mut().zip(unseen).for_each(|(v, unseen)| *v += way * unseen);
        }
        stage.raw_torques(found, &motion)
    };
    let (Ok(less), Ok(as_seen), Ok(more)) = (along(-1.0), along(0.0), along(1.0)) else {
        // An arm that can't be leaves the rows as they are.
        return off.to_vec();
    };
    let of_channel = |(channel, off): (&Channel, &Vec<f64>)| match channel.kind {
        Kind::Torque(joint) => {
            let through = treatment.low_pass(&as_seen[joint]);
            let jumps: Vec<f64> = (0..through.len())
                .map(|k| {
                    let as_seen = as_seen[joint][k];
                    // What is in proportion to the speed is no jump.
                    (as_seen - through[k]).hypot(0.5 * (less[joint][k] + more[joint][k]) - as_seen)
                })
                .collect();
            let around = treatment.keep(&envelope(&jumps, reach));
            off.iter().zip(around).map(|(off, jump)| off.hypot(jump)).collect()
        }
        Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => off.clone(),
    };
    stage.channels.iter().zip(off).map(of_channel).collect()
}

/// The deviation between the courses that the effects `found` may take, by channel. Each row has the greatest deviation of the rows around it. `None` in a channel in which all effects
/// have one course.
pub(crate) fn apart_with(stage: &Stage, found: &[Placed]) -> Answer {
    let reach = reach(&stage.ground.treatment);
    let mut squares: Answer = vec![None; stage.channels.len()];
    for placed in found {
        let courses = placed.effect.courses().into_iter().map(|effect| Placed { effect, ..*placed });
        let answers: Vec<Answer> = courses.filter_map(|course| stage.answer(&course).ok()).collect();
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

/// Speeds that each joint of `stage` may have beside those that its encoder shows, on all grid points: what the encoder's noise makes of them, and those at which a joint stands.
fn unseen_speeds(stage: &Stage, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let (read, whole) = (misread_whole(stage, rng), stage.whole());
    let of_joint = |(read, v): (&Vec<f64>, &Vec<f64>)| {
        let creeping = normals(rng, v.len(), slowest(v));
        (0..v.len()).map(|k| read[k] - v[k] + creeping[k]).collect()
    };
    read.v.iter().zip(&whole.v).map(of_joint).collect()
}

/// Half a period of the low-pass's cutoff, in points: so far the low-pass smears a jump.
fn reach(treatment: &Treatment) -> usize {
    (treatment.rate_hz() / treatment.filter().cutoff_hz() / 2.0) as usize
}

/// The speed below which a joint with the speeds `v` stands still.
fn slowest(v: &[f64]) -> f64 {
    STANDING * v.iter().fold(0.0_f64, |most, v| most.max(v.abs()))
}

/// Dry friction of `joint` that the model leaves out, about: the step of its residual with the direction beside a constant and the speed, by least squares.
fn left_dry(stage: &Stage, joint: usize, channel: usize, counts: &[f64]) -> f64 {
    let v = &stage.motion().v[joint];
    let residual = stage.channels[channel].residual();
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for ((v, residual), counts) in v.iter().zip(residual).zip(counts) {
        let row = Vector3::new(1.0, *v, v.signum());
        normal += *counts * row * row.transpose();
        right += *counts * residual * row;
    }
    normal.cholesky().map_or(0.0, |factor| factor.solve(&right)[2].abs())
}

/// Whether `joint` stays where it is throughout, for all that its encoder sees.
pub(crate) fn rests(stage: &Stage, joint: usize) -> bool {
    span(&stage.whole().q[joint]) < STILL.max(2.0 * UNMOVED * stage.ground.noises.positions[joint].deviation)
}

/// True if something holds `joint`: it stands throughout, although the commands of `stage` would move it.
pub(crate) fn is_held(stage: &Stage, joint: usize) -> bool {
    let told = stage.ground.recording.q_ref.as_ref().and_then(|columns| columns.get(joint));
    rests(stage, joint) && told.is_some_and(|told| span(told) > STILL)
}

/// Where the encoder of `joint` sees no motion from one sample to the next.
fn sticking(stage: &Stage, joint: usize) -> Vec<bool> {
    let ground = stage.ground;
    let read = ground.treatment.whole_column(ground.recording, &ground.recording.q[joint]);
    let least = UNMOVED * ground.noises.positions[joint].deviation;
    let still = |k: usize, other: usize| read.get(other).is_some_and(|x| (x - read[k]).abs() < least);
    (0..read.len()).map(|k| still(k, k + 1) || still(k, k.wrapping_sub(1))).collect()
}

/// 1 within `reach` points of where the speed `v` stays below `slow` for longer than that, else 0.
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

/// The greatest size of `x` within `reach` points of each.
fn envelope(x: &[f64], reach: usize) -> Vec<f64> {
    let around = |k: usize| &x[k.saturating_sub(reach)..(k + reach + 1).min(x.len())];
    (0..x.len()).map(|k| around(k).iter().fold(0.0_f64, |most, x| most.max(x.abs()))).collect()
}
