//! From runs to what trains and tests: the extractor of the controller, fed state by state.

use std::sync::Arc;

use freeplay_arm::forward_kinematics;
use freeplay_controller::features::{Features, REGRESSORS};
use freeplay_controller::learned::Learned;
use freeplay_controller::narx_qp::lap;
use freeplay_controller::{Model, QuasiStatic, TaskMode};
use freeplay_laws::{ArmWithPlay, Clearance, ClearanceTable};
use freeplay_path::JointPath;
use freeplay_plant::DeviationStatistics;
use freeplay_predictor::Narx;
use freeplay_shm::{Joints, State};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::parallel::on_all_cores;
use indicatif::ProgressBar;
use nalgebra::Vector3;

use crate::closed_loop::{ClosedLoop, RATE, task};
use crate::train::scenarios::{RunSpec, Subject};

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
    /// Where the twin with the network, fed with what the network said before, expects it there, m; as the twin without a network.
    pub piloted: [f64; 2],
    /// Where narx-qp expects it there, m.
    pub product: [f64; 2],
    /// Whether the journal flies.
    pub free: bool,
    /// What the paper's network looks at: the torques of the joints, N·m (N), and the tool's reference, base frame, m.
    pub torque: Joints,
    /// See above.
    pub path: [f64; 3],
    /// The tool's deviation, base frame, m.
    pub deviation: [f64; 3],
}

/// One run, row after row without a gap from tick `first` on.
#[derive(Clone, Debug)]
pub struct Collected {
    /// What was run.
    pub spec: RunSpec,
    /// Joints of the arm.
    pub joints: usize,
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

/// Who looks ahead.
#[derive(Clone, Copy, Debug)]
pub struct Observer<'a> {
    /// Ticks looked ahead.
    pub horizon: usize,
    /// Whether the tool is seen.
    pub tracked: bool,
    /// The network that says, tick by tick, how wrong the twin's forecast will be; without a tracked tool the twin believes it. narx-qp
    /// corrects its forecast by it as far as it is trusted.
    pub network: Option<&'a Narx>,
}

/// Runs all `specs` on all cores, with `observer` looking ahead from every state.
///
/// # Errors
/// The first run that fails.
pub fn collect(
    subject: &Subject,
    specs: &[RunSpec],
    observer: Observer<'_>,
    bar: &ProgressBar,
) -> Result<Vec<Collected>, Failure> {
    on_all_cores(specs.len(), |index| {
        let collected = one(subject, &specs[index], observer);
        bar.inc(1);
        collected
    })
}

fn one(subject: &Subject, spec: &RunSpec, observer: Observer<'_>) -> Result<Collected, Failure> {
    let Observer { horizon, tracked, network } = observer;
    let fault = |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", spec.name));
    let clearance = Clearance::new(&ClearanceTable::new(spec.clearance)).map_err(|error| fault(&error))?;
    let model = Model {
        arm: subject.arm.clone(),
        clearances: vec![(subject.joint, clearance)],
        effects: Arc::default(),
    };
    let play = ArmWithPlay::new(&model.arm, &model.clearances).map_err(|error| fault(&error))?;
    let path = JointPath::plan(&model.arm, &spec.path, RATE).map_err(|error| fault(&error))?;
    let features = Features::new(&model, &play, path, TaskMode::Torque, 1.0 / RATE, horizon)
        .ok_or_else(|| Failure::usage(format!("--horizon {horizon}: give 1 to 16 ticks")))?;
    let folder = tempfile::tempdir().map_err(Failure::internal)?;
    let plays = [(subject.joint, spec.clearance)];
    let task = task(&subject.arm, &plays, &spec.path, toml::Table::new(), folder.path())?;
    let mut collected =
        Collected { spec: spec.clone(), joints: subject.arm.dof(), first: 0, rows: Vec::new() };
    let mut truth = Truth::new(&model, &play);
    let lap = lap(&spec.path, RATE);
    let mut learned = Learned::new(features, network.cloned(), 1.0 / RATE, lap);
    let run = ClosedLoop {
        arm: &subject.arm,
        plays: &plays,
        path: &spec.path,
        controller: spec.controller,
        task: &task,
        tracked: true,
        after: DeviationStatistics::START,
    };
    run.run(|tick| {
        let journal = truth.journal(tick.state);
        let free = !tick.system.bearings()[0].touching();
        let mut state = *tick.state;
        if !tracked {
            state.flags &= !State::FLAG_TOOL_TRACKED;
        }
        match learned.push(&state) {
            None => collected.rows.clear(),
            Some(_) => {
                if collected.rows.is_empty() {
                    collected.first = state.tick;
                }
                let (correction, product) = (learned.said(), learned.forecast());
                let features = learned.features();
                let (&regressors, scale) = features.outlines();
                let rests = features.rests();
                let beyond = features.forecast();
                let forecast = [rests[1][0] + beyond[0], rests[1][1] + beyond[1]];
                let path = truth.tool(&tick.state.reference.q);
                let tool = Vector3::from_column_slice(&tick.state.tool[..3]);
                collected.rows.push(Row {
                    torque: tick.state.tau,
                    path: path.into(),
                    deviation: (tool - path).into(),
                    regressors,
                    scale,
                    journal,
                    rests,
                    forecast,
                    piloted: [forecast[0] + correction[0], forecast[1] + correction[1]],
                    product,
                    normal: features.along_slides([1.0, 0.0]),
                    directions: features.directions(),
                    free,
                });
            }
        }
    })
    .map_err(|error| Failure { exit: error.exit, ..fault(&error) })?;
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

    /// The perfect arm's tool, base frame, m.
    fn tool(&mut self, q: &Joints) -> Vector3<f64> {
        forward_kinematics(&self.arm, &mut self.workspace, &q[..self.arm.dof()]).translation.vector
    }

    /// Offset along the slides, m: they move the tool along two directions at right angles.
    fn journal(&mut self, state: &State) -> [f64; 2] {
        let q = &state.q[..self.arm.dof()];
        let tool = self.tool(&state.q);
        let off = Vector3::new(state.tool[0], state.tool[1], state.tool[2]) - tool;
        [[1.0, 0.0], [0.0, 1.0]].map(|slide| self.slides.deviation_with(q, &slide).dot(&off))
    }
}
