//! Machines with physics that no catalogue names, in addition to named physics: commissioned with a tracker, controlled without one.
//!
//! The program tracks the tool on three paths and diagnoses the recordings. Named effects go into the model; a network learns the remaining deviation
//! ([`freeplay_training`]). Then the program compares five methods to control the machine on three other paths and periods, without a tracker.
//!
//! `machines` (concealed physics, and the paths), `bench` (runs), `outcome` (outcome of a machine and its checks), `text`, `page`.

mod bench;
mod machines;
mod outcome;
mod page;
mod text;

use std::path::Path;

use freeplay_diagnosis::{DiagnoseSettings, Diagnosis, diagnose};
use freeplay_harness::weights::beside;
use freeplay_model::{ArmFile, paper_arm, to_toml};
use freeplay_recording::Recording;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::{make_folder, read_json, write};
use serde::{Deserialize, Serialize};

use crate::blind::hash::of_program;

use bench::{Bench, Method};
use machines::DemoPaths;
use outcome::Cell;

pub use machines::{Machine, all};
pub use outcome::{METHODS, Outcome};
pub use page::document;
pub use text::text;

/// File of an outcome in the folder of its machine.
const OUTCOME: &str = "outcome.json";

/// An outcome with its inputs, so that a later call can tell whether it applies.
#[derive(Serialize, Deserialize)]
struct Kept {
    program: String,
    seed: u64,
    period: f64,
    truth: String,
    outcome: Outcome,
}

/// Settings shared by all machines of a demonstration.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Time of a lap of the first path, s; the others are in proportion.
    pub period: f64,
    /// Seed of all noise.
    pub seed: u64,
}

/// The outcome of `machine` that an earlier call with the same settings, program and concealed effects left in `out`; `None` if there is none.
pub fn kept(machine: &Machine, settings: Settings, out: &Path) -> Option<Outcome> {
    let file = out.join(OUTCOME);
    let kept: Kept = file.is_file().then(|| read_json(&file, "an outcome").ok()).flatten()?;
    let is_same = of_program().is_ok_and(|program| kept.program == program)
        && (kept.seed, kept.period.to_bits()) == (settings.seed, settings.period.to_bits())
        && kept.truth == to_toml(&truth(machine));
    is_same.then_some(kept.outcome)
}

fn truth(machine: &Machine) -> ArmFile {
    ArmFile { effects: machine.effects.clone(), ..paper_arm() }
}

/// Commissions, diagnoses, trains and judges `machine`, with all files in `out`.
///
/// # Errors
/// A run of the commissioning that fails, or a file that can't be written.
pub fn outcome(machine: &Machine, settings: Settings, out: &Path) -> Result<Outcome, Failure> {
    let Settings { period, seed } = settings;
    let paths = DemoPaths { period };
    make_folder(out)?;
    let nominal = paper_arm();
    let truth = truth(machine);
    let concealed = to_toml(&truth);
    write(&out.join("truth.toml"), &concealed)?;
    let bench = Bench::new(truth, paths, seed)?;
    let (given, found) = (out.join("nominal.toml"), out.join("model.toml"));
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
    let second = if diagnosis.effects.is_empty() {
        write(&beside(&found), &alone.file.to_json().map_err(Failure::internal)?)?;
        None
    } else {
        Some(bench.learn(&bench.commission(&found)?, &found)?)
    };
    // A falsely named effect may be harder to compensate by learning than no effect; held-out paths decide.
    let (both, chosen) = match &second {
        Some(second) if second.leaves_less_than(&alone) || !alone.receipt.proved => (second, &found),
        Some(_) => (&alone, &given),
        None => (&alone, &found),
    };
    let way = |controller, model| Method { controller, model, has_weights: true };
    let ways = [
        way("computed-torque", &given),
        way("quasi-static", &given),
        way("quasi-static", &found),
        way("narx-qp", &given),
        way("narx-qp", chosen),
    ];
    let (mut cells, mut courses) = (Vec::new(), Vec::new());
    for (name, path) in paths.judged() {
        let ran = ways.iter().map(|way| bench.reached(*way, &path).ok());
        let (reached, drawn): (Vec<_>, Vec<_>) = ran
            .map(|ran| ran.map_or((None, Vec::new()), |(reached, course)| (Some(reached), course)))
            .unzip();
        cells.push(Cell { path: name.to_owned(), reached });
        courses.push((name, drawn));
    }
    let far = [false, true].map(|has_weights| {
        let way = Method { controller: "narx-qp", model: chosen, has_weights };
        bench.reached(way, &paths.far_outside()).ok().map(|(reached, _)| reached)
    });
    let outcome = Outcome {
        machine: machine.name.to_owned(),
        hidden: machine.hidden.to_owned(),
        is_nameless: machine.is_nameless,
        is_its_model: machine.effects.is_empty(),
        verdict: serde_json::to_value(diagnosis.verdict)
            .ok()
            .and_then(|verdict| verdict.as_str().map(str::to_owned))
            .unwrap_or_default(),
        named,
        proved: [alone.receipt.proved, second.as_ref().unwrap_or(&alone).receipt.proved],
        is_nominal: chosen == &given,
        cells,
        far,
    };
    write(&out.join("report.html"), &page::of_machine(&outcome, both, &courses).to_html())?;
    let kept = Kept { program: of_program()?, seed, period, truth: concealed, outcome };
    write(&out.join(OUTCOME), &serde_json::to_string_pretty(&kept).map_err(Failure::internal)?)?;
    Ok(kept.outcome)
}

fn diagnosed(nominal: &ArmFile, recordings: &[(String, Recording)], seed: u64) -> Result<Diagnosis, Failure> {
    // The recording of a real machine: no references, no predictions.
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
