//! Child processes that end with their owner.

use std::process::Child;

use crate::guard::Group;

/// A child process, with its whole group if it has one; dropping it ends them.
pub struct Running(pub Child, Option<Group>);

impl Running {
    /// `child`, without child processes of its own.
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
        // An error means that the child has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
        drop(self.1.take());
    }
}
