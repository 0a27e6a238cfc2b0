//! The error of a model in one channel.

use serde::Serialize;

use crate::signals::channel::Kind;

/// Error of a model in one channel. Values without a unit of their own are in the channel's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelError {
    /// Name of the column.
    pub name: String,
    /// The measured quantity.
    #[serde(skip)]
    pub kind: Kind,
    /// `N*m`, `N`, `m` or `rad`.
    pub unit: &'static str,
    /// Name of the joint in the model; `None` for the tool.
    pub joint: Option<String>,
    /// Root mean square of measured minus model.
    pub rmse: f64,
    /// Root mean square of the measured signal.
    pub rms_measured: f64,
    /// `rmse / rms_measured`, a fraction: 1 is as bad as a model that always predicts zero. `None` if all measured values are zero.
    pub nrmse: Option<f64>,
    /// Standard deviation of the measured signal.
    pub std_measured: f64,
    /// `rmse / std_measured`, a fraction: 1 is as bad as a model that always predicts the mean. `None` if the measured signal is constant.
    pub nrmse_std: Option<f64>,
    /// `rmse` of the model without its nominal friction; `None` if the model has none for this joint.
    pub rmse_without_friction: Option<f64>,
    /// Mean of measured minus model.
    pub mean_error: f64,
    /// Standard deviation of measured minus model: `rmse` without the constant part.
    pub std_error: f64,
    /// Largest amount of measured minus model.
    pub max_error: f64,
    /// Standard deviation of the channel's own noise after the low-pass, estimated from its samples above the cutoff; `None` for positions compared with
    /// commanded ones, which no filter touches.
    pub noise: Option<f64>,
    /// Delay of the measured behind the commanded position, s; of command channels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag_s: Option<f64>,
}

impl ChannelError {
    /// Ratio of the error to the noise.
    pub fn times_noise(&self) -> Option<f64> {
        self.noise.filter(|noise| *noise > 0.0).map(|noise| self.rmse / noise)
    }
}
