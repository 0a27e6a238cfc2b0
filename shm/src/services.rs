//! The iceoryx2 services of a run, each declared in one place.
//!
//! The creator of a service fixes its settings. The plant creates all services, the hello service last; controllers only open them, by
//! name and type and without requesting settings. A controller of another version can therefore neither spoil a run nor miss the reason
//! for its refusal.
//!
//! | service | pattern | payload |
//! | --- | --- | --- |
//! | `freeplay/state` | publish-subscribe, 1 publisher, up to 8 subscribers | [`State`] |
//! | `freeplay/command/<slot>` | publish-subscribe, 1 publisher, 1 subscriber | [`Command`] |
//! | `freeplay/hello` | request-response, 1 server | [`Hello`], [`Welcome`] |
//!
//! `docs/messages.md` contains everything that a controller in another language needs; `python/freeplay/controller.py` is an example.
//!
//! No process waits for another: full buffers lose their oldest message, and the sender skips an unreachable peer.

use std::fmt::Debug;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::port::DegradationAction;
use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    FileName, LogLevel, Path, SemanticString, ServiceName, SignalHandlingMode, ZeroCopySend,
    set_log_level_from_env_or,
};
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::Builder as PubSubBuilder;
use iceoryx2::service::builder::request_response::Builder as ReqResBuilder;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as PubSub;
use iceoryx2::service::port_factory::request_response::PortFactory as ReqRes;

use crate::address::Address;
use crate::error::LinkError;
use crate::handshake::{Hello, Welcome};
use crate::limits::MAX_SLOTS;
use crate::messages::{Command, State};
use crate::outbox::{Ipc, Outbox};
use crate::segments::Segments;

pub(crate) type StateSubscriber = Subscriber<Ipc, State, ()>;
pub(crate) type CommandSubscriber = Subscriber<Ipc, Command, ()>;
pub(crate) type StateSample = Sample<Ipc, State, ()>;
pub(crate) type CommandSample = Sample<Ipc, Command, ()>;
pub(crate) type CommandService = PubSub<Ipc, Command, ()>;
pub(crate) type DoorServer = Server<Ipc, Hello, (), Welcome, ()>;
pub(crate) type DoorClient = Client<Ipc, Hello, (), Welcome, ()>;
pub(crate) type DoorService = ReqRes<Ipc, Hello, (), Welcome, ()>;

/// Name of the service of states.
pub(crate) const STATE_SERVICE: &str = "freeplay/state";
/// Name of the service of hellos and welcomes.
pub(crate) const DOOR_SERVICE: &str = "freeplay/hello";

/// Number of states that a subscriber can fall behind before it loses the oldest.
pub const STATE_BUFFER: usize = 16;
/// Number of commands that the plant can fall behind before it loses the oldest.
pub const COMMAND_BUFFER: usize = 16;
/// Number of processes that can take part in a run at once, including those that the plant will refuse.
const MAX_NODES: usize = 2 * MAX_SLOTS + SPARE;
/// Spare places for dead processes, because iceoryx2 may fail to clean up after a process that was killed at a bad moment. The seats,
/// not the number of places, decide who takes part in the run.
const SPARE: usize = 4;

/// Longest wait for another process that is removing the remains of a dead one.
const CLEANING: Duration = Duration::from_millis(500);

/// Memory that a process must be able to allocate before it joins a run, bytes. iceoryx2 0.10 writes to the allocator's result without
/// a check (`owning_pointer`): if a port gets no memory, a signal ends the process without a message. A plant with all slots allocates
/// a part of this amount; a test measures how much.
pub const MEMORY: usize = 16 << 20;

/// Checks that this process can allocate [`MEMORY`].
fn see_memory() -> Result<(), LinkError> {
    let mut room: Vec<u8> = Vec::new();
    room.try_reserve_exact(MEMORY).map_err(|_| LinkError::NoMemory { bytes: MEMORY })?;
    // Without `black_box`, the compiler removes the allocation.
    std::hint::black_box(&mut room);
    Ok(())
}

/// Creates this process's node in the run at `address`. iceoryx2 stays inside the run's folder and prefix, logs nothing about errors
/// that this crate handles (`IOX2_LOG_LEVEL` changes that), and leaves signals alone. It cleans up after dead processes here and at no
/// other time.
pub(crate) fn node(address: &Address) -> Result<Node<Ipc>, LinkError> {
    see_memory()?;
    Segments::open()?.see_room()?;
    set_log_level_from_env_or(LogLevel::Fatal);
    let bad_address = |_| LinkError::BadAddress { text: address.to_string() };
    let mut config = Config::default();
    let root = Path::new(address.root().as_os_str().as_encoded_bytes()).map_err(bad_address)?;
    config.global.set_root_path(&root);
    config.global.prefix = FileName::new(address.prefix().as_bytes()).map_err(bad_address)?;
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .map_err(transport("create the node of", "this process"))?;
    Segments::open()?.remove_unborn(address);
    node.blocking_cleanup_dead_nodes(CLEANING);
    Ok(node)
}

/// States from the plant to all subscribers.
pub(crate) fn states(node: &Node<Ipc>) -> PubSubBuilder<State, (), Ipc> {
    node.service_builder(&service_name(STATE_SERVICE)).publish_subscribe()
}

/// Commands of the controller in `slot` to the plant.
pub(crate) fn commands(node: &Node<Ipc>, slot: u32) -> PubSubBuilder<Command, (), Ipc> {
    node.service_builder(&service_name(&command_service(slot))).publish_subscribe()
}

/// Hellos to the plant and its welcomes.
pub(crate) fn door(node: &Node<Ipc>) -> ReqResBuilder<Hello, (), Welcome, (), Ipc> {
    node.service_builder(&service_name(DOOR_SERVICE)).request_response()
}

/// Name of the service of commands of `slot`.
pub(crate) fn command_service(slot: u32) -> String {
    format!("freeplay/command/{slot}")
}

/// Creates the service of states.
pub(crate) fn create_states(node: &Node<Ipc>) -> Result<PubSub<Ipc, State, ()>, LinkError> {
    let settings = with_settings(states(node), STATE_BUFFER).max_subscribers(MAX_SLOTS + SPARE);
    settings.open_or_create().map_err(transport("make", STATE_SERVICE))
}

/// Creates the service of commands of `slot`.
pub(crate) fn create_commands(node: &Node<Ipc>, slot: u32) -> Result<CommandService, LinkError> {
    let settings = with_settings(commands(node, slot), COMMAND_BUFFER).max_subscribers(1 + SPARE);
    settings.open_or_create().map_err(transport("make", &command_service(slot)))
}

/// Creates the hello service.
pub(crate) fn create_door(node: &Node<Ipc>) -> Result<DoorService, LinkError> {
    door(node)
        .max_servers(1 + SPARE)
        .max_clients(MAX_NODES)
        .max_nodes(MAX_NODES)
        .max_active_requests_per_client(2)
        .enable_safe_overflow_for_requests(true)
        .enable_safe_overflow_for_responses(true)
        .enable_fire_and_forget_requests(false)
        .open_or_create()
        .map_err(transport("make", DOOR_SERVICE))
}

/// Settings common to states and commands.
fn with_settings<Message: Debug + ZeroCopySend>(
    service: PubSubBuilder<Message, (), Ipc>,
    buffer: usize,
) -> PubSubBuilder<Message, (), Ipc> {
    service
        .max_publishers(1 + SPARE)
        .max_nodes(MAX_NODES)
        .history_size(0)
        .subscriber_max_buffer_size(buffer)
        .enable_safe_overflow(true)
}

fn service_name(name: &str) -> ServiceName {
    name.try_into().expect("the names in this file are short and not empty")
}

/// The sending end of the service called `name`.
pub(crate) fn outbox<Message: Debug + Copy + ZeroCopySend>(
    service: &PubSub<Ipc, Message, ()>,
    name: &str,
) -> Result<Outbox<Message>, LinkError> {
    let publisher = service
        .publisher_builder()
        .max_loaned_samples(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .set_degradation_handler(|_, _| DegradationAction::Ignore)
        .create()
        .map_err(transport("publish on", name))?;
    Ok(Outbox::new(publisher))
}

/// A subscriber of the service called `name`.
pub(crate) fn subscriber<Message: Debug + ZeroCopySend>(
    service: &PubSub<Ipc, Message, ()>,
    name: &str,
) -> Result<Subscriber<Ipc, Message, ()>, LinkError> {
    service
        .subscriber_builder()
        .set_degradation_handler(|_, _| DegradationAction::Ignore)
        .create()
        .map_err(transport("subscribe to", name))
}

/// Creates the server of the hello service.
pub(crate) fn door_server(service: &DoorService) -> Result<DoorServer, LinkError> {
    service
        .server_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .set_request_degradation_handler(|_, _| DegradationAction::Ignore)
        .set_response_degradation_handler(|_, _| DegradationAction::Ignore)
        .create()
        .map_err(transport("answer on", DOOR_SERVICE))
}

/// Creates a client of the hello service.
pub(crate) fn door_client(service: &DoorService) -> Result<DoorClient, LinkError> {
    service
        .client_builder()
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .set_request_degradation_handler(|_, _| DegradationAction::Ignore)
        .set_response_degradation_handler(|_, _| DegradationAction::Ignore)
        .create()
        .map_err(transport("knock on", DOOR_SERVICE))
}

/// The process of the port with the iceoryx2 `id`. Version 0.10 composes ids of the time (bits 0 to 63), the process (64 to 95) and a
/// counter (`iceoryx2_bb_posix::UniqueSystemId`), and publishes the process only for a node's id; a test pins this format.
pub(crate) fn process_of(id: u128) -> u32 {
    (id >> 64) as u32
}

/// Converts the error of iceoryx2 into a [`LinkError`].
pub(crate) fn transport<Cause: Debug>(doing: &'static str, service: &str) -> impl FnOnce(Cause) -> LinkError {
    move |cause| LinkError::Transport { doing, service: service.to_owned(), cause: format!("{cause:?}") }
}
