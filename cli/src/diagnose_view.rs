//! The output of `freeplay diagnose`: screen, JSON and files.

use std::path::{Path, PathBuf};

use freeplay_diagnosis::Diagnosis;
use freeplay_diagnosis::page::{Subject, diagnose_command, document};
use freeplay_harness::setup::PAPER_MODEL;
use freeplay_model::{ArmFile, to_toml};
use freeplay_recording::Recording;
use freeplay_report::paste::seen_from;
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use freeplay_terminal::target::{asked_file, folder_of};
use serde_json::Value;

use crate::diagnose_args::DiagnoseArgs;

/// The result file with the mapping that corrects the recordings.
pub const SETUP: &str = "setup.toml";

/// The endings of the single files that a diagnosis writes.
pub const EXTENSIONS: [&str; 2] = ["toml", "json"];

/// Data of the output.
pub struct View<'a> {
    /// The options of the command.
    pub args: &'a DiagnoseArgs,
    /// The model.
    pub file: &'a ArmFile,
    /// The recordings.
    pub recordings: &'a [Recording],
    /// The diagnosis.
    pub diagnosis: &'a Diagnosis,
}

impl View<'_> {
    /// The folder of results.
    pub fn out(&self) -> Option<&Path> {
        self.args.out.as_deref().filter(|out| selected_file(out).is_none())
    }

    /// The single file of results.
    pub fn file(&self) -> Option<&Path> {
        self.args.out.as_deref().filter(|out| selected_file(out).is_some())
    }

    /// The path of the corrected mapping, if one is written.
    pub fn setup_file(&self) -> Option<PathBuf> {
        self.diagnosis.mapping.as_ref().and_then(|_| Some(self.out()?.join(SETUP)))
    }

    /// The mapping file for the recordings: the corrected one, or else the one on the command line.
    pub fn mapping_file(&self) -> Option<PathBuf> {
        self.setup_file().or_else(|| self.args.mapping.clone())
    }

    /// The commands that use the model `model` of this diagnosis: one compares it with the recording that was held out, one moves it; by the scenario of that
    /// recording if it has one.
    pub fn commands(&self, model: &Path) -> [String; 2] {
        let recording = self.args.recording.last().map_or(Path::new(""), PathBuf::as_path);
        let scenario = self.recordings.last().and_then(scenario_of);
        freeplay_diagnosis::page::commands(
            model,
            recording,
            self.mapping_file().as_deref(),
            scenario.as_deref(),
        )
    }

    /// The command that repeats this diagnosis with the corrected mapping, or that writes this mapping.
    pub fn again(&self) -> String {
        match (self.setup_file(), &self.args.mapping) {
            (Some(mended), _) => self.command(Some(&mended)),
            (None, given) => self.command(given.as_deref()) + " --out found",
        }
    }

    /// This diagnosis as a command with the mapping `mapping`.
    fn command(&self, mapping: Option<&Path>) -> String {
        let DiagnoseArgs { model, tip, recording, lowpass, .. } = self.args;
        diagnose_command(model, tip.as_deref(), recording, *lowpass, mapping)
    }

    /// `freeplay.diagnosis/1`, with its inputs.
    pub fn json(&self) -> Result<Value, Failure> {
        let mut value = serde_json::to_value(self.diagnosis).map_err(Failure::internal)?;
        value["inputs"] = serde_json::json!({ "model": self.args.model, "recordings": self.args.recording });
        if let Some(tip) = &self.args.tip {
            value["inputs"]["tip"] = serde_json::json!(tip);
        }
        if self.args.out.is_some() {
            if self.diagnosis.has_model() {
                value["model"] = serde_json::json!("model.toml");
            }
            value["report"] = serde_json::json!("report.html");
        }
        Ok(value)
    }

    /// Writes diagnosis.json, report.html and, if the data sufficed, model.toml into the folder `out`, or the one of them that the ending of the file `out`
    /// selects. Paths in a diagnosis.json are relative to its folder.
    pub fn write(&self, out: &Path, json: &Value) -> Result<(), Failure> {
        let folder = selected_file(out).map_or(out, |_| folder_of(out));
        let mut moved = json.clone();
        if self.args.model != PAPER_MODEL {
            moved["inputs"]["model"] = serde_json::json!(seen_from(folder, Path::new(&self.args.model)));
        }
        let recordings: Vec<PathBuf> =
            self.args.recording.iter().map(|path| seen_from(folder, path)).collect();
        moved["inputs"]["recordings"] = serde_json::json!(recordings);
        let json = moved;
        match selected_file(out) {
            Some("toml") if !self.diagnosis.has_model() => return Ok(freeplay_storage::remove_file(out)?),
            Some("toml") => return write(out, &to_toml(&self.diagnosis.model)),
            Some(_) => return write(out, &format!("{json:#}\n")),
            None => {}
        }
        write(&out.join("diagnosis.json"), &format!("{json:#}\n"))?;
        // This diagnosis replaces an earlier one in the same folder, whose remaining files would look like its own.
        let model = out.join("model.toml");
        if self.diagnosis.has_model() {
            write(&model, &to_toml(&self.diagnosis.model))?;
        } else {
            freeplay_storage::remove_file(&model)?;
        }
        match &self.diagnosis.mapping {
            Some(mapping) => write(&out.join(SETUP), mapping)?,
            None => freeplay_storage::remove_file(&out.join(SETUP))?,
        }
        let View { args, file, diagnosis, .. } = self;
        let subject = Subject {
            model: &args.model,
            file,
            recordings: &args.recording,
            command: self.command(args.mapping.as_deref()),
            commands: self.commands(&model),
            diagnosis,
            out,
        };
        write(&out.join("report.html"), &document(&subject).to_html())
    }
}

/// The single result file that `out` selects.
pub fn selected_file(out: &Path) -> Option<&'static str> {
    asked_file(out, &EXTENSIONS)
}

/// The scenario that a run left beside its `recording`; `None` for a recording of another machine.
fn scenario_of(recording: &Recording) -> Option<PathBuf> {
    let is_of_a_run = recording.metadata.iter().any(|(key, _)| key == "scenario");
    let file = folder_of(&recording.origin).join("scenario.toml");
    (is_of_a_run && file.is_file()).then_some(file)
}

/// The name of its file.
pub fn file_name(recording: &Recording) -> String {
    recording.origin.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
