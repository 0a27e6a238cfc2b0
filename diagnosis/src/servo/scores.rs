//! Errors on the test part: of the model as given, of a plain lag, of nameless filters and of the identified servos.

use std::collections::BTreeMap;

use freeplay_recording::Group;
use freeplay_servo::Track;

use super::parts::Rows;
use super::tracks::median_step;
use crate::evidence::gain::Gain;
use crate::report::diagnosis::Rmse;
use crate::statistics::{bootstrap, difference};

/// Length of a block of rows that counts as independent, s: many lags of a servo, whose response takes up to 0.2 s.
pub const BLOCK: f64 = 2.0;

/// Deviations of one model, `[recording][joint][row]`: measured minus model.
pub type Deviations = Vec<Vec<Vec<f64>>>;

/// Measured minus `model`, `[joint][row]`.
pub fn deviations(track: &Track, model: &[Vec<f64>]) -> Vec<Vec<f64>> {
    track.measured.iter().zip(model).map(|(q, model)| difference(q, model)).collect()
}

/// Root mean square of each joint's channel on `parts`, by the name of its column.
pub fn errors(of: &Deviations, parts: &[Rows]) -> BTreeMap<String, Rmse> {
    let joints = of.first().map_or(0, Vec::len);
    (0..joints)
        .map(|joint| (Group::Position.column(joint), Rmse { rmse: rms(of, parts, &[joint]) }))
        .collect()
}

/// Root mean square of the channels of `joints` on `parts`.
pub fn rms(of: &Deviations, parts: &[Rows], joints: &[usize]) -> f64 {
    let (square, count) = blocks(of, parts, joints, f64::INFINITY)
        .into_iter()
        .fold((0.0, 0.0), |sum, (square, count)| (sum.0 + square, sum.1 + count));
    if count > 0.0 { f64::sqrt(square / count) } else { 0.0 }
}

/// Sum of squares and number of rows in each block of `parts`.
fn blocks(of: &Deviations, parts: &[Rows], joints: &[usize], rows: f64) -> Vec<(f64, f64)> {
    let mut blocks = Vec::new();
    for (index, part) in parts {
        let length = if rows.is_finite() { (rows as usize).max(1) } else { part.len().max(1) };
        for begin in part.clone().step_by(length) {
            let mut block = (0.0, 0.0);
            for joint in joints {
                let column = &of[*index][*joint][begin..part.end.min(begin + length)];
                column.iter().filter(|r| r.is_finite()).for_each(|r| {
                    block.0 += r * r;
                    block.1 += 1.0;
                });
            }
            blocks.push(block);
        }
    }
    blocks
}

/// Share of the error of `before` that `after` removes on `parts`, over the channels of `joints`, with a 95 % interval from resampled blocks.
pub fn gain(
    [before, after]: [&Deviations; 2],
    parts: &[Rows],
    joints: &[usize],
    tracks: &[Track],
    seed: u64,
) -> Gain {
    let step = tracks.iter().map(median_step).fold(f64::INFINITY, f64::min);
    let rows = (BLOCK / step).max(1.0);
    let before = blocks(before, parts, joints, rows);
    let after = blocks(after, parts, joints, rows);
    let share = |picked: &mut dyn Iterator<Item = usize>| {
        let (b, a) = picked.fold((0.0, 0.0), |sum, at| (sum.0 + before[at].0, sum.1 + after[at].0));
        if b > 0.0 { 1.0 - f64::sqrt(a / b) } else { 0.0 }
    };
    let value = share(&mut (0..before.len()));
    Gain { value, ci95: bootstrap(before.len(), seed, share) }
}
