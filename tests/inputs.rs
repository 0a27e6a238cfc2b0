//! What bad input does to a call of the real binary.
