//! The handshake of controller and plant: [`Hello`] from the controller, [`Welcome`] from the plant.
//!
//! The layout of both is frozen permanently, so that any version can refuse any other with a reason. Their first fields contain
//! the properties that may differ: the layout version and the sizes of [`State`] and [`Command`].

use std::mem::size_of;

use iceoryx2::prelude::ZeroCopySend;

use crate::messages::{Command, LAYOUT_VERSION, MAGIC, Mode, State, from_code};

/// Pace of the plant's steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Pace {
    /// The plant steps when the answer has arrived; deterministic, at full speed.
    Lockstep = 0,
    /// The plant steps by the wall clock; a late answer counts as a miss.
    RealTime = 1,
}

/// The plant's answer to a [`Hello`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Verdict {
    /// The controller has the slot.
    Accepted = 0,
    /// The hello does not begin with [`MAGIC`].
    WrongMagic = 1,
    /// The two sides differ in the layout version or in the size of a message.
    WrongLayout = 2,
    /// The controller's number of joints differs from that of the arm.
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

/// First message of a controller. Layout frozen permanently: 136 bytes.
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
    /// Number of joints of the controller; 0 accepts any number.
    pub joints: u32,
    /// The requested slot, from 0.
    pub slot: u32,
    /// 1 if the sender holds the exclusive `flock` on `slot-<slot>.lock` in the run's folder; otherwise 0.
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
    /// A hello of this process for `slot`, with this version's layout; `joints` 0 accepts any number. A name longer than 64 bytes
    /// is cut at a character boundary.
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

/// Answer of the plant. Layout frozen permanently: 1136 bytes.
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

    /// Pace of the plant's steps, or `None` if this version does not know the code.
    #[must_use]
    pub fn pace(&self) -> Option<Pace> {
        Pace::from_code(self.pace)
    }

    /// Mode of the joints' motion, or `None` if this version does not know the code.
    #[must_use]
    pub fn mode(&self) -> Option<Mode> {
        Mode::from_code(self.mode)
    }
}

/// Description of the run that the plant sends to every controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offer {
    /// Number of joints of the arm, 1 to [`MAX_JOINTS`](crate::MAX_JOINTS).
    pub joints: usize,
    /// The drive of the joints: torques, an ideal drive, or position servos.
    pub mode: Mode,
    /// Pace of the plant's steps.
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

    /// The plant's verdict on `hello`, in `run` with `slots` slots: the first mismatch in the order magic, layout, run, slot,
    /// joints, claim.
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

/// Result of a handshake on the plant's side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Greeting {
    /// The slot is now this controller's.
    Accepted {
        /// Slot of the controller.
        slot: u32,
        /// Process id according to the hello.
        pid: u32,
        /// Name according to the hello.
        name: String,
    },
    /// The plant refused the controller and sent the reason.
    Refused {
        /// The requested slot.
        slot: u32,
        /// Process id according to the hello.
        pid: u32,
        /// Name according to the hello.
        name: String,
        /// Reason.
        verdict: Verdict,
    },
}

impl Greeting {
    /// The result for `hello`, answered with `verdict`.
    #[must_use]
    pub fn of(hello: &Hello, verdict: Verdict) -> Self {
        let (slot, pid, name) = (hello.slot, hello.pid, hello.name());
        match verdict {
            Verdict::Accepted => Self::Accepted { slot, pid, name },
            verdict => Self::Refused { slot, pid, name, verdict },
        }
    }
}

/// `text` in N bytes, zero padded; text that is too long is cut at a character boundary.
fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    let end = text.floor_char_boundary(N);
    bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
    bytes
}

/// The text before the first zero byte; invalid UTF-8 is replaced.
fn unpadded(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
