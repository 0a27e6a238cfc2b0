//! Child processes that end with their owner.

use std::process::Child;

use crate::guard::Group;

/// A child process, with all that it has started if it is a group's; ended when this is dropped.
pub struct Running(pub Child, Option<Group>);

impl Running {
    /// `child`, which starts no processes of its own.
    pub fn alone(child: Child) -> Self {
        Self(child, None)
    }

    /// `child`, with all processes of its group if it has one.
    pub fn new(child: Child, group: Option<Group>) -> Self {
        Self(child, group)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Errors here mean that the child is gone already, which is what is wanted.
        let _ = self.0.kill();
        let _ = self.0.wait();
        drop(self.1.take());
    }
}
