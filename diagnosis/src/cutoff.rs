//! How far up a recorded motion says what the torque was: the cutoff of the low-pass.
//!
//! The torque of a rigid arm grows with the square of the frequency of its motion, and so does what the noise of positions makes of it. Where a
//! motion asks for more torque than was measured, and for one that has nothing to do with the measured one, it is noise; a soft joint or a slow
//! torque sensor takes torque away, too, but in proportion.
//!
//! Source: magnitude-squared coherence (Carter, Knapp & Nuttall 1973), here band by band in the time domain.

use freeplay_arm::Arm;
use freeplay_laws::rigid_torques;
use freeplay_recording::Recording;

use crate::filter::{LowPass, derivatives};
use crate::motion::{LEAST_CUTOFF, Treatment};
use crate::presence::only;
use crate::statistics::Moments;

/// Bands of the two octaves by which the cutoff is lowered at most, each a third of an octave wide.
const BANDS: u8 = 6;
/// Most of a torque's variance that the noise of the motion may make: a tenth of its deviation.
const MOST_ASTRAY: f64 = 0.01;
/// A band holds noise where the motion asks for this many times the power that was measured: a drive that clips takes less away.
const FAR_MORE: f64 = 4.0;
/// It holds nothing else where this share of that power has nothing to do with what was measured.
const NOTHING_ELSE: f64 = 0.8;

/// The cutoff of `treatment`, Hz, lowered where noise of the motion in `recording` would make too much torque along `arm`: in the middle one of
/// its joints, since a light wrist is no reason to blur the others.
pub(crate) fn cutoff_for(arm: &Arm, recording: &Recording, treatment: &Treatment) -> f64 {
    let (rate_hz, top_hz) = (treatment.rate_hz(), treatment.filter().cutoff_hz());
    let Some(measured) = recording.tau.as_ref() else { return top_hz };
    let cutoffs_hz =
        (0..=BANDS).rev().map(|third| top_hz / (2.0 * f64::from(third) / f64::from(BANDS)).exp2());
    let passes: Vec<LowPass> = cutoffs_hz.filter_map(|hz| LowPass::new(rate_hz, hz).ok()).collect();
    let torques = rigid_torques(arm, &treatment.fine_motion(recording), None);
    let below = |column: &[f64]| -> Vec<Vec<f64>> {
        passes.iter().map(|pass| treatment.keep(&treatment.through(pass, column))).collect()
    };
    let joints: Vec<Vec<Astray>> = measured
        .iter()
        .zip(&torques)
        .filter(|(measured, _)| measured.iter().any(|torque| !torque.is_nan()))
        .map(|(measured, model)| {
            let present = treatment.present(recording, measured);
            let of = |columns: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
                columns.iter().map(|column| only(column, present.as_deref()).into_owned()).collect()
            };
            astray(&of(below(model)), &of(below(&treatment.whole_column(recording, measured))))
        })
        .collect();
    let is_worth = |band: &usize| {
        let of_joints = |of: fn(&Astray) -> f64| middle(joints.iter().map(|joint| of(&joint[band - 1])));
        // Above the motions of an arm a band is kept for what it shows of friction and gaps alone.
        let is_idle =
            passes[*band].cutoff_hz() > LEAST_CUTOFF && of_joints(|astray| astray.of_band) > NOTHING_ELSE;
        of_joints(|astray| astray.below) < MOST_ASTRAY && !is_idle
    };
    let most = (1..passes.len()).take_while(is_worth).count();
    passes.get(most).map_or(top_hz, LowPass::cutoff_hz)
}

/// How much a model has astray from a measured torque: power that exceeds the measured one by far and is not coherent with it.
struct Astray {
    /// As a share of the torque's variance, below the upper end of a band.
    below: f64,
    /// As a share of what the model has in that band.
    of_band: f64,
}

/// What `model` has astray from `measured`, both below each of the cutoffs from the lowest on, up to each but that one.
fn astray(model: &[Vec<f64>], measured: &[Vec<f64>]) -> Vec<Astray> {
    let variance = |column: Option<&Vec<f64>>| column.map_or(0.0, |column| Moments::of(column).std.powi(2));
    let whole = variance(model.first()).max(variance(measured.last()));
    let band = |columns: &[Vec<f64>]| -> Vec<f64> {
        columns[1].iter().zip(&columns[0]).map(|(high, low)| high - low).collect()
    };
    let mut sum = 0.0;
    model
        .windows(2)
        .zip(measured.windows(2))
        .map(|(model, measured)| {
            let (asked, seen) = (band(model), band(measured));
            let [of_asked, of_seen] = [&asked, &seen].map(|band| Moments::of(band).rms.powi(2));
            let mut of_band = 0.0;
            if of_asked > FAR_MORE * of_seen {
                let incoherent = ((1.0 - coherence(&asked, &seen)) * of_asked).min(of_asked - of_seen);
                (sum, of_band) = (sum + incoherent, incoherent / of_asked);
            }
            Astray { below: if whole > 0.0 { sum / whole } else { 0.0 }, of_band }
        })
        .collect()
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
