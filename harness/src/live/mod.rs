//! `freeplay run --live`: live view of a run, with keys that control it.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Observer`]: collects statistics of the ticks on the recorder's thread of the plant's process, without involving the loop.
//! - [`LiveSnapshot`]: the data of a run a few times a second; a line of JSON on the plant's standard output.
//! - [`Console`]: communication of the plant with its parent: snapshots out, requests in.
//! - [`Dashboard`]: the data of a run so far, in the parent; [`draw()`] draws it.
//! - [`Action`]: action of a key.
//! - [`Watch`]: the view of a run: a terminal with keys, or plain lines without a terminal.

mod console;
mod dashboard;
mod draw;
mod keys;
mod observer;
mod snapshot;
mod watch;

pub use console::Console;
pub use dashboard::{ControllerState, Dashboard, Title};
pub use draw::draw;
pub use keys::Action;
pub use observer::Observer;
pub use snapshot::{ContactMode, LiveSnapshot, PlaySnapshot, StageSnapshot};
pub use watch::Watch;

/// Time between two pictures. Without spare cores, the drawing shares the cores of the loop. It takes a millisecond or two and displaces data
/// from the caches, which slows the neighbouring ticks. At this interval it affects less than one tick in a hundred and leaves p99 unchanged.
const PICTURE: std::time::Duration = std::time::Duration::from_millis(250);
