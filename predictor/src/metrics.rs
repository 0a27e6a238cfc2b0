//! Quality of predictions, per output channel.
//!
//! # Formulas
//! MSE = mean (ŷ − y)², R = correlation of ŷ and y (Pearson), skill = 1 − MSE / MSE of the best baseline (A. H. Murphy,
//! "Skill scores based on the mean square error", Monthly Weather Review 116, 1988, with the best of several references). A skill
//! of 1 is perfect, 0 equals the baseline, below 0 is worse. R alone is not sufficient: persistence reaches 0.999 on slowly
//! varying outputs.

use crate::series::Series;
use crate::split::Split;
use crate::window::{Window, targets};
use serde::Serialize;

/// Scores of one output channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Number of scored predictions.
    pub count: usize,
    /// Mean squared error, in the output's unit squared; NaN without predictions.
    pub mse: f64,
    /// Correlation of prediction and truth; `None` if one of them is constant.
    pub r: Option<f64>,
    /// Largest absolute error, in the output's unit.
    pub max: f64,
}

/// One result per part of a split.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parts<T> {
    /// On the training windows.
    pub train: T,
    /// On the validation windows, which stop the training.
    pub validation: T,
    /// On the test windows.
    pub test: T,
}

/// The lists differ in length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "{predictions} predicted and {truths} true values of {channels} channels, mask of {mask}: they must match"
)]
pub struct ShapeError {
    /// Number of predicted values.
    pub predictions: usize,
    /// Number of true values.
    pub truths: usize,
    /// Number of channels.
    pub channels: usize,
    /// Rows of the mask; without a mask, rows of the true values.
    pub mask: usize,
}

/// Scores row-major `prediction` against row-major `truth`, channel by channel, over the rows with a true `mask` (all rows
/// without a mask). Separate masks give, for example, the scores in steady contact and around detachments.
///
/// # Errors
/// If the lists differ in length.
pub fn score(
    truth: &[f64],
    prediction: &[f64],
    channels: usize,
    mask: Option<&[bool]>,
) -> Result<Vec<Score>, ShapeError> {
    let rows = truth.len().checked_div(channels).unwrap_or(0);
    let mask_rows = mask.map_or(rows, <[bool]>::len);
    if truth.len() != prediction.len() || rows * channels != truth.len() || mask_rows != rows {
        let (predictions, truths) = (prediction.len(), truth.len());
        return Err(ShapeError { predictions, truths, channels, mask: mask_rows });
    }
    let wanted = |row: usize| mask.is_none_or(|mask| mask[row]);
    let channel = |c: usize| {
        let pairs = (0..rows).filter(|&row| wanted(row)).map(move |row| row * channels + c);
        score_channel(pairs.map(|at| (truth[at], prediction[at])))
    };
    Ok((0..channels).map(channel).collect())
}

/// Skill of a model against the best of several baselines, per channel: 1 − MSE / (smallest baseline MSE).
///
/// The result is `None` if the best baseline is perfect or unknown.
#[must_use]
pub fn skill(model: &[Score], baselines: &[&[Score]]) -> Vec<Option<f64>> {
    let of_channel = |(channel, model): (usize, &Score)| {
        let best =
            baselines.iter().filter_map(|b| b.get(channel)).map(|b| b.mse).fold(f64::INFINITY, f64::min);
        (best > 0.0 && best.is_finite()).then(|| 1.0 - model.mse / best)
    };
    model.iter().enumerate().map(of_channel).collect()
}

/// Scores a predictor on the three parts of a split.
///
/// # Errors
/// Any error of `predict`.
///
/// # Panics
/// If `predict` returns a number of values other than windows × outputs.
pub fn by_part<E>(
    series: &Series,
    split: &Split,
    mut predict: impl FnMut(&[Window]) -> Result<Vec<f64>, E>,
) -> Result<Parts<Vec<Score>>, E> {
    let mut part = |windows: &[Window]| {
        let scores = score(&targets(series, windows), &predict(windows)?, series.outputs(), None);
        Ok(scores.expect("a predictor answers every window once"))
    };
    Ok(Parts { train: part(&split.train)?, validation: part(&split.validation)?, test: part(&split.test)? })
}

#[expect(clippy::cast_precision_loss)]
fn score_channel(pairs: impl Iterator<Item = (f64, f64)>) -> Score {
    let (mut count, mut squares, mut max) = (0_usize, 0.0, 0.0_f64);
    let (mut means, mut spread) = ([0.0; 2], [0.0; 3]);
    for (truth, prediction) in pairs {
        count += 1;
        let error = prediction - truth;
        squares += error * error;
        max = max.max(error.abs());
        // Running means and co-moments (Welford 1962) avoid cancellation for small variations around a large value.
        let delta = [truth - means[0], prediction - means[1]];
        means[0] += delta[0] / count as f64;
        means[1] += delta[1] / count as f64;
        spread[0] += delta[0] * (truth - means[0]);
        spread[1] += delta[1] * (prediction - means[1]);
        spread[2] += delta[0] * (prediction - means[1]);
    }
    let scale = (spread[0] * spread[1]).sqrt();
    let r = (scale > 0.0).then(|| (spread[2] / scale).clamp(-1.0, 1.0));
    Score { count, mse: squares / count as f64, r, max }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_equal_their_closed_forms() {
        // Channel 0: ŷ = y + 0.1 (R = 1, MSE 0.01); channel 1: ŷ = −y (R = −1); channel 2: constant truth.
        let truth: Vec<f64> = (0..50).flat_map(|i| [f64::from(i), f64::from(i % 7) - 3.0, 4.0]).collect();
        let prediction: Vec<f64> = truth.chunks(3).flat_map(|y| [y[0] + 0.1, -y[1], y[2]]).collect();
        let scores = score(&truth, &prediction, 3, None).unwrap();
        assert!((scores[0].mse - 0.01).abs() < 1.0e-12 && (scores[0].max - 0.1).abs() < 1.0e-12);
        assert!((scores[0].r.unwrap() - 1.0).abs() < 1.0e-12 && (scores[1].r.unwrap() + 1.0).abs() < 1.0e-12);
        assert_eq!((scores[2].r, scores[2].mse, scores[2].count), (None, 0.0, 50));
    }

    #[test]
    fn correlation_survives_a_large_offset() {
        let truth: Vec<f64> = (0..100).map(|i| 1.0e6 + 1.0e-4 * f64::from(i).sin()).collect();
        let prediction: Vec<f64> = (0..100).map(|i| 1.0e6 + 1.0e-4 * f64::from(i).sin() + 1.0e-5).collect();
        let r = score(&truth, &prediction, 1, None).unwrap()[0].r.unwrap();
        eprintln!("1 - R = {:.1e}", 1.0 - r);
        assert!((1.0 - r).abs() < 1.0e-9);
    }

    #[test]
    fn a_mask_scores_only_its_rows() {
        let (truth, prediction) = ([0.0, 0.0, 0.0], [1.0, 2.0, 3.0]);
        let masked = score(&truth, &prediction, 1, Some(&[true, false, true])).unwrap();
        assert_eq!((masked[0].count, masked[0].mse, masked[0].max), (2, 5.0, 3.0));
        let nothing = score(&truth, &prediction, 1, Some(&[false; 3])).unwrap();
        assert!(nothing[0].mse.is_nan() && nothing[0].count == 0);
        assert!(score(&truth, &prediction, 1, Some(&[true])).is_err());
        assert!(score(&truth, &prediction[..2], 1, None).is_err());
        assert!(score(&truth, &prediction, 2, None).is_err());
    }

    #[test]
    fn skill_is_against_the_best_baseline() {
        let with = |mse| vec![Score { count: 1, mse, r: None, max: 0.0 }];
        assert_eq!(skill(&with(0.25), &[&with(4.0), &with(0.5)]), [Some(0.5)]);
        assert_eq!(skill(&with(2.0), &[&with(1.0)]), [Some(-1.0)]);
        assert_eq!(skill(&with(2.0), &[&with(0.0), &with(1.0)]), [None]);
        assert_eq!(skill(&with(2.0), &[]), [None]);
    }
}
