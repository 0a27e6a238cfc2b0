//! The answers of the built-in controllers: identical for identical states, without allocations, and no answer to invalid states.

use crate::simulation::{Outcome, Simulation, model_file, run, run_info};
use freeplay_controller::{Answer, BUILT_IN, Controller, Task, TaskMode, built_in};
use freeplay_shm::{CommandStatus, State};
use nalgebra::DMatrix;

/// A task on the paper's arm with a clearance of 0.6 mm, and the folder that holds its model.
fn task(mode: TaskMode) -> (Task, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let model = model_file(folder.path(), &[(4, 6e-4)]).display().to_string();
    (Task { model, mode, ..Task::default() }, folder)
}

fn started(name: &str, task: &Task) -> Box<dyn Controller> {
    let mut controller = built_in(name).unwrap();
    controller.start(task, &run_info(task, 6)).unwrap();
    controller
}

/// An answer without its times, as bits.
fn bits(answer: &Answer) -> Vec<u64> {
    let joints = [answer.value, answer.velocity, answer.acceleration];
    let numbers = joints.iter().flatten().chain(&answer.deviation).map(|value| value.to_bits());
    numbers.chain([answer.status.code().into(), answer.qp_iterations.into()]).collect()
}

fn recorded(name: &str, task: &Task, ticks: u64) -> Outcome {
    run(built_in(name).unwrap().as_mut(), task, &[(4, 6e-4)], ticks)
}

#[test]
fn the_same_states_give_the_same_answers_bit_for_bit() {
    for mode in [TaskMode::Torque, TaskMode::Driven] {
        let (task, _folder) = task(mode);
        for name in BUILT_IN {
            let outcome = recorded(name, &task, 150);
            let mut again = started(name, &task);
            for (index, (state, answer)) in outcome.states.iter().zip(&outcome.answers).enumerate() {
                let mut replayed = Answer::BLANK;
                again.answer(state, &mut replayed);
                assert_eq!(
                    bits(&replayed),
                    bits(answer),
                    "{name}, {mode:?}: answer {index} differs when replayed"
                );
            }
            let changed = outcome.answers.windows(2).filter(|pair| bits(&pair[0]) != bits(&pair[1])).count();
            println!("{name}, {mode:?}: {changed} of 149 answers differ from the one before");
            assert!(changed > 140, "answers that never change prove nothing");
        }
    }
}

#[test]
fn answering_allocates_nothing_but_what_clarabel_takes() {
    let rows = DMatrix::from_fn(12, 6, |r, c| if r % 6 == c { 1.0 - 2.0 * (r / 6) as f64 } else { 0.0 });
    let mut qp = freeplay_controller::Qp::new(&rows).unwrap();
    let cost = DMatrix::identity(6, 6);
    qp.solve(&cost, &[0.1; 6], &[1.0; 12]);
    let solve = allocation_counter::measure(|| {
        qp.solve(&cost, &[0.2; 6], &[1.0; 12]);
    });
    println!("one solve: {} allocations, {} bytes", solve.count_total, solve.bytes_total);
    for mode in [TaskMode::Torque, TaskMode::Driven] {
        let (task, _folder) = task(mode);
        for (name, allowed) in
            [("computed-torque", 0), ("quasi-static", solve.count_total), ("narx-qp", solve.count_total)]
        {
            let outcome = recorded(name, &task, 60);
            let mut controller = started(name, &task);
            let (mut most, mut free) = (0, 0);
            for (index, state) in outcome.states.iter().enumerate() {
                let mut answer = Answer::BLANK;
                let count = allocation_counter::measure(|| controller.answer(state, &mut answer)).count_total;
                // Clarabel's table of timers grows in its first solve.
                if index > 0 {
                    most = most.max(count);
                    free += u32::from(answer.qp_iterations == 0);
                    assert!(
                        count == 0 || answer.qp_iterations > 0,
                        "{name}, {mode:?}: {count} allocations without Clarabel"
                    );
                }
                assert_eq!(answer.status, CommandStatus::Ok);
            }
            assert!(free > 0, "{name}, {mode:?}: a limit binds at every tick");
            println!("{name}, {mode:?}: at most {most} allocations an answer, {allowed} allowed");
            assert!(most <= allowed, "{name}, {mode:?}: {most} allocations, Clarabel takes {allowed}");
        }
    }
}

#[test]
fn with_a_horizon_answers_are_the_same_again_and_allocate_nothing() {
    for mode in [TaskMode::Torque, TaskMode::Driven] {
        let (mut task, _folder) = task(mode);
        for name in ["quasi-static", "narx-qp"] {
            task.options = toml::Table::new();
            let without = recorded(name, &task, 60);
            task.options = toml::Table::from_iter([("horizon".to_owned(), toml::Value::from(0.02))]);
            let outcome = recorded(name, &task, 60);
            let mut again = started(name, &task);
            let mut differ = 0;
            for (index, (state, expected)) in outcome.states.iter().zip(&outcome.answers).enumerate() {
                let mut answer = Answer::BLANK;
                let count = allocation_counter::measure(|| again.answer(state, &mut answer)).count_total;
                assert_eq!(answer.status, CommandStatus::Ok);
                assert_eq!(
                    bits(&answer),
                    bits(expected),
                    "{name}, {mode:?}: answer {index} differs when replayed"
                );
                assert_eq!(count, 0, "{name}, {mode:?}: answer {index} allocates");
                differ += usize::from(bits(&answer) != bits(&without.answers[index]));
            }
            println!("{name}, {mode:?}: {differ} of 60 answers differ from those without a horizon");
            assert!(differ > 50, "a horizon that changes nothing is none");
        }
    }
}

#[test]
fn a_horizon_out_of_range_is_refused() {
    let (mut task, _folder) = task(TaskMode::Torque);
    for horizon in [-0.01, 0.0004, 0.0606, f64::NAN, f64::INFINITY] {
        task.options = toml::Table::from_iter([("horizon".to_owned(), toml::Value::from(horizon))]);
        for name in ["quasi-static", "narx-qp"] {
            let refused = built_in(name).unwrap().start(&task, &run_info(&task, 6)).unwrap_err().to_string();
            assert!(refused.contains("horizon must be 0 s, or 1 to 60 ticks"), "{horizon}: {refused}");
        }
    }
}

#[test]
fn nonsense_gets_no_answer_and_is_forgotten() {
    for mode in [TaskMode::Torque, TaskMode::Driven] {
        let (task, _folder) = task(mode);
        for name in BUILT_IN {
            let outcome = recorded(name, &task, 40);
            let mut controller = started(name, &task);
            for state in &outcome.states {
                let mut bad = *state;
                match state.tick % 4 {
                    1 => bad.q[1] = f64::NAN,
                    2 => bad.reference_next.q[0] = f64::NAN,
                    3 => bad.applied[3] = f64::INFINITY,
                    _ => {}
                }
                let mut answer = Answer::BLANK;
                controller.answer(&bad, &mut answer);
                let all = [answer.value, answer.velocity, answer.acceleration];
                assert!(all.iter().flatten().all(|value| value.is_finite()), "{name}: {answer:?}");
                // A driven controller ignores torques, and one without feedback ignores positions.
                let touched = matches!(
                    (mode, name, state.tick % 4),
                    (_, _, 2)
                        | (TaskMode::Torque, _, 1 | 3)
                        | (TaskMode::Driven, "quasi-static" | "narx-qp", 1)
                );
                let expected = if touched { CommandStatus::NoAnswer } else { CommandStatus::Ok };
                assert_eq!(answer.status, expected, "{name}, {mode:?}, tick {}", state.tick);
            }
        }
    }
}

#[test]
fn a_controller_that_was_not_started_has_no_answer() {
    for name in BUILT_IN {
        let mut answer = Answer::BLANK;
        built_in(name).unwrap().answer(&State::new(1, 6), &mut answer);
        assert_eq!(answer.status, CommandStatus::NoAnswer);
    }
}

#[test]
fn missed_ticks_do_not_jerk_the_arm() {
    let (task, _folder) = task(TaskMode::Torque);
    let outcome = recorded("quasi-static", &task, 500);
    let mut controller = started("quasi-static", &task);
    let mut worst = 0.0_f64;
    for (state, expected) in outcome.states.iter().zip(&outcome.answers) {
        // The test drops two ticks in a hundred, and twenty in a row.
        if state.tick % 100 == 50 || state.tick % 100 == 51 || (200..220).contains(&state.tick) {
            continue;
        }
        let mut answer = Answer::BLANK;
        controller.answer(state, &mut answer);
        assert_eq!(answer.status, CommandStatus::Ok);
        worst = (0..6).map(|joint| (answer.value[joint] - expected.value[joint]).abs()).fold(worst, f64::max);
    }
    println!("torques differ by at most {worst:.3} N·m from those without a gap (limit 10)");
    assert!(worst < 10.0);
}

#[test]
fn taking_over_from_another_controller_does_not_jump() {
    let (task, _folder) = task(TaskMode::Torque);
    let mut simulation = Simulation::new(&task, &[(4, 6e-4)]);
    let mut first = started("quasi-static", &task);
    let mut second = started("quasi-static", &task);
    let mut last = Answer::BLANK;
    let mut jump = 0.0_f64;
    for tick in 0..700 {
        let state = simulation.state();
        let mut answer = Answer::BLANK;
        let controller = if tick < 600 { &mut first } else { &mut second };
        controller.answer(&state, &mut answer);
        if tick == 600 {
            jump = (0..6).map(|joint| (answer.value[joint] - last.value[joint]).abs()).fold(jump, f64::max);
        }
        last = answer;
        simulation.step(answer);
    }
    println!("torques jump by {jump:.3} N·m at the swap (limit 1)");
    assert!(jump < 1.0);
}

#[test]
fn computed_torque_holds_the_arm_at_rest() {
    let mut controller = started("computed-torque", &Task::default());
    let mut answer = Answer::BLANK;
    controller.answer(&State::new(1, 6), &mut answer);
    // Reference and joints at q = 0: the gravity torques of the fact sheet.
    for (found, expected) in answer.value.iter().zip([0.0, -143.018813, -143.018813, 0.0, -1.252247, 0.0]) {
        assert!((found - expected).abs() < 1e-6, "{answer:?}");
    }
}
