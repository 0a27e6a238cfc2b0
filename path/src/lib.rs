//! Reference motions: where the tool or the joints should be, when.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`PathSpec`]: a path as a scenario describes it (kind, centre, size, period, laps…), with its [`SpecError`].

mod spec;

pub use spec::{
    LARGEST_BLEND, LONGEST_DURATION, PathKind, PathSpec, SHORTEST_PERIOD, SMALLEST_BLEND, Size, SpecError,
};
