//! The tests of the messages in shared memory, in one program: they are linked once, and run side by side on all cores.
#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod layout;
mod messages;
mod specification;
