//! The truth: an arm with play, stepped in time, and the process that plays the machine.
