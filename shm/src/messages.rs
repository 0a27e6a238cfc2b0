//! The messages of the tick protocol: [`State`] from the plant, [`Command`] from a controller.
//!
//! Both are `repr(C)`, of fixed size and without padding, so that a program in any language can map them. All numbers
//! are in the byte order of the machine. Joint arrays always have [`MAX_JOINTS`] entries; the first `joints` are used,
//! in the order of the arm file from base to tool, the rest are zero. A revolute joint counts in rad, rad/s, rad/s²,
//! N·m; a prismatic joint in m, m/s, m/s², N. `tests/layout.rs` pins sizes and offsets; whoever changes one of them must raise
//! [`LAYOUT_VERSION`].

use iceoryx2::prelude::ZeroCopySend;
use thiserror::Error;

/// Largest number of joints a message can carry.
pub const MAX_JOINTS: usize = 12;

/// Version of the layout of [`State`] and [`Command`].
pub const LAYOUT_VERSION: u32 = 1;

/// First eight bytes of every message: the ASCII letters `FREEPLAY`.
pub const MAGIC: u64 = u64::from_ne_bytes(*b"FREEPLAY");

/// One number per joint; the first `joints` entries are used, the rest are zero.
pub type Joints = [f64; MAX_JOINTS];

/// Mode of the joints' motion: the controller's torque, an ideal drive that follows commanded positions, or position servos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Mode {
    /// Commands are joint torques (forces for prismatic joints).
    Torque = 0,
    /// Commands are joint positions with velocity and acceleration; the drive follows them exactly.
    Driven = 1,
    /// Commands are joint positions; the position servos of the arm close the loop.
    Servo = 2,
}

/// Meaning of [`Command::value`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum CommandKind {
    /// Joint torques τ, N·m (forces, N, for prismatic joints).
    Torque = 0,
    /// Joint positions q, rad (m), with `velocity` and `acceleration`.
    Position = 1,
}

/// Status of the controller's computation of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum CommandStatus {
    /// Computed without a fault.
    Ok = 0,
    /// The quadratic programme failed; the command is the controller's own fallback.
    QpFailed = 1,
    /// The quadratic programme stopped at its iteration limit; the command is its last iterate or the fallback.
    QpLimit = 2,
    /// The controller has no answer to this state; the plant's gate applies its fallback.
    NoAnswer = 3,
}

/// Converts the code in a message to an enum; `None` for a code that this version does not know.
macro_rules! from_code {
    ($name:ident: $($variant:ident),+) => {
        impl $name {
            /// The variant with this code, or `None` if this version does not know the code.
            #[inline]
            #[must_use]
            pub fn from_code(code: u32) -> Option<Self> {
                [$(Self::$variant),+].into_iter().find(|variant| *variant as u32 == code)
            }

            /// The code in messages.
            #[inline]
            #[must_use]
            pub fn code(self) -> u32 {
                self as u32
            }
        }
    };
}
pub(crate) use from_code;

from_code!(Mode: Torque, Driven, Servo);
from_code!(CommandKind: Torque, Position);
from_code!(CommandStatus: Ok, QpFailed, QpLimit, NoAnswer);

/// Desired motion of the arm at one tick.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("freeplay.Reference")]
pub struct Reference {
    /// q_d: desired joint positions, joint frame, rad (m).
    pub q: Joints,
    /// q̇_d: desired joint velocities, joint frame, rad/s (m/s).
    pub qd: Joints,
    /// q̈_d: desired joint accelerations, joint frame, rad/s² (m/s²).
    pub qdd: Joints,
}

impl Reference {
    /// All joints at rest at zero.
    pub const REST: Reference =
        Reference { q: [0.0; MAX_JOINTS], qd: [0.0; MAX_JOINTS], qdd: [0.0; MAX_JOINTS] };
}

/// The arm at one tick, published by the plant.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("freeplay.State")]
pub struct State {
    /// [`MAGIC`].
    pub magic: u64,
    /// [`LAYOUT_VERSION`] of the sender.
    pub layout: u32,
    /// n: number of joints in use, 1 to [`MAX_JOINTS`].
    pub joints: u32,
    /// Hash of the run's id, see [`Address::run`](crate::Address::run).
    pub run: u64,
    /// k: tick number, from 0.
    pub tick: u64,
    /// Time of tick k on the schedule, ns: `CLOCK_MONOTONIC` in real time, simulated time from 0 in lockstep.
    pub scheduled_ns: u64,
    /// Time at which the plant published this state, `CLOCK_MONOTONIC`, ns.
    pub published_ns: u64,
    /// Code of the run's [`Mode`].
    pub mode: u32,
    /// Sum of the set `FLAG_…` bits.
    pub flags: u32,
    /// q: measured joint positions, joint frame, rad (m).
    pub q: Joints,
    /// q̇: measured joint velocities, joint frame, rad/s (m/s).
    pub qd: Joints,
    /// τ: measured joint torques, joint frame, N·m (N).
    pub tau: Joints,
    /// The command in force during this tick, after the gate; same meaning and unit as [`Command::value`] in this mode.
    pub applied: Joints,
    /// Reference at tick k.
    pub reference: Reference,
    /// Reference at the instant of the answer to this state: in mode torque the start of tick k + 1, when the torque takes
    /// effect; in mode driven its end, when the joint reaches the position.
    pub reference_next: Reference,
    /// Measured pose of frame `tool0` in the base frame: x y z, m; unit quaternion qx qy qz qw, 1. NaN without tracking.
    pub tool: [f64; 7],
}

impl State {
    /// Bit of [`State::flags`]: this is the last tick of the run.
    pub const FLAG_LAST: u32 = 1;
    /// Bit of [`State::flags`]: [`State::tool`] contains a measurement.
    pub const FLAG_TOOL_TRACKED: u32 = 1 << 1;
    /// Bit of [`State::flags`]: the gate's fallback, not a controller, is in force during this tick.
    pub const FLAG_FALLBACK: u32 = 1 << 2;
    /// Lowest of the four bits of [`State::flags`] with the slot whose command is in force during this tick.
    pub const IN_CHARGE_SHIFT: u32 = 8;
    /// Lowest of the four bits of [`State::flags`] with the slot whose answer to this state comes into force.
    pub const NEXT_SHIFT: u32 = 12;
    /// Mask of a slot in [`State::flags`].
    const SLOT_MASK: u32 = 0xf;

    /// A state at rest at tick 0 of `run` for an arm of `joints` joints, without tool tracking.
    #[inline]
    #[must_use]
    pub fn new(run: u64, joints: usize) -> Self {
        Self {
            magic: MAGIC,
            layout: LAYOUT_VERSION,
            joints: joints as u32,
            run,
            tick: 0,
            scheduled_ns: 0,
            published_ns: 0,
            mode: Mode::Torque.code(),
            flags: 0,
            q: [0.0; MAX_JOINTS],
            qd: [0.0; MAX_JOINTS],
            tau: [0.0; MAX_JOINTS],
            applied: [0.0; MAX_JOINTS],
            reference: Reference::REST,
            reference_next: Reference::REST,
            tool: [f64::NAN; 7],
        }
    }

    /// Returns true if all bits of `flag` are set.
    #[inline]
    #[must_use]
    pub fn has(&self, flag: u32) -> bool {
        self.flags & flag == flag
    }

    /// The slot whose command is in force during this tick, from 0.
    #[inline]
    #[must_use]
    pub fn active_slot(&self) -> u32 {
        self.flags >> Self::IN_CHARGE_SHIFT & Self::SLOT_MASK
    }

    /// The slot whose answer to this state comes into force. It differs from [`State::active_slot`] if a swap is planned for this
    /// tick.
    #[inline]
    #[must_use]
    pub fn next_active_slot(&self) -> u32 {
        self.flags >> Self::NEXT_SHIFT & Self::SLOT_MASK
    }

    /// The bits of [`State::flags`] for these two slots.
    #[inline]
    #[must_use]
    pub fn slot_flags(in_charge: u32, next: u32) -> u32 {
        (in_charge & Self::SLOT_MASK) << Self::IN_CHARGE_SHIFT | (next & Self::SLOT_MASK) << Self::NEXT_SHIFT
    }

    /// Checks that this message belongs to `run` and that this version can read it.
    ///
    /// # Errors
    /// The first mismatch of magic, layout, run and joints.
    #[inline]
    pub fn check(&self, run: u64) -> Result<(), MessageFault> {
        check(self.magic, self.layout, self.run, self.joints, run)
    }
}

/// The answer of one controller to one [`State`].
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
#[type_name("freeplay.Command")]
pub struct Command {
    /// [`MAGIC`].
    pub magic: u64,
    /// [`LAYOUT_VERSION`] of the sender.
    pub layout: u32,
    /// n: number of joints in use, the same as in the state.
    pub joints: u32,
    /// Hash of the run's id, copied from the state.
    pub run: u64,
    /// k: tick of the state this answers.
    pub tick: u64,
    /// The slot in which the controller was accepted.
    pub slot: u32,
    /// Code of the [`CommandStatus`].
    pub status: u32,
    /// Time at which the controller took the state, `CLOCK_MONOTONIC`, ns.
    pub received_ns: u64,
    /// Time of the prediction, ns; 0 without a prediction.
    pub predict_ns: u64,
    /// Time of the quadratic programme, ns; 0 without one.
    pub qp_ns: u64,
    /// Time at which the controller sent this command, `CLOCK_MONOTONIC`, ns.
    pub sent_ns: u64,
    /// Iterations of the quadratic programme; 0 without one, or if no limit is active.
    pub qp_iterations: u32,
    /// Code of the [`CommandKind`].
    pub kind: u32,
    /// τ, joint frame, N·m (N), or q, joint frame, rad (m), depending on `kind`.
    pub value: Joints,
    /// q̇: with kind position, joint frame, rad/s (m/s); otherwise zero.
    pub velocity: Joints,
    /// q̈: with kind position, joint frame, rad/s² (m/s²); otherwise zero.
    pub acceleration: Joints,
    /// Predicted deviation of the tool by the play at that instant, before compensation; base frame, m; zero without a
    /// prediction.
    pub deviation: [f64; 3],
}

impl Command {
    /// An answer to `state` from `slot`: same run, tick and joints, kind by the state's mode; all other fields are zero.
    #[inline]
    #[must_use]
    pub fn answer_to(state: &State, slot: u32) -> Self {
        let is_torque = state.mode == Mode::Torque.code();
        Self {
            magic: MAGIC,
            layout: LAYOUT_VERSION,
            joints: state.joints,
            run: state.run,
            tick: state.tick,
            slot,
            status: CommandStatus::Ok.code(),
            received_ns: 0,
            predict_ns: 0,
            qp_ns: 0,
            sent_ns: 0,
            qp_iterations: 0,
            kind: if is_torque { CommandKind::Torque } else { CommandKind::Position }.code(),
            value: [0.0; MAX_JOINTS],
            velocity: [0.0; MAX_JOINTS],
            acceleration: [0.0; MAX_JOINTS],
            deviation: [0.0; 3],
        }
    }

    /// Checks that this message belongs to `run` and that this version can read it.
    ///
    /// # Errors
    /// The first mismatch of magic, layout, run and joints.
    #[inline]
    pub fn check(&self, run: u64) -> Result<(), MessageFault> {
        check(self.magic, self.layout, self.run, self.joints, run)
    }
}

/// Reasons why a message is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MessageFault {
    /// The first bytes are not [`MAGIC`]: the message is not one of this protocol.
    #[error(
        "magic {found:#018x} is not {MAGIC:#018x} (\"FREEPLAY\"): the sender does not speak this protocol"
    )]
    Magic {
        /// The first bytes of the message.
        found: u64,
    },
    /// The sender was built against another layout.
    #[error(
        "layout version {found}, this program reads {LAYOUT_VERSION}: rebuild both sides from one version"
    )]
    Layout {
        /// The sender's version.
        found: u32,
    },
    /// The message belongs to another run.
    #[error("run {found:#018x}, this is run {expected:#018x}: the sender has the address of another run")]
    Run {
        /// The run in the message.
        found: u64,
        /// The run of the receiver.
        expected: u64,
    },
    /// The number of joints is out of range.
    #[error("{found} joints, expected 1 to {MAX_JOINTS}")]
    Joints {
        /// The number in the message.
        found: u32,
    },
}

#[inline]
fn check(magic: u64, layout: u32, run: u64, joints: u32, expected: u64) -> Result<(), MessageFault> {
    if magic != MAGIC {
        return Err(MessageFault::Magic { found: magic });
    }
    if layout != LAYOUT_VERSION {
        return Err(MessageFault::Layout { found: layout });
    }
    if run != expected {
        return Err(MessageFault::Run { found: run, expected });
    }
    if joints == 0 || joints as usize > MAX_JOINTS {
        return Err(MessageFault::Joints { found: joints });
    }
    Ok(())
}
