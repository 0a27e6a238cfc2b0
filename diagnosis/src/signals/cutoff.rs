//! How far up a recorded motion says what the torque was: the cutoff of the low-pass.
//!
//! The torque of a rigid arm grows with the square of the frequency of its motion, and so does what the noise of positions makes of it. Two things tell that
//! noise. Above the motions of an arm a recording of positions has nothing else: white noise as large as there is in every band. And where a motion asks for more torque
//! than was measured, and for one that has nothing to do with the measured one, it is noise of whatever colour; a soft joint or a slow torque sensor takes torque away, too, but in proportion.
//! The first is needed beside the second: a loop that is closed over noisy positions answers their noise as a slow sensor would answer a motion.
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
use crate::statistics::{Moments, Quantile, difference};

/// Bands, each a third of an octave wide: the cutoff is not lowered by more than two octaves.
const BANDS: u8 = 6;
/// Most of a torque's variance that the noise of the motion may make: 1 % is a tenth of its deviation, and adds half a per cent to what is left of a torque.
const MOST_NOISE: f64 = 0.01;
/// A band holds noise where the motion asks for this many times the power that was measured: a drive that clips takes less away.
const FAR_MORE: f64 = 4.0;

/// The cutoff of `treatment`, Hz, lowered where noise of the motion in `recording` would make too much torque along `arm`, or more than the motion itself: in the
/// middle one of its joints, since a light wrist is no reason to blur the others.
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
        // Above the motions of an arm a band is kept for what it shows of friction and gaps alone.
        let is_idle = passes[*band].cutoff_hz() > LEAST_CUTOFF && of_joints(|noise| noise.of_band) > 0.5;
        of_joints(|noise| noise.below) < MOST_NOISE && !is_idle
    };
    let most = (1..passes.len()).take_while(is_worth).count();
    passes.get(most).map_or(top_hz, LowPass::cutoff_hz)
}

/// White noise as large as that of the positions in the octave above the cutoff of `treatment`, by joint and grid point.
fn white_noise(recording: &Recording, treatment: &Treatment) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let of_joint = |q: &Vec<f64>| {
        let whole = treatment.whole_column(recording, q);
        let deviation = treatment.deviation_above(&whole, None, Quantile::Median);
        normals(&mut rng, whole.len(), deviation)
    };
    recording.q.iter().map(of_joint).collect()
}

/// The part of the model's torque that the noise of the recorded positions makes.
struct Noise {
    /// As a share of the torque's variance, below the upper end of a band.
    below: f64,
    /// As a share of what the model has in that band.
    of_band: f64,
}

/// The noise in what `model` asks for, where `white` noise alone would ask for so much: below each of the cutoffs from the lowest on, and in the band up to each but that one.
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

/// The power that was `asked` for and exceeds what was `seen` by far, as far as it has nothing to do with it.
fn incoherent(asked: &[f64], seen: &[f64]) -> f64 {
    let [of_asked, of_seen] = [asked, seen].map(|band| Moments::of(band).rms.powi(2));
    if of_asked > FAR_MORE * of_seen {
        ((1.0 - coherence(asked, seen)) * of_asked).min(of_asked - of_seen)
    } else {
        0.0
    }
}

/// Share of the square of `y` that `x` says in whatever phase: regression on `x` and its derivative.
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

/// The middle one of `values`, the greater of two; 0 of none.
fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}
