//! Machines with physics that no catalogue names, beside physics that it does: commissioned with a tracker, controlled without one.
//!
//! On three paths the tool is tracked. The recordings are diagnosed; what has a name goes into the model, what the model leaves is learned
//! ([`freeplay_training`]). Then five ways to control the machine are compared on three other paths and periods, without a tracker.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use freeplay_arm::{ArmFile, EffectTable, paper_arm, to_toml};
use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, diagnose};
use freeplay_harness::run::{Contestant, Files, play};
use freeplay_harness::scenario::{RecordingKind, Scenario};
use freeplay_harness::setup::Setup;
use freeplay_harness::weights::beside;
use freeplay_path::{PathKind, PathSpec, Size};
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::files::{make_folder, write};
use freeplay_training::{Settings, Trained, train};
use serde::Serialize;

use super::cases::with;
use super::play::{measured, sensors};

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
        machine("play-detent", "play of joint 5, a detent in joint 3", vec![play(), detent("joint_3", 6.0, 0.35)]),
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
        machine("friction-warped", "20 N·m of Coulomb friction in joint 3, a warped base", vec![rub(), warped(3e-4)]),
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
        ("small and aside, 7 s", path(PathKind::Lissajous, Some(Size::Axes([0.12, 0.12, 0.03])), 7.0, [0.93, 0.05, 0.97])),
        ("square, 9 s", path(PathKind::Square, Some(Size::One(0.12)), 9.0, [0.95, 0.0, 0.95])),
    ]
}

fn path(kind: PathKind, size: Option<Size>, period: f64, centre: [f64; 3]) -> PathSpec {
    PathSpec { kind, size, period, centre, ..PathSpec::default() }
}

/// A machine in its folder.
struct Bench<'a> {
    out: &'a Path,
    truth: PathBuf,
    seed: u64,
    stop: &'a AtomicBool,
}

impl Bench<'_> {
    /// A run along `path`: its recording, and what it came to.
    fn run(
        &self,
        (controller, model): (&str, &Path),
        path: &PathSpec,
        is_tracked: bool,
        folder: &str,
    ) -> Result<(PathBuf, Reached), Failure> {
        let mut sensors = sensors();
        sensors.track_tool = is_tracked;
        let mut scenario = Scenario {
            model: self.truth.display().to_string(),
            controllers: vec![controller.to_owned()],
            clearance: BTreeMap::new(),
            recording: if is_tracked { RecordingKind::Mcap } else { RecordingKind::None },
            sensors,
            seed: self.seed,
            path: path.clone(),
            ..Scenario::default()
        };
        scenario.controller.model = Some(model.display().to_string());
        let setup = Setup::new(&scenario)?;
        let files = Files::write(&scenario, &setup, &self.out.join(folder))?;
        let (exit, summary) = play(&scenario, &Contestant::of(controller)?, &files, 0.0, self.stop)?;
        let summary = summary
            .filter(|_| exit == Exit::Done)
            .ok_or_else(|| Failure::internal(format!("a run in {folder} did not end well")))?;
        let number = |key: &str| summary.deviation_mm[key].as_f64().unwrap_or(f64::NAN);
        let reached = Reached { rms: number("rms_after_start"), max: number("max_after_start") };
        Ok((files.out.join(summary.recording.unwrap_or_default()), reached))
    }

    /// The recordings of the commissioning under `quasi-static` with `model`.
    fn commission(&self, model: &Path, round: &str) -> Result<Vec<PathBuf>, Failure> {
        let paths = commissioning();
        let recorded = paths.iter().map(|(name, path)| {
            let folder = format!("{round}-{name}");
            self.run(("quasi-static", model), path, true, &folder).map(|(recording, _)| recording)
        });
        recorded.collect()
    }

    /// What `model` leaves in `recordings`, learned, its weights beside the model.
    fn learn(&self, recordings: &[PathBuf], model: &Path) -> Result<Trained, Failure> {
        let command = format!("freeplay demo, seed {}", self.seed);
        let trained = train(recordings, model, &Settings { seed: self.seed, command, ..Settings::default() })?;
        write(&beside(model), &trained.file.to_json().map_err(Failure::internal)?)?;
        Ok(trained)
    }
}

/// Commissions, diagnoses, learns and judges `machine`, with all files in `out`.
///
/// # Errors
/// A run of the commissioning that fails, or a file that can't be written.
pub fn outcome(machine: &Machine, seed: u64, out: &Path, stop: &AtomicBool) -> Result<Outcome, Failure> {
    make_folder(out)?;
    let nominal = paper_arm();
    let bench = Bench { out, truth: out.join("truth.toml"), seed, stop };
    let (given, found) = (out.join("nominal.toml"), out.join("model.toml"));
    let truth = ArmFile { effects: machine.effects.clone(), ..nominal.clone() };
    write(&bench.truth, &to_toml(&truth))?;
    write(&given, &to_toml(&nominal))?;
    let first = bench.commission(&given, "nominal")?;
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
        let second = bench.commission(&found, "diagnosed")?;
        bench.learn(&second, &found)?.receipt.proved
    };
    let ways: [(&str, &Path); 5] = [
        ("computed-torque", &given),
        ("quasi-static", &given),
        ("quasi-static", &found),
        ("narx-qp", &given),
        ("narx-qp", &found),
    ];
    let cells = judged().into_iter().enumerate().map(|(number, (name, path))| {
        let reached = ways.iter().enumerate().map(|(way, how)| {
            bench.run(*how, &path, false, &format!("judged-{}-{}", number + 1, way + 1)).ok().map(|(_, reached)| reached)
        });
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

fn diagnosed(nominal: &ArmFile, recordings: &[PathBuf], seed: u64) -> Result<Diagnosis, Failure> {
    let read: Result<Vec<_>, Failure> = recordings.iter().map(|path| measured(path, None)).collect();
    let settings = DiagnoseSettings { seed, ..DiagnoseSettings::default() };
    diagnose(nominal, &read?, &settings, &mut |_| {}).map_err(Failure::internal)
}

/// The table of `outcomes`.
pub fn text(outcomes: &[Outcome]) -> String {
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::NOTHING);
    let header = ["machine", "path"].into_iter().chain(WAYS).chain(["taken", ""]);
    table.set_header(header.collect::<Vec<_>>());
    for outcome in outcomes {
        for (number, cell) in outcome.cells.iter().enumerate() {
            let mut row = vec![if number == 0 { outcome.machine } else { "" }.to_owned(), cell.path.to_owned()];
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
        text.push_str(&format!(
            "{}: {}; verdict {}, named {named}; network on the nominal model {}, on the diagnosed one {}\n",
            outcome.machine,
            outcome.hidden,
            outcome.verdict,
            proved(outcome.proved[0]),
            proved(outcome.proved[1])
        ));
    }
    text.push_str(
        "\ndeviation of the tool after the first 0.5 s, RMS / greatest, mm, on paths and periods that took no part, without a tracker\n\
         taken: share of what the diagnosed model leaves that the network takes away\n",
    );
    text
}
