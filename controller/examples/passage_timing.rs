//! Computing time of passing a corner: the planning of a passage before the run (sharp square, c = 0.6 mm, T = 6 s); within a
//! tick, the programme that follows it; and, for comparison, the programme on accelerations, which considers one tick.
//!
//! `cargo run --release --workspace --example passage_timing`
//!
//! For scale, one update and solve of a sparse horizon of 10 steps by Clarabel on the reference machine: 499 µs p50, 606 µs p99.

use std::error::Error;
use std::time::Instant;

use freeplay_arm::{Arm, Workspace, jacobian};
use freeplay_controller::acceleration_programme::Wanted;
use freeplay_controller::displacement_preview::DisplacementPreview;
use freeplay_controller::{
    AccelerationOptions, AccelerationProgramme, CompensationStatus, CornerSearch, Correction, Motion,
    Passage, PassageOptions, Weights,
};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_model::paper_arm;
use freeplay_path::{JointPath, PathKind, PathSpec};
use nalgebra::{DMatrix, Vector3, Vector6};

const PERIOD: f64 = 1e-3;
/// Number of plannings of a corner.
const PLANS: usize = 20;
/// Number of runs along a passage.
const LAPS: usize = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let arm = paper_arm().arm;
    let play = ArmWithPlay::new(&arm, &[(4, Clearance::new(&ClearanceTable::new(6e-4))?)])?;
    let spec = PathSpec { kind: PathKind::SquareSharp, period: 6.0, ..PathSpec::default() };
    let path = JointPath::plan(&arm, &spec, 1.0 / PERIOD)?;
    let (options, weights) = (PassageOptions::default(), Weights::default());
    let search = CornerSearch { arm: &arm, with_play: &play, period: PERIOD, weights, options };
    println!("{:<44} {:>9} {:>9} {:>9} {:>9}", "µs", "p50", "p99", "p99.9", "max");
    let mut planned: Option<Passage> = None;
    let mut plans = Vec::with_capacity(PLANS);
    for _ in 0..PLANS {
        let mut outlook = DisplacementPreview::new(path.clone(), &play, PERIOD, 10);
        let begun = Instant::now();
        let passages = search.passages(&mut outlook, 1300, 1700);
        plans.push(begun.elapsed());
        planned = passages.planned().first().cloned();
    }
    let passage = planned.ok_or("the corner could not be planned")?;
    print(&format!("before the run: one corner, {} ticks", passage.ticks()), plans);
    let mut follow = Vec::new();
    let (mut single, mut bound) = (Vec::new(), Vec::new());
    for _ in 0..LAPS {
        follow.extend(followed(&arm, &path, &passage, &weights)?);
        for (time, status) in guarded(&arm, &play, &path, &passage)? {
            single.push(time);
            if status != CompensationStatus::Free {
                bound.push(time);
            }
        }
    }
    print("in a tick: to follow the passage", follow);
    print("in a tick: accelerations with contact rows", single);
    if bound.is_empty() {
        println!("no row binds");
    } else {
        print(&format!("those of them in which a row binds, {} a lap", bound.len() / LAPS), bound);
    }
    Ok(())
}

fn print(name: &str, mut times: Vec<std::time::Duration>) {
    times.sort_unstable();
    let last = times.len() - 1;
    let at = |quantile: f64| times[(quantile * last as f64).round() as usize].as_secs_f64() * 1e6;
    println!("{name:<44} {:>9.1} {:>9.1} {:>9.1} {:>9.1}", at(0.5), at(0.99), at(0.999), at(1.0));
}

/// The motion of the path at `tick`: positions, velocities, accelerations.
fn motion(path: &JointPath, tick: u64) -> [[f64; 6]; 3] {
    let mut motion = [[0.0; 6]; 3];
    let [q, v, a] = &mut motion;
    path.at(tick as f64 * PERIOD, q, v, a);
    motion
}

/// Times of the programme that follows `passage`, tick by tick.
fn followed(
    arm: &Arm,
    path: &JointPath,
    passage: &Passage,
    weights: &Weights,
) -> Result<Vec<std::time::Duration>, Box<dyn Error>> {
    let mut correction = Correction::new(arm, PERIOD, 1e-3, weights)?;
    correction.start(&[0.0; 6], &[0.0; 6]);
    let ticks = passage.first()..passage.first() + passage.ticks() as u64;
    let rows = ticks.filter_map(|tick| passage.at(tick).map(|step| (tick, step)));
    Ok(rows
        .map(|(tick, step)| {
            let [q, v, a] = motion(path, tick);
            let begun = Instant::now();
            correction.follow(
                arm,
                Motion { q: &q, v: &v, a: &a },
                step.corrections,
                &Vector3::new(1e-6, 0.0, 0.0),
            );
            begun.elapsed()
        })
        .collect())
}

/// Times of the programme on accelerations on the same ticks, and the status of each solve.
fn guarded(
    arm: &Arm,
    play: &ArmWithPlay,
    path: &JointPath,
    passage: &Passage,
) -> Result<Vec<(std::time::Duration, CompensationStatus)>, Box<dyn Error>> {
    let mut programme = AccelerationProgramme::new(arm, play, PERIOD, AccelerationOptions::default())?;
    let (mut workspace, mut tool) = (Workspace::new(arm), DMatrix::zeros(6, 6));
    let ticks = passage.first()..passage.first() + passage.ticks() as u64;
    let rows = ticks.filter_map(|tick| passage.at(tick).map(|step| (tick, step)));
    Ok(rows
        .map(|(tick, step)| {
            let [q, v, a] = motion(path, tick);
            jacobian(arm, &mut workspace, &q, &mut tool);
            let wanted = &tool * nalgebra::DVector::from_row_slice(&a);
            let wanted = Vector6::from_column_slice(wanted.as_slice());
            let [x, y] = [step.journals[0], step.journals[1]];
            let normal = [x / x.hypot(y), y / x.hypot(y)];
            let journals = Motion { q: step.journals, v: &[0.0; 2], a: &[0.0; 2] };
            let joints = Motion { q: &q, v: &v, a: &a };
            let wanted = Wanted { jacobian: &tool, tool: &wanted, joints: &a };
            let begun = Instant::now();
            let report = programme.solve(joints, journals, &normal, &[0.0; 6], &wanted);
            (begun.elapsed(), report.status)
        })
        .collect())
}
