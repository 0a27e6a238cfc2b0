//! Search: which effects together make the data most probable.

pub(crate) mod moves;
pub(crate) mod tried;
