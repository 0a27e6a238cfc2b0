//! [`Outbox`]: sends messages of one type; the memory for the next message is loaned in advance.

use std::fmt::{self, Debug, Formatter};
use std::mem::MaybeUninit;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{LoanError, SendError};
use iceoryx2::prelude::{ZeroCopySend, ipc};
use iceoryx2::sample_mut_uninit::SampleMutUninit;

/// Communication between processes; one thread uses each port.
pub(crate) type Ipc = ipc::Service;

/// The sending end of a service. It loans the memory for the next message right after sending one, while the peer works, so that
/// sending needs only writing and handing over.
pub(crate) struct Outbox<Message: Debug + ZeroCopySend + 'static> {
    // The sample must drop before the publisher that loaned it.
    next: Option<SampleMutUninit<Ipc, MaybeUninit<Message>, ()>>,
    publisher: Publisher<Ipc, Message, ()>,
}

impl<Message: Debug + Copy + ZeroCopySend + 'static> Outbox<Message> {
    /// Creates an outbox that sends through `publisher`.
    pub(crate) fn new(publisher: Publisher<Ipc, Message, ()>) -> Self {
        Self { next: publisher.loan_uninit().ok(), publisher }
    }

    /// Writes `message` into shared memory and sends it to all subscribers.
    ///
    /// When peers come or go, iceoryx2 may fail to connect to one of them and then sends to none; a second attempt skips that
    /// peer.
    #[inline]
    pub(crate) fn send(&mut self, message: &Message) -> Result<(), SendError> {
        let sent = match self.send_once(message) {
            Err(SendError::ConnectionError(_)) => self.send_once(message),
            sent => sent,
        };
        // If the loan fails now, the next send retries it and reports the error.
        self.next = self.publisher.loan_uninit().ok();
        sent
    }

    /// Opens the shared memory of new peers and closes that of peers that have gone. The next message retries failed connections.
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
