//! The reasons for which a sample is not taken.

/// Why a sample is not taken. The predictor is unchanged, but a sample is missing: repeat it or reset.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PushError {
    /// A sample has another number of channels.
    #[error("{given} {kind} values for {channels} channels")]
    WrongLength {
        /// `input`, `planned input` or `output`.
        kind: &'static str,
        /// Values given.
        given: usize,
        /// Channels of the model.
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
    /// The model looks at the inputs of the predicted instant, and they are not given (or the reverse).
    #[error(
        "inputs at the predicted instant: the model uses them: {used}, they are given: {given}; call the matching push"
    )]
    Planned {
        /// Whether the model uses them.
        used: bool,
        /// Whether they are given.
        given: bool,
    },
    /// The network's output overflowed. This sample *is* taken; its prediction counts as unknown.
    #[error("prediction of output channel {channel} is {value}: reset the predictor")]
    NonFinitePrediction {
        /// Index of the channel.
        channel: usize,
        /// The value.
        value: f64,
    },
}
