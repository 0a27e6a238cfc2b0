//! Requests of a user to a running plant: a queue passes them to the loop, which handles them at the start of a tick.

use std::sync::Arc;

use crossbeam::queue::ArrayQueue;
use serde::{Deserialize, Serialize};

/// One request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperatorRequest {
    /// Makes the controller in this slot active, from the first tick at which its answer passes. The plant ignores a slot that does not
    /// exist.
    Swap {
        /// The slot.
        to: usize,
    },
    /// Corrupts the next answer of the active controller: its first value becomes NaN before the gate checks it.
    Spoil,
    /// Increments the number of marks in the recording from this tick on.
    Mark,
}

/// Capacity of the queue of requests.
const WAITING: usize = 64;

/// The queue of requests, shared by the loop and its users.
#[derive(Clone, Debug)]
pub struct OperatorRequests(Arc<ArrayQueue<OperatorRequest>>);

impl Default for OperatorRequests {
    fn default() -> Self {
        Self(Arc::new(ArrayQueue::new(WAITING)))
    }
}

impl OperatorRequests {
    /// Adds `request` to the queue; `false` if the queue is full.
    pub fn ask(&self, request: OperatorRequest) -> bool {
        self.0.push(request).is_ok()
    }

    /// The oldest request.
    pub(crate) fn next(&self) -> Option<OperatorRequest> {
        self.0.pop()
    }
}
