//! The laws of a joint with play: pure functions of numbers, one file a law.
