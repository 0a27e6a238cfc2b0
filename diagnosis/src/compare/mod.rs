//! The comparison of a recording with a model, channel by channel.

pub(crate) mod channel_error;
pub(crate) mod comparison;
pub(crate) mod curves;
pub(crate) mod notes;
pub(crate) mod tally;
