//! Reference motions: where the tool or the joints should be, when.
