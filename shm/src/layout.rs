//! The layout of the messages as data, the source of `docs/messages.md` and `docs/freeplay.h`.
//!
//! Offsets, sizes and types come from the Rust types; this file adds symbol, frame, unit and meaning.

use std::mem::{offset_of, size_of};

use crate::handshake::{Hello, Pace, Verdict, Welcome};
use crate::messages::{Command, CommandKind, CommandStatus, Joints, Mode, Reference, State};

/// One field of a message.
#[derive(Clone, Debug)]
pub struct Field {
    /// Name.
    pub name: &'static str,
    /// The type of one element in C.
    pub c_type: &'static str,
    /// Number of array elements; 0 for a single value.
    pub count: usize,
    /// Offset from the start of the message, bytes.
    pub offset: usize,
    /// Size, bytes.
    pub size: usize,
    /// Symbol in equations; may be empty.
    pub symbol: &'static str,
    /// Reference frame; may be empty.
    pub frame: &'static str,
    /// Unit; may be empty.
    pub unit: &'static str,
    /// Meaning.
    pub meaning: &'static str,
}

/// One message.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Name.
    pub name: &'static str,
    /// Size, bytes.
    pub size: usize,
    /// True if the layout never changes, in any version.
    pub frozen: bool,
    /// Meaning.
    pub meaning: &'static str,
    /// Fields in their order, without gaps.
    pub fields: Vec<Field>,
}

/// The codes of a field.
#[derive(Clone, Debug)]
pub struct Codes {
    /// Name of the enumeration.
    pub name: &'static str,
    /// The fields that carry it.
    pub fields: &'static str,
    /// Name, number and meaning of each.
    pub codes: Vec<(&'static str, u32, &'static str)>,
}

/// Representation of a type in messages: its element in C, and the number of elements if it is an array.
trait Wire {
    const C: &'static str;
    const COUNT: usize = 0;
}

impl Wire for u32 {
    const C: &'static str = "uint32_t";
}

impl Wire for u64 {
    const C: &'static str = "uint64_t";
}

impl Wire for Reference {
    const C: &'static str = "freeplay_reference";
}

impl<const N: usize> Wire for [f64; N] {
    const C: &'static str = "double";
    const COUNT: usize = N;
}

impl<const N: usize> Wire for [u8; N] {
    const C: &'static str = "uint8_t";
    const COUNT: usize = N;
}

/// Size, element and number of elements of the field that `_select` points to.
fn wire<Whole, Field: Wire>(_select: fn(&Whole) -> *const Field) -> (usize, &'static str, usize) {
    (size_of::<Field>(), Field::C, Field::COUNT)
}

macro_rules! layout {
    ($type:ident, $frozen:literal, $about:literal, $($field:ident: $symbol:literal, $frame:literal, $unit:literal, $meaning:literal;)+) => {
        Layout {
            name: stringify!($type),
            size: size_of::<$type>(),
            frozen: $frozen,
            meaning: $about,
            fields: vec![$({
                let (size, c_type, count) = wire(|whole: &$type| &raw const whole.$field);
                Field {
                    name: stringify!($field), c_type, count, size, offset: offset_of!($type, $field),
                    symbol: $symbol, frame: $frame, unit: $unit, meaning: $meaning,
                }
            }),+],
        }
    };
}

/// All messages, in the order that a C compiler needs.
#[must_use]
pub fn messages() -> Vec<Layout> {
    vec![reference(), state(), command(), hello(), welcome()]
}

fn reference() -> Layout {
    layout!(
        Reference, false, "Where the arm should be at one instant; part of State.",
        q: "q_d", "joint", "rad (m)", "Desired joint positions.";
        qd: "q̇_d", "joint", "rad/s (m/s)", "Desired joint velocities.";
        qdd: "q̈_d", "joint", "rad/s² (m/s²)", "Desired joint accelerations.";
    )
}

fn state() -> Layout {
    layout!(
        State, false, "The arm at one tick, from the plant to everyone who listens.",
        magic: "", "", "", "The eight ASCII letters FREEPLAY.";
        layout: "", "", "", "Layout version of the sender.";
        joints: "n", "", "1", "Number of joints in use, 1 to 12.";
        run: "", "", "", "Hash of the run's id: FNV-1a, 64 bit.";
        tick: "k", "", "1", "Tick number, from 0.";
        scheduled_ns: "t_k", "", "ns", "Time of tick k on the schedule: CLOCK_MONOTONIC in real time, simulated time from 0 in lockstep.";
        published_ns: "", "", "ns", "When the plant published this state, CLOCK_MONOTONIC.";
        mode: "", "", "", "Code of Mode.";
        flags: "", "", "", "Sum of the flags that hold.";
        q: "q", "joint", "rad (m)", "Measured joint positions.";
        qd: "q̇", "joint", "rad/s (m/s)", "Measured joint velocities.";
        tau: "τ", "joint", "N·m (N)", "Measured joint torques (forces).";
        applied: "", "joint", "as Command.value", "The command in force during this tick, after the gate.";
        reference: "", "", "", "Reference at tick k.";
        reference_next: "", "", "", "Reference at the instant that the answer to this state is for: in modes torque and servo the start of tick k + 1, in mode driven its end.";
        tool: "x y z qx qy qz qw", "base", "m, 1", "Measured pose of frame tool0: position and unit quaternion; NaN if not tracked.";
    )
}

fn command() -> Layout {
    layout!(
        Command, false, "The answer of one controller to one State.",
        magic: "", "", "", "The eight ASCII letters FREEPLAY.";
        layout: "", "", "", "Layout version of the sender.";
        joints: "n", "", "1", "Number of joints in use, as in the state.";
        run: "", "", "", "Hash of the run's id, as in the state.";
        tick: "k", "", "1", "Tick of the state this answers.";
        slot: "", "", "1", "The slot in which the controller was accepted.";
        status: "", "", "", "Code of CommandStatus.";
        received_ns: "", "", "ns", "When the controller took the state, CLOCK_MONOTONIC.";
        predict_ns: "", "", "ns", "How long the prediction took; 0 if there was none.";
        qp_ns: "", "", "ns", "How long the quadratic programme took; 0 if there was none.";
        sent_ns: "", "", "ns", "When the controller sent this, CLOCK_MONOTONIC.";
        qp_iterations: "", "", "1", "Iterations of the quadratic programme; 0 if there was none, or no limit binds.";
        kind: "", "", "", "Code of CommandKind: by State.mode.";
        value: "τ or q", "joint", "N·m (N) or rad (m)", "Joint torques with kind torque, joint positions with kind position.";
        velocity: "q̇", "joint", "rad/s (m/s)", "With kind position; else zero.";
        acceleration: "q̈", "joint", "rad/s² (m/s²)", "With kind position; else zero.";
        deviation: "", "base", "m", "Predicted deviation of the tool, x y z, before it is taken out; zero if not predicted.";
    )
}

fn hello() -> Layout {
    layout!(
        Hello, true, "What a controller says first.",
        magic: "", "", "", "The eight ASCII letters FREEPLAY.";
        layout: "", "", "", "Layout version of the controller.";
        state_size: "", "", "B", "The controller's size of State.";
        command_size: "", "", "B", "The controller's size of Command.";
        joints: "", "", "1", "Number of joints the controller is made for; 0 takes what comes.";
        slot: "", "", "1", "The slot it asks for, from 0.";
        claim: "", "", "", "1 if it holds the exclusive flock on slot-<slot>.lock in the run's folder; else 0.";
        pid: "", "", "", "Its process id.";
        reserved: "", "", "", "Zero.";
        run: "", "", "", "Hash of the run's id: FNV-1a, 64 bit.";
        name: "", "", "", "Its name for people, UTF-8, zero padded.";
        reserved_tail: "", "", "", "Zero.";
    )
}

fn welcome() -> Layout {
    layout!(
        Welcome, true, "What the plant answers.",
        magic: "", "", "", "The eight ASCII letters FREEPLAY.";
        layout: "", "", "", "Layout version of the plant.";
        state_size: "", "", "B", "The plant's size of State.";
        command_size: "", "", "B", "The plant's size of Command.";
        verdict: "", "", "", "Code of Verdict.";
        joints: "n", "", "1", "Number of joints of the arm.";
        mode: "", "", "", "Code of Mode.";
        pace: "", "", "", "Code of Pace.";
        slots: "", "", "1", "Number of slots of the run.";
        period_ns: "T", "", "ns", "Time between two ticks.";
        ticks: "", "", "1", "Length of the run.";
        run: "", "", "", "Hash of the run's id.";
        task: "", "", "", "Path of the controllers' task file, UTF-8, zero padded.";
        reserved_tail: "", "", "", "Zero.";
    )
}

/// The codes of all enumerations.
#[must_use]
pub fn codes() -> Vec<Codes> {
    vec![
        Codes {
            name: "Mode",
            fields: "State.mode, Welcome.mode",
            codes: vec![
                ("torque", Mode::Torque.code(), "Commands are joint torques (forces)."),
                ("driven", Mode::Driven.code(), "Commands are joint positions; an ideal drive follows them."),
                (
                    "servo",
                    Mode::Servo.code(),
                    "Commands are joint positions; the position servos of the arm close the loop.",
                ),
            ],
        },
        Codes {
            name: "Pace",
            fields: "Welcome.pace",
            codes: vec![
                ("lockstep", Pace::Lockstep.code(), "The plant waits for the answer to each state."),
                ("realtime", Pace::RealTime.code(), "The wall clock decides; a late answer is a miss."),
            ],
        },
        Codes {
            name: "CommandKind",
            fields: "Command.kind",
            codes: vec![
                ("torque", CommandKind::Torque.code(), "Command.value holds torques."),
                ("position", CommandKind::Position.code(), "Command.value holds positions."),
            ],
        },
        statuses(),
        verdicts(),
        flags(),
    ]
}

fn statuses() -> Codes {
    let codes = vec![
        ("ok", CommandStatus::Ok.code(), "Computed as intended."),
        (
            "qp_failed",
            CommandStatus::QpFailed.code(),
            "The quadratic programme failed; the command is the controller's fallback.",
        ),
        (
            "qp_limit",
            CommandStatus::QpLimit.code(),
            "The quadratic programme stopped at its iteration limit.",
        ),
        (
            "no_answer",
            CommandStatus::NoAnswer.code(),
            "The controller has no answer; the gate takes its fallback.",
        ),
    ];
    Codes { name: "CommandStatus", fields: "Command.status", codes }
}

fn verdicts() -> Codes {
    let codes = vec![
        ("accepted", Verdict::Accepted.code(), "The slot is the controller's."),
        ("wrong_magic", Verdict::WrongMagic.code(), "The hello does not begin with FREEPLAY."),
        (
            "wrong_layout",
            Verdict::WrongLayout.code(),
            "Another layout version, or another size of a message.",
        ),
        ("wrong_joints", Verdict::WrongJoints.code(), "Another number of joints than the arm has."),
        (
            "slot_taken",
            Verdict::SlotTaken.code(),
            "The hello claims no seat, or one that its process does not hold: another controller has it.",
        ),
        ("wrong_run", Verdict::WrongRun.code(), "The address of another run."),
        ("no_such_slot", Verdict::NoSuchSlot.code(), "The run has no slot of that number."),
    ];
    Codes { name: "Verdict", fields: "Welcome.verdict", codes }
}

fn flags() -> Codes {
    let codes = vec![
        ("last", State::FLAG_LAST, "This is the last tick of the run."),
        ("tool_tracked", State::FLAG_TOOL_TRACKED, "State.tool holds a measurement."),
        ("fallback", State::FLAG_FALLBACK, "The gate's fallback is in force during this tick."),
    ];
    Codes { name: "Flag", fields: "State.flags (bits; those of the slots are below)", codes }
}

/// Number of joints that a message carries.
pub const JOINTS: usize = size_of::<Joints>() / size_of::<f64>();
