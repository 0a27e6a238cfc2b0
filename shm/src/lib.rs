//! What crosses the process boundary: messages, links over iceoryx2, handshake, pacing.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`RunFolder`]: the folder of one run on tmpfs; whoever starts a run holds it, dropping it leaves nothing behind.
//! - [`Address`]: what another process needs to find that run; travels in `FREEPLAY_RUN` or `--run`.
//! - [`Hello`]: what a controller says first; its layout is frozen for all time.
//! - [`Welcome`]: what the plant answers, with a [`Verdict`]; its layout is frozen for all time.
//! - [`Offer`]: what the plant tells every controller about the run.
//! - [`Greeting`]: what the plant learns about a controller that knocked.
//! - [`State`]: the arm at one tick, from the plant to everyone who listens; holds a [`Reference`].
//! - [`Command`]: the answer of one controller to one state.
//! - [`MessageFault`]: why a message is not to be used.
//! - [`PlantLink`]: the plant's end: publishes states, greets controllers, takes commands slot by slot.
//! - [`Foreign`]: commands for a slot that did not come from its seat.
//! - [`ControllerLink`]: a controller's end: takes states, sends commands.
//! - [`LinkError`]: why a link could not be opened or used, with the remedy.
//! - [`Schedule`], [`Arrival`], [`now_ns`], [`sleep_then_spin_until`]: the wall clock of a paced run.
//! - [`Backoff`]: how a lockstep run waits for its peer.
//! - [`RtRequest`], [`RtReport`]: priority, affinity and memory locking, asked for, reported, never required.
//! - [`layout::Layout`], [`layout_text::markdown`], [`layout_text::c_header`]: the messages described, for other languages.
//! - [`BarePlant`], [`BareController`]: iceoryx2 alone with the same messages, to measure the links against.
//! - [`Machine`]: the facts that timing depends on, stamped into every result.
//!
//! This is the only crate that names iceoryx2.

pub mod address;
pub mod bare;
pub mod controller_link;
mod cores;
pub mod error;
pub mod handshake;
pub mod layout;
pub mod layout_text;
mod limits;
pub mod machine;
pub mod messages;
mod open_folder;
mod outbox;
pub mod pacing;
pub mod plant_link;
pub mod realtime;
pub mod run_folder;
mod seat;
mod segments;
pub mod services;

pub use address::{Address, RUN_ENV};
pub use bare::{BareController, BarePlant};
pub use controller_link::ControllerLink;
pub use error::LinkError;
pub use handshake::{Greeting, Hello, Offer, Pace, Verdict, Welcome};
pub use limits::MAX_SLOTS;
pub use machine::Machine;
pub use messages::{
    Command, CommandKind, CommandStatus, Joints, LAYOUT_VERSION, MAGIC, MAX_JOINTS, MessageFault, Mode,
    Reference, State,
};
pub use pacing::{Arrival, Backoff, Schedule, now_ns, sleep_then_spin_until};
pub use plant_link::{Foreign, PlantLink};
pub use realtime::{Outcome, RtReport, RtRequest, prepare};
pub use run_folder::{RunFolder, SHM_ENV};
pub use segments::ROOM;
pub use services::{COMMAND_BUFFER, MEMORY, STATE_BUFFER};
