//! The outcome of a reading: its evidence and the residual of each channel.

use nalgebra::Vector3;

use super::change::Change;

/// Least share of the rigid arm in a channel's variance for the channel to be evidence on its reading: with less, friction dominates. A fault leaves a larger
/// residual in some channel.
pub(crate) const SPOKEN: f64 = 0.1;

/// The outcome of a reading: its changes, their evidence, and the residual of each channel.
#[derive(Clone)]
pub(crate) struct Outcome {
    pub changes: Vec<Change>,
    /// ln p(S), up to a constant.
    pub evidence: f64,
    /// Log-likelihood of each channel, a term of the evidence, in the order of `left`; 0 for a missing channel.
    pub likelihood: Vec<f64>,
    /// Relative mean square residual of each channel: the torques by joint (NaN where none), then the tool.
    pub left: Vec<f64>,
    /// The size of each channel: variance of the recorded column plus the gravity that the reading adds.
    pub sizes: Vec<f64>,
    /// Floor of the mean square residual of each channel: smaller residuals don't count.
    pub floors: Vec<f64>,
    /// Variance of the rigid arm's torque over that of the recorded one, in the same order: a channel of friction alone is no evidence on its reading.
    pub spoken: Vec<f64>,
    /// Gravity, m/s².
    pub gravity: Vector3<f64>,
    /// Measured torque over the model's, by joint.
    pub scale: Vec<f64>,
    /// The recorded channel of each entry, in the order of `likelihood`: the torques by column, then the tool.
    pub sources: Vec<usize>,
}

impl Outcome {
    /// The changes of the reading among its changes.
    pub fn readings(&self) -> Vec<Change> {
        self.changes.iter().copied().filter(Change::is_reading).collect()
    }

    /// Returns true if a machine can have these changes.
    pub fn is_possible(&self) -> bool {
        self.evidence > f64::NEG_INFINITY
    }

    /// Mean square residual of channel `c`, in its own unit.
    pub fn square(&self, c: usize) -> f64 {
        self.left[c] * self.sizes[c]
    }

    /// Reduction of the evidence by the changes: price of the fitted parameters minus log prior odds.
    pub fn price(&self) -> f64 {
        self.likelihood.iter().sum::<f64>() - self.evidence
    }
}
