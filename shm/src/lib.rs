//! Communication between processes: messages, links over iceoryx2, handshake, pacing.
//!
//! The nouns, in the order in which data passes through them:
//!
//! - [`RunFolder`]: the folder of one run on tmpfs; the process that starts a run owns it, and dropping it removes everything.
//! - [`Address`]: the information with which another process finds that run; passed in `FREEPLAY_RUN` or `--run`.
//! - [`Hello`]: first message of a controller; its layout is frozen permanently.
//! - [`Welcome`]: answer of the plant, with a [`Verdict`]; its layout is frozen permanently.
//! - [`Offer`]: description of the run that the plant sends to every controller.
//! - [`Greeting`]: result of a handshake on the plant's side.
//! - [`State`]: the arm at one tick, from the plant to all subscribers; contains a [`Reference`].
//! - [`Command`]: the answer of one controller to one state.
//! - [`MessageFault`]: reason why a message is invalid.
//! - [`PlantLink`]: the plant's end: publishes states, greets controllers, reads commands slot by slot.
//! - [`Foreign`]: commands for a slot from a process that does not hold its seat.
//! - [`ControllerLink`]: a controller's end: reads states, sends commands.
//! - [`LinkError`]: reason why a link could not be opened or used, with the remedy.
//! - [`Schedule`], [`Arrival`], [`now_ns`], [`sleep_then_spin_until`]: the wall clock of a paced run.
//! - [`Backoff`]: waiting strategy of a lockstep run for its peer.
//! - [`RtRequest`], [`RtReport`]: priority, affinity and memory locking: requested and reported, never required.
//! - [`layout::Layout`], [`layout_text::markdown`], [`layout_text::c_header`]: the messages described, for other languages.
//! - [`BarePlant`], [`BareController`]: iceoryx2 alone with the same messages, a baseline for the links.
//! - [`Machine`]: properties of the machine that affect timing, stored with every result.
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
