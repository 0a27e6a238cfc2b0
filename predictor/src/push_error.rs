//! Errors of refused samples.

/// Reasons why the predictor refuses a sample. The predictor stays unchanged, but a sample is missing: repeat it or reset.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PushError {
    /// The number of channels of a sample is wrong.
    #[error("{given} {kind} values for {channels} channels")]
    WrongLength {
        /// `input`, `planned input` or `output`.
        kind: &'static str,
        /// Number of given values.
        given: usize,
        /// Number of channels of the model.
        channels: usize,
    },
    /// A value is NaN or infinite.
    #[error("{kind} channel {channel} is {value}: only finite samples can be used")]
    NonFinite {
        /// `input`, `planned input` or `output`.
        kind: &'static str,
        /// Index of the channel.
        channel: usize,
        /// The value.
        value: f64,
    },
    /// The model uses the inputs of the predicted instant, and they are not given (or the reverse).
    #[error(
        "inputs at the predicted instant: the model uses them: {used}, they are given: {given}; call the matching push"
    )]
    Planned {
        /// True if the model uses them.
        used: bool,
        /// True if they are given.
        given: bool,
    },
    /// The network's output overflowed. The predictor has taken this sample; its prediction counts as unknown.
    #[error("prediction of output channel {channel} is {value}: reset the predictor")]
    NonFinitePrediction {
        /// Index of the channel.
        channel: usize,
        /// The value.
        value: f64,
    },
}
