//! Evidence: the linear model, its bounded least squares, and how probable the data are under it.

pub(crate) mod block;
pub(crate) mod bvls;
pub(crate) mod gain;
pub(crate) mod nameless;
pub(crate) mod system;
pub(crate) mod tails;
