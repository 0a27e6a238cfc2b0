//! Findings: the laws that the test part of the data confirms, with intervals, alternatives and errors.

pub(crate) mod alternatives;
pub(crate) mod conclude;
pub(crate) mod event;
pub(crate) mod event_search;
pub(crate) mod held;
pub(crate) mod interval;
pub(crate) mod joined;
pub(crate) mod locate;
pub(crate) mod passage;
pub(crate) mod recording_quality;
pub(crate) mod standing;
pub(crate) mod variables;
