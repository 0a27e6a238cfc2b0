//! How much each row of a channel counts: little where what it holds is beyond what the model and the samples can say.

use freeplay_laws::DriveFriction;

use super::stage::Stage;
use crate::presence::masked;
use crate::residual::Kind;
use crate::statistics::Moments;

/// A joint slower than this share of its greatest speed for longer than the filter remembers stands still, unless its encoder sees it creep: what
/// its dry friction does then, no motion tells.
const STANDING: f64 = 2e-3;
/// The low-pass with the cutoff f_c rounds the corner of a speed where a joint starts to stick or to slip: by about this times the
/// acceleration over f_c. A slower joint may as well stick, with any dry friction up to its own.
const ROUNDED: f64 = 0.05;
/// A joint whose position changes by less than this many standard deviations of its encoder's noise from one sample to the next may stick…
const UNMOVED: f64 = 4.5;
/// …unless the low-pass makes its speed more than this many times what it may make of a corner.
const LONGEST: f64 = 4.0;
/// A joint that stands for more than this share of the time is judged at rest.
const MOSTLY: f64 = 0.9;
/// Share of what a sharper look at the motion adds to the model's torque that a still sharper one may add.
const HIDDEN: f64 = 0.1;

/// What the samples and the model can say of each row of a channel.
pub(crate) struct Counted {
    /// How much it counts, 0 to 1.
    pub rows: Vec<f64>,
    /// By how much a perfect model may be off there, in the channel's unit, times that.
    pub doubt: Vec<f64>,
}

impl Counted {
    fn none(points: usize) -> Self {
        Self { rows: vec![0.0; points], doubt: vec![0.0; points] }
    }

    fn all(points: usize) -> Self {
        Self { rows: vec![1.0; points], doubt: vec![0.0; points] }
    }

    /// Of rows where the joint stands as `standing` says, with noise of the deviation `white` and what a model may be `off`. Of a motion that is
    /// only planned no noise is known: every row in which the joint moves counts.
    fn of(standing: &[f64], white: f64, off: &[f64]) -> Self {
        let share = |off: f64| if white > 0.0 { white / white.hypot(off) } else { 1.0 };
        let moving = |(standing, off): (&f64, &f64)| (1.0 - standing) * share(*off);
        let rows: Vec<f64> = standing.iter().zip(off).map(moving).collect();
        let doubt = rows.iter().zip(off).map(|(row, off)| row * off).collect();
        Self { rows, doubt }
    }
}

/// How much each row of the channel number `channel` of `stage` counts, 0 to 1: nothing where it is missing; of a torque, nothing if it is stuck or while its joint stands; the less, the
/// more the dry friction that the model knows is undecided, where the joint sticks or turns; the less, the faster the model's torque
/// changes for the rate; and the less, the more of it the low-pass on the motion hides.
pub(crate) fn rows_that_count(stage: &Stage, channel: usize) -> Counted {
    let present = stage.channels[channel].present.as_deref();
    let Counted { rows, doubt } = measured_rows_that_count(stage, channel);
    Counted { rows: masked(rows, present), doubt: masked(doubt, present) }
}

/// The same, were nothing missing.
fn measured_rows_that_count(stage: &Stage, channel: usize) -> Counted {
    let points = stage.motion().len();
    let Kind::Torque(joint) = stage.channels[channel].kind else { return Counted::all(points) };
    if stage.ground.is_stuck(Kind::Torque(joint)) {
        return Counted::none(points);
    }
    let (v, a) = (&stage.whole().v[joint], &stage.whole().a[joint]);
    let treatment = &stage.ground.treatment;
    let (rate_hz, cutoff_hz) = (treatment.rate_hz(), treatment.filter().cutoff_hz());
    let reach = (rate_hz / cutoff_hz / 2.0) as usize;
    let slow = STANDING * v.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    // Seen to creep, and to which side, within the filter's memory.
    let creeping = UNMOVED * stage.ground.noises.positions[joint].deviation * rate_hz / reach.max(1) as f64;
    let dry = DriveFriction::nominal(stage.arm().joints()[joint].friction).coulomb;
    if dry > 0.0 && rests(stage, joint) {
        return Counted::none(points);
    }
    // Where it turns, and not on the whole: a joint that goes straight to and fro turns in a small part of its time.
    let usual = Moments::of(a).rms;
    let blurred = |here: &f64| (ROUNDED * usual.max(*here) / cutoff_hz).max(slow);
    let sticks = sticking(stage, joint);
    let undecided: Vec<f64> = v
        .iter()
        .zip(&envelope(a, reach))
        .zip(sticks)
        .map(|((v, here), sticks)| {
            let most = if sticks { LONGEST * blurred(here) } else { blurred(here) };
            if v.abs() < most { dry } else { 0.0 }
        })
        .collect();
    // A sample says of a jump between two of them no more than that. By half the time between samples it is early or late, times
    // the slope of the low-pass's answer, which is twice the cutoff times twice what the low-pass takes from the jump.
    let unresolved = &stage.ground.sharpening.unresolved[joint];
    let white = stage.ground.noises.channels[channel].deviation * (2.0 * cutoff_hz / rate_hz).sqrt();
    let stands = treatment.keep(&standing(v, slow.min(creeping), reach));
    // A joint that hardly ever moves still carries its load: all that is not friction shows there.
    if Moments::of(&stands).mean > MOSTLY {
        return Counted::all(points);
    }
    let hidden = &stage.ground.sharpening.more.torque[joint];
    let off: Vec<f64> = treatment
        .keep(&envelope(&treatment.low_pass(&undecided), reach))
        .iter()
        .zip(treatment.keep(&envelope(unresolved, reach)))
        .zip(treatment.keep(&envelope(hidden, reach)))
        .map(|((undecided, unresolved), hidden)| {
            undecided.hypot(2.0 * cutoff_hz / rate_hz * unresolved).hypot(HIDDEN * hidden)
        })
        .collect();
    Counted::of(&stands, white, &off)
}

/// Whether `joint` stays where it is throughout, for all that its encoder sees.
fn rests(stage: &Stage, joint: usize) -> bool {
    let (least, most) =
        stage.whole().q[joint].iter().fold((f64::MAX, f64::MIN), |(a, b), q| (a.min(*q), b.max(*q)));
    most - least < 2.0 * UNMOVED * stage.ground.noises.positions[joint].deviation
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
