//! Time of the compensation programmes in the ticks of a run, sharp square, T = 6 s, c = 0.6 mm; runs of the one-tick programme and of a
//! horizon alternate.
//!
//! `cargo run --release --workspace --example horizon_timing [HORIZON [WEIGHT]]`: s, mm²/(rad/s²)²
//!
//! The joints are on the reference. The programmes do not depend on this, because they use the planned path alone.

use std::error::Error;

use freeplay_controller::quasi_static::QUASI_STATIC;
use freeplay_controller::{Answer, RunInfo, Task, built_in};
use freeplay_model::{EffectTable, paper_arm, to_toml};
use freeplay_path::{JointPath, PathKind, PathSpec};
use freeplay_shm::{CommandStatus, Mode, Pace, State};

const TICKS: u64 = 6000;
/// Number of alternating runs of each programme.
const TURNS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: f64| arguments.next().map_or(Ok(default), |text| text.parse::<f64>());
    let (span, weight) = (number(0.02)?, number(1e-5)?);
    let file = std::env::temp_dir().join(format!("horizon_timing-{}.toml", std::process::id()));
    let mut model = paper_arm();
    let parameters = toml::Table::from_iter([("clearance".to_owned(), toml::Value::from(6e-4))]);
    let joint = Some(model.arm.joints()[4].name.clone());
    model.effects.push(EffectTable { kind: "joint_clearance".to_owned(), joint, parameters, line: 0 });
    std::fs::write(&file, to_toml(&model))?;
    let path = PathSpec { kind: PathKind::SquareSharp, ..PathSpec::default() };
    let task = Task { model: file.display().to_string(), path, ..Task::default() };
    let states = states(&task)?;
    let weights = toml::Table::from_iter([("acceleration".to_owned(), weight.into())]);
    let horizon = toml::Table::from_iter([
        ("horizon".to_owned(), toml::Value::from(span)),
        ("weights".to_owned(), toml::Value::from(weights)),
    ]);
    let programmes = [("one tick", toml::Table::new()), ("horizon", horizon)];
    let mut runs: [Vec<Vec<Answer>>; 2] = Default::default();
    for _ in 0..TURNS {
        for ((_, options), runs) in programmes.iter().zip(&mut runs) {
            runs.push(run(&Task { options: options.clone(), ..task.clone() }, &states)?);
        }
    }
    std::fs::remove_file(&file)?;
    println!("horizon {span} s, weight {weight:e}, {TURNS} runs of {TICKS} ticks each in turns, µs");
    for ((name, _), runs) in programmes.iter().zip(&runs) {
        let failed = runs[0].iter().filter(|answer| answer.status != CommandStatus::Ok).count();
        println!("\n{name}: {failed} ticks without a solution");
        println!("{:<34} {:>6} {:>7} {:>7} {:>7} {:>7}", "", "ticks", "p50", "p99", "p99.9", "max");
        let is_free = |answer: &Answer| answer.qp_iterations == 0;
        report("predict", runs, |answer| Some(answer.predict_ns));
        report("programme", runs, |answer| Some(answer.qp_ns));
        report("- free", runs, |answer| is_free(answer).then_some(answer.qp_ns));
        report("- iterated", runs, |answer| (!is_free(answer)).then_some(answer.qp_ns));
        let iterations =
            runs[0].iter().filter(|answer| !is_free(answer)).map(|answer| answer.qp_iterations.into());
        print("iterations", iterations.collect(), 1.0);
    }
    Ok(())
}

/// Prints the times that `of` extracts from the answers of `runs`: all of them, and the least of each tick. The runs solve the same
/// programmes, so only the machine makes them differ.
fn report(name: &str, runs: &[Vec<Answer>], of: impl Fn(&Answer) -> Option<u64>) {
    print(name, runs.iter().flatten().filter_map(&of).collect(), 1e3);
    let least = (0..TICKS as usize).filter_map(|tick| runs.iter().filter_map(|run| of(&run[tick])).min());
    print(&format!("{name}, least of {TURNS} runs"), least.collect(), 1e3);
}

fn print(name: &str, mut values: Vec<u64>, unit: f64) {
    values.sort_unstable();
    let Some(last) = values.len().checked_sub(1) else { return };
    let at = |share: f64| values[(last as f64 * share) as usize] as f64 / unit;
    println!(
        "{name:<34} {:>6} {:>7.1} {:>7.1} {:>7.1} {:>7.1}",
        values.len(),
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0)
    );
}

/// States of joints that follow the reference of `task`.
fn states(task: &Task) -> Result<Vec<State>, Box<dyn Error>> {
    let path = JointPath::plan(&paper_arm().arm, &task.path, task.rate)?;
    let on = |tick: u64| {
        let mut state = State::new(1, path.dof());
        state.tick = tick;
        let reference = &mut state.reference;
        path.at(tick as f64 * task.period(), &mut reference.q, &mut reference.qd, &mut reference.qdd);
        (state.q, state.qd) = (state.reference.q, state.reference.qd);
        let next = &mut state.reference_next;
        path.at((tick + 1) as f64 * task.period(), &mut next.q, &mut next.qd, &mut next.qdd);
        state
    };
    Ok((0..TICKS).map(on).collect())
}

fn run(task: &Task, states: &[State]) -> Result<Vec<Answer>, Box<dyn Error>> {
    let mut controller = built_in(QUASI_STATIC).ok_or("no such controller")?;
    let run =
        RunInfo { joints: 6, mode: Mode::Torque, pace: Pace::Lockstep, period_ns: 1_000_000, ticks: TICKS };
    controller.start(task, &run)?;
    let answered = states.iter().map(|state| {
        let mut answer = Answer::BLANK;
        controller.answer(state, &mut answer);
        answer
    });
    Ok(answered.collect())
}
