//! The `freeplay` command.
fn main() {}
