//! The two ends of a run: [`PlantLink`] and [`ControllerLink`].

use std::time::Duration;

use crate::address::Address;
use crate::error::LinkError;
use crate::handshake::{Greeting, Hello, Offer, Welcome};
use crate::messages::{Command, State};

/// The plant's end of a run. Belongs to the thread that opened it. Dropping it ends the service.
pub struct PlantLink;

impl PlantLink {
    /// Opens the plant's end of the run at `address`, with `slots` slots for controllers.
    ///
    /// # Errors
    /// [`LinkError::NoRun`] if the run has ended; [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn open(address: &Address, slots: usize, offer: Offer) -> Result<Self, LinkError> {
        let _ = (address, slots, offer);
        unimplemented!()
    }

    /// Publishes `state` to everyone who listens. Never waits: who is slow loses the oldest states.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn publish(&mut self, state: &State) -> Result<(), LinkError> {
        let _ = state;
        unimplemented!()
    }

    /// The oldest command of `slot` not yet taken.
    ///
    /// # Errors
    /// [`LinkError::NoSlot`]; [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn next_command(&mut self, slot: usize) -> Result<Option<Command>, LinkError> {
        let _ = slot;
        unimplemented!()
    }

    /// Takes all commands of `slot` and returns the newest; the others are counted in [`PlantLink::skipped`].
    ///
    /// # Errors
    /// As [`PlantLink::next_command`].
    pub fn newest_command(&mut self, slot: usize) -> Result<Option<Command>, LinkError> {
        let _ = slot;
        unimplemented!()
    }

    /// How many commands of `slot` [`PlantLink::newest_command`] has passed over so far; 0 for a slot there is not.
    #[must_use]
    pub fn skipped(&self, slot: usize) -> u64 {
        let _ = slot;
        unimplemented!()
    }

    /// Answers every waiting hello: accepts it or says why not. Does not wait.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn greet(&mut self) -> Result<Vec<Greeting>, LinkError> {
        unimplemented!()
    }
}

/// A controller's end of a run. Belongs to the thread that opened it. Dropping it frees the slot.
pub struct ControllerLink;

impl ControllerLink {
    /// Finds the plant of the run at `address`, says `hello` until it answers or `patience` ends, and takes the slot.
    /// It does not matter who starts first.
    ///
    /// # Errors
    /// [`LinkError::NoRun`] if the run has ended; [`LinkError::NoPlant`] if nobody answers in time;
    /// [`LinkError::Refused`] with the reason; [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn connect(
        address: &Address,
        hello: Hello,
        patience: Duration,
    ) -> Result<(Self, Welcome), LinkError> {
        let _ = (address, hello, patience);
        unimplemented!()
    }

    /// The oldest state not yet taken. States lost because this side was slow are counted in [`ControllerLink::lost`].
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn next_state(&mut self) -> Result<Option<State>, LinkError> {
        unimplemented!()
    }

    /// Takes all waiting states and returns the newest; the others are counted in [`ControllerLink::skipped`].
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn newest_state(&mut self) -> Result<Option<State>, LinkError> {
        unimplemented!()
    }

    /// How many states this side has lost so far because its buffer was full.
    #[must_use]
    pub fn lost(&self) -> u64 {
        unimplemented!()
    }

    /// How many states [`ControllerLink::newest_state`] has passed over so far.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        unimplemented!()
    }

    /// Sends `command` to the plant. Never waits: if the plant does not take commands, the oldest are lost.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn send(&mut self, command: &Command) -> Result<(), LinkError> {
        let _ = command;
        unimplemented!()
    }
}
