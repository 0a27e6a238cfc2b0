//! Noise and rounding of a recording, estimated from its samples.

use freeplay_recording::Recording;

use crate::data::columns::dot;
use crate::signals::channel::{Channel, Kind};
use crate::signals::missing::only;
use crate::signals::motion::Treatment;
use crate::sorting::sort;
use crate::statistics::{FINEST, difference, span, white_noise};

/// Least noise of a torque, as a share of what the torque spans: a current sensor of twelve bits resolves 2.4·10⁻⁴. No model is more exact, and this noise stands in for
/// the noise that a simulated recording lacks.
const FINEST_TORQUE: f64 = 3e-4;
/// Least noise of a tracked tool, m: laser trackers have some micrometres. This noise stands in for the noise that a simulated recording lacks.
const FINEST_TOOL: f64 = 2e-6;
/// Least noise of a link encoder, rad (m): an encoder of 22 bits has steps of 1.5·10⁻⁶ rad. This noise stands in for the noise that a simulated recording lacks.
const FINEST_LINK: f64 = 1e-6;

/// Noise of one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Noise {
    /// Standard deviation of a sample, rounding included, unit of the column.
    pub deviation: f64,
    /// Step of rounding; 0 if none is seen.
    pub step: f64,
}

impl Noise {
    /// The noise of a column: `samples` on an even grid, and the `raw` recorded values, which still show the rounding. Fourth differences suppress smooth
    /// motion, and their median tolerates a few jumps (Hampel 1974).
    pub fn of(samples: &[f64], raw: &[f64]) -> Self {
        let step = rounding(raw);
        let least = (step / 12_f64.sqrt()).max(FINEST * span(samples));
        Self { deviation: white_noise(samples).max(least), step }
    }
}

/// The noise of the measured columns of one recording.
#[derive(Clone, Debug)]
pub(crate) struct Noises {
    /// Of the joint encoders.
    pub positions: Vec<Noise>,
    /// Of each channel.
    pub channels: Vec<Noise>,
}

impl Noises {
    /// The noise of `recording` in the `channels` that are compared with a model; `sharp` holds the part of the model's torques above the low-pass.
    pub fn of(
        recording: &Recording,
        treatment: &Treatment,
        channels: &[Channel],
        sharp: &[Vec<f64>],
    ) -> Self {
        let whole = |column: &[f64]| treatment.whole_column(recording, column);
        let positions = recording.q.iter().map(|q| Noise::of(&whole(q), q)).collect();
        let measured = |kind: Kind| match kind {
            Kind::Torque(joint) => recording.tau.as_ref().map(|tau| &tau[joint]),
            Kind::Tool(axis) => recording.tool.as_ref().map(|tool| &tool[axis]),
            Kind::Link(joint) => recording.q_link[joint].as_ref(),
            Kind::Position(joint) => Some(&recording.q[joint]),
        };
        let of_channel = |channel: &Channel| {
            let Some(column) = measured(channel.kind) else { return Noise { deviation: 0.0, step: 0.0 } };
            let (whole, present) = (whole(column), treatment.whole_present(recording, column));
            let present = present.as_deref();
            let read: Vec<f64> = column.iter().copied().filter(|value| !value.is_nan()).collect();
            let fine = Noise::of(&only(&whole, present), &read);
            // A tracker that samples more slowly than the recorder has noise that neighbouring samples share. Physical jumps of a torque are no noise, and in
            // some motions they occur half of the time.
            let above = match channel.kind {
                Kind::Torque(joint) => {
                    let beside: Vec<f64> = difference(&whole, &sharp[joint]);
                    treatment.quiet_deviation_above([&whole, &beside], present)
                }
                Kind::Tool(_) | Kind::Link(_) | Kind::Position(_) => {
                    treatment.deviation_above(&whole, present)
                }
            };
            let finest = match channel.kind {
                Kind::Torque(_) => FINEST_TORQUE * span(&read),
                Kind::Tool(_) => FINEST_TOOL,
                Kind::Link(_) | Kind::Position(_) => FINEST_LINK,
            };
            Noise { deviation: fine.deviation.max(above).max(finest), ..fine }
        };
        Self { positions, channels: channels.iter().map(of_channel).collect() }
    }
}

/// Greatest multiple of the step that the smallest change of a column may be: a larger smallest change reveals no step, since near the step of rounding every
/// number is a multiple.
const MOST_STEPS: u8 = 64;
/// Least and greatest number of changes, the smallest ones first, for estimating a step: fewer can be multiples of a step by chance, and larger changes contain
/// too many steps for exactness.
const CHANGES: [usize; 2] = [16, 128];
/// Greatest distance between a change and a multiple of the step, in steps; values printed with few digits are no exact multiples.
const OFF: f64 = 0.1;

/// The step of which nearly all samples are multiples; 0 without a clear step.
fn rounding(samples: &[f64]) -> f64 {
    let mut changes: Vec<f64> =
        samples.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|change| *change > 0.0).collect();
    let [fewest, most] = CHANGES;
    if changes.len() < fewest {
        return 0.0;
    }
    sort(&mut changes);
    // Without a few glitches.
    let glitches = (changes.len() / 50).min(4);
    let near = &changes[glitches..changes.len().min(glitches + most)];
    // A joint that rarely moves slowly shows no single step.
    let candidates = (1..=MOST_STEPS).map(|times| near[0] / f64::from(times));
    candidates.map(|step| refined(step, near)).find(|step| are_multiples(near, *step)).unwrap_or(0.0)
}

/// Least-squares estimate of `step` from its multiples `changes`.
fn refined(step: f64, changes: &[f64]) -> f64 {
    let sums = changes.iter().fold([0.0, 0.0], |[both, squares], change| {
        let times = (change / step).round();
        [both + times * change, squares + times * times]
    });
    sums[0] / sums[1].max(f64::MIN_POSITIVE)
}

/// Returns true if nine of ten `changes` are multiples of `step` and thereby differ: at a steady speed all changes are alike.
fn are_multiples(changes: &[f64], step: f64) -> bool {
    let off = |change: f64| change - (change / step).round() * step;
    let near: Vec<f64> = changes
        .iter()
        .copied()
        .filter(|change| *change > 0.5 * step && off(*change).abs() < OFF * step)
        .collect();
    let mean = near.iter().sum::<f64>() / near.len().max(1) as f64;
    let [beside, apart] = near.iter().fold([0.0, 0.0], |[beside, apart], change| {
        [beside + off(*change).powi(2), apart + (change - mean).powi(2)]
    });
    near.len() * 10 > changes.len() * 9 && beside <= 0.01 * apart + 1e-8 * mean * mean * near.len() as f64
}

/// Effective number of independent samples of `x`, whose mean is zero: n/(1 + 2Σρ_k). The sum ends where the autocorrelation first falls below zero (Geyer
/// 1992, initial positive sequence).
pub(crate) fn effective_samples(x: &[f64]) -> f64 {
    let n = x.len();
    let power: f64 = x.iter().map(|x| x * x).sum();
    if n < 8 || power <= 0.0 {
        return n as f64;
    }
    let mut sum = 0.0;
    for lag in 1..n / 4 {
        let rho = dot(&x[lag..], &x[..n - lag]) / power;
        if rho <= 0.0 {
            break;
        }
        sum += rho;
    }
    n as f64 / (1.0 + 2.0 * sum)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{Noise, effective_samples};
    use crate::random::normals;

    #[test]
    fn noise_is_found_under_a_motion() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let noise = normals(&mut rng, 4000, 0.02);
        let motion = |k: usize| 5.0 * (k as f64 * 0.02).sin();
        let samples: Vec<f64> = noise.iter().enumerate().map(|(k, e)| motion(k) + e).collect();
        let seen = Noise::of(&samples, &samples);
        println!("{seen:?} for 0.02");
        assert!((seen.deviation / 0.02 - 1.0).abs() < 0.05 && seen.step == 0.0);
        let rounded: Vec<f64> =
            noise.iter().enumerate().map(|(k, e)| ((motion(k) + e) / 0.01).round() * 0.01).collect();
        let seen = Noise::of(&rounded, &rounded);
        println!("{seen:?} for steps of 0.01");
        assert!((seen.step / 0.01 - 1.0).abs() < 0.02);
    }

    /// An encoder sampled at speed: two neighbouring samples never differ by a single step.
    #[test]
    fn a_step_is_found_without_slow_motion() {
        let step = 4e-6;
        let read = |k: usize| ((2e-4 * (k as f64 * 0.02).sin() + 2e-5 * k as f64) / step).round() * step;
        let samples: Vec<f64> = (0..300).map(read).map(|x| (x * 1e6).round() * 1e-6).collect();
        let least = samples.windows(2).map(|w| w[1] - w[0]).fold(f64::MAX, f64::min);
        let seen = Noise::of(&samples, &samples);
        println!("{:.3e}, the least change is {:.1} steps", seen.step, least / step);
        assert!((seen.step / step - 1.0).abs() < 1e-3 && least > 2.0 * step);
        let smooth: Vec<f64> = (0..300).map(|k| (k as f64 * 0.02).sin() + 0.01 * k as f64).collect();
        assert!(Noise::of(&smooth, &smooth).step == 0.0, "a motion that is not rounded");
    }

    /// A first-order process of coefficient r has n(1 − r)/(1 + r) effective samples: the closed form.
    #[test]
    fn coloured_samples_are_worth_less() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut x = 0.0;
        let coloured: Vec<f64> = normals(&mut rng, 40_000, 1.0)
            .into_iter()
            .map(|e| {
                x = 0.8 * x + e;
                x
            })
            .collect();
        let (worth, exact) = (effective_samples(&coloured), 40_000.0 / 9.0);
        println!("{worth:.0} against {exact:.0}");
        assert!((worth / exact - 1.0).abs() < 0.15);
    }
}
