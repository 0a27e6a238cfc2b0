//! The layout of the messages is a contract with programs in other languages: this test pins every size and offset. Whoever
//! changes a number below must raise `LAYOUT_VERSION`; the numbers of `Hello` and `Welcome` never change.

#![allow(clippy::cognitive_complexity, reason = "a table, unrolled by a macro")]

use std::mem::{align_of, offset_of, size_of};

use freeplay_shm::{Command, Hello, LAYOUT_VERSION, MAGIC, MAX_JOINTS, Reference, State, Welcome};

/// Compares the offset of each field with the given number, and checks that the fields follow each other without gaps up to the
/// size of the type.
macro_rules! assert_layout {
    ($type:ident, $size:expr, $($field:ident: $offset:expr),+ $(,)?) => {
        assert_eq!(size_of::<$type>(), $size, "size of {}", stringify!($type));
        assert_eq!(align_of::<$type>(), 8, "alignment of {}", stringify!($type));
        let mut end = 0;
        $(
            let offset = offset_of!($type, $field);
            assert_eq!(offset, $offset, "offset of {}::{}", stringify!($type), stringify!($field));
            assert_eq!(offset, end, "gap before {}::{}", stringify!($type), stringify!($field));
            end = offset + size_of_field(|value: &$type| &raw const value.$field);
        )+
        assert_eq!(end, $size, "gap at the end of {}", stringify!($type));
    };
}

/// Size of the field that `select` points to.
fn size_of_field<Whole, Field>(_select: fn(&Whole) -> *const Field) -> usize {
    size_of::<Field>()
}

#[test]
fn state() {
    assert_eq!((LAYOUT_VERSION, MAX_JOINTS, MAGIC.to_ne_bytes()), (1, 12, *b"FREEPLAY"));
    assert_layout!(Reference, 288, q: 0, qd: 96, qdd: 192);
    assert_layout!(
        State, 1072,
        magic: 0, layout: 8, joints: 12, run: 16, tick: 24, scheduled_ns: 32, published_ns: 40, mode: 48, flags: 52,
        q: 56, qd: 152, tau: 248, applied: 344, reference: 440, reference_next: 728, tool: 1016,
    );
}

#[test]
fn command() {
    assert_layout!(
        Command, 392,
        magic: 0, layout: 8, joints: 12, run: 16, tick: 24, slot: 32, status: 36, received_ns: 40, predict_ns: 48,
        qp_ns: 56, sent_ns: 64, qp_iterations: 72, kind: 76, value: 80, velocity: 176, acceleration: 272, deviation: 368,
    );
}

#[test]
fn hello_and_welcome_are_frozen() {
    assert_layout!(
        Hello, 136,
        magic: 0, layout: 8, state_size: 12, command_size: 16, joints: 20, slot: 24, claim: 28, pid: 32, reserved: 36,
        run: 40, name: 48, reserved_tail: 112,
    );
    assert_layout!(
        Welcome, 1136,
        magic: 0, layout: 8, state_size: 12, command_size: 16, verdict: 20, joints: 24, mode: 28, pace: 32, slots: 36,
        period_ns: 40, ticks: 48, run: 56, task: 64, reserved_tail: 1088,
    );
}
