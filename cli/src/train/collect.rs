//! From runs to what trains and tests: the extractor of the controller, fed state by state.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use freeplay_arm::{ArmFile, EffectTable, forward_kinematics, to_toml};
use freeplay_controller::features::{Features, REGRESSORS};
use freeplay_controller::{Model, QuasiStatic, Task, TaskMode};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_path::JointPath;
use freeplay_shm::State;
use indicatif::ProgressBar;
use nalgebra::Vector3;

use crate::exit::Failure;
use crate::train::simulate::{RATE, RunSpec, Subject, simulate};

/// What is known at one tick, and the truth.
#[derive(Clone, Debug)]
pub struct Row {
    /// What the network looks at.
    pub regressors: [f64; REGRESSORS.len()],
    /// Unit of its answer, m.
    pub scale: f64,
    /// Where the journal is, slides, m.
    pub journal: [f64; 2],
    /// Where it rests now and at the target, m.
    pub rests: [[f64; 2]; 2],
    /// Where the twin expects it at the target, m.
    pub forecast: [f64; 2],
    /// n at the target.
    pub normal: [f64; 2],
    /// Directions of the slides at the target, base frame.
    pub directions: [Vector3<f64>; 2],
    /// Whether the journal flies.
    pub free: bool,
}

/// One run, row after row without a gap from tick `first` on.
#[derive(Clone, Debug)]
pub struct Collected {
    /// What was run.
    pub spec: RunSpec,
    /// Tick of the first row.
    pub first: u64,
    /// The rows.
    pub rows: Vec<Row>,
}

impl Collected {
    /// `pair`, in the frame of the contact at the target of `row`, along the slides.
    pub fn along_slides(row: &Row, [n, t]: [f64; 2]) -> [f64; 2] {
        let [a, b] = row.normal;
        [n * a - t * b, n * b + t * a]
    }

    /// `pair`, along the slides, in the frame of the contact at the target of `row`.
    pub fn in_contact(row: &Row, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b] = row.normal;
        [x * a + y * b, y * a - x * b]
    }
}

/// Runs all `specs` on all cores and looks `horizon` ticks ahead from every state. `tracked` hides the tool if false.
///
/// # Errors
/// The first run that fails.
pub fn collect(
    subject: &Subject,
    specs: &[RunSpec],
    horizon: usize,
    tracked: bool,
    bar: &ProgressBar,
) -> Result<Vec<Collected>, Failure> {
    let next = AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, usize::from).min(specs.len().max(1));
    let work = || {
        let mut mine = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(spec) = specs.get(index) else { return Ok(mine) };
            mine.push((index, one(subject, spec, horizon, tracked)?));
            bar.inc(1);
        }
    };
    let done: Vec<Result<Vec<(usize, Collected)>, Failure>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let lost = || Err(Failure::internal("a run failed; its message is above"));
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(|_| lost())).collect()
    });
    let mut all = Vec::with_capacity(specs.len());
    for runs in done {
        all.extend(runs?);
    }
    all.sort_by_key(|(index, _)| *index);
    Ok(all.into_iter().map(|(_, run)| run).collect())
}

fn one(subject: &Subject, spec: &RunSpec, horizon: usize, tracked: bool) -> Result<Collected, Failure> {
    let fault = |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", spec.name));
    let clearance = Clearance::new(&ClearanceTable::new(spec.clearance)).map_err(|error| fault(&error))?;
    let model = Model {
        arm: subject.arm.clone(),
        clearances: vec![(subject.joint, clearance)],
        effects: Arc::default(),
    };
    let play = ArmWithPlay::new(&model.arm, &model.clearances).map_err(|error| fault(&error))?;
    let path = JointPath::plan(&model.arm, &spec.path, RATE).map_err(|error| fault(&error))?;
    let mut features = Features::new(&model, &play, path, TaskMode::Torque, 1.0 / RATE, horizon)
        .ok_or_else(|| Failure::usage(format!("--horizon {horizon}: give 1 to 16 ticks")))?;
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let task = task(subject, spec, folder.path())?;
    let mut collected = Collected { spec: spec.clone(), first: 0, rows: Vec::new() };
    let mut truth = Truth::new(&model, &play);
    simulate(subject, spec, &task, |state, free| {
        let journal = truth.journal(state);
        let mut state = *state;
        if !tracked {
            state.flags &= !State::FLAG_TOOL_TRACKED;
        }
        let seen = features.push(&state).map(|outlines| (*outlines.regressors, outlines.scale));
        match seen {
            None => collected.rows.clear(),
            Some((regressors, scale)) => {
                if collected.rows.is_empty() {
                    collected.first = state.tick;
                }
                let rests = features.rests();
                let beyond = features.forecast();
                collected.rows.push(Row {
                    regressors,
                    scale,
                    journal,
                    rests,
                    forecast: [rests[1][0] + beyond[0], rests[1][1] + beyond[1]],
                    normal: features.along_slides([1.0, 0.0]),
                    directions: features.directions(),
                    free,
                });
            }
        }
    })?;
    Ok(collected)
}

/// Where the journal truly is, from an ideally tracked tool.
struct Truth {
    arm: freeplay_arm::Arm,
    workspace: freeplay_arm::Workspace,
    slides: QuasiStatic,
}

impl Truth {
    fn new(model: &Model, play: &ArmWithPlay) -> Self {
        Self {
            workspace: freeplay_arm::Workspace::new(&model.arm),
            arm: model.arm.clone(),
            slides: QuasiStatic::new(play, 1.0 / RATE),
        }
    }

    /// Offset along the slides, m: they move the tool along two directions at right angles.
    fn journal(&mut self, state: &State) -> [f64; 2] {
        let q = &state.q[..self.arm.dof()];
        let tool = forward_kinematics(&self.arm, &mut self.workspace, q).translation.vector;
        let off = Vector3::new(state.tool[0], state.tool[1], state.tool[2]) - tool;
        [[1.0, 0.0], [0.0, 1.0]].map(|slide| self.slides.deviation_with(q, &slide).dot(&off))
    }
}

/// The task of the controller of `spec`, with the true model in `folder`.
fn task(subject: &Subject, spec: &RunSpec, folder: &std::path::Path) -> Result<Task, Failure> {
    let parameters = toml::Table::from_iter([("clearance".to_owned(), toml::Value::from(spec.clearance))]);
    let joint = Some(subject.arm.joints()[subject.joint].name.clone());
    let effect = EffectTable { kind: Clearance::KIND.to_owned(), joint, parameters, line: 0 };
    let file = ArmFile { arm: subject.arm.clone(), effects: vec![effect], ignored: Vec::new() };
    let model = folder.join("model.toml");
    crate::setup::write(&model, &to_toml(&file))?;
    Ok(Task {
        model: model.display().to_string(),
        gravity: Some((*subject.arm.gravity()).into()),
        rate: RATE,
        path: spec.path.clone(),
        ..Task::default()
    })
}
