//! Printed commands, in a form that can be pasted into a shell.

use std::path::{Path, PathBuf};

use freeplay_report::paste::{quoted, shell_word};

/// The command that diagnoses `recordings`, read with `mapping`, against the `model`; its arm ends at the link `tip`, and the low-pass has its cutoff at
/// `lowpass` Hz.
pub fn diagnose_command(
    model: &str,
    tip: Option<&str>,
    recordings: &[PathBuf],
    lowpass: Option<f64>,
    mapping: Option<&Path>,
) -> String {
    let tip = tip.map_or_else(String::new, |tip| format!(" --tip {}", shell_word(Path::new(tip))));
    let recordings: Vec<String> = recordings.iter().map(|path| shell_word(path)).collect();
    let lowpass = lowpass.map_or_else(String::new, |lowpass| format!(" --lowpass {lowpass}"));
    format!(
        "freeplay diagnose --model {}{tip} --recording {}{lowpass}{}",
        shell_word(Path::new(model)),
        recordings.join(" "),
        mapping_option(mapping)
    )
}

/// The commands that use `model`: one compares it with `recording`, read with `mapping`, and one moves the arm with it. If the recording belongs to a
/// `scenario`, a controller repeats that scenario with this model in place of the original one.
pub fn commands(
    model: &Path,
    recording: &Path,
    mapping: Option<&Path>,
    scenario: Option<&Path>,
) -> [String; 2] {
    let compare = format!(
        "freeplay compare --model {} --recording {}{}",
        shell_word(model),
        shell_word(recording),
        mapping_option(mapping)
    );
    let run = match scenario {
        Some(scenario) => {
            // The paths in a scenario are relative to its own folder.
            let absolute = std::path::absolute(model).unwrap_or_else(|_| model.to_owned());
            let key = quoted(&format!("controller.model={}", absolute.display()));
            format!("freeplay run {} --controller narx-qp --set {key}", shell_word(scenario))
        }
        None => format!("freeplay run --model {}   # moves each joint on a sine", shell_word(model)),
    };
    [compare, run]
}

fn mapping_option(mapping: Option<&Path>) -> String {
    mapping.map_or_else(String::new, |mapping| format!(" --mapping {}", shell_word(mapping)))
}
