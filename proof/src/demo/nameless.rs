//! Machines with physics that no catalogue names, beside physics that it does: commissioned with a tracker, controlled without one.
//!
//! On three paths the tool is tracked. The recordings are diagnosed; what has a name goes into the model, what the model leaves is learned
//! ([`freeplay_training`]). Then five ways to control the machine are compared on three other paths and periods, without a tracker.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use freeplay_arm::{ArmFile, EffectTable, paper_arm, to_toml};
use freeplay_controller::Task;
use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, diagnose};
use freeplay_harness::closed_loop::{ClosedLoop, RATE, Tick};
use freeplay_harness::weights::beside;
use freeplay_laws::Effects;
use freeplay_path::{PathKind, PathSpec, Size};
use freeplay_plant::DeviationStatistics;
use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::{make_folder, write};
use freeplay_terminal::layout::text_table;
use freeplay_training::{Settings, Trained, train};
use serde::Serialize;

use super::cases::with;
use super::play::sensors;

/// A machine with something nameless.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Name of its folder, and on the command line.
    pub name: &'static str,
    /// What is concealed, in words.
    pub hidden: &'static str,
    /// What is concealed.
    pub effects: Vec<EffectTable>,
}

/// The five ways, in the order of the columns.
pub const WAYS: [&str; 5] = [
    "no compensation",
    "quasi-static, nominal model",
    "quasi-static, diagnosed model",
    "network on the nominal model",
    "diagnosed model and network",
];

/// The tool's deviation in a run, after the first 0.5 s, mm.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Reached {
    /// Root of the mean square.
    pub rms: f64,
    /// Greatest.
    pub max: f64,
}

/// One path, under all five ways.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Name of the path.
    pub path: &'static str,
    /// In the order of [`WAYS`]; none for a run that did not end well.
    pub reached: Vec<Option<Reached>>,
}

/// What came of a machine.
#[derive(Debug, Serialize)]
pub struct Outcome {
    /// Its name.
    pub machine: &'static str,
    /// What is concealed, in words.
    pub hidden: &'static str,
    /// Verdict of the diagnosis.
    pub verdict: String,
    /// What it named.
    pub named: Vec<String>,
    /// Whether the weights on the nominal and on the diagnosed model proved themselves.
    pub proved: [bool; 2],
    /// The paths.
    pub cells: Vec<Cell>,
}

/// How much worse than the best the last way may be: as a factor, and in mm.
const WITHIN: [f64; 2] = [1.02, 0.2e-3];

impl Cell {
    /// Whether the diagnosed model with the network is the best way, or as good.
    pub fn holds(&self) -> bool {
        let best = self.reached.iter().flatten().map(|reached| reached.rms).fold(f64::INFINITY, f64::min);
        let last = self.reached.last().copied().flatten();
        last.is_some_and(|last| last.rms <= (best * WITHIN[0]).max(best + WITHIN[1]))
    }

    /// What share of the deviation that the diagnosed model leaves the network takes away.
    pub fn taken(&self) -> Option<f64> {
        let [_, _, model, _, both] = self.reached.as_slice() else { return None };
        Some(1.0 - both.as_ref()?.rms / model.as_ref()?.rms)
    }
}

/// All machines.
pub fn all() -> Vec<Machine> {
    let play = || with("joint_clearance", Some("joint_5"), [("clearance", 6e-4.into())]);
    let detent = |joint, torque: f64, position: f64| {
        let place = [("torque", torque.into()), ("position", position.into()), ("width", 0.08.into())];
        with("detent", Some(joint), place)
    };
    let cable = || {
        let hook = toml::Value::from(vec![0.3, 0.4, 2.0]);
        let rest = [("mass", 0.4.into()), ("length", 1.0.into()), ("stiffness", 8.0.into())];
        let [mass, length, stiffness] = rest;
        with("cable_drag", None, [("hook", hook), mass, length, stiffness])
    };
    let warped = |tilt: f64| with("warped_base", None, [("tilt", tilt.into()), ("waves", 3.0.into())]);
    let drift = || {
        let drift = toml::Value::from(vec![0.0, 1e-4, -1.5e-4]);
        with("thermal_drift", None, [("drift", drift), ("time", 6.0.into())])
    };
    let rub = || with("coulomb_friction", Some("joint_3"), [("coulomb", 20.0.into())]);
    let machine = |name, hidden, effects: Vec<Option<EffectTable>>| Machine {
        name,
        hidden,
        effects: effects.into_iter().flatten().collect(),
    };
    vec![
        machine("play", "play of joint 5, nothing nameless", vec![play()]),
        machine(
            "play-detent",
            "play of joint 5, a detent in joint 3",
            vec![play(), detent("joint_3", 6.0, 0.35)],
        ),
        machine("play-cable", "play of joint 5, a cable on the tool", vec![play(), cable()]),
        machine("play-warped", "play of joint 5, a warped base", vec![play(), warped(3e-4)]),
        machine("play-drift", "play of joint 5, a drift of the tool", vec![play(), drift()]),
        machine(
            "play-all",
            "play of joint 5, detent, cable, warped base and drift",
            vec![play(), detent("joint_3", 6.0, 0.35), cable(), warped(3e-4), drift()],
        ),
        machine("detent", "a detent in joint 2", vec![detent("joint_2", 20.0, 0.3)]),
        machine("cable", "a cable on the tool", vec![cable()]),
        machine("warped", "a warped base", vec![warped(5e-4)]),
        machine("cable-drift", "a cable on the tool and a drift", vec![cable(), drift()]),
        machine(
            "friction-warped",
            "20 N·m of Coulomb friction in joint 3, a warped base",
            vec![rub(), warped(3e-4)],
        ),
        machine("nothing-nameless", "nothing: the machine is its model", vec![]),
    ]
}

/// Paths on which the machine is commissioned, with a tracker.
fn commissioning() -> [(&'static str, PathSpec); 3] {
    [
        ("one", path(PathKind::Lissajous, None, 6.0, [0.95, 0.0, 0.95])),
        ("two", path(PathKind::Lissajous, Some(Size::Axes([0.2, 0.15, 0.1])), 5.0, [0.95, 0.0, 0.95])),
        ("three", path(PathKind::Square, Some(Size::One(0.2)), 8.0, [0.95, 0.0, 0.95])),
    ]
}

/// Paths on which it is judged, without one.
fn judged() -> [(&'static str, PathSpec); 3] {
    [
        ("wide, 5 s", path(PathKind::Lissajous, Some(Size::Axes([0.1, 0.2, 0.08])), 5.0, [0.95, 0.0, 0.95])),
        (
            "small and aside, 7 s",
            path(PathKind::Lissajous, Some(Size::Axes([0.12, 0.12, 0.03])), 7.0, [0.93, 0.05, 0.97]),
        ),
        ("square, 9 s", path(PathKind::Square, Some(Size::One(0.12)), 9.0, [0.95, 0.0, 0.95])),
    ]
}

fn path(kind: PathKind, size: Option<Size>, period: f64, centre: [f64; 3]) -> PathSpec {
    PathSpec { kind, size, period, centre, ..PathSpec::default() }
}

/// A machine in its folder.
struct Bench {
    truth: ArmFile,
    effects: Effects,
    seed: u64,
}

impl Bench {
    /// A run along `path`, in this process: what it recorded, and what it came to.
    fn run(
        &self,
        (controller, model): (&'static str, &Path),
        path: &PathSpec,
        is_tracked: bool,
    ) -> Result<(Option<Recording>, Reached), Failure> {
        let weights = Some(beside(model)).filter(|file| !is_tracked && file.is_file());
        let task = Task {
            model: model.display().to_string(),
            weights: weights.map(|file| file.display().to_string()),
            path: path.clone(),
            ..Task::default()
        };
        let closed = ClosedLoop {
            arm: &self.truth.arm,
            effects: &self.effects,
            path,
            controller,
            task: &task,
            tracked: is_tracked,
            after: DeviationStatistics::START,
            sensors: (sensors(), self.seed),
            beyond: &[],
        };
        let mut recorder = Recorder::new(self.truth.arm.dof());
        let outcome = closed.run(|tick| {
            if is_tracked {
                recorder.keep(tick);
            }
        })?;
        let [norm, ..] = outcome.deviation.components();
        let reached = Reached { rms: norm.rms_after_start, max: norm.max_after_start };
        let recording = is_tracked.then(|| recorder.finish(controller)).transpose()?;
        Ok((recording, reached))
    }

    /// The recordings of the commissioning under `quasi-static` with `model`, by name.
    fn commission(&self, model: &Path) -> Result<Vec<(String, Recording)>, Failure> {
        let paths = commissioning();
        let recorded = paths.iter().map(|(name, path)| {
            let (recording, _) = self.run(("quasi-static", model), path, true)?;
            let recording = recording.ok_or_else(|| Failure::internal("a run was not recorded"))?;
            Ok(((*name).to_owned(), recording))
        });
        recorded.collect()
    }

    /// What `model` leaves in `recordings`, learned, its weights beside the model.
    fn learn(&self, recordings: &[(String, Recording)], model: &Path) -> Result<Trained, Failure> {
        let command = format!("freeplay demo, seed {}", self.seed);
        let nominal = Some(paper_arm().arm);
        let settings = Settings { seed: self.seed, command, nominal, ..Settings::default() };
        let trained = train(recordings, Task::default(), model, &settings)?;
        write(&beside(model), &trained.file.to_json().map_err(Failure::internal)?)?;
        Ok(trained)
    }
}

/// What a run leaves: joints, torques and the tracked tool, the reference and what the controller predicted.
struct Recorder {
    columns: Vec<(String, Vec<f64>)>,
    joints: usize,
}

impl Recorder {
    fn new(joints: usize) -> Recorder {
        let of_joints = ["q", "qd", "tau", "q_ref", "qd_ref_", "qdd_ref_"];
        let names = of_joints.iter().flat_map(|name| (1..=joints).map(move |joint| format!("{name}{joint}")));
        let rest = ["x", "y", "z", "predicted_x", "predicted_y", "predicted_z", "tick"].map(str::to_owned);
        let columns = std::iter::once("t".to_owned()).chain(names).chain(rest);
        Recorder { columns: columns.map(|name| (name, Vec::new())).collect(), joints }
    }

    fn keep(&mut self, tick: &Tick<'_>) {
        let (state, n) = (tick.state, self.joints);
        let joints =
            [&state.q, &state.qd, &state.tau, &state.reference.q, &state.reference.qd, &state.reference.qdd];
        let row = std::iter::once(state.tick as f64 / RATE)
            .chain(joints.into_iter().flat_map(|values| values[..n].iter().copied()))
            .chain(state.tool[..3].iter().copied())
            .chain(tick.answer.deviation)
            .chain([state.tick as f64]);
        self.columns.iter_mut().zip(row).for_each(|((_, column), value)| column.push(value));
    }

    fn finish(self, controller: &str) -> Result<Recording, Failure> {
        Recording::new(&PathBuf::from(format!("{controller}.csv")), self.columns).map_err(Failure::internal)
    }
}

/// Commissions, diagnoses, learns and judges `machine`, with all files in `out`.
///
/// # Errors
/// A run of the commissioning that fails, or a file that can't be written.
pub fn outcome(machine: &Machine, seed: u64, out: &Path) -> Result<Outcome, Failure> {
    make_folder(out)?;
    let nominal = paper_arm();
    let truth = ArmFile { effects: machine.effects.clone(), ..nominal.clone() };
    let bench = Bench { effects: Effects::of(&truth).map_err(Failure::internal)?, truth, seed };
    let (given, found) = (out.join("nominal.toml"), out.join("model.toml"));
    write(&out.join("truth.toml"), &to_toml(&bench.truth))?;
    write(&given, &to_toml(&nominal))?;
    let first = bench.commission(&given)?;
    let alone = bench.learn(&first, &given)?;
    let diagnosis = diagnosed(&nominal, &first, seed)?;
    write(&found, &to_toml(&diagnosis.model))?;
    let named: Vec<String> = diagnosis
        .effects
        .iter()
        .map(|effect| freeplay_diagnosis::page::title(effect.kind, effect.joint.as_deref()))
        .collect();
    let both = if diagnosis.effects.is_empty() {
        write(&beside(&found), &alone.file.to_json().map_err(Failure::internal)?)?;
        alone.receipt.proved
    } else {
        let second = bench.commission(&found)?;
        bench.learn(&second, &found)?.receipt.proved
    };
    let ways: [(&'static str, &Path); 5] = [
        ("computed-torque", &given),
        ("quasi-static", &given),
        ("quasi-static", &found),
        ("narx-qp", &given),
        ("narx-qp", &found),
    ];
    let cells = judged().into_iter().map(|(name, path)| {
        let reached = ways.iter().map(|how| bench.run(*how, &path, false).ok().map(|(_, reached)| reached));
        Cell { path: name, reached: reached.collect() }
    });
    Ok(Outcome {
        machine: machine.name,
        hidden: machine.hidden,
        verdict: serde_json::to_value(diagnosis.verdict)
            .ok()
            .and_then(|verdict| verdict.as_str().map(str::to_owned))
            .unwrap_or_default(),
        named,
        proved: [alone.receipt.proved, both],
        cells: cells.collect(),
    })
}

fn diagnosed(nominal: &ArmFile, recordings: &[(String, Recording)], seed: u64) -> Result<Diagnosis, Failure> {
    // What a real machine would have recorded: no references, no predictions.
    let seen = |(_, recording): &(String, Recording)| {
        let columns = recording.named().filter(|(name, _)| {
            let end = name.trim_end_matches(|c: char| c.is_ascii_digit());
            ["t", "q", "tau", "x", "y", "z"].contains(&end)
        });
        let columns = columns.map(|(name, column)| (name, column.to_vec())).collect();
        Recording::new(&recording.origin, columns).map_err(Failure::internal)
    };
    let seen: Vec<Recording> = recordings.iter().map(seen).collect::<Result<_, _>>()?;
    let settings = DiagnoseSettings { seed, ..DiagnoseSettings::default() };
    diagnose(nominal, &seen, &settings, &mut |_| {}).map_err(Failure::internal)
}

/// The table of `outcomes`.
pub fn text(outcomes: &[Outcome]) -> String {
    let mut table = text_table();
    let header = ["machine", "path"].into_iter().chain(WAYS).chain(["taken", ""]);
    table.set_header(header.collect::<Vec<_>>());
    for outcome in outcomes {
        for (number, cell) in outcome.cells.iter().enumerate() {
            let mut row =
                vec![if number == 0 { outcome.machine } else { "" }.to_owned(), cell.path.to_owned()];
            row.extend(cell.reached.iter().map(|reached| {
                reached.map_or_else(|| "–".to_owned(), |r| format!("{:.4} / {:.3}", r.rms, r.max))
            }));
            row.push(cell.taken().map_or_else(|| "–".to_owned(), |taken| format!("{:.0} %", 1e2 * taken)));
            row.push(if cell.holds() { "best" } else { "NOT BEST" }.to_owned());
            table.add_row(row);
        }
    }
    let mut text = format!("{table}\n\n");
    for outcome in outcomes {
        let named = if outcome.named.is_empty() { "nothing".to_owned() } else { outcome.named.join(", ") };
        let proved = |proved: bool| if proved { "proved" } else { "not proved, not used" };
        let _ = writeln!(
            text,
            "{}: {}; verdict {}, named {named}; network on the nominal model {}, on the diagnosed one {}",
            outcome.machine,
            outcome.hidden,
            outcome.verdict,
            proved(outcome.proved[0]),
            proved(outcome.proved[1])
        );
    }
    text.push_str(
        "\ndeviation of the tool after the first 0.5 s, RMS / greatest, mm, on paths and periods that took no part, without a tracker\n\
         taken: share of what the diagnosed model leaves that the network takes away\n",
    );
    text
}
