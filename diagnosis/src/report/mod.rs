//! The report: what a diagnosis says, as types and as sentences.

pub(crate) mod diagnosis;
pub(crate) mod settings;
pub(crate) mod words;
