//! Columns with missing samples: bridged, masked, or shortened.

use std::borrow::Cow;

/// `column`, sampled at `t`, with linear interpolation across missing samples; constant at its ends, zero if all samples are missing.
pub(crate) fn bridged<'c>(t: &[f64], column: &'c [f64]) -> Cow<'c, [f64]> {
    if !column.iter().any(|value| value.is_nan()) {
        return Cow::Borrowed(column);
    }
    let mut whole = column.to_vec();
    for run in runs(column) {
        let (before, after) = (run.start.checked_sub(1), Some(run.end).filter(|end| *end < column.len()));
        for k in run {
            whole[k] = match (before, after) {
                (Some(i), Some(j)) => column[i] + (column[j] - column[i]) * (t[k] - t[i]) / (t[j] - t[i]),
                (Some(i), None) | (None, Some(i)) => column[i],
                (None, None) => 0.0,
            };
        }
    }
    Cow::Owned(whole)
}

/// The runs of missing samples in `column`.
pub(super) fn runs(column: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut runs = Vec::new();
    let mut begin = 0;
    for run in column.chunk_by(|a, b| a.is_nan() == b.is_nan()) {
        if run[0].is_nan() {
            runs.push(begin..begin + run.len());
        }
        begin += run.len();
    }
    runs
}

/// The `values` that are `present`.
pub(crate) fn only<'v>(values: &'v [f64], present: Option<&[bool]>) -> Cow<'v, [f64]> {
    match present {
        None => Cow::Borrowed(values),
        Some(present) => Cow::Owned(
            values.iter().zip(present).filter(|(_, present)| **present).map(|(value, _)| *value).collect(),
        ),
    }
}

/// `values` with zeros for those that are not `present`.
pub(crate) fn masked(mut values: Vec<f64>, present: Option<&[bool]>) -> Vec<f64> {
    if let Some(present) = present {
        values.iter_mut().zip(present).filter(|(_, present)| !**present).for_each(|(value, _)| *value = 0.0);
    }
    values
}
