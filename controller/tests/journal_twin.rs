//! The twin of the journals beside a simulation of its own: another integrator, the same laws.

#![allow(clippy::unwrap_used, reason = "a test ends at the first surprise")]

mod simulation;

use std::sync::Arc;

use freeplay_arm::paper_arm;
use freeplay_controller::features::Features;
use freeplay_controller::{Answer, Model, Task, TaskMode, built_in};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_path::JointPath;
use freeplay_shm::State;
use simulation::{Simulation, model_file, run_info};

const HORIZON: usize = 3;
const C: f64 = 6e-4;

/// RMS errors of what is said `HORIZON` ticks ahead over the first 0.25 s, in which the journal falls and bounces: by the twin, by
/// persistence, m.
fn forecast_errors(mode: TaskMode, tracked: bool) -> [f64; 2] {
    let folder = tempfile::tempdir().unwrap();
    let model = model_file(folder.path(), &[(4, C)]).display().to_string();
    let task = Task { model, mode, ..Task::default() };
    let clearance = Clearance::new(&ClearanceTable::new(C)).unwrap();
    let model = Model { arm: paper_arm().arm, clearances: vec![(4, clearance)], effects: Arc::default() };
    let play = ArmWithPlay::new(&model.arm, &model.clearances).unwrap();
    let path = JointPath::plan(&model.arm, &task.path, task.rate).unwrap();
    let mut features = Features::new(&model, &play, path, mode, task.period(), HORIZON).unwrap();
    let mut simulation = Simulation::new(&task, &[(4, C)]);
    let mut controller = built_in("quasi-static").unwrap();
    controller.start(&task, &run_info(&task, simulation.joints())).unwrap();
    let (mut said, mut truth) = (Vec::new(), Vec::new());
    for _ in 0..250 {
        let mut state = simulation.state();
        if !tracked {
            state.flags &= !State::FLAG_TOOL_TRACKED;
            state.tool = [f64::NAN; 7];
        }
        features.push(&state).unwrap();
        let (beyond, [_, rest]) = (features.forecast(), features.rests());
        said.push([rest[0] + beyond[0], rest[1] + beyond[1]]);
        truth.push(simulation.journals());
        let mut answer = Answer::BLANK;
        controller.answer(&state, &mut answer);
        simulation.step(answer);
    }
    let rms = |error: &dyn Fn(usize) -> f64| {
        let ticks = 10..truth.len() - HORIZON;
        let count = ticks.len() as f64;
        (ticks.map(error).sum::<f64>() / count).sqrt()
    };
    let off = |a: &[f64], b: &[f64]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    let twin = rms(&|tick| off(&said[tick], &truth[tick + HORIZON]));
    let persistence = rms(&|tick| off(&truth[tick], &truth[tick + HORIZON]));
    println!(
        "{mode:?}, tracked {tracked}: twin {:.2} µm, persistence {:.2} µm, {HORIZON} ticks ahead",
        twin * 1e6,
        persistence * 1e6
    );
    [twin, persistence]
}

#[test]
fn it_forecasts_the_bounces_of_a_tracked_journal() {
    for mode in [TaskMode::Torque, TaskMode::Driven] {
        let [twin, persistence] = forecast_errors(mode, true);
        assert!(persistence > 2e-5, "there is something to forecast");
        assert!(twin < 0.3 * persistence, "{mode:?}");
    }
}
