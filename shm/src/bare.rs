//! iceoryx2 alone with its default settings and the same messages, as a baseline for the links of this crate.
//!
//! This transport has no checks, no handshake, no counters and no seats. Both ends copy each message as a user does, and loan the memory
//! for the next message in advance, as the links do. With `send_copy` the loan would lie between the two time stamps of a message, and
//! the links would seem faster than the transport under them.

use std::fmt::Debug;
use std::mem::MaybeUninit;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    FileName, LogLevel, Path, SemanticString, ServiceName, SignalHandlingMode, ZeroCopySend,
    set_log_level_from_env_or,
};
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use crate::address::Address;
use crate::error::LinkError;
use crate::messages::{Command, State};
use crate::outbox::Ipc;
use crate::services::transport;

const STATES: &str = "state";
const COMMANDS: &str = "command";

/// The plant's end.
pub struct BarePlant {
    states: PreloanedPublisher<State>,
    commands: Subscriber<Ipc, Command, ()>,
    _node: Node<Ipc>,
}

/// The controller's end.
pub struct BareController {
    states: Subscriber<Ipc, State, ()>,
    commands: PreloanedPublisher<Command>,
    _node: Node<Ipc>,
}

impl BarePlant {
    /// Opens the plant's end in the run at `address`, whether the other end exists or not.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn open(address: &Address) -> Result<Self, LinkError> {
        let node = node(address)?;
        let states = service(&node, STATES)?.publisher_builder().create();
        let commands = service(&node, COMMANDS)?.subscriber_builder().create();
        Ok(Self {
            states: PreloanedPublisher::of(states.map_err(transport("publish on", STATES))?, STATES)?,
            commands: commands.map_err(transport("subscribe to", COMMANDS))?,
            _node: node,
        })
    }

    /// Publishes `state`.
    ///
    /// # Errors
    /// See [`BarePlant::open`].
    #[inline]
    pub fn publish(&mut self, state: &State) -> Result<(), LinkError> {
        self.states.send(state, STATES)
    }

    /// Takes the oldest unread command.
    ///
    /// # Errors
    /// See [`BarePlant::open`].
    #[inline]
    pub fn next_command(&self) -> Result<Option<Command>, LinkError> {
        let command = self.commands.receive().map_err(transport("take commands of", COMMANDS))?;
        Ok(command.map(|command| *command.payload()))
    }
}

impl BareController {
    /// Opens the controller's end in the run at `address`, whether the other end exists or not.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn open(address: &Address) -> Result<Self, LinkError> {
        let node = node(address)?;
        let states = service(&node, STATES)?.subscriber_builder().create();
        let commands = service(&node, COMMANDS)?.publisher_builder().create();
        Ok(Self {
            states: states.map_err(transport("subscribe to", STATES))?,
            commands: PreloanedPublisher::of(commands.map_err(transport("publish on", COMMANDS))?, COMMANDS)?,
            _node: node,
        })
    }

    /// Takes the oldest unread state.
    ///
    /// # Errors
    /// See [`BareController::open`].
    #[inline]
    pub fn next_state(&self) -> Result<Option<State>, LinkError> {
        let state = self.states.receive().map_err(transport("take states of", STATES))?;
        Ok(state.map(|state| *state.payload()))
    }

    /// Sends `command`.
    ///
    /// # Errors
    /// See [`BareController::open`].
    #[inline]
    pub fn send(&mut self, command: &Command) -> Result<(), LinkError> {
        self.commands.send(command, COMMANDS)
    }
}

/// A publisher that loans the memory for its next message in advance.
struct PreloanedPublisher<Message: Debug + ZeroCopySend + 'static> {
    // The sample must drop before the publisher that loaned it.
    next: Option<SampleMutUninit<Ipc, MaybeUninit<Message>, ()>>,
    publisher: Publisher<Ipc, Message, ()>,
}

impl<Message: Debug + Copy + ZeroCopySend + 'static> PreloanedPublisher<Message> {
    fn of(publisher: Publisher<Ipc, Message, ()>, service: &str) -> Result<Self, LinkError> {
        let next = Some(publisher.loan_uninit().map_err(transport("loan memory of", service))?);
        Ok(Self { next, publisher })
    }

    #[inline]
    fn send(&mut self, message: &Message, service: &str) -> Result<(), LinkError> {
        if let Some(memory) = self.next.take() {
            memory.write_payload(*message).send().map_err(transport("publish on", service))?;
        }
        self.next = Some(self.publisher.loan_uninit().map_err(transport("loan memory of", service))?);
        Ok(())
    }
}

fn node(address: &Address) -> Result<Node<Ipc>, LinkError> {
    set_log_level_from_env_or(LogLevel::Fatal);
    let bad_address = |_| LinkError::BadAddress { text: address.to_string() };
    let mut config = Config::default();
    let root = Path::new(address.root().as_os_str().as_encoded_bytes()).map_err(bad_address)?;
    config.global.set_root_path(&root);
    config.global.prefix = FileName::new(address.prefix().as_bytes()).map_err(bad_address)?;
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create()
        .map_err(transport("create the node of", "this process"))
}

fn service<Message: Debug + ZeroCopySend>(
    node: &Node<Ipc>,
    name: &str,
) -> Result<PortFactory<Ipc, Message, ()>, LinkError> {
    let full = ServiceName::new(name).map_err(transport("name", name))?;
    node.service_builder(&full)
        .publish_subscribe::<Message>()
        .open_or_create()
        .map_err(transport("make", name))
}
