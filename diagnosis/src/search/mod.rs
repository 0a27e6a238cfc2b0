//! Search: the set of effects under which the data are most probable.

pub(crate) mod moves;
pub(crate) mod tried;
