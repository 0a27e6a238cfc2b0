//! Tests of messages: names of faults, fields copied into an answer, and codes.

use freeplay_shm::{
    Command, CommandKind, CommandStatus, Hello, MAX_JOINTS, MessageFault, Mode, Offer, Pace, State, Verdict,
};
use proptest::prelude::{any, prop_assert, prop_assert_eq, proptest};

const RUN: u64 = 42;

#[test]
fn every_fault_has_its_name() {
    let good = State::new(RUN, 7);
    assert_eq!(good.check(RUN), Ok(()));
    let faults = [
        (State { magic: 1, ..good }, MessageFault::Magic { found: 1 }),
        (State { layout: 9, ..good }, MessageFault::Layout { found: 9 }),
        (State { run: 43, ..good }, MessageFault::Run { found: 43, expected: RUN }),
        (State { joints: 0, ..good }, MessageFault::Joints { found: 0 }),
        (State { joints: 13, ..good }, MessageFault::Joints { found: 13 }),
    ];
    for (state, fault) in faults {
        assert_eq!(state.check(RUN), Err(fault));
        let answer = Command { magic: state.magic, layout: state.layout, ..Command::answer_to(&state, 0) };
        assert_eq!(answer.check(RUN), Err(fault));
    }
    // The check names the first fault; the other fields of a message of another protocol are meaningless.
    assert_eq!(State { magic: 1, layout: 9, ..good }.check(RUN), Err(MessageFault::Magic { found: 1 }));
}

#[test]
fn an_answer_copies_what_ties_it_to_its_state() {
    let state = State { tick: 17, mode: Mode::Driven.code(), ..State::new(RUN, 6) };
    let answer = Command::answer_to(&state, 3);
    assert_eq!((answer.run, answer.tick, answer.joints, answer.slot), (RUN, 17, 6, 3));
    assert_eq!(CommandKind::from_code(answer.kind), Some(CommandKind::Position));
    assert_eq!(CommandStatus::from_code(answer.status), Some(CommandStatus::Ok));
    let torque = Command::answer_to(&State { mode: Mode::Torque.code(), ..state }, 3);
    assert_eq!(CommandKind::from_code(torque.kind), Some(CommandKind::Torque));
}

#[test]
fn the_numbers_that_travel_are_pinned() {
    assert_eq!([Mode::Torque.code(), Mode::Driven.code(), Mode::Servo.code()], [0, 1, 2]);
    assert_eq!([Pace::Lockstep.code(), Pace::RealTime.code()], [0, 1]);
    assert_eq!([CommandKind::Torque.code(), CommandKind::Position.code()], [0, 1]);
    let statuses =
        [CommandStatus::Ok, CommandStatus::QpFailed, CommandStatus::QpLimit, CommandStatus::NoAnswer];
    assert_eq!(statuses.map(CommandStatus::code), [0, 1, 2, 3]);
    assert_eq!([State::FLAG_LAST, State::FLAG_TOOL_TRACKED, State::FLAG_FALLBACK], [1, 2, 4]);
    let verdicts: Vec<Verdict> = (0..8).filter_map(Verdict::from_code).collect();
    let in_order = [
        Verdict::Accepted,
        Verdict::WrongMagic,
        Verdict::WrongLayout,
        Verdict::WrongJoints,
        Verdict::SlotTaken,
        Verdict::WrongRun,
        Verdict::NoSuchSlot,
    ];
    assert_eq!(verdicts, in_order);
}

proptest! {
    #[test]
    fn a_code_is_read_back_as_itself_or_not_at_all(code in any::<u32>()) {
        prop_assert!(CommandStatus::from_code(code).is_none_or(|status| status.code() == code));
        prop_assert_eq!(Mode::from_code(code).is_some(), code < 3);
    }

    #[test]
    fn names_and_paths_are_cut_at_a_character_and_come_back(text in "\\PC{0,80}") {
        let name = Hello::new(&text, 0, 0).name();
        prop_assert!(text.starts_with(&name) && name.len() <= 64 && (name == text || name.len() > 60));
        let offer = Offer {
            joints: MAX_JOINTS, mode: Mode::Torque, pace: Pace::Lockstep, period_ns: 1, ticks: 1, task: text.clone(),
        };
        prop_assert_eq!(offer.welcome(RUN, 1, Verdict::Accepted).task(), text);
    }
}
