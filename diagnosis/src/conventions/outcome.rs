//! A reading of a recording has an outcome: how probable it is, and what it leaves of each channel.

use nalgebra::Vector3;

use super::change::Change;

/// Share of a channel's variance that the rigid arm has to make for the channel to speak of its reading: with less, friction decides how it looks. A fault
/// leaves more than this of some channel.
pub(crate) const SPOKEN: f64 = 0.1;

/// The outcome of a reading: its changes, their evidence, and what they leave of each channel.
#[derive(Clone)]
pub(crate) struct Outcome {
    pub changes: Vec<Change>,
    /// ln p(S), up to a constant.
    pub evidence: f64,
    /// Each channel adds this log-likelihood to the evidence, in the order of `left`; a channel that is missing adds 0.
    pub likelihood: Vec<f64>,
    /// Mean square of what is left of each channel over its size: the torques by joint (NaN where none), then the tool.
    pub left: Vec<f64>,
    /// The size of each channel: variance of what was recorded, with the gravity that the reading adds to it.
    pub sizes: Vec<f64>,
    /// Mean square of each channel below which nothing is asked.
    pub floors: Vec<f64>,
    /// Variance of what the rigid arm asks for over that of what was recorded, in the same order: a channel of friction alone shows
    /// nothing of how it is to be read.
    pub spoken: Vec<f64>,
    /// Gravity, m/s².
    pub gravity: Vector3<f64>,
    /// Measured torque over the model's, by joint.
    pub scale: Vec<f64>,
    /// The recorded channel of each, in the order of `likelihood`: the torques by column, then the tool.
    pub sources: Vec<usize>,
}

impl Outcome {
    /// Its changes that are of the reading.
    pub fn readings(&self) -> Vec<Change> {
        self.changes.iter().copied().filter(Change::is_reading).collect()
    }

    /// True if a machine can be as its changes have it.
    pub fn is_possible(&self) -> bool {
        self.evidence > f64::NEG_INFINITY
    }

    /// Mean square of what is left of channel `c`, in its own unit.
    pub fn square(&self, c: usize) -> f64 {
        self.left[c] * self.sizes[c]
    }

    /// The changes lower the evidence by this price: for fitted numbers and for their odds before the data.
    pub fn price(&self) -> f64 {
        self.likelihood.iter().sum::<f64>() - self.evidence
    }
}
