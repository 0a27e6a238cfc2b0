//! The curves of a comparison as columns of a Parquet file, for pandas and the like.

use std::path::Path;

use freeplay_diagnosis::Residuals;
use freeplay_terminal::exit::Failure;

/// Writes `residuals` to the Parquet file `path`: `t` in s, `stretch`, the number of the gap-free stretch that contains the point, and for each channel
/// `NAME_measured` and `NAME_model` in the channel's unit, both NaN without a measurement.
///
/// # Errors
/// A file that can't be written.
pub fn write(residuals: &Residuals, path: &Path) -> Result<(), Failure> {
    let mut stretch = vec![f64::NAN; residuals.t.len()];
    for (number, points) in residuals.stretches.iter().enumerate() {
        stretch[points.clone()].fill(number as f64);
    }
    let mut named = vec![("t".to_owned(), residuals.t.clone()), ("stretch".to_owned(), stretch)];
    for channel in &residuals.channels {
        let present = |values: &[f64]| match &channel.present {
            None => values.to_vec(),
            Some(present) => values
                .iter()
                .zip(present)
                .map(|(value, present)| if *present { *value } else { f64::NAN })
                .collect(),
        };
        named.push((format!("{}_measured", channel.name), present(&channel.measured)));
        named.push((format!("{}_model", channel.name), present(&channel.model)));
    }
    let columns: Vec<(String, &[f64])> =
        named.iter().map(|(name, values)| (name.clone(), values.as_slice())).collect();
    freeplay_recording::export_columns(&columns, path).map_err(Failure::input)?;
    Ok(())
}
