//! Signals: a recording on a uniform grid after the zero-phase filter, and the parts of its channels beyond the model.

pub(crate) mod channel;
pub(crate) mod cutoff;
pub(crate) mod filter;
pub(crate) mod grid;
pub(crate) mod initial_state;
pub(crate) mod law_grid;
pub(crate) mod long;
pub(crate) mod missing;
pub(crate) mod motion;
pub(crate) mod presence;
pub(crate) mod residual;
pub(crate) mod rest;
pub(crate) mod stamps;
pub(crate) mod stuck;
