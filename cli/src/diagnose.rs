//! `freeplay diagnose`: the differences between a model and a recording, the missing physics, and the improvement of the model.

use freeplay_diagnosis::{DiagnoseError, Diagnosis, ExciteSettings, beyond_limits, diagnose as diagnosed};
use freeplay_model::ArmFile;
use freeplay_recording::Recording;
use freeplay_terminal::arguments::Format;
use freeplay_terminal::exit::{Exit, Failure};
use freeplay_terminal::messages;
use freeplay_terminal::output::{say, show};
use freeplay_terminal::target::claim_out;

use crate::diagnose_args::DiagnoseArgs;
use crate::diagnose_screen;
use crate::diagnose_view::{EXTENSIONS, View, file_name, selected_file};
use crate::excite::{self, Question};
use crate::inputs::{self, Measured};

/// The next motion: its duration, s, the reach of a joint, rad (m), and the number of candidates.
const NEXT_S: f64 = 16.0;
const NEXT_REACH: f64 = 1.2;
const NEXT_CANDIDATES: usize = 16;

/// Results in the folder that `--out` names.
const RESULTS: [&str; 3] = ["diagnosis.json", "model.toml", "report.html"];

/// Diagnoses the recordings of `args`.
///
/// # Errors
/// Bad input: a file that can't be read, another number of joints, nothing to compare, recordings with different columns.
pub fn diagnose(args: &DiagnoseArgs) -> Result<Exit, Failure> {
    let settings = args.settings()?;
    inputs::only_once(&args.recording)?;
    let measured: Vec<Measured> = args
        .recording
        .iter()
        .map(|path| Measured::read(path, args.mapping.as_deref()))
        .collect::<Result<_, _>>()?;
    let [first, ..] = measured.as_slice() else { return Err(Failure::usage("name a --recording")) };
    let file = first.model(&args.model, args.tip.as_deref())?;
    let for_arm = |measured: Measured| measured.for_arm(&args.model, &file);
    let recordings: Vec<Recording> = measured.into_iter().map(for_arm).collect::<Result<_, _>>()?;
    // Checked first, since the diagnosis takes minutes.
    let folder =
        args.out.as_deref().map(|out| claim_out(out, &EXTENSIONS, &RESULTS, args.force)).transpose()?;
    let found = diagnosed(&file, &recordings, &settings, &mut |what| messages::announce(what));
    let mut diagnosis = found.map_err(|error| match error {
        DiagnoseError::Law(error) => Failure::input(format!("{}: {error}", args.model)),
        other => Failure::input(other),
    })?;
    remark(&mut diagnosis.quality, &file, &recordings);
    let next = next_motion(args, &file, &recordings, &diagnosis)?;
    diagnosis.next.extend(next);
    let view = View { args, file: &file, recordings: &recordings, diagnosis: &diagnosis };
    let json = view.json()?;
    if let Some(out) = &args.out {
        view.write(out, &json)?;
    }
    drop(folder);
    match args.format {
        Format::Json => say(&format!("{json:#}\n"))?,
        Format::Text => show(&diagnose_screen::text(&view))?,
    }
    Ok(Exit::Done)
}

/// Adds notes on the inputs to those of `recording_quality`: first joints beyond their limits, last unused parts of the model file.
fn remark(quality: &mut Vec<String>, file: &ArmFile, recordings: &[Recording]) {
    let beyond = recordings.iter().flat_map(|recording| {
        let name = file_name(recording);
        beyond_limits(&file.arm, recording).into_iter().map(move |note| format!("{name}: {note}"))
    });
    quality.splice(0..0, beyond);
    quality.extend(file.ignored.iter().map(|ignored| format!("model: {ignored}")));
}

/// If two causes remain, writes the motion that would separate them into the folder of results; returns one sentence on it. Several recordings of one machine
/// were not enough, so that the first of them represents the motion so far.
fn next_motion(
    args: &DiagnoseArgs,
    file: &ArmFile,
    recordings: &[Recording],
    diagnosis: &Diagnosis,
) -> Result<Option<String>, Failure> {
    let folder = args.out.as_deref().filter(|out| selected_file(out).is_none());
    let (Some(out), Some(seen)) = (folder, recordings.first()) else { return Ok(None) };
    let rivals = excite::rivals(diagnosis, file)?;
    if rivals.len() < 2 {
        return Ok(None);
    }
    let settings = ExciteSettings {
        duration: NEXT_S,
        candidates: NEXT_CANDIDATES,
        seed: args.seed,
        posture: None,
        reach: NEXT_REACH,
        tolerances: args.settings()?.tolerances,
        noise: diagnosis.noise.clone(),
    };
    let question = Question { file, rivals, seen: Some(seen) };
    match excite::seek(&question, &settings) {
        Ok(found) => {
            let path = excite::write_path(&found, &args.model, file, out)?;
            Ok(Some(excite::sentence(&found, file, &path)))
        }
        // A diagnosis is useful without the next motion.
        Err(failure) => {
            Ok(Some(format!("the search found no motion that separates these causes: {failure}")))
        }
    }
}
