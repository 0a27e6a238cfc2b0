use freeplay_shm::{Command, MAX_JOINTS, Mode, State};

use super::{Cause, ControllerManager, ControllerSet};
use crate::{Applied, GateLimits, Rejection};

const RUN: u64 = 7;

/// Two controllers of one joint that have both answered the ticks before `tick`, the first active.
fn sound_until(tick: u64) -> ControllerManager {
    let limits = GateLimits {
        mode: Mode::Torque,
        lower: [-100.0; MAX_JOINTS],
        upper: [100.0; MAX_JOINTS],
        period: 1e-3,
        change: [50.0; MAX_JOINTS],
        speed: [5.0; MAX_JOINTS],
        acceleration: [50.0; MAX_JOINTS],
        hold: 20,
    };
    let spec = ControllerSet { controllers: 2, ..ControllerSet::default() };
    let mut manager = ControllerManager::new(&spec, limits, RUN, 1, 1e-3);
    for before in 0..tick {
        play(&mut manager, before, [Some(answer(before, 5.0)), Some(answer(before, 6.0))]);
    }
    manager
}

fn answer(tick: u64, value: f64) -> Command {
    let mut command = Command::answer_to(&State { tick, ..State::new(RUN, 1) }, 0);
    command.value[0] = value;
    command
}

/// The command source after `tick`, and the rejection of the active controller.
fn play(
    manager: &mut ControllerManager,
    tick: u64,
    answers: [Option<Command>; 2],
) -> (Applied, Option<Rejection>) {
    manager.begin_tick();
    for (slot, answer) in answers.into_iter().enumerate() {
        manager.slot_mut(slot).answer = answer.map(|answer| Command { slot: slot as u32, ..answer });
    }
    let verdict = manager.judge(tick, true, &[]);
    (verdict.applied, verdict.rejection)
}

/// For every failure of the active controller, no tick is lost if the standby has answered it.
#[test]
fn the_standby_s_answer_to_the_same_tick_takes_the_place_of_one_that_does_not_pass() {
    let nan = Command { value: [f64::NAN; MAX_JOINTS], ..answer(9, 5.0) };
    for (reason, failed) in [
        (Rejection::Missing, None),
        (Rejection::Stale, Some(answer(8, 5.0))),
        (Rejection::NotFinite, Some(nan)),
        (Rejection::OutOfRange, Some(answer(9, 101.0))),
        (Rejection::TooFast, Some(answer(9, 90.0))),
        (Rejection::Malformed, Some(Command { magic: 1, ..answer(9, 5.0) })),
    ] {
        let mut manager = sound_until(9);
        assert_eq!(manager.active(), 0);
        assert_eq!(play(&mut manager, 9, [failed, Some(answer(9, 6.0))]), (Applied::Command, Some(reason)));
        assert_eq!(manager.active(), 1, "{reason:?}");
        let swap = manager.swaps()[0];
        assert_eq!((swap.tick, swap.gap, swap.held, swap.cause), (9, 0, 0, Cause::Failed(reason)));
        assert_eq!(manager.in_force().map(|command| command.tick), Some(9), "the answer to this very tick");
    }
}

#[test]
fn where_nobody_has_answered_the_command_is_held_until_somebody_has() {
    let mut manager = sound_until(9);
    for tick in 9..12 {
        assert_eq!(play(&mut manager, tick, [None, None]), (Applied::Hold, Some(Rejection::Missing)));
    }
    assert_eq!(play(&mut manager, 12, [None, Some(answer(12, 6.0))]).0, Applied::Command);
    let swap = manager.swaps()[0];
    assert_eq!((swap.tick, swap.gap, swap.held, manager.active()), (12, 3, 3, 1));
    // An old answer of the standby counts as no answer.
    let mut manager = sound_until(9);
    assert_eq!(play(&mut manager, 9, [None, Some(answer(8, 6.0))]).0, Applied::Hold);
}
