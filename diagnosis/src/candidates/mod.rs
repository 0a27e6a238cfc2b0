//! Candidates: each effect of the catalogue at each place and in each form, as columns of a linear model.

pub(crate) mod candidate;
pub(crate) mod transients;
pub(crate) mod windows;
