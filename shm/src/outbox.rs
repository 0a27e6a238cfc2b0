//! [`Outbox`]: sends messages of one kind, with the memory for the next one already at hand.

use std::fmt::{self, Debug, Formatter};
use std::mem::MaybeUninit;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{LoanError, SendError};
use iceoryx2::prelude::{ZeroCopySend, ipc};
use iceoryx2::sample_mut_uninit::SampleMutUninit;

/// Between processes, each port used by one thread.
pub(crate) type Ipc = ipc::Service;

/// The sending end of a service. It loans the memory for the next message right after sending one, while the peer is at
/// work, so that sending is but writing and handing over.
pub(crate) struct Outbox<Message: Debug + ZeroCopySend + 'static> {
    // Dropped before the publisher it is loaned from.
    next: Option<SampleMutUninit<Ipc, MaybeUninit<Message>, ()>>,
    publisher: Publisher<Ipc, Message, ()>,
}

impl<Message: Debug + Copy + ZeroCopySend + 'static> Outbox<Message> {
    /// An outbox that sends by `publisher`.
    pub(crate) fn new(publisher: Publisher<Ipc, Message, ()>) -> Self {
        Self { next: publisher.loan_uninit().ok(), publisher }
    }

    /// Writes `message` into shared memory and hands it to everybody who listens.
    ///
    /// When peers come or go, iceoryx2 may fail to connect to one of them and then sends to none; a second attempt does
    /// without it.
    #[inline]
    pub(crate) fn send(&mut self, message: &Message) -> Result<(), SendError> {
        let sent = match self.send_once(message) {
            Err(SendError::ConnectionError(_)) => self.send_once(message),
            sent => sent,
        };
        // What cannot be loaned now is loaned, or told, when it is needed.
        self.next = self.publisher.loan_uninit().ok();
        sent
    }

    /// Opens the shared memory of peers that have come and closes that of peers that have gone. What fails is tried again
    /// when the next message is sent.
    pub(crate) fn meet_peers(&self) {
        let _ = self.publisher.update_connections();
    }

    #[inline]
    fn send_once(&mut self, message: &Message) -> Result<(), SendError> {
        let memory = match self.next.take() {
            Some(memory) => memory,
            None => self.loan().map_err(SendError::LoanError)?,
        };
        memory.write_payload(*message).send().map(|_receivers| ())
    }

    #[cold]
    fn loan(&self) -> Result<SampleMutUninit<Ipc, MaybeUninit<Message>, ()>, LoanError> {
        self.publisher.loan_uninit()
    }
}

impl<Message: Debug + ZeroCopySend> Debug for Outbox<Message> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("Outbox").field("publisher", &self.publisher).finish_non_exhaustive()
    }
}
