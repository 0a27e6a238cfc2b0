//! Choice: what more of the data leaves of the best answers of the search.

pub(crate) mod choose;
pub(crate) mod confirm;
