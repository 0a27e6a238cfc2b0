//! `freeplay run --live`: a run seen while it goes on, and taken a hand in.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`Observer`]: sums up what the recorder's thread of the plant's process sees of the ticks; the loop knows nothing of it.
//! - [`LiveSnapshot`]: what is worth seeing of a run a few times a second; a line of JSON on the plant's standard output.
//! - [`Console`]: the plant's end of the talk with its parent: snapshots out, requests in.
//! - [`Dashboard`]: what the parent has seen of a run so far; [`draw()`] makes a picture of it.
//! - [`Action`]: what a key asks for.
//! - [`Watch`]: a run that is watched: the terminal with its keys, or plain lines where there is none.

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

/// Time between two pictures. Where there are no cores to spare one is drawn on those of the loop: it takes a millisecond or two, and what it
/// leaves in the caches is felt in the ticks beside it. So seldom, that stays below one tick in a hundred, and p99 what it is without.
const PICTURE: std::time::Duration = std::time::Duration::from_millis(250);
