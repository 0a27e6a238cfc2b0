//! Time of one answer of each built-in controller on the paper's arm, c = 0.6 mm, on the smooth path and the sharp square, with the
//! joints on the reference. For the programme, the example distinguishes ticks without an active limit (`free`) from those in which
//! Clarabel iterates.
//!
//! `cargo run --release -p freeplay-controller --example answer_timing`

use std::error::Error;
use std::time::Instant;

use freeplay_arm::{Workspace, forward_kinematics};
use freeplay_controller::{Answer, BUILT_IN, RunInfo, Task, TaskMode, built_in};
use freeplay_model::{EffectTable, paper_arm, to_toml};
use freeplay_path::{JointPath, PathKind, PathSpec};
use freeplay_shm::{Mode, Pace, State};

const TICKS: u64 = 6000;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::temp_dir().join(format!("answer_timing-{}.toml", std::process::id()));
    let mut model = paper_arm();
    let parameters = toml::Table::from_iter([("clearance".to_owned(), toml::Value::from(6e-4))]);
    let joint = Some(model.arm.joints()[4].name.clone());
    model.effects.push(EffectTable { kind: "joint_clearance".to_owned(), joint, parameters, line: 0 });
    std::fs::write(&file, to_toml(&model))?;
    let task = Task { model: file.display().to_string(), ..Task::default() };
    println!("{TICKS} answers each, µs");
    println!(
        "{:<16} {:<8} {:<12} {:>6} {:>7} {:>7} {:>7} {:>7}",
        "controller", "mode", "stage", "ticks", "p50", "p99", "p99.9", "max"
    );
    for kind in [PathKind::Lissajous, PathKind::SquareSharp] {
        let task = Task { path: PathSpec { kind, ..task.path.clone() }, ..task.clone() };
        let states = states(&task)?;
        println!("{kind:?}");
        for mode in [TaskMode::Torque, TaskMode::Driven] {
            for name in BUILT_IN {
                measure(name, &Task { mode, ..task.clone() }, &states)?;
            }
        }
    }
    std::fs::remove_file(&file)?;
    Ok(())
}

/// States of joints that follow the reference of `task`; the tracker measures the tool 0.6 mm below that of the perfect arm.
fn states(task: &Task) -> Result<Vec<State>, Box<dyn Error>> {
    let arm = paper_arm().arm;
    let mut workspace = Workspace::new(&arm);
    let path = JointPath::plan(&paper_arm().arm, &task.path, task.rate)?;
    let mut on = |tick: u64| {
        let mut state = State::new(1, path.dof());
        state.tick = tick;
        let reference = &mut state.reference;
        path.at(tick as f64 * task.period(), &mut reference.q, &mut reference.qd, &mut reference.qdd);
        (state.q, state.qd) = (state.reference.q, state.reference.qd);
        let tool = forward_kinematics(&arm, &mut workspace, &state.q[..arm.dof()]);
        state.tool[..3].copy_from_slice(tool.translation.vector.as_slice());
        state.tool[2] -= 6e-4;
        state.tool[3..].copy_from_slice(tool.rotation.coords.as_slice());
        state.flags = State::FLAG_TOOL_TRACKED;
        let next = &mut state.reference_next;
        path.at((tick + 1) as f64 * task.period(), &mut next.q, &mut next.qd, &mut next.qdd);
        state
    };
    Ok((0..TICKS).map(&mut on).collect())
}

fn measure(name: &str, task: &Task, states: &[State]) -> Result<(), Box<dyn Error>> {
    let mut controller = built_in(name).ok_or("no such controller")?;
    let mode = if task.mode == TaskMode::Torque { Mode::Torque } else { Mode::Driven };
    let run = RunInfo { joints: 6, mode, pace: Pace::Lockstep, period_ns: 1_000_000, ticks: TICKS };
    let begun = Instant::now();
    controller.start(task, &run)?;
    println!("{name:<16} started in {:.1} ms", 1e3 * begun.elapsed().as_secs_f64());
    let mut stages =
        ["answer", "  predict", "  programme", "  - free", "  - iterated"].map(|name| (name, Vec::new()));
    for state in states {
        let mut answer = Answer::BLANK;
        let begun = Instant::now();
        controller.answer(state, &mut answer);
        let took = begun.elapsed().as_nanos() as u64;
        for ((_, times), took) in stages.iter_mut().zip([took, answer.predict_ns, answer.qp_ns]) {
            times.push(took);
        }
        let kind = if answer.qp_iterations == 0 { 3 } else { 4 };
        stages[kind].1.push(answer.qp_ns);
    }
    for (stage, mut times) in stages.into_iter().filter(|(_, times)| !times.is_empty()) {
        times.sort_unstable();
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize] as f64 / 1e3;
        if at(1.0) > 0.0 {
            println!(
                "{name:<16} {:<8} {stage:<12} {:>6} {:>7.1} {:>7.1} {:>7.1} {:>7.1}",
                format!("{:?}", task.mode).to_lowercase(),
                times.len(),
                at(0.5),
                at(0.99),
                at(0.999),
                at(1.0)
            );
        }
    }
    Ok(())
}
