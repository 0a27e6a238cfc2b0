//! [`ControllerLink`]: a controller's end of a run.

use std::fmt::Debug;
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;

use crate::address::Address;
use crate::error::LinkError;
use crate::handshake::{Hello, Verdict, Welcome};
use crate::messages::{Command, LAYOUT_VERSION, MAGIC, State};
use crate::outbox::{Ipc, Outbox};
use crate::run_folder::Share;
use crate::seat::Seat;
use crate::segments::Segments;
use crate::services::{
    self, DoorClient, STATE_SERVICE, StateSample, StateSubscriber, command_service, transport,
};

/// Interval at which a controller checks for the plant and for its answer.
const LOOK_AGAIN: Duration = Duration::from_micros(500);

/// A controller's end of a run. Belongs to the thread that opened it. Dropping it frees the slot.
///
/// After set-up, [`next_state`](Self::next_state), [`newest_state`](Self::newest_state) and [`send`](Self::send) neither
/// allocate nor wait.
#[derive(Debug)]
pub struct ControllerLink {
    states: StateSubscriber,
    commands: Outbox<Command>,
    last_tick: Option<u64>,
    lost: u64,
    skipped: u64,
    service: String,
    // Fields drop in this order: the node after its ports, then the seat, the share last.
    _node: Node<Ipc>,
    _seat: Seat,
    plant: Seat,
    _share: Share,
}

/// Ports that a controller could open before it was accepted; a missing service, or one with another layout, gives `None`.
struct Ends {
    states: Option<StateSubscriber>,
    commands: Option<Outbox<Command>>,
}

impl ControllerLink {
    /// Finds the plant of the run at `address`, sends `hello` until the plant answers or `patience` ends, and takes the slot.
    /// Plant and controller may start in any order. The function fills in the claim of `hello`, and the run if it is 0.
    ///
    /// # Errors
    /// [`LinkError::NoRun`] if the run has ended; [`LinkError::NoPlant`] if no plant answers in time; [`LinkError::Refused`] with
    /// the reason; [`LinkError::Planted`] if another user made a segment of this run; [`LinkError::NoMemory`] or
    /// [`LinkError::NoRoom`] if memory is insufficient; [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn connect(
        address: &Address,
        mut hello: Hello,
        patience: Duration,
    ) -> Result<(Self, Welcome), LinkError> {
        let mut wait = Wait::new(patience);
        let share = Share::take(address)?;
        let node = services::node(address)?;
        let door = wait.until_ok("the plant has not opened its door", || services::door(&node).open())?;
        let client = services::door_client(&door)?;
        let seat = Seat::of_controller(address, hello.slot)?;
        let is_ours = seat.take()?;
        // A process without the slot opens no subscriber, so that refused processes cannot crowd out the others.
        let ends = if is_ours { Ends::open(&node, hello.slot, &mut wait)? } else { Ends::NONE };
        hello.claim = u32::from(is_ours);
        if hello.run == 0 {
            hello.run = address.run();
        }
        let welcome = send_hello(&client, &hello, &mut wait)?;
        let segments = Segments::open()?;
        segments.check_owner(address)?;
        segments.reserve(address)?;
        let (true, Some(states), Some(commands)) = (is_accepted(&welcome), ends.states, ends.commands) else {
            return Err(refusal(&hello, &welcome));
        };
        let plant = Seat::of_plant(address)?;
        let service = command_service(hello.slot);
        let link = Self {
            states,
            commands,
            last_tick: None,
            lost: 0,
            skipped: 0,
            service,
            _node: node,
            _seat: seat,
            plant,
            _share: share,
        };
        Ok((link, welcome))
    }

    /// Takes the oldest unread state. [`ControllerLink::lost`] counts the states lost because this side was slow.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    #[inline]
    pub fn next_state(&mut self) -> Result<Option<State>, LinkError> {
        Ok(self.next_sample()?.map(|sample| *sample.payload()))
    }

    /// Takes all waiting states and returns the newest; [`ControllerLink::skipped`] counts the others.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses.
    #[inline]
    pub fn newest_state(&mut self) -> Result<Option<State>, LinkError> {
        let mut newest: Option<StateSample> = None;
        while let Some(sample) = self.next_sample()? {
            self.skipped += u64::from(newest.is_some());
            newest = Some(sample);
        }
        Ok(newest.map(|sample| *sample.payload()))
    }

    /// Number of states lost so far because the buffer of [`STATE_BUFFER`](crate::STATE_BUFFER) on this side was full.
    #[inline]
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Number of states that [`ControllerLink::newest_state`] has skipped so far.
    #[inline]
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Sends `command` to the plant without waiting. If the plant does not read commands, the oldest are lost.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses. A plant that has died causes no error.
    #[inline]
    pub fn send(&mut self, command: &Command) -> Result<(), LinkError> {
        self.commands.send(command).map_err(transport("send on", &self.service))
    }

    /// Takes the oldest unread state without copying it from shared memory.
    #[inline]
    fn next_sample(&mut self) -> Result<Option<StateSample>, LinkError> {
        let Some(sample) = self.states.receive().map_err(transport("take states of", STATE_SERVICE))? else {
            return Ok(None);
        };
        // A tick that is not later than the last one comes from another plant on the same run.
        if let Some(last) = self.last_tick.filter(|&last| sample.tick > last) {
            self.lost += sample.tick - last - 1;
        }
        self.last_tick = Some(sample.tick);
        Ok(Some(sample))
    }

    /// Returns true if the plant lives. It costs one system call; call it only after a long time without a state.
    #[must_use]
    pub fn plant_lives(&self) -> bool {
        self.plant.is_taken()
    }
}

impl Ends {
    const NONE: Self = Self { states: None, commands: None };

    /// Opens the existing services. The plant opens the hello service last, so a service that is missing now will not appear.
    fn open(node: &Node<Ipc>, slot: u32, wait: &mut Wait) -> Result<Self, LinkError> {
        let open_slot = || if_there(services::commands(node, slot).open());
        let open_states = || if_there(services::states(node).open());
        let commands = wait.until_ok("the slot cannot be opened", open_slot)?;
        let states = wait.until_ok("the states cannot be opened", open_states)?;
        let commands =
            commands.map(|service| services::outbox(&service, &command_service(slot))).transpose()?;
        let states = states.map(|service| services::subscriber(&service, STATE_SERVICE)).transpose()?;
        Ok(Self { states, commands })
    }
}

/// The service, or `None` if there is none or one of another layout; the plant then decides on the refusal.
fn if_there<Service>(
    opened: Result<Service, PublishSubscribeOpenError>,
) -> Result<Option<Service>, PublishSubscribeOpenError> {
    match opened {
        Err(PublishSubscribeOpenError::IncompatibleTypes | PublishSubscribeOpenError::DoesNotExist) => {
            Ok(None)
        }
        opened => opened.map(Some),
    }
}

fn is_accepted(welcome: &Welcome) -> bool {
    welcome.magic == MAGIC && welcome.layout == LAYOUT_VERSION && welcome.verdict() == Some(Verdict::Accepted)
}

/// Sends `hello` until the plant answers.
fn send_hello(client: &DoorClient, hello: &Hello, wait: &mut Wait) -> Result<Welcome, LinkError> {
    loop {
        wait.note("the plant is running, but does not answer the hello");
        let pending = client.send_copy(*hello).map_err(transport("knock on", services::DOOR_SERVICE))?;
        // The answer may arrive between the check for it and the check that the plant still holds the hello, so check once more.
        loop {
            let is_held = pending.number_of_server_connections() > 0 && pending.is_connected();
            let answer = pending.receive().map_err(transport("hear from", services::DOOR_SERVICE))?;
            if let Some(answer) = answer {
                return Ok(*answer.payload());
            }
            wait.a_little()?;
            if !is_held {
                break;
            }
        }
    }
}

/// Error with the plant's refusal of `hello` as text.
fn refusal(hello: &Hello, welcome: &Welcome) -> LinkError {
    let verdict = welcome.verdict();
    let reason = match verdict {
        Some(Verdict::WrongMagic) => {
            format!("its hello begins with {:#018x}, expected {:#018x}", hello.magic, welcome.magic)
        }
        Some(Verdict::WrongJoints) => {
            format!(
                "it is made for {} joints, the arm has {}: give it the arm of this run",
                hello.joints, welcome.joints
            )
        }
        Some(Verdict::SlotTaken) => {
            format!("slot {} is held by another controller: end that one or take another slot", hello.slot)
        }
        Some(Verdict::WrongRun) => "it has the address of another run".to_owned(),
        Some(Verdict::NoSuchSlot) => {
            format!(
                "it asks for slot {}, but this run has slots 0 to {}",
                hello.slot,
                welcome.slots.saturating_sub(1)
            )
        }
        Some(Verdict::Accepted | Verdict::WrongLayout) | None => format!(
            "it speaks layout {} (State {} B, Command {} B), the plant speaks layout {} (State {} B, Command {} B): \
             build both from one version",
            hello.layout,
            hello.state_size,
            hello.command_size,
            welcome.layout,
            welcome.state_size,
            welcome.command_size
        ),
    };
    LinkError::Refused { verdict, reason }
}

/// Retry state: retries until the patience ends.
struct Wait {
    patience: Duration,
    start: Instant,
    last: Option<String>,
}

impl Wait {
    fn new(patience: Duration) -> Self {
        Self { patience, start: Instant::now(), last: None }
    }

    /// Stores the current obstacle for the error message at the end of the patience.
    fn note(&mut self, what: &str) {
        self.last = Some(what.to_owned());
    }

    /// Waits briefly, or fails if the patience has ended.
    fn a_little(&mut self) -> Result<(), LinkError> {
        if self.start.elapsed() >= self.patience {
            return Err(LinkError::NoPlant { patience: self.patience, last: self.last.take() });
        }
        thread::sleep(LOOK_AGAIN);
        Ok(())
    }

    /// Repeats `attempt` until it succeeds.
    fn until_ok<T, E: Debug>(
        &mut self,
        obstacle: &str,
        mut attempt: impl FnMut() -> Result<T, E>,
    ) -> Result<T, LinkError> {
        loop {
            match attempt() {
                Ok(value) => return Ok(value),
                Err(error) => self.note(&format!("{obstacle}: {error:?}")),
            }
            self.a_little()?;
        }
    }
}
