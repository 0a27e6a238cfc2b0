//! Choice: the confirmation of the best answers of the search by more of the data.

pub(crate) mod choose;
pub(crate) mod confirm;
