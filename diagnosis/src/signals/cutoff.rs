//! The cutoff of the low-pass: the highest frequency at which the recorded motion still predicts the torque.
//!
//! The torque of a rigid arm grows with the square of the frequency of its motion, and so does the contribution of position noise. Two observations reveal this
//! noise. First, above the frequencies of an arm's motions a recording of positions has noise only: white noise, equally large in every band. Second, where the
//! motion requires more torque than was measured, and this torque is unrelated to the measured one, it is noise of any colour; a soft joint or a slow torque
//! sensor also reduces the torque, but in proportion. The second observation needs the first: a control loop closed over noisy positions reacts to their noise
//! as a slow sensor would react to a motion.
//!
//! Source: magnitude-squared coherence (Carter, Knapp & Nuttall 1973), here band by band in the time domain.

use freeplay_arm::Arm;
use freeplay_laws::rigid_torques;
use freeplay_recording::Recording;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::random::normals;
use crate::signals::filter::{LowPass, derivatives};
use crate::signals::missing::only;
use crate::signals::motion::{LEAST_CUTOFF, Treatment};
use crate::sorting::sort;
use crate::statistics::{Moments, difference};

/// Bands, each a third of an octave wide: the cutoff is not lowered by more than two octaves.
const BANDS: u8 = 6;
/// Greatest share of a torque's variance that motion noise may cause: 1 % is a tenth of the deviation, and adds half a per cent to the torque's residual.
const MOST_NOISE: f64 = 0.01;
/// A band holds noise if the motion requires this many times the measured power: a clipping drive removes less.
const FAR_MORE: f64 = 4.0;

/// The cutoff of `treatment`, Hz. The function lowers it where the motion noise in `recording` would cause too much torque along `arm`, or more than the motion
/// itself. The median joint decides, since a light wrist is no reason to blur the others.
pub(crate) fn cutoff_for(arm: &Arm, recording: &Recording, treatment: &Treatment) -> f64 {
    let (rate_hz, top_hz) = (treatment.rate_hz(), treatment.filter().cutoff_hz());
    let Some(measured) = recording.tau.as_ref() else { return top_hz };
    let cutoffs_hz = (0..=BANDS).rev().map(|third| top_hz / (f64::from(third) / 3.0).exp2());
    let passes: Vec<LowPass> = cutoffs_hz.filter_map(|hz| LowPass::new(rate_hz, hz).ok()).collect();
    let torques = rigid_torques(arm, &treatment.fine_motion(recording), None);
    let more = white_noise(recording, treatment);
    let noisy = rigid_torques(arm, &treatment.fine_motion_with(recording, &more), None);
    let joints: Vec<Vec<Noise>> = measured
        .iter()
        .zip(torques.iter().zip(&noisy))
        .filter(|(measured, _)| measured.iter().any(|torque| !torque.is_nan()))
        .map(|(measured, (model, noisy))| {
            let present = treatment.present(recording, measured);
            let below = |column: &[f64]| -> Vec<Vec<f64>> {
                let kept = passes.iter().map(|pass| treatment.keep(&treatment.through(pass, column)));
                kept.map(|column| only(&column, present.as_deref()).into_owned()).collect()
            };
            let white = difference(noisy, model);
            noise(&below(model), &below(&white), &below(&treatment.whole_column(recording, measured)))
        })
        .collect();
    let is_worth = |band: &usize| {
        let of_joints = |of: fn(&Noise) -> f64| middle(joints.iter().map(|joint| of(&joint[band - 1])));
        // Above the motions of an arm, a band is only of use for what it shows of friction and gaps.
        let is_idle = passes[*band].cutoff_hz() > LEAST_CUTOFF && of_joints(|noise| noise.of_band) > 0.5;
        of_joints(|noise| noise.below) < MOST_NOISE && !is_idle
    };
    let most = (1..passes.len()).take_while(is_worth).count();
    passes.get(most).map_or(top_hz, LowPass::cutoff_hz)
}

/// White noise of the level of the positions in the octave above the cutoff of `treatment`, by joint and grid point.
fn white_noise(recording: &Recording, treatment: &Treatment) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let of_joint = |q: &Vec<f64>| {
        let whole = treatment.whole_column(recording, q);
        let deviation = treatment.deviation_above(&whole, None);
        normals(&mut rng, whole.len(), deviation)
    };
    recording.q.iter().map(of_joint).collect()
}

/// The part of the model's torque that stems from noise of the recorded positions.
struct Noise {
    /// Share of the torque's variance, below the upper end of a band.
    below: f64,
    /// Share of the model's power in that band.
    of_band: f64,
}

/// The noise in the torque of `model`, at least the torque of `white` noise alone. The columns are filtered at increasing cutoffs; the result has an entry for
/// the band below each cutoff but the lowest.
fn noise(model: &[Vec<f64>], white: &[Vec<f64>], measured: &[Vec<f64>]) -> Vec<Noise> {
    let variance = |column: Option<&Vec<f64>>| column.map_or(0.0, |column| Moments::of(column).std.powi(2));
    let whole = variance(model.first()).max(variance(measured.last()));
    let band = |columns: &[Vec<f64>]| difference(&columns[1], &columns[0]);
    let mut sum = 0.0;
    let share = |noise: f64, of: f64| if of > 0.0 { noise / of } else { 0.0 };
    let bands = model.windows(2).zip(white.windows(2)).zip(measured.windows(2));
    bands
        .map(|((model, white), measured)| {
            let (asked, seen) = (band(model), band(measured));
            let [of_asked, of_white] = [&asked, &band(white)].map(|band| Moments::of(band).rms.powi(2));
            let noise = of_white.max(incoherent(&asked, &seen));
            sum += noise;
            Noise { below: share(sum, whole), of_band: share(noise, of_asked) }
        })
        .collect()
}

/// The power of the `asked` torque that is incoherent with the `seen` one, if it exceeds that by far.
fn incoherent(asked: &[f64], seen: &[f64]) -> f64 {
    let [of_asked, of_seen] = [asked, seen].map(|band| Moments::of(band).rms.powi(2));
    if of_asked > FAR_MORE * of_seen {
        ((1.0 - coherence(asked, seen)) * of_asked).min(of_asked - of_seen)
    } else {
        0.0
    }
}

/// Share of the square of `y` that `x` explains at any phase: regression on `x` and its derivative.
fn coherence(x: &[f64], y: &[f64]) -> f64 {
    let (quadrature, _) = derivatives(x, 1.0);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (xx, qq, xq) = (dot(x, x), dot(&quadrature, &quadrature), dot(x, &quadrature));
    let (xy, qy, yy) = (dot(x, y), dot(&quadrature, y), dot(y, y));
    let whole = (xx * qq - xq * xq) * yy;
    if whole > 0.0 {
        ((qq * xy * xy - 2.0 * xq * xy * qy + xx * qy * qy) / whole).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// The median of `values`, the greater of two; 0 if empty.
fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sort(&mut sorted);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}
