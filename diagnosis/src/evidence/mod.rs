//! Evidence: the linear model, its bounded least squares, and the probability of the data under it.

pub(crate) mod block;
pub(crate) mod bvls;
pub(crate) mod gain;
pub(crate) mod nameless;
pub(crate) mod parabola;
pub(crate) mod system;
pub(crate) mod tails;
