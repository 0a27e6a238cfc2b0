//! The report: the result of a diagnosis, as types and as sentences.

pub(crate) mod diagnosis;
pub(crate) mod settings;
pub(crate) mod words;
