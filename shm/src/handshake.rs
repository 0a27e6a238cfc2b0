//! How a controller and a plant agree to speak: [`Hello`] from the controller, [`Welcome`] from the plant.
//!
//! The layout of both is frozen for all time, so that any version can refuse any other in words. What the two sides
//! may differ in (the layout version and the sizes of [`State`] and [`Command`]) stands in their first fields.

use std::mem::size_of;

use iceoryx2::prelude::ZeroCopySend;

use crate::messages::{Command, LAYOUT_VERSION, MAGIC, Mode, State, from_code};

/// When the plant takes its next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Pace {
    /// When the answer is there; deterministic, as fast as it goes.
    Lockstep = 0,
    /// When the wall clock says so; a late answer is a miss.
    RealTime = 1,
}

/// The plant's answer to a [`Hello`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Verdict {
    /// The slot is the controller's.
    Accepted = 0,
    /// The hello does not begin with [`MAGIC`].
    WrongMagic = 1,
    /// The two sides differ in the layout version or in the size of a message.
    WrongLayout = 2,
    /// The controller wants another number of joints than the arm has.
    WrongJoints = 3,
    /// Another living controller holds the slot.
    SlotTaken = 4,
    /// The controller has the address of another run.
    WrongRun = 5,
    /// The run has no slot of that number.
    NoSuchSlot = 6,
}

from_code!(Pace: Lockstep, RealTime);
from_code!(Verdict: Accepted, WrongMagic, WrongLayout, WrongJoints, SlotTaken, WrongRun, NoSuchSlot);

/// What a controller says first. Layout frozen for all time: 136 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("freeplay.Hello")]
pub struct Hello {
    /// [`MAGIC`].
    pub magic: u64,
    /// The controller's [`LAYOUT_VERSION`].
    pub layout: u32,
    /// The controller's size of [`State`], bytes.
    pub state_size: u32,
    /// The controller's size of [`Command`], bytes.
    pub command_size: u32,
    /// Number of joints the controller is made for; 0 takes what comes.
    pub joints: u32,
    /// The slot the controller asks for, from 0.
    pub slot: u32,
    /// 1 if the sender holds the exclusive `flock` on `slot-<slot>.lock` in the run's folder; else 0.
    pub claim: u32,
    /// Process id of the controller.
    pub pid: u32,
    /// Zero.
    pub reserved: u32,
    /// Hash of the run's id; 0 lets [`ControllerLink::connect`](crate::ControllerLink::connect) fill it in.
    pub run: u64,
    /// Name of the controller for people, UTF-8, zero padded.
    pub name: [u8; 64],
    /// Zero.
    pub reserved_tail: [u8; 24],
}

impl Hello {
    /// A hello of this process for `slot`, with this version's layout; `joints` 0 takes what comes. A name longer than
    /// 64 bytes is cut at a character.
    #[must_use]
    pub fn new(name: &str, slot: u32, joints: usize) -> Self {
        Self {
            magic: MAGIC,
            layout: LAYOUT_VERSION,
            state_size: size_of::<State>() as u32,
            command_size: size_of::<Command>() as u32,
            joints: joints as u32,
            slot,
            claim: 0,
            pid: std::process::id(),
            reserved: 0,
            run: 0,
            name: padded(name),
            reserved_tail: [0; 24],
        }
    }

    /// The name as text.
    #[must_use]
    pub fn name(&self) -> String {
        unpadded(&self.name)
    }
}

/// What the plant answers. Layout frozen for all time: 1136 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
#[type_name("freeplay.Welcome")]
pub struct Welcome {
    /// [`MAGIC`].
    pub magic: u64,
    /// The plant's [`LAYOUT_VERSION`].
    pub layout: u32,
    /// The plant's size of [`State`], bytes.
    pub state_size: u32,
    /// The plant's size of [`Command`], bytes.
    pub command_size: u32,
    /// Code of the [`Verdict`].
    pub verdict: u32,
    /// Number of joints of the arm.
    pub joints: u32,
    /// Code of the run's [`Mode`].
    pub mode: u32,
    /// Code of the run's [`Pace`].
    pub pace: u32,
    /// Number of slots of the run.
    pub slots: u32,
    /// Time between two ticks, ns.
    pub period_ns: u64,
    /// Length of the run, ticks.
    pub ticks: u64,
    /// Hash of the run's id.
    pub run: u64,
    /// Path of the controller's task file, UTF-8, zero padded.
    pub task: [u8; 1024],
    /// Zero.
    pub reserved_tail: [u8; 48],
}

impl Welcome {
    /// The verdict, or `None` if this version does not know its code.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        Verdict::from_code(self.verdict)
    }

    /// Path of the controller's task file; empty if there is none.
    #[must_use]
    pub fn task(&self) -> String {
        unpadded(&self.task)
    }

    /// When the plant takes its next step, or `None` if this version does not know the code.
    #[must_use]
    pub fn pace(&self) -> Option<Pace> {
        Pace::from_code(self.pace)
    }

    /// Who moves the joints, or `None` if this version does not know the code.
    #[must_use]
    pub fn mode(&self) -> Option<Mode> {
        Mode::from_code(self.mode)
    }
}

/// What the plant tells every controller about the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offer {
    /// Number of joints of the arm, 1 to [`MAX_JOINTS`](crate::MAX_JOINTS).
    pub joints: usize,
    /// The drive of the joints: torques, an ideal drive, or position servos.
    pub mode: Mode,
    /// When the plant takes its next step.
    pub pace: Pace,
    /// Time between two ticks, ns.
    pub period_ns: u64,
    /// Length of the run, ticks.
    pub ticks: u64,
    /// Path of the controllers' task file, at most 1024 bytes of UTF-8; empty if there is none.
    pub task: String,
}

impl Offer {
    /// The welcome with this offer and `verdict`, in `run` with `slots` slots.
    #[must_use]
    pub fn welcome(&self, run: u64, slots: usize, verdict: Verdict) -> Welcome {
        Welcome {
            magic: MAGIC,
            layout: LAYOUT_VERSION,
            state_size: size_of::<State>() as u32,
            command_size: size_of::<Command>() as u32,
            verdict: verdict.code(),
            joints: self.joints as u32,
            mode: self.mode.code(),
            pace: self.pace.code(),
            slots: slots as u32,
            period_ns: self.period_ns,
            ticks: self.ticks,
            run,
            task: padded(&self.task),
            reserved_tail: [0; 48],
        }
    }

    /// What this offer answers to `hello`, in `run` with `slots` slots: the first thing that does not fit, in the order
    /// magic, layout, run, slot, joints, claim.
    #[must_use]
    pub fn judge(&self, hello: &Hello, run: u64, slots: usize) -> Verdict {
        let sizes = (size_of::<State>() as u32, size_of::<Command>() as u32);
        if hello.magic != MAGIC {
            Verdict::WrongMagic
        } else if hello.layout != LAYOUT_VERSION || (hello.state_size, hello.command_size) != sizes {
            Verdict::WrongLayout
        } else if hello.run != run {
            Verdict::WrongRun
        } else if hello.slot as usize >= slots {
            Verdict::NoSuchSlot
        } else if hello.joints != 0 && hello.joints as usize != self.joints {
            Verdict::WrongJoints
        } else if hello.claim == 0 {
            Verdict::SlotTaken
        } else {
            Verdict::Accepted
        }
    }
}

/// What the plant learns about a controller that knocked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Greeting {
    /// The slot is now this controller's.
    Accepted {
        /// Its slot.
        slot: u32,
        /// Its process id, as it says.
        pid: u32,
        /// Its name, as it says.
        name: String,
    },
    /// The controller was told why it may not take part.
    Refused {
        /// The slot it asked for.
        slot: u32,
        /// Its process id, as it says.
        pid: u32,
        /// Its name, as it says.
        name: String,
        /// Why.
        verdict: Verdict,
    },
}

impl Greeting {
    /// The plant's note on `hello`, answered with `verdict`.
    #[must_use]
    pub fn of(hello: &Hello, verdict: Verdict) -> Self {
        let (slot, pid, name) = (hello.slot, hello.pid, hello.name());
        match verdict {
            Verdict::Accepted => Self::Accepted { slot, pid, name },
            verdict => Self::Refused { slot, pid, name, verdict },
        }
    }
}

/// `text` in N bytes, zero padded, cut at a character if it is too long.
fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    let end = text.floor_char_boundary(N);
    bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
    bytes
}

/// The text before the first zero byte; what is not UTF-8 is replaced.
fn unpadded(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
