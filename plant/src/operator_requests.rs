//! What a person asks of a plant that runs: handed to the loop through a queue, heard at the start of a tick.

use std::sync::Arc;

use crossbeam::queue::ArrayQueue;
use serde::{Deserialize, Serialize};

/// One request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperatorRequest {
    /// The controller in this slot is to be in charge, from the first tick on at which its answer passes. Ignored where there is
    /// no such slot.
    Swap {
        /// The slot.
        to: usize,
    },
    /// The next answer of who is in charge is to be spoiled: its first value becomes NaN before the gate sees it.
    Spoil,
    /// From this tick on, the number of marks in the recording is one more.
    Mark,
}

/// So many requests can wait at once.
const WAITING: usize = 64;

/// The queue of requests, shared by the loop and by whoever asks.
#[derive(Clone, Debug)]
pub struct OperatorRequests(Arc<ArrayQueue<OperatorRequest>>);

impl Default for OperatorRequests {
    fn default() -> Self {
        Self(Arc::new(ArrayQueue::new(WAITING)))
    }
}

impl OperatorRequests {
    /// Asks for `request`; `false` if too many wait already.
    pub fn ask(&self, request: OperatorRequest) -> bool {
        self.0.push(request).is_ok()
    }

    /// The request that has waited longest.
    pub(crate) fn next(&self) -> Option<OperatorRequest> {
        self.0.pop()
    }
}
