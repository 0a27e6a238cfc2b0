//! [`PlantLink`]: the plant's end of a run.

use iceoryx2::node::Node;
use iceoryx2::port::update_connections::UpdateConnections;

use crate::address::Address;
use crate::error::LinkError;
use crate::handshake::{Greeting, Hello, Offer, Verdict};
use crate::limits::MAX_SLOTS;
use crate::messages::{Command, State};
use crate::outbox::{Ipc, Outbox};
use crate::run_folder::Share;
use crate::seat::Seat;
use crate::segments::Segments;
use crate::services::{
    self, COMMAND_BUFFER, CommandSample, CommandSubscriber, DOOR_SERVICE, DoorServer, STATE_SERVICE,
    command_service, process_of, transport,
};

/// Ignored commands for a slot from a process that does not hold its seat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Foreign {
    /// Number of commands.
    pub commands: u64,
    /// The process of the last one.
    pub process: Option<u32>,
}

/// The plant's end of a run. Belongs to the thread that opened it.
///
/// After set-up, [`publish`](Self::publish), [`next_command`](Self::next_command) and [`newest_command`](Self::newest_command)
/// neither allocate nor wait, unless a subscriber has come or gone since the last call. A call of [`greet`](Self::greet) does that
/// work in advance.
#[derive(Debug)]
pub struct PlantLink {
    states: Outbox<State>,
    slots: Vec<Slot>,
    door: DoorServer,
    offer: Offer,
    run: u64,
    // Fields drop in this order: the node after its ports, then the seat, the share last.
    _node: Node<Ipc>,
    _seat: Seat,
    share: Share,
}

/// The plant's end of one slot.
#[derive(Debug)]
struct Slot {
    commands: CommandSubscriber,
    seat: Seat,
    /// The process that was accepted for this slot; commands of other processes are ignored.
    seated: Option<u32>,
    foreign: Foreign,
    skipped: u64,
}

impl PlantLink {
    /// Opens the plant's end of the run at `address`, with `slots` slots for controllers.
    ///
    /// # Errors
    /// [`LinkError::NoRun`] if the run has ended; [`LinkError::PlantExists`] if it has a plant; [`LinkError::SlotCount`] unless
    /// there are 1 to [`MAX_SLOTS`] slots; [`LinkError::Planted`] if another user made a segment of this run;
    /// [`LinkError::NoMemory`] or [`LinkError::NoRoom`] if memory is insufficient; [`LinkError::Transport`] if iceoryx2 refuses.
    pub fn open(address: &Address, slots: usize, offer: Offer) -> Result<Self, LinkError> {
        if slots == 0 || slots > MAX_SLOTS {
            return Err(LinkError::SlotCount { slots });
        }
        let share = Share::take(address)?;
        let seat = Seat::of_plant(address)?;
        if !seat.take()? {
            return Err(LinkError::PlantExists { path: address.root().to_owned() });
        }
        let node = services::node(address)?;
        let service = services::create_states(&node)?;
        let states = services::outbox(&service, STATE_SERVICE)?;
        let slots =
            (0..slots as u32).map(|slot| Slot::open(address, &node, slot)).collect::<Result<_, _>>()?;
        let service = services::create_door(&node)?;
        let door = services::door_server(&service)?;
        let segments = Segments::open()?;
        segments.check_owner(address)?;
        segments.reserve(address)?;
        Ok(Self { states, slots, door, offer, run: address.run(), _node: node, _seat: seat, share })
    }

    /// Publishes `state` to all subscribers without waiting. A slow subscriber loses the oldest states.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses. A subscriber that has died causes no error.
    #[inline]
    pub fn publish(&mut self, state: &State) -> Result<(), LinkError> {
        self.states.send(state).map_err(transport("publish on", STATE_SERVICE))
    }

    /// Takes the oldest unread command of `slot`.
    ///
    /// # Errors
    /// [`LinkError::NoSlot`]; [`LinkError::Transport`] if iceoryx2 refuses.
    #[inline]
    pub fn next_command(&mut self, slot: usize) -> Result<Option<Command>, LinkError> {
        Ok(self.slot(slot)?.next(slot)?.map(|command| *command.payload()))
    }

    /// Takes all commands of `slot` and returns the newest; [`PlantLink::skipped`] counts the others.
    ///
    /// # Errors
    /// See [`PlantLink::next_command`].
    #[inline]
    pub fn newest_command(&mut self, slot: usize) -> Result<Option<Command>, LinkError> {
        let this = self.slot(slot)?;
        let mut newest: Option<CommandSample> = None;
        while let Some(command) = this.next(slot)? {
            this.skipped += u64::from(newest.is_some());
            newest = Some(command);
        }
        Ok(newest.map(|command| *command.payload()))
    }

    /// Number of commands of `slot` that [`PlantLink::newest_command`] has skipped so far; 0 for a missing slot.
    #[inline]
    #[must_use]
    pub fn skipped(&self, slot: usize) -> u64 {
        self.slots.get(slot).map_or(0, |slot| slot.skipped)
    }

    /// The commands for `slot` so far from processes that do not hold its seat; none for a missing slot.
    #[inline]
    #[must_use]
    pub fn foreign(&self, slot: usize) -> Foreign {
        self.slots.get(slot).map_or_else(Foreign::default, |slot| slot.foreign)
    }

    /// Answers every waiting hello: accepts it or refuses it with a reason. The function does not wait. It allocates and opens
    /// shared memory if there is a hello.
    ///
    /// The transport gives the sender of a hello, and the system gives the holder of the seat. The plant refuses a hello that
    /// claims the seat of another process. Afterwards the plant uses only commands of the accepted process for its slot.
    ///
    /// A controller without an answer for a long time repeats its hello, so the plant may greet it twice.
    ///
    /// # Errors
    /// [`LinkError::Transport`] if iceoryx2 refuses. A controller that died meanwhile causes no error and is not reported.
    #[inline]
    pub fn greet(&mut self) -> Result<Vec<Greeting>, LinkError> {
        let mut greetings = Vec::new();
        while let Some(request) = self.door.receive().map_err(transport("take hellos of", DOOR_SERVICE))? {
            let hello: Hello = *request.payload();
            let sender = process_of(request.origin().value());
            let verdict = match self.offer.judge(&hello, self.run, self.slots.len()) {
                Verdict::Accepted => self.seat(hello.slot as usize, sender),
                verdict => verdict,
            };
            if request.send_copy(self.offer.welcome(self.run, self.slots.len(), verdict)).is_ok() {
                greetings.push(Greeting::of(&hello, verdict));
            }
        }
        Ok(greetings)
    }

    /// Returns true if a living controller holds `slot`. It costs one system call; call it only after a long time without a
    /// command.
    #[must_use]
    pub fn has_controller(&self, slot: usize) -> bool {
        self.slots.get(slot).is_some_and(|slot| slot.seat.is_taken())
    }

    /// Returns true if the process that was started for `slot` has ended. The process that started it reports the end with
    /// [`RunFolder::report_process_exit`](crate::RunFolder::report_process_exit), so that no one waits for it. It costs one system
    /// call.
    #[must_use]
    pub fn has_ended(&self, slot: usize) -> bool {
        self.share.has_ended(slot)
    }

    #[inline]
    fn slot(&mut self, slot: usize) -> Result<&mut Slot, LinkError> {
        let slots = self.slots.len();
        self.slots.get_mut(slot).ok_or(LinkError::NoSlot { slot, slots })
    }

    /// Assigns `slot` to the process `sender` if that process holds the seat.
    fn seat(&mut self, slot: usize, sender: u32) -> Verdict {
        match self.slots.get_mut(slot) {
            Some(it) if it.seat.is_held_by(sender) => it.seated = Some(sender),
            _ => return Verdict::SlotTaken,
        }
        self.connect_to(slot);
        Verdict::Accepted
    }

    /// Opens the shared memory of the controller of `slot` now, so that the first tick need not. That tick retries a failed
    /// attempt.
    fn connect_to(&mut self, slot: usize) {
        self.states.meet_peers();
        if let Some(slot) = self.slots.get(slot) {
            let _ = slot.commands.update_connections();
        }
    }
}

impl Slot {
    fn open(address: &Address, node: &Node<Ipc>, slot: u32) -> Result<Self, LinkError> {
        let service = services::create_commands(node, slot)?;
        let commands = services::subscriber(&service, &command_service(slot))?;
        Ok(Self {
            commands,
            seat: Seat::of_controller(address, slot)?,
            seated: None,
            foreign: Foreign::default(),
            skipped: 0,
        })
    }

    /// Takes the oldest unread command of the process that holds the seat, without copying it from shared memory. The function
    /// counts commands of other processes, at most one buffer at a time, so that a flood does not stall the loop.
    #[inline]
    fn next(&mut self, slot: usize) -> Result<Option<CommandSample>, LinkError> {
        for _ in 0..COMMAND_BUFFER {
            let received = self.commands.receive();
            let received = received
                .map_err(|error| transport("take commands of", &command_service(slot as u32))(error))?;
            let Some(command) = received else { return Ok(None) };
            let sender = process_of(command.origin().value());
            if self.seated == Some(sender) {
                return Ok(Some(command));
            }
            self.foreign.commands += 1;
            self.foreign.process = Some(sender);
        }
        Ok(None)
    }
}
